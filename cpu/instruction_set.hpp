// SPDX-License-Identifier: MIT
#pragma once

namespace kerf::cpu {

/// What the file that reads this is compiled for; the same steps as in cpu/pack.hpp, and AVX-512 as
/// x86-64-v4 has it. Not `inline`: in a build for distribution it differs from file to file.
#if defined(__AVX512F__) && defined(__AVX512BW__) && defined(__AVX512DQ__) && \
    defined(__AVX512VL__) && defined(__FMA__)
constexpr const char* kInstructionSet = "avx512";
#elif defined(__AVX2__) && defined(__FMA__)
constexpr const char* kInstructionSet = "avx2";
#else
constexpr const char* kInstructionSet = "baseline";
#endif

}  // namespace kerf::cpu
