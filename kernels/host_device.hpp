// SPDX-License-Identifier: MIT
//
// The only macros of Kerf. Everything in kernels/ is compiled by the host compiler and by nvcc.
#pragma once

#include <cstddef>
#include <cstdint>

#if defined(__CUDACC__)
#define KERF_HD __host__ __device__ inline
#else
#define KERF_HD inline
#endif

#if !defined(NDEBUG) && !defined(__CUDA_ARCH__)
#include <cassert>
#define KERF_ASSERT(condition) assert(condition)
#else
#define KERF_ASSERT(condition) ((void)0)
#endif
