// SPDX-License-Identifier: MIT
//
// Packs of 256 bits: cpu/pack.hpp says what these functions do.
#pragma once

#include "cpu/pack.hpp"

#if KERF_PACK_BITS == 256
#include <immintrin.h>

namespace kerf::cpu {

template <class S>
bool all(const PackMask<S>& mask) {
  return _mm256_movemask_epi8(__m256i(mask.v)) == -1;
}

inline Pack<float> greater_size(const Pack<float>& a, const Pack<float>& b) {
  const __m256 size = _mm256_andnot_ps(_mm256_set1_ps(-0.0F), __m256(a.v));
  return Pack<float>::Vector(_mm256_max_ps(size, __m256(b.v)));
}

inline Pack<float> fma(const Pack<float>& a, const Pack<float>& b, const Pack<float>& c) {
  return Pack<float>::Vector(_mm256_fmadd_ps(__m256(a.v), __m256(b.v), __m256(c.v)));
}
inline Pack<double> fma(const Pack<double>& a, const Pack<double>& b, const Pack<double>& c) {
  return Pack<double>::Vector(_mm256_fmadd_pd(__m256d(a.v), __m256d(b.v), __m256d(c.v)));
}
inline Pack<float> sqrt(const Pack<float>& a) {
  return Pack<float>::Vector(_mm256_sqrt_ps(__m256(a.v)));
}
inline Pack<double> sqrt(const Pack<double>& a) {
  return Pack<double>::Vector(_mm256_sqrt_pd(__m256d(a.v)));
}

/// Records 0 and 4, 1 and 5, 2 and 6, 3 and 7, by components.
inline void transpose(__m256 a, __m256 b, __m256 c, __m256 d, kernels::Vec3<Pack<float>>& out) {
  const __m256 ab_low = _mm256_unpacklo_ps(a, b), ab_high = _mm256_unpackhi_ps(a, b);
  const __m256 cd_low = _mm256_unpacklo_ps(c, d), cd_high = _mm256_unpackhi_ps(c, d);
  out.x.v = _mm256_shuffle_ps(ab_low, cd_low, 0x44);
  out.y.v = _mm256_shuffle_ps(ab_low, cd_low, 0xEE);
  out.z.v = _mm256_shuffle_ps(ab_high, cd_high, 0x44);
}
inline void transpose(__m256d a, __m256d b, __m256d c, __m256d d,
                      kernels::Vec3<Pack<double>>& out) {
  const __m256d ab_low = _mm256_unpacklo_pd(a, b), ab_high = _mm256_unpackhi_pd(a, b);
  const __m256d cd_low = _mm256_unpacklo_pd(c, d), cd_high = _mm256_unpackhi_pd(c, d);
  out.x.v = _mm256_permute2f128_pd(ab_low, cd_low, 0x20);
  out.y.v = _mm256_permute2f128_pd(ab_high, cd_high, 0x20);
  out.z.v = _mm256_permute2f128_pd(ab_low, cd_low, 0x31);
}
/// And back.
inline void transpose(__m256 x, __m256 y, __m256 z, __m256 (&r)[4]) {
  const __m256 zero = _mm256_setzero_ps();
  const __m256 xy_low = _mm256_unpacklo_ps(x, y), xy_high = _mm256_unpackhi_ps(x, y);
  const __m256 z0_low = _mm256_unpacklo_ps(z, zero), z0_high = _mm256_unpackhi_ps(z, zero);
  r[0] = _mm256_shuffle_ps(xy_low, z0_low, 0x44);
  r[1] = _mm256_shuffle_ps(xy_low, z0_low, 0xEE);
  r[2] = _mm256_shuffle_ps(xy_high, z0_high, 0x44);
  r[3] = _mm256_shuffle_ps(xy_high, z0_high, 0xEE);
}
inline void transpose(__m256d x, __m256d y, __m256d z, __m256d (&r)[4]) {
  const __m256d zero = _mm256_setzero_pd();
  const __m256d xy_low = _mm256_unpacklo_pd(x, y), xy_high = _mm256_unpackhi_pd(x, y);
  const __m256d z0_low = _mm256_unpacklo_pd(z, zero), z0_high = _mm256_unpackhi_pd(z, zero);
  r[0] = _mm256_permute2f128_pd(xy_low, z0_low, 0x20);
  r[1] = _mm256_permute2f128_pd(xy_high, z0_high, 0x20);
  r[2] = _mm256_permute2f128_pd(xy_low, z0_low, 0x31);
  r[3] = _mm256_permute2f128_pd(xy_high, z0_high, 0x31);
}
inline __m256 two_records(const float* low, const float* high) {
  return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_load_ps(low)), _mm_load_ps(high), 1);
}
inline void add_record(float* to, __m128 record) {
  _mm_store_ps(to, _mm_add_ps(_mm_load_ps(to), record));
}
inline void add_record(double* to, __m256d record) {
  _mm256_store_pd(to, _mm256_add_pd(_mm256_load_pd(to), record));
}

