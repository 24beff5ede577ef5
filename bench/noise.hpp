// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace kerf::bench {

/// Random values in [-1, 1), the same everywhere and at every call.
inline std::vector<double> noise(std::size_t size) {
  std::vector<double> out(size);
  std::uint64_t state = 1;
  for (double& value : out) {
    state = state * 6364136223846793005U + 1442695040888963407U;
    value = static_cast<double>(state >> 11) * 0x1p-52 - 1;
  }
  return out;
}

}  // namespace kerf::bench
