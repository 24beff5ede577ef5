// SPDX-License-Identifier: MIT
#include "app/backends.hpp"

#include "app/version.hpp"
#include "core/base/error.hpp"
#include "cpu/cpu_backend.hpp"

namespace kerf {

const char* precision_name(Precision precision) {
  switch (precision) {
    case Precision::mixed:
      return "mixed";
    case Precision::single:
      return "single";
    default:
      return "double";
  }
}

std::unique_ptr<Backend> make_backend(const SolverSetup& solver) {
  expects(solver.precision == Precision::double_,
          text("solver.precision = \"", precision_name(solver.precision),
               "\": only \"double\" is available in this version"));
  if (solver.backend == "cpu" || solver.backend == "auto")
    return make_cpu_backend(CpuOptions{.threads = solver.threads});
  expects(solver.backend == "cuda", text("solver.backend = \"", solver.backend,
                                         "\": expected \"cpu\", \"cuda\" or \"auto\""));
  throw Error(ErrorKind::unavailable,
              "this version has no CUDA backend yet; set backend = "
              "\"cpu\"");
}

std::vector<std::pair<std::string, std::string>> backend_states() {
  const auto cpu = make_cpu_backend({});
  return {{"cpu", text("ready, ", cpu->threads(), cpu->threads() == 1 ? " thread" : " threads",
                       ", double precision")},
          {"cuda", "not in this version"}};
}

}  // namespace kerf
