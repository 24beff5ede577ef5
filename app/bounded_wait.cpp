// SPDX-License-Identifier: MIT
#include "app/bounded_wait.hpp"

#include <sys/auxv.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <system_error>

namespace kerf {

void bound_waiting(char** argv) {
  constexpr const char* kRounds = "10000";  // some 0.1 to 0.5 ms
  if (std::getenv("OMP_WAIT_POLICY") != nullptr || std::getenv("GOMP_SPINCOUNT") != nullptr) return;
  if (getauxval(AT_BASE) == 0) return;  // started through its loader, which is /proc/self/exe then
  std::error_code error;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", error);
  if (error || setenv("GOMP_SPINCOUNT", kRounds, 1) != 0) return;
  execv(program.c_str(), argv);  // returns only where it fails: then all goes on as it was
}

}  // namespace kerf
