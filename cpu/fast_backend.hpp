// SPDX-License-Identifier: MIT
//
// The fast backend: SIMD over cells side by side, in double or with the cycle in single precision.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/backend.hpp"

namespace kerf {

struct FastOptions {
  int threads = 0;            ///< 0: all that OpenMP offers
  bool single_cycle = false;  ///< vectors and matrices of the cycle in float; what is added on
                              ///< level 0 (displacements, residuals, forces) stays double
  bool updates = true;        ///< false: loads anew after each cut, for comparison
  /// "baseline", "avx2" or "avx512"; empty: what the variable KERF_INSTRUCTION_SET of the
  /// environment says, else the best that there is.
  std::string instruction_set = {};
};

/// The instruction sets that this build has code for and this processor can run, the best last.
/// A build for one kind of machine (KERF_NATIVE) has one.
std::vector<std::string> fast_instruction_sets();

/// The same bits for any number of threads, with one instruction set. Smooths by Chebyshev only;
/// the reference backend (cpu_backend.hpp) has Gauss-Seidel too.
/// @throws Error (unavailable) for an instruction set that is not there, which names those that
/// are; Error (bad_input) for a word that names none.
std::unique_ptr<Backend> make_fast_backend(const FastOptions& options = {});

}  // namespace kerf
