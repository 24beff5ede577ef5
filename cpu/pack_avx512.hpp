// SPDX-License-Identifier: MIT
//
// Packs of 512 bits: cpu/pack.hpp says what these functions do. A register holds four points in
// single precision and two in double.
#pragma once

#include "cpu/pack.hpp"
#include "kernels/unrolled.hpp"

#if KERF_PACK_BITS == 512
#include <immintrin.h>

namespace kerf::cpu {

template <class S>
bool all(const PackMask<S>& mask) {
  return _mm512_movepi32_mask(__m512i(mask.v)) == 0xFFFF;
}

inline Pack<float> greater_size(const Pack<float>& a, const Pack<float>& b) {
  return Pack<float>::Vector(_mm512_max_ps(_mm512_abs_ps(__m512(a.v)), __m512(b.v)));
}

inline Pack<float> fma(const Pack<float>& a, const Pack<float>& b, const Pack<float>& c) {
  return Pack<float>::Vector(_mm512_fmadd_ps(__m512(a.v), __m512(b.v), __m512(c.v)));
}
inline Pack<double> fma(const Pack<double>& a, const Pack<double>& b, const Pack<double>& c) {
  return Pack<double>::Vector(_mm512_fmadd_pd(__m512d(a.v), __m512d(b.v), __m512d(c.v)));
}
inline Pack<double, 32> fma(const Pack<double, 32>& a, const Pack<double, 32>& b,
                            const Pack<double, 32>& c) {
  return Pack<double, 32>::Vector(_mm256_fmadd_pd(__m256d(a.v), __m256d(b.v), __m256d(c.v)));
}
inline Pack<float> sqrt(const Pack<float>& a) {
  return Pack<float>::Vector(_mm512_sqrt_ps(__m512(a.v)));
}
inline Pack<double> sqrt(const Pack<double>& a) {
  return Pack<double>::Vector(_mm512_sqrt_pd(__m512d(a.v)));
}

inline __m512i even_numbers() {
  return _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
}
/// Whether each half of sixteen numbers, not negative, goes on in steps of two from its first.
inline bool are_every_other(const std::int32_t* numbers) {
  const __m512i first = _mm512_mask_set1_epi32(_mm512_set1_epi32(numbers[0]), 0xFF00, numbers[8]),
                within = _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 0, 2, 4, 6, 8, 10, 12, 14);
  return numbers[0] >= 0 && numbers[8] >= 0 &&
         _mm512_cmpeq_epi32_mask(_mm512_loadu_si512(numbers), _mm512_add_epi32(first, within)) ==
             0xFFFF;
}
/// Every other of the scalars at `low` and then at `high`, from the first or the second one on.
inline Pack<float> every_other(const float* low, const float* high, int first) {
  const __m512i which = _mm512_add_epi32(_mm512_set1_epi32(first), even_numbers());
  return Pack<float>::Vector(
      _mm512_permutex2var_ps(_mm512_loadu_ps(low), which, _mm512_loadu_ps(high)));
}

/// Four scalars for each of some numbers, below zero those of the first one. They lie as
/// [number / 16][4][number % 16], and there are fewer than 2^31 of them.
inline void gather_fours(const float* x, const std::int32_t* numbers, Pack<float> (&out)[4]) {
  const __m512i number = _mm512_max_epi32(_mm512_loadu_si512(numbers), _mm512_setzero_si512());
  const __m512i at = _mm512_add_epi32(_mm512_slli_epi32(_mm512_srli_epi32(number, 4), 6),
                                      _mm512_and_si512(number, _mm512_set1_epi32(15)));
  for (int c = 0; c < 4; ++c)
    out[c].v = Pack<float>::Vector(_mm512_i32gather_ps(at, x + 16 * c, sizeof(float)));
}

