// SPDX-License-Identifier: MIT
//
// The CUDA backend by its precision; a file each, since they take a compiler minutes.
#pragma once

#include <memory>

#include "core/backend.hpp"

namespace kerf::gpu {

class CudaDevice;

std::unique_ptr<Backend> make_cuda_double(std::unique_ptr<CudaDevice> device);
std::unique_ptr<Backend> make_cuda_mixed(std::unique_ptr<CudaDevice> device);

}  // namespace kerf::gpu
