// SPDX-License-Identifier: MIT
//
// The CUDA backend: one GPU. Without CUDA in the build the same functions say so.
#pragma once

#include <memory>
#include <string>

#include "core/backend.hpp"

namespace kerf {

struct CudaOptions {
  int device = 0;
  bool single_cycle = false;  ///< vectors and matrices of the cycle in float; what is added on
                              ///< level 0 (displacements, residuals, forces) stays double
  bool records = false;       ///< products of level 0 by records, for comparison
};

/// Empty where a CUDA backend can be made; else the reason, in words.
std::string cuda_problem();

/// "NVIDIA H100, 80 GB" of the device that is used; empty where there is none.
std::string cuda_device_name();

/// What the GPU can do at most; seconds of the fastest runs.
struct CudaCeilings {
  double elements = 0, triad_seconds = 0;  ///< a = b + s c, 24 bytes an element
  double multiply_adds = 0, float_seconds = 0, double_seconds = 0;
};
/// @throws Error (unavailable) where cuda_problem says why.
CudaCeilings measure_cuda_ceilings();

/// The same bits from run to run. @throws Error (unavailable) where cuda_problem says why.
std::unique_ptr<Backend> make_cuda_backend(const CudaOptions& options = {});

}  // namespace kerf