template <class At>
Pack<double> records_of(const At& at, int k) {
  return Pack<double>::Vector(_mm256_load_pd(at(k)));
}
inline void by_components(const Pack<double> (&r)[4], kernels::Vec3<Pack<double>>& out) {
  transpose(__m256d(r[0].v), __m256d(r[1].v), __m256d(r[2].v), __m256d(r[3].v), out);
}

inline void gather_points(const float* x, const std::uint16_t* at,
                          kernels::Vec3<Pack<float>>& out) {
  const auto pair = [&](int k) {
    return two_records(x + 4 * std::size_t(at[k]), x + 4 * std::size_t(at[k + 4]));
  };
  transpose(pair(0), pair(1), pair(2), pair(3), out);
}
inline void gather_points(const double* x, const std::uint16_t* at,
                          kernels::Vec3<Pack<double>>& out) {
  const auto one = [&](int k) { return _mm256_load_pd(x + 4 * std::size_t(at[k])); };
  transpose(one(0), one(1), one(2), one(3), out);
}

template <class Body>
[[gnu::always_inline]] inline void for_records(const kernels::Vec3<Pack<float>>& f,
                                               const Body& body) {
  using R = Record<float>::Vector;
  __m256 r[4];
  transpose(__m256(f.x.v), __m256(f.y.v), __m256(f.z.v), r);
  for (int i = 0; i < 4; ++i) body(i, R(_mm256_castps256_ps128(r[i])));
  for (int i = 0; i < 4; ++i) body(i + 4, R(_mm256_extractf128_ps(r[i], 1)));
}
template <class Body>
[[gnu::always_inline]] inline void for_records(const kernels::Vec3<Pack<double>>& f,
                                               const Body& body) {
  __m256d r[4];
  transpose(__m256d(f.x.v), __m256d(f.y.v), __m256d(f.z.v), r);
  for (int i = 0; i < 4; ++i) body(i, Record<double>::Vector(r[i]));
}

inline void gather_rows(const float* low, const float* high, kernels::Vec3<Pack<float>>& left,
                        kernels::Vec3<Pack<float>>& right) {
  const auto pair = [&](int k) { return two_records(low + 4 * k, high + 4 * k); };
  const __m256 a = pair(0), b = pair(1), c = pair(2), d = pair(3), e = pair(4);
  transpose(a, b, c, d, left);
  transpose(b, c, d, e, right);
}
template <int kRun>
inline void gather_runs(const float* x, const std::uint16_t* points,
                        kernels::Vec3<Pack<float>>& left, kernels::Vec3<Pack<float>>& right) {
  static_assert(kRun == 4 || kRun == 8);
  const float* const low = x + 4 * std::size_t(points[0]);
  gather_rows(low, kRun == 8 ? low + 16 : x + 4 * std::size_t(points[1]), left, right);
}
template <int kRun>
inline void gather_runs(const double* x, const std::uint16_t* points,
                        kernels::Vec3<Pack<double>>& left, kernels::Vec3<Pack<double>>& right) {
  static_assert(kRun == 4);
  const double* const first = x + 4 * std::size_t(points[0]);
  const auto one = [&](int k) { return _mm256_load_pd(first + 4 * k); };
  const __m256d a = one(0), b = one(1), c = one(2), d = one(3), e = one(4);
  transpose(a, b, c, d, left);
  transpose(b, c, d, e, right);
}

