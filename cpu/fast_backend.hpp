// SPDX-License-Identifier: MIT
//
// The fast backend: SIMD over eight cells, in double or with the cycle in single precision.
#pragma once

#include <memory>

#include "core/backend.hpp"

namespace kerf {

struct FastOptions {
  int threads = 0;            ///< 0: all that OpenMP offers
  bool single_cycle = false;  ///< vectors and matrices of the cycle in float; what is added on
                              ///< level 0 (displacements, residuals, forces) stays double
  bool updates = true;        ///< false: loads anew after each cut, for comparison
};

/// The same bits for any number of threads. Smooths by Chebyshev only; the reference backend
/// (cpu_backend.hpp) has Gauss-Seidel too.
std::unique_ptr<Backend> make_fast_backend(const FastOptions& options = {});

}  // namespace kerf
