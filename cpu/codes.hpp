// SPDX-License-Identifier: MIT
//
// Packs stored with 16 bits a lane: integers, and numbers that are exact in so few.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

#include "cpu/pack.hpp"

namespace kerf::cpu {

/// What is stored as an integer goes from minus this to this.
inline constexpr float kGreatestCode = 32767;

/// Integers as scalars.
inline Pack<float> widened(const std::int16_t* from) {
#if KERF_PACK_BITS == 512
  const __m256i codes = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(from));
  return Pack<float>::Vector(_mm512_cvtepi32_ps(_mm512_cvtepi16_epi32(codes)));
#elif KERF_PACK_BITS == 256
  const __m128i codes = _mm_loadu_si128(reinterpret_cast<const __m128i*>(from));
  return Pack<float>::Vector(_mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(codes)));
#else
  Pack<float> out;
  for (int k = 0; k < Pack<float>::kLanes; ++k) out.set(k, static_cast<float>(from[k]));
  return out;
#endif
}

/// The nearest integers, even ones in the middle.
inline void store_narrowed(std::int16_t* to, const Pack<float>& x) {
#if KERF_PACK_BITS == 512
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(to),
                      _mm512_cvtsepi32_epi16(_mm512_cvtps_epi32(__m512(x.v))));
#elif KERF_PACK_BITS == 256
  const __m256i codes = _mm256_cvtps_epi32(__m256(x.v));
  _mm_storeu_si128(
      reinterpret_cast<__m128i*>(to),
      _mm_packs_epi32(_mm256_castsi256_si128(codes), _mm256_extracti128_si256(codes, 1)));
#else
  for (int k = 0; k < Pack<float>::kLanes; ++k) to[k] = static_cast<std::int16_t>(std::lrint(x[k]));
#endif
}

/// As bits of floats.
typedef std::int32_t FloatBits __attribute__((vector_size(kPackBytes)));

/// The least numbers, not below the positive ones of x, whose lower halves are zero.
inline Pack<float> rounded_up(const Pack<float>& x) {
  const auto bits = reinterpret_cast<FloatBits>(x.v);
  return reinterpret_cast<Pack<float>::Vector>((bits + 0xFFFF) & ~0xFFFF);
}

/// The upper halves of numbers.
inline void store_upper(std::int16_t* to, const Pack<float>& x) {
  typedef std::int16_t Halves __attribute__((vector_size(kPackBytes / 2)));
  const auto halves = __builtin_convertvector(reinterpret_cast<FloatBits>(x.v) >> 16, Halves);
  std::memcpy(to, &halves, sizeof halves);
}
inline Pack<float> load_upper(const std::int16_t* from) {
#if KERF_PACK_BITS == 512
  const __m256i halves = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(from));
  return Pack<float>::Vector(_mm512_slli_epi32(_mm512_cvtepi16_epi32(halves), 16));
#elif KERF_PACK_BITS == 256
  const __m128i halves = _mm_loadu_si128(reinterpret_cast<const __m128i*>(from));
  return Pack<float>::Vector(_mm256_slli_epi32(_mm256_cvtepi16_epi32(halves), 16));
#else
  FloatBits bits;
  for (int k = 0; k < Pack<float>::kLanes; ++k) bits[k] = from[k] * 65536;
  return reinterpret_cast<Pack<float>::Vector>(bits);
#endif
}

}  // namespace kerf::cpu