/// Records of four registers, one after the other, by components.
inline void transpose(__m512 a, __m512 b, __m512 c, __m512 d, kernels::Vec3<Pack<float>>& out) {
  const __m512i xy = _mm512_setr_epi32(0, 4, 8, 12, 16, 20, 24, 28, 1, 5, 9, 13, 17, 21, 25, 29);
  const __m512i z = _mm512_setr_epi32(2, 6, 10, 14, 18, 22, 26, 30, 2, 6, 10, 14, 18, 22, 26, 30);
  const __m512 xy_low = _mm512_permutex2var_ps(a, xy, b);
  const __m512 xy_high = _mm512_permutex2var_ps(c, xy, d);
  out.x.v = _mm512_shuffle_f32x4(xy_low, xy_high, 0x44);
  out.y.v = _mm512_shuffle_f32x4(xy_low, xy_high, 0xEE);
  out.z.v =
      _mm512_shuffle_f32x4(_mm512_permutex2var_ps(a, z, b), _mm512_permutex2var_ps(c, z, d), 0x44);
}
inline void transpose(__m512d a, __m512d b, __m512d c, __m512d d,
                      kernels::Vec3<Pack<double>>& out) {
  const __m512i xy = _mm512_setr_epi64(0, 4, 8, 12, 1, 5, 9, 13);
  const __m512i z = _mm512_setr_epi64(2, 6, 10, 14, 2, 6, 10, 14);
  const __m512d xy_low = _mm512_permutex2var_pd(a, xy, b);
  const __m512d xy_high = _mm512_permutex2var_pd(c, xy, d);
  out.x.v = _mm512_shuffle_f64x2(xy_low, xy_high, 0x44);
  out.y.v = _mm512_shuffle_f64x2(xy_low, xy_high, 0xEE);
  out.z.v =
      _mm512_shuffle_f64x2(_mm512_permutex2var_pd(a, z, b), _mm512_permutex2var_pd(c, z, d), 0x44);
}

/// Lane 4 k + q from lane 4 q + k: what transpose_turned starts from.
inline __m512 turned(__m512 v) {
  return _mm512_permutexvar_ps(
      _mm512_setr_epi32(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15), v);
}
/// And back, from components that are turned.
inline void transpose_turned(__m512 x, __m512 y, __m512 z, __m512 (&r)[4]) {
  const __m512 zero = _mm512_setzero_ps();
  const __m512 xy_low = _mm512_unpacklo_ps(x, y), xy_high = _mm512_unpackhi_ps(x, y);
  const __m512 z0_low = _mm512_unpacklo_ps(z, zero), z0_high = _mm512_unpackhi_ps(z, zero);
  r[0] = _mm512_shuffle_ps(xy_low, z0_low, 0x44);
  r[1] = _mm512_shuffle_ps(xy_low, z0_low, 0xEE);
  r[2] = _mm512_shuffle_ps(xy_high, z0_high, 0x44);
  r[3] = _mm512_shuffle_ps(xy_high, z0_high, 0xEE);
}
template <int kFirst>
__m512d two_records(__m512d x, __m512d y, __m512d z) {
  constexpr int a = kFirst, b = kFirst + 1;
  const __m512d xy =
      _mm512_maskz_permutex2var_pd(0x33, x, _mm512_setr_epi64(a, 8 + a, 0, 0, b, 8 + b, 0, 0), y);
  return _mm512_mask_permutexvar_pd(xy, 0x44, _mm512_setr_epi64(0, 0, a, 0, 0, 0, b, 0), z);
}
inline void transpose(__m512d x, __m512d y, __m512d z, __m512d (&r)[4]) {
  r[0] = two_records<0>(x, y, z);
  r[1] = two_records<2>(x, y, z);
  r[2] = two_records<4>(x, y, z);
  r[3] = two_records<6>(x, y, z);
}

inline void add_to(float* to, __m512 four) {
  _mm512_storeu_ps(to, _mm512_add_ps(_mm512_loadu_ps(to), four));
}
inline void add_to(float* to, __m128 one) { _mm_store_ps(to, _mm_add_ps(_mm_load_ps(to), one)); }
inline void add_to(double* to, __m512d two) {
  _mm512_storeu_pd(to, _mm512_add_pd(_mm512_loadu_pd(to), two));
}
inline void add_to(double* to, __m256d one) {
  _mm256_store_pd(to, _mm256_add_pd(_mm256_load_pd(to), one));
}

template <class At>
Pack<double> records_of(const At& at, int k) {
  const __m512d first = _mm512_castpd256_pd512(_mm256_load_pd(at(2 * k)));
  return Pack<double>::Vector(_mm512_insertf64x4(first, _mm256_load_pd(at(2 * k + 1)), 1));
}
inline void by_components(const Pack<double> (&r)[4], kernels::Vec3<Pack<double>>& out) {
  transpose(__m512d(r[0].v), __m512d(r[1].v), __m512d(r[2].v), __m512d(r[3].v), out);
}

