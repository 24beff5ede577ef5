// SPDX-License-Identifier: MIT
#pragma once

#include <unistd.h>

#include <limits>

namespace kerf {

/// Bytes of memory that this machine has; infinite where it does not say.
inline double physical_memory() {
  const long pages = sysconf(_SC_PHYS_PAGES), page = sysconf(_SC_PAGESIZE);
  if (pages <= 0 || page <= 0) return std::numeric_limits<double>::infinity();
  return static_cast<double>(pages) * static_cast<double>(page);
}

}  // namespace kerf
