// SPDX-License-Identifier: MIT
//
// The few scalar operations whose form must be the same on every machine.
// A SIMD pack joins by overloading fma, sqrt and select in its own namespace and by specialising
// Precision; the kernels call all of them unqualified.
//
// Needs   A build for a machine with fused multiply-add (KERF_NATIVE or -mfma): without it, each
//         fma on the host is a call into the C library; the bits are the same.
#pragma once

#include <cmath>

#include "kernels/host_device.hpp"

namespace kerf::kernels {

using std::fma;
using std::sqrt;

/// Distance from one to the next number of the type.
template <class T>
struct Precision;
template <>
struct Precision<double> {
  static constexpr double kEpsilon = 0x1p-52;
};
template <>
struct Precision<float> {
  static constexpr float kEpsilon = 0x1p-23F;
};

/// a where the mask holds, else b. Both are evaluated; keep them free of traps, not of infinities.
template <class T>
KERF_HD T select(bool mask, const T& a, const T& b) {
  return mask ? a : b;
}

}  // namespace kerf::kernels
