// SPDX-License-Identifier: MIT
#include "gpu/cuda_device.cuh"
#include "gpu/device_ceilings.hpp"

namespace kerf {

CudaCeilings measure_cuda_ceilings() {
  // Beyond all caches, and long enough that a launch is no part of it.
  constexpr std::int32_t kElements = 1 << 26, kThreads = 1 << 20, kRounds = 4096;
  const std::string problem = cuda_problem();
  if (!problem.empty()) throw Error(ErrorKind::unavailable, "no ceilings of a GPU: " + problem);
  gpu::CudaDevice device(0);
  return gpu::measure_ceilings(device, kElements, kThreads, kRounds);
}

}  // namespace kerf
