// SPDX-License-Identifier: MIT
//
// The fast backend of one instruction set. In a build for distribution fast_backend.cpp,
// fast_cycle.cpp, fast_values.cpp and fast_variant.cpp are compiled for several
// (cpu/CMakeLists.txt).
//
// Needs   What both sides of these functions see has the same layout for every instruction set: of
//         the standard library and of kerf, no Eigen, no packs. What is thrown is known by its
//         name, not by the address of its type, of which each variant has its own.
#pragma once

#include "cpu/fast_backend.hpp"

extern "C" {

/// The only names that leave the objects of a variant (cmake/isolate.cmake). The caller owns the
/// backend.
kerf::Backend* kerf_fast_baseline(const kerf::FastOptions& options);
kerf::Backend* kerf_fast_avx2(const kerf::FastOptions& options);
kerf::Backend* kerf_fast_avx512(const kerf::FastOptions& options);

}  // extern "C"
