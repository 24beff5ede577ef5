// SPDX-License-Identifier: MIT
//
// All code for the device. In one file, since both precisions share half of it, and since the
// compiler takes ten seconds to read what each file includes.
#include "gpu/cuda_backend.hpp"
#include "gpu/cuda_device.cuh"
#include "gpu/device_ceilings.hpp"
#include "gpu/make_device_backend.hpp"

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
  const gpu::DeviceOptions chosen{.blocks = !options.records};
  if (options.single_cycle) return gpu::make_device_backend<float>(std::move(device), chosen);
  return gpu::make_device_backend<double>(std::move(device), chosen);
}

CudaCeilings measure_cuda_ceilings() {
  // Beyond all caches, and long enough that a launch is no part of it.
  constexpr std::int32_t kElements = 1 << 26, kThreads = 1 << 20, kRounds = 4096;
  const std::string problem = cuda_problem();
  if (!problem.empty()) throw Error(ErrorKind::unavailable, "no ceilings of a GPU: " + problem);
  gpu::CudaDevice device(0);
  return gpu::measure_ceilings(device, kElements, kThreads, kRounds);
}

}  // namespace kerf
