// SPDX-License-Identifier: MIT
//
// Random values that are the same everywhere.
#pragma once

#include "kernels/host_device.hpp"

namespace kerf::kernels {

/// Value number i, in [-1, 1): splitmix64 on the index.
/// Source  Steele, Lea, Flood 2014.
KERF_HD double noise(std::uint64_t i) {
  std::uint64_t z = (i + 1) * 0x9E3779B97F4A7C15U;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9U;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBU;
  z ^= z >> 31;
  return static_cast<double>(z >> 11) * 0x1p-52 - 1.0;
}

}  // namespace kerf::kernels
