// SPDX-License-Identifier: MIT
#include "gpu/bodies/vectors.hpp"
#include "gpu/cuda_backend.hpp"
#include "gpu/cuda_device.cuh"
#include "gpu/cuda_parts.hpp"

namespace kerf {
namespace {

constexpr double kGigabyte = 1e9;

// Whether there is code in this build that the device can run.
std::string code_problem() {
  cudaFuncAttributes attributes{};
  const cudaError_t status =
      cudaFuncGetAttributes(&attributes, gpu::run_body<gpu::ZeroBody<double>>);
  if (status == cudaSuccess) return {};
  cudaGetLastError();
  return text("the GPU cannot run the code of this build (", cudaGetErrorString(status),
              "); configure with its CMAKE_CUDA_ARCHITECTURES");
}

}  // namespace

std::string cuda_problem() {
  int devices = 0;
  const cudaError_t status = cudaGetDeviceCount(&devices);
  if (status != cudaSuccess) {
    cudaGetLastError();
    int driver = 0;
    if (cudaDriverGetVersion(&driver) == cudaSuccess && driver == 0)
      return "no GPU that CUDA can use: there is no driver";
    return text("no GPU that CUDA can use: ", cudaGetErrorString(status));
  }
  if (devices == 0) return "no GPU that CUDA can use";
  return code_problem();
}

std::string cuda_device_name() {
  cudaDeviceProp properties{};
  if (!cuda_problem().empty() || cudaGetDeviceProperties(&properties, 0) != cudaSuccess) return {};
  const auto gigabytes =
      static_cast<int>(static_cast<double>(properties.totalGlobalMem) / kGigabyte);
  return text(properties.name, ", ", gigabytes, " GB");
}

std::unique_ptr<Backend> make_cuda_backend(const CudaOptions& options) {
  const std::string problem = cuda_problem();
  if (!problem.empty())
    throw Error(ErrorKind::unavailable,
                "no CUDA backend: " + problem + "; or set solver.backend = \"cpu\"");
  auto device = std::make_unique<gpu::CudaDevice>(options.device);
  return options.single_cycle ? gpu::make_cuda_mixed(std::move(device))
                              : gpu::make_cuda_double(std::move(device));
}

}  // namespace kerf
