// SPDX-License-Identifier: MIT
//
// The most memory that this process held since the last reset (Linux).
#pragma once

#include <sys/resource.h>

#include <cstddef>
#include <fstream>
#include <string>

#if defined(__linux__)
#include <malloc.h>
#endif

namespace kerf::bench {

/// Gives what was freed back to the system; else it would count as held.
inline void release_free_memory() {
#if defined(__GLIBC__)
  malloc_trim(0);
#endif
}

/// Where the system does not let a process do so, the peak is that of its whole life.
inline void reset_memory_peak() { std::ofstream("/proc/self/clear_refs") << 5; }

inline double memory_peak() {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;)
    if (double kib = 0; word == "VmHWM:" && status >> kib) return 1024 * kib;
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1024.0 * static_cast<double>(usage.ru_maxrss);
}

}  // namespace kerf::bench
