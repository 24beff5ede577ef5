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

// Bits of a SIMD register that packs of scalars are written for (cpu/pack.hpp); 0: for none.
#if defined(__AVX512VL__) && defined(__AVX512DQ__) && defined(__AVX512BW__) && defined(__FMA__)
#define KERF_PACK_BITS 512
#elif defined(__AVX2__) && defined(__FMA__)
#define KERF_PACK_BITS 256
#else
#define KERF_PACK_BITS 0
#endif

// Before a loop of constant length: what it indexes is to stay in registers of a device. The host's
// compiler decides by itself.
#if defined(__CUDA_ARCH__)
#define KERF_UNROLL _Pragma("unroll")
#else
#define KERF_UNROLL
#endif

// Inlines all that a function calls. With packs of 512 bits frames come to be 4096 bytes apart, and
// loads of one wait for stores to the other; elsewhere it gains nothing and takes long to compile.
#if KERF_PACK_BITS == 512 && !defined(__CUDACC__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define KERF_FLATTEN __attribute__((flatten))
#else
#define KERF_FLATTEN
#endif

#if !defined(NDEBUG) && !defined(__CUDA_ARCH__)
#include <cassert>
#define KERF_ASSERT(condition) assert(condition)
#else
#define KERF_ASSERT(condition) ((void)0)
#endif
