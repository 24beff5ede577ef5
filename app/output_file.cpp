// SPDX-License-Identifier: MIT
#include "app/output_file.hpp"

#include <cerrno>
#include <cstring>
#include <fstream>

#include "core/base/error.hpp"

namespace kerf {

void write_file(const std::filesystem::path& file,
                const std::function<void(std::ostream&)>& write) {
  std::ofstream out(file, std::ios::binary);
  if (out) {
    write(out);
    out.close();
  }
  if (!out)
    throw Error(ErrorKind::bad_input,
                text(file.string(), ": cannot be written: ", std::strerror(errno)));
}

}  // namespace kerf
