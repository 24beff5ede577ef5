// SPDX-License-Identifier: MIT
#include "gpu/cuda_device.cuh"
#include "gpu/cuda_parts.hpp"
#include "gpu/make_device_backend.hpp"

namespace kerf::gpu {

std::unique_ptr<Backend> make_cuda_double(std::unique_ptr<CudaDevice> device) {
  return make_device_backend<double>(std::move(device));
}

}  // namespace kerf::gpu