inline void add_to_rows(float* low, float* high, const kernels::Vec3<Pack<float>>& left,
                        const kernels::Vec3<Pack<float>>& right) {
  const __m256 zero = _mm256_setzero_ps();
  const auto merged = [&](const Pack<float>& l, const Pack<float>& r) {
    const __m256 turned = _mm256_permute_ps(__m256(r.v), 0x93);  // lanes 3 0 1 2 of each half
    return _mm256_add_ps(__m256(l.v), _mm256_blend_ps(turned, zero, 0x11));
  };
  __m256 r[4];
  transpose(merged(left.x, right.x), merged(left.y, right.y), merged(left.z, right.z), r);
  const __m256 last = _mm256_shuffle_ps(_mm256_unpackhi_ps(__m256(right.x.v), __m256(right.y.v)),
                                        _mm256_unpackhi_ps(__m256(right.z.v), zero), 0xEE);
  // One row after the other: the second may begin where the first ends.
  for (int k = 0; k < 5; ++k) add_record(low + 4 * k, _mm256_castps256_ps128(k < 4 ? r[k] : last));
  for (int k = 0; k < 5; ++k)
    add_record(high + 4 * k, _mm256_extractf128_ps(k < 4 ? r[k] : last, 1));
}
inline void add_to_row(float* first, const kernels::Vec3<Pack<float>>& left,
                       const kernels::Vec3<Pack<float>>& right) {
  const auto merged = [](const Pack<float>& l, const Pack<float>& r) {
    const __m256 turned =
        _mm256_permutevar8x32_ps(__m256(r.v), _mm256_setr_epi32(7, 0, 1, 2, 3, 4, 5, 6));
    return _mm256_add_ps(__m256(l.v), _mm256_blend_ps(turned, _mm256_setzero_ps(), 1));
  };
  __m256 r[4];
  transpose(merged(left.x, right.x), merged(left.y, right.y), merged(left.z, right.z), r);
  const auto add = [&](int point, __m256 two) {
    float* to = first + 4 * point;
    _mm256_storeu_ps(to, _mm256_add_ps(_mm256_loadu_ps(to), two));
  };
  add(0, _mm256_permute2f128_ps(r[0], r[1], 0x20));
  add(2, _mm256_permute2f128_ps(r[2], r[3], 0x20));
  add(4, _mm256_permute2f128_ps(r[0], r[1], 0x31));
  add(6, _mm256_permute2f128_ps(r[2], r[3], 0x31));
  const auto upper = [](const Pack<float>& p) { return _mm256_extractf128_ps(__m256(p.v), 1); };
  add_record(first + 32, _mm_shuffle_ps(_mm_unpackhi_ps(upper(right.x), upper(right.y)),
                                        _mm_unpackhi_ps(upper(right.z), _mm_setzero_ps()), 0xEE));
}
template <int kRun>
inline void add_runs(double* y, const std::uint16_t* points,
                     const kernels::Vec3<Pack<double>>& left,
                     const kernels::Vec3<Pack<double>>& right) {
  static_assert(kRun == 4);
  double* const first = y + 4 * std::size_t(points[0]);
  const __m256d zero = _mm256_setzero_pd();
  const auto merged = [&](const Pack<double>& l, const Pack<double>& r) {
    const __m256d turned = _mm256_permute4x64_pd(__m256d(r.v), 0x93);
    return _mm256_add_pd(__m256d(l.v), _mm256_blend_pd(turned, zero, 1));
  };
  __m256d r[4];
  transpose(merged(left.x, right.x), merged(left.y, right.y), merged(left.z, right.z), r);
  for (int k = 0; k < 4; ++k) add_record(first + 4 * k, r[k]);
  add_record(first + 16,
             _mm256_permute2f128_pd(_mm256_unpackhi_pd(__m256d(right.x.v), __m256d(right.y.v)),
                                    _mm256_unpackhi_pd(__m256d(right.z.v), zero), 0x31));
}