inline void gather_points(const float* x, const std::uint16_t* at,
                          kernels::Vec3<Pack<float>>& out) {
  const auto one = [&](int k) { return _mm_load_ps(x + 4 * std::size_t(at[k])); };
  const auto four = [&](int k) {
    const __m256 low = _mm256_insertf128_ps(_mm256_castps128_ps256(one(k)), one(k + 1), 1);
    const __m256 high = _mm256_insertf128_ps(_mm256_castps128_ps256(one(k + 2)), one(k + 3), 1);
    return _mm512_insertf32x8(_mm512_castps256_ps512(low), high, 1);
  };
  transpose(four(0), four(4), four(8), four(12), out);
}
inline void gather_points(const double* x, const std::uint16_t* at,
                          kernels::Vec3<Pack<double>>& out) {
  const auto one = [&](int k) { return _mm256_load_pd(x + 4 * std::size_t(at[k])); };
  const auto two = [&](int k) {
    return _mm512_insertf64x4(_mm512_castpd256_pd512(one(k)), one(k + 1), 1);
  };
  transpose(two(0), two(2), two(4), two(6), out);
}

inline void gather_in_order(const float* records, kernels::Vec3<Pack<float>>& out) {
  const auto four = [&](int k) { return _mm512_loadu_ps(records + 4 * k); };
  transpose(four(0), four(4), four(8), four(12), out);
}
inline void gather_in_order(const double* records, kernels::Vec3<Pack<double>>& out) {
  const auto two = [&](int k) { return _mm512_loadu_pd(records + 4 * k); };
  transpose(two(0), two(2), two(4), two(6), out);
}

template <class Body>
[[gnu::always_inline]] inline void for_records(const kernels::Vec3<Pack<float>>& f,
                                               const Body& body) {
  using R = Record<float>::Vector;
  __m512 r[4];
  transpose_turned(turned(__m512(f.x.v)), turned(__m512(f.y.v)), turned(__m512(f.z.v)), r);
  for (int i = 0; i < 4; ++i) {
    body(4 * i, R(_mm512_castps512_ps128(r[i])));
    body(4 * i + 1, R(_mm512_extractf32x4_ps(r[i], 1)));
    body(4 * i + 2, R(_mm512_extractf32x4_ps(r[i], 2)));
    body(4 * i + 3, R(_mm512_extractf32x4_ps(r[i], 3)));
  }
}
template <class Body>
[[gnu::always_inline]] inline void for_records(const kernels::Vec3<Pack<double>>& f,
                                               const Body& body) {
  using R = Record<double>::Vector;
  __m512d r[4];
  transpose(__m512d(f.x.v), __m512d(f.y.v), __m512d(f.z.v), r);
  for (int i = 0; i < 4; ++i) {
    body(2 * i, R(_mm512_castpd512_pd256(r[i])));
    body(2 * i + 1, R(_mm512_extractf64x4_pd(r[i], 1)));
  }
}

template <int kRun>
inline void gather_runs(const float* x, const std::uint16_t* points,
                        kernels::Vec3<Pack<float>>& left, kernels::Vec3<Pack<float>>& right) {
  static_assert(kRun == 4 || kRun == 8 || kRun == 16);
  const auto four = [&](int k) { return _mm512_loadu_ps(at_lane<kRun>(x, points, k)); };
  transpose(four(0), four(4), four(8), four(12), left);
  // The last point of each row, and the others one lane on.
  const auto last = [&](int row) {
    return _mm_load_ps(at_lane<kRun>(x, points, kRun * row + kRun - 1) + 4);
  };
  __m512 ends = _mm512_castps128_ps512(last(0));
  if constexpr (kRun < 16) ends = _mm512_insertf32x4(ends, last(1), 1);
  if constexpr (kRun < 8) {
    ends = _mm512_insertf32x4(ends, last(2), 2);
    ends = _mm512_insertf32x4(ends, last(3), 3);
  }
  const auto shifted = [&](const Pack<float>& v, int c) {
    const auto from = [&](int lane) {
      return lane % kRun == kRun - 1 ? 16 + 4 * (lane / kRun) + c : lane + 1;
    };
    const __m512i order = _mm512_setr_epi32(from(0), from(1), from(2), from(3), from(4), from(5),
                                            from(6), from(7), from(8), from(9), from(10), from(11),
                                            from(12), from(13), from(14), from(15));
    return _mm512_permutex2var_ps(__m512(v.v), order, ends);
  };
  right.x.v = shifted(left.x, 0);
  right.y.v = shifted(left.y, 1);
  right.z.v = shifted(left.z, 2);
}
template <int kRun>
inline void gather_runs(const double* x, const std::uint16_t* points,
                        kernels::Vec3<Pack<double>>& left, kernels::Vec3<Pack<double>>& right) {
  static_assert(kRun == 4 || kRun == 8);
  const auto two = [&](int k) { return _mm512_loadu_pd(at_lane<kRun>(x, points, k)); };
  transpose(two(0), two(2), two(4), two(6), left);
  const auto last = [&](int row) {
    return _mm256_load_pd(at_lane<kRun>(x, points, kRun * row + kRun - 1) + 4);
  };
  __m512d ends = _mm512_castpd256_pd512(last(0));
  if constexpr (kRun < 8) ends = _mm512_insertf64x4(ends, last(1), 1);
  const auto shifted = [&](const Pack<double>& v, int c) {
    const auto from = [&](int lane) {
      return lane % kRun == kRun - 1 ? 8 + 4 * (lane / kRun) + c : lane + 1;
    };
    const __m512i order =
        _mm512_setr_epi64(from(0), from(1), from(2), from(3), from(4), from(5), from(6), from(7));
    return _mm512_permutex2var_pd(__m512d(v.v), order, ends);
  };
  right.x.v = shifted(left.x, 0);
  right.y.v = shifted(left.y, 1);
  right.z.v = shifted(left.z, 2);
}

