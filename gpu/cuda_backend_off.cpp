// SPDX-License-Identifier: MIT
#include "core/base/error.hpp"
#include "gpu/cuda_backend.hpp"

namespace kerf {

std::string cuda_problem() { return "built without CUDA; configure with -DKERF_CUDA=ON"; }

std::string cuda_device_name() { return {}; }

CudaCeilings measure_cuda_ceilings() {
  throw Error(ErrorKind::unavailable, "no ceilings of a GPU: " + cuda_problem());
}

std::unique_ptr<Backend> make_cuda_backend(const CudaOptions&) {
  throw Error(ErrorKind::unavailable,
              "no CUDA backend: " + cuda_problem() + "; or set solver.backend = \"cpu\"");
}

}  // namespace kerf
