// SPDX-License-Identifier: MIT
#pragma once

#include <unistd.h>
#if defined(__GLIBC__)
#include <malloc.h>
#endif

#include <limits>

namespace kerf {

/// Bytes of memory that this machine has; infinite where it does not say.
inline double physical_memory() {
  const long pages = sysconf(_SC_PHYS_PAGES), page = sysconf(_SC_PAGESIZE);
  if (pages <= 0 || page <= 0) return std::numeric_limits<double>::infinity();
  return static_cast<double>(pages) * static_cast<double>(page);
}

/// What was freed goes back to the machine: after work that takes many small pieces, most of it
/// would stay with the process.
inline void return_freed_memory() {
#if defined(__GLIBC__)
  malloc_trim(0);
#endif
}

/// For the main function of a program: blocks from 1 MB on go back to the machine when they are
/// freed. By itself glibc takes blocks as large as one that was freed for common ones from then on,
/// and keeps them (docs/decisions/0024-what-is-held.md).
inline void return_large_blocks_when_freed() {
#if defined(__GLIBC__)
  constexpr int kLarge = 1 << 20, kKept = 1 << 25;
  mallopt(M_MMAP_THRESHOLD, kLarge);
  mallopt(M_TRIM_THRESHOLD, kKept);
#endif
}

}  // namespace kerf