template <int kRun>
inline void add_runs(float* y, const std::uint16_t* points, const kernels::Vec3<Pack<float>>& left,
                     const kernels::Vec3<Pack<float>>& right) {
  static_assert(kRun == 4 || kRun == 8);
  float* const first = y + 4 * std::size_t(points[0]);
  if constexpr (kRun == 8)
    add_to_row(first, left, right);
  else
    add_to_rows(first, y + 4 * std::size_t(points[1]), left, right);
}

template <class S>
inline void gather_in_order(const S* records, kernels::Vec3<Pack<S>>& out) {
  static constexpr std::uint16_t kOrder[] = {0, 1, 2, 3, 4, 5, 6, 7};
  gather_points(records, kOrder, out);
}

inline void gather_pairs(const float* x, const std::uint16_t* at, kernels::Vec3<Pack<float>>& left,
                         kernels::Vec3<Pack<float>>& right) {
  const auto pair = [&](int k) { return _mm256_loadu_ps(x + 4 * std::size_t(at[k])); };
  kernels::Vec3<Pack<float>> low, high;  // left ends of four lanes, and their right ones
  transpose(pair(0), pair(1), pair(2), pair(3), low);
  transpose(pair(4), pair(5), pair(6), pair(7), high);
  for (int c = 0; c < 3; ++c) {
    left[c].v = _mm256_permute2f128_ps(__m256(low[c].v), __m256(high[c].v), 0x20);
    right[c].v = _mm256_permute2f128_ps(__m256(low[c].v), __m256(high[c].v), 0x31);
  }
}
inline void gather_pairs(const double* x, const std::uint16_t* at,
                         kernels::Vec3<Pack<double>>& left, kernels::Vec3<Pack<double>>& right) {
  gather_points(x, at, left);
  gather_points(x + 4, at, right);
}

[[gnu::always_inline]] inline void add_pairs(float* y, const std::uint16_t* at,
                                             const kernels::Vec3<Pack<float>>& left,
                                             const kernels::Vec3<Pack<float>>& right) {
  const auto low = [](const Pack<float>& l, const Pack<float>& r) {
    return _mm256_permute2f128_ps(__m256(l.v), __m256(r.v), 0x20);
  };
  const auto high = [](const Pack<float>& l, const Pack<float>& r) {
    return _mm256_permute2f128_ps(__m256(l.v), __m256(r.v), 0x31);
  };
  __m256 r[4];
  const auto add = [&](int first) {
    for (int i = 0; i < 4; ++i) {
      float* const to = y + 4 * std::size_t(at[first + i]);
      _mm256_storeu_ps(to, _mm256_add_ps(_mm256_loadu_ps(to), r[i]));
    }
  };
  transpose(low(left.x, right.x), low(left.y, right.y), low(left.z, right.z), r);
  add(0);
  transpose(high(left.x, right.x), high(left.y, right.y), high(left.z, right.z), r);
  add(4);
}
[[gnu::always_inline]] inline void add_pairs(double* y, const std::uint16_t* at,
                                             const kernels::Vec3<Pack<double>>& left,
                                             const kernels::Vec3<Pack<double>>& right) {
  __m256d l[4], r[4];
  transpose(__m256d(left.x.v), __m256d(left.y.v), __m256d(left.z.v), l);
  transpose(__m256d(right.x.v), __m256d(right.y.v), __m256d(right.z.v), r);
  for (int i = 0; i < 4; ++i) {
    double* const to = y + 4 * std::size_t(at[i]);
    add_record(to, l[i]);
    add_record(to + 4, r[i]);
  }
}

}  // namespace kerf::cpu

#endif