template <int kRun>
inline void add_runs(float* y, const std::uint16_t* points, const kernels::Vec3<Pack<float>>& left,
                     const kernels::Vec3<Pack<float>>& right) {
  static_assert(kRun == 4 || kRun == 8 || kRun == 16);
  // Turned: the lane before 4 q + k is in 4 k + q, and none before the first of a row.
  constexpr __mmask16 kInner = kRun == 16 ? 0xFFFE : kRun == 8 ? 0xFFFA : 0xFFF0;
  const __m512i before = _mm512_setr_epi32(0, 3, 7, 11, 0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14);
  const auto merged = [&](const Pack<float>& l, const Pack<float>& r) {
    return _mm512_add_ps(turned(__m512(l.v)),
                         _mm512_maskz_permutexvar_ps(kInner, before, __m512(r.v)));
  };
  __m512 r[4];
  transpose_turned(merged(left.x, right.x), merged(left.y, right.y), merged(left.z, right.z), r);
  for (int i = 0; i < 4; ++i) add_to(at_lane<kRun>(y, points, 4 * i), r[i]);
  const __m512 ends = _mm512_shuffle_ps(_mm512_unpackhi_ps(__m512(right.x.v), __m512(right.y.v)),
                                        _mm512_unpackhi_ps(__m512(right.z.v), _mm512_setzero_ps()),
                                        0xEE);  // of lanes 3, 7, 11, 15
  const auto add_last = [&](int lane, __m128 record) {
    add_to(at_lane<kRun>(y, points, lane) + 4, record);
  };
  if constexpr (kRun == 4) add_last(3, _mm512_castps512_ps128(ends));
  if constexpr (kRun <= 8) add_last(7, _mm512_extractf32x4_ps(ends, 1));
  if constexpr (kRun == 4) add_last(11, _mm512_extractf32x4_ps(ends, 2));
  add_last(15, _mm512_extractf32x4_ps(ends, 3));
}
template <int kRun>
inline void add_runs(double* y, const std::uint16_t* points,
                     const kernels::Vec3<Pack<double>>& left,
                     const kernels::Vec3<Pack<double>>& right) {
  static_assert(kRun == 4 || kRun == 8);
  constexpr __mmask8 kInner = kRun == 8 ? 0xFE : 0xEE;
  const __m512i before = _mm512_setr_epi64(0, 0, 1, 2, 3, 4, 5, 6);
  const auto merged = [&](const Pack<double>& l, const Pack<double>& r) {
    return _mm512_add_pd(__m512d(l.v), _mm512_maskz_permutexvar_pd(kInner, before, __m512d(r.v)));
  };
  __m512d r[4];
  transpose(merged(left.x, right.x), merged(left.y, right.y), merged(left.z, right.z), r);
  for (int i = 0; i < 4; ++i) add_to(at_lane<kRun>(y, points, 2 * i), r[i]);
  const auto record = [&](int lane) {
    return Record<double>::Vector{right.x[lane], right.y[lane], right.z[lane], 0};
  };
  if constexpr (kRun == 4) add_to(at_lane<kRun>(y, points, 3) + 4, __m256d(record(3)));
  add_to(at_lane<kRun>(y, points, 7) + 4, __m256d(record(7)));
}

inline void gather_pairs(const float* x, const std::uint16_t* at, kernels::Vec3<Pack<float>>& left,
                         kernels::Vec3<Pack<float>>& right) {
  const auto pair = [&](int k) { return _mm256_loadu_ps(x + 4 * std::size_t(at[k])); };
  const auto two = [&](int k) {
    return _mm512_insertf32x8(_mm512_castps256_ps512(pair(k)), pair(k + 1), 1);
  };
  __m512 l[4], r[4];
  kernels::unrolled<4>([&](auto i) {
    const __m512 low = two(4 * i), high = two(4 * i + 2);
    l[i] = _mm512_shuffle_f32x4(low, high, 0x88);
    r[i] = _mm512_shuffle_f32x4(low, high, 0xDD);
  });
  transpose(l[0], l[1], l[2], l[3], left);
  transpose(r[0], r[1], r[2], r[3], right);
}
inline void gather_pairs(const double* x, const std::uint16_t* at,
                         kernels::Vec3<Pack<double>>& left, kernels::Vec3<Pack<double>>& right) {
  const auto pair = [&](int k) { return _mm512_loadu_pd(x + 4 * std::size_t(at[k])); };
  __m512d l[4], r[4];
  kernels::unrolled<4>([&](auto i) {
    const __m512d low = pair(2 * i), high = pair(2 * i + 1);
    l[i] = _mm512_shuffle_f64x2(low, high, 0x44);
    r[i] = _mm512_shuffle_f64x2(low, high, 0xEE);
  });
  transpose(l[0], l[1], l[2], l[3], left);
  transpose(r[0], r[1], r[2], r[3], right);
}

[[gnu::always_inline]] inline void add_pairs(float* y, const std::uint16_t* at,
                                             const kernels::Vec3<Pack<float>>& left,
                                             const kernels::Vec3<Pack<float>>& right) {
  __m512 l[4], r[4];
  transpose_turned(turned(__m512(left.x.v)), turned(__m512(left.y.v)), turned(__m512(left.z.v)), l);
  transpose_turned(turned(__m512(right.x.v)), turned(__m512(right.y.v)), turned(__m512(right.z.v)),
                   r);
  const __m512i low = _mm512_setr_epi64(0, 1, 8, 9, 2, 3, 10, 11);
  const __m512i high = _mm512_setr_epi64(4, 5, 12, 13, 6, 7, 14, 15);
  const auto add = [&](int lane, __m256 pair) {
    float* const to = y + 4 * std::size_t(at[lane]);
    _mm256_storeu_ps(to, _mm256_add_ps(_mm256_loadu_ps(to), pair));
  };
  kernels::unrolled<4>([&](auto i) {
    const __m512d a = _mm512_castps_pd(l[i]), b = _mm512_castps_pd(r[i]);
    const __m512 first = _mm512_castpd_ps(_mm512_permutex2var_pd(a, low, b));
    const __m512 second = _mm512_castpd_ps(_mm512_permutex2var_pd(a, high, b));
    add(4 * i, _mm512_castps512_ps256(first));
    add(4 * i + 1, _mm512_extractf32x8_ps(first, 1));
    add(4 * i + 2, _mm512_castps512_ps256(second));
    add(4 * i + 3, _mm512_extractf32x8_ps(second, 1));
  });
}
[[gnu::always_inline]] inline void add_pairs(double* y, const std::uint16_t* at,
                                             const kernels::Vec3<Pack<double>>& left,
                                             const kernels::Vec3<Pack<double>>& right) {
  __m512d l[4], r[4];
  transpose(__m512d(left.x.v), __m512d(left.y.v), __m512d(left.z.v), l);
  transpose(__m512d(right.x.v), __m512d(right.y.v), __m512d(right.z.v), r);
  kernels::unrolled<4>([&](auto i) {
    add_to(y + 4 * std::size_t(at[2 * i]), _mm512_shuffle_f64x2(l[i], r[i], 0x44));
    add_to(y + 4 * std::size_t(at[2 * i + 1]), _mm512_shuffle_f64x2(l[i], r[i], 0xEE));
  });
}

}  // namespace kerf::cpu

#endif
