// SPDX-License-Identifier: MIT
//
// A SIMD pack that the bodies of kernels/ take for a scalar: one cell in each lane.
//
// Layout  256 bits: 8 floats or 4 doubles. Without AVX2 the compiler splits packs; the results are
//         the same bits, since every lane does what a scalar would.
#pragma once

#include <cstdint>
#include <type_traits>

#include "kernels/fma.hpp"
#include "kernels/mat3.hpp"

#if defined(__AVX2__) && defined(__FMA__)
#include <immintrin.h>
#endif

namespace kerf::cpu {

inline constexpr int kPackBytes = 32;

/// Lane by lane all ones or all zeros.
template <class S>
struct PackMask {
  using Int = std::conditional_t<sizeof(S) == 4, std::int32_t, std::int64_t>;
  typedef Int Vector __attribute__((vector_size(kPackBytes)));
  Vector v;

  friend PackMask operator&&(const PackMask& a, const PackMask& b) { return {a.v & b.v}; }
  friend PackMask operator||(const PackMask& a, const PackMask& b) { return {a.v | b.v}; }
  friend PackMask operator!(const PackMask& a) { return {~a.v}; }
};

template <class S>
struct Pack {
  using Scalar = S;
  static constexpr int kLanes = kPackBytes / static_cast<int>(sizeof(S));
  typedef S Vector __attribute__((vector_size(kPackBytes)));
  Vector v;  // Pack{} is zero; an array of packs without braces is not

  Pack() = default;
  Pack(const Vector& vector) : v(vector) {}  // NOLINT: packs and vectors are one thing
  template <class Number>
  requires std::is_arithmetic_v<Number>
  explicit Pack(Number s) : v(static_cast<S>(s) - Vector{}) {}

  S operator[](int lane) const { return v[lane]; }
  void set(int lane, S value) { v[lane] = value; }

  Pack& operator+=(const Pack& b) {
    v += b.v;
    return *this;
  }
  Pack& operator-=(const Pack& b) {
    v -= b.v;
    return *this;
  }
  Pack& operator*=(const Pack& b) {
    v *= b.v;
    return *this;
  }
  friend Pack operator+(const Pack& a, const Pack& b) { return a.v + b.v; }
  friend Pack operator-(const Pack& a, const Pack& b) { return a.v - b.v; }
  friend Pack operator*(const Pack& a, const Pack& b) { return a.v * b.v; }
  friend Pack operator/(const Pack& a, const Pack& b) { return a.v / b.v; }
  friend Pack operator-(const Pack& a) { return -a.v; }
  friend PackMask<S> operator<(const Pack& a, const Pack& b) { return {a.v < b.v}; }
  friend PackMask<S> operator>(const Pack& a, const Pack& b) { return {a.v > b.v}; }
  friend PackMask<S> operator<=(const Pack& a, const Pack& b) { return {a.v <= b.v}; }
};

template <class S>
Pack<S> select(const PackMask<S>& mask, const Pack<S>& a, const Pack<S>& b) {
  return mask.v ? a.v : b.v;
}

template <class S>
bool all(const PackMask<S>& mask) {
  for (int i = 0; i < Pack<S>::kLanes; ++i)
    if (mask.v[i] == 0) return false;
  return true;
}

inline Pack<float> fma(const Pack<float>& a, const Pack<float>& b, const Pack<float>& c) {
#if defined(__AVX2__) && defined(__FMA__)
  return Pack<float>::Vector(_mm256_fmadd_ps(__m256(a.v), __m256(b.v), __m256(c.v)));
#else
  Pack<float> out;
  for (int i = 0; i < 8; ++i) out.v[i] = __builtin_fmaf(a.v[i], b.v[i], c.v[i]);
  return out;
#endif
}
inline Pack<double> fma(const Pack<double>& a, const Pack<double>& b, const Pack<double>& c) {
#if defined(__AVX2__) && defined(__FMA__)
  return Pack<double>::Vector(_mm256_fmadd_pd(__m256d(a.v), __m256d(b.v), __m256d(c.v)));
#else
  Pack<double> out;
  for (int i = 0; i < 4; ++i) out.v[i] = __builtin_fma(a.v[i], b.v[i], c.v[i]);
  return out;
#endif
}
inline Pack<float> sqrt(const Pack<float>& a) {
#if defined(__AVX2__) && defined(__FMA__)
  return Pack<float>::Vector(_mm256_sqrt_ps(__m256(a.v)));
#else
  Pack<float> out;
  for (int i = 0; i < 8; ++i) out.v[i] = __builtin_sqrtf(a.v[i]);
  return out;
#endif
}
inline Pack<double> sqrt(const Pack<double>& a) {
#if defined(__AVX2__) && defined(__FMA__)
  return Pack<double>::Vector(_mm256_sqrt_pd(__m256d(a.v)));
#else
  Pack<double> out;
  for (int i = 0; i < 4; ++i) out.v[i] = __builtin_sqrt(a.v[i]);
  return out;
#endif
}

/// Three components of one point, and a fourth scalar that is zero.
template <class S>
struct Record {
  typedef S Vector __attribute__((vector_size(4 * sizeof(S))));
};

template <class S>
Pack<S> load_pack(const S* from) {
  Pack<S> out;
  __builtin_memcpy(&out.v, from, sizeof out.v);
  return out;
}
template <class S>
void store_pack(S* to, const Pack<S>& pack) {
  __builtin_memcpy(to, &pack.v, sizeof pack.v);
}

// Points are records of four scalars, the fourth of them zero, aligned to their size.

/// One vector of each lane's point.
inline void gather_points(const float* x, const std::uint16_t* at,
                          kernels::Vec3<Pack<float>>& out) {
#if defined(__AVX2__) && defined(__FMA__)
  const auto pair = [&](int low, int high) {
    return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_load_ps(x + 4 * std::size_t(at[low]))),
                                _mm_load_ps(x + 4 * std::size_t(at[high])), 1);
  };
  const __m256 a = pair(0, 4), b = pair(1, 5), c = pair(2, 6), d = pair(3, 7);
  const __m256 ab_low = _mm256_unpacklo_ps(a, b), ab_high = _mm256_unpackhi_ps(a, b);
  const __m256 cd_low = _mm256_unpacklo_ps(c, d), cd_high = _mm256_unpackhi_ps(c, d);
  out.x.v = _mm256_shuffle_ps(ab_low, cd_low, 0x44);
  out.y.v = _mm256_shuffle_ps(ab_low, cd_low, 0xEE);
  out.z.v = _mm256_shuffle_ps(ab_high, cd_high, 0x44);
#else
  for (int i = 0; i < 8; ++i)
    for (int c = 0; c < 3; ++c) out[c].set(i, x[4 * std::size_t(at[i]) + std::size_t(c)]);
#endif
}
inline void gather_points(const double* x, const std::uint16_t* at,
                          kernels::Vec3<Pack<double>>& out) {
#if defined(__AVX2__) && defined(__FMA__)
  const __m256d a = _mm256_load_pd(x + 4 * std::size_t(at[0]));
  const __m256d b = _mm256_load_pd(x + 4 * std::size_t(at[1]));
  const __m256d c = _mm256_load_pd(x + 4 * std::size_t(at[2]));
  const __m256d d = _mm256_load_pd(x + 4 * std::size_t(at[3]));
  const __m256d ab_low = _mm256_unpacklo_pd(a, b), ab_high = _mm256_unpackhi_pd(a, b);
  const __m256d cd_low = _mm256_unpacklo_pd(c, d), cd_high = _mm256_unpackhi_pd(c, d);
  out.x.v = _mm256_permute2f128_pd(ab_low, cd_low, 0x20);
  out.y.v = _mm256_permute2f128_pd(ab_high, cd_high, 0x20);
  out.z.v = _mm256_permute2f128_pd(ab_low, cd_low, 0x31);
#else
  for (int i = 0; i < 4; ++i)
    for (int c = 0; c < 3; ++c) out[c].set(i, x[4 * std::size_t(at[i]) + std::size_t(c)]);
#endif
}
template <class S>
kernels::Vec3<Pack<S>> gathered(const S* x, const std::uint16_t* at) {
  kernels::Vec3<Pack<S>> out;
  gather_points(x, at, out);
  return out;
}

/// Calls body(lane, record) for the vectors of the lanes, as records, in the order of the lanes.
template <class Body>
[[gnu::always_inline]] inline void for_records(const kernels::Vec3<Pack<float>>& f,
                                               const Body& body) {
#if defined(__AVX2__) && defined(__FMA__)
  const __m256 x(f.x.v), y(f.y.v), z(f.z.v), zero = _mm256_setzero_ps();
  const __m256 xy_low = _mm256_unpacklo_ps(x, y), xy_high = _mm256_unpackhi_ps(x, y);
  const __m256 z0_low = _mm256_unpacklo_ps(z, zero), z0_high = _mm256_unpackhi_ps(z, zero);
  const __m256 r[4] = {
      _mm256_shuffle_ps(xy_low, z0_low, 0x44), _mm256_shuffle_ps(xy_low, z0_low, 0xEE),
      _mm256_shuffle_ps(xy_high, z0_high, 0x44), _mm256_shuffle_ps(xy_high, z0_high, 0xEE)};
  using R = Record<float>::Vector;
  for (int i = 0; i < 4; ++i) body(i, R(_mm256_castps256_ps128(r[i])));
  for (int i = 0; i < 4; ++i) body(i + 4, R(_mm256_extractf128_ps(r[i], 1)));
#else
  for (int i = 0; i < 8; ++i) body(i, Record<float>::Vector{f.x[i], f.y[i], f.z[i], 0});
#endif
}
template <class Body>
[[gnu::always_inline]] inline void for_records(const kernels::Vec3<Pack<double>>& f,
                                               const Body& body) {
#if defined(__AVX2__) && defined(__FMA__)
  const __m256d x(f.x.v), y(f.y.v), z(f.z.v), zero = _mm256_setzero_pd();
  const __m256d xy_low = _mm256_unpacklo_pd(x, y), xy_high = _mm256_unpackhi_pd(x, y);
  const __m256d z0_low = _mm256_unpacklo_pd(z, zero), z0_high = _mm256_unpackhi_pd(z, zero);
  using R = Record<double>::Vector;
  body(0, R(_mm256_permute2f128_pd(xy_low, z0_low, 0x20)));
  body(1, R(_mm256_permute2f128_pd(xy_high, z0_high, 0x20)));
  body(2, R(_mm256_permute2f128_pd(xy_low, z0_low, 0x31)));
  body(3, R(_mm256_permute2f128_pd(xy_high, z0_high, 0x31)));
#else
  for (int i = 0; i < 4; ++i) body(i, Record<double>::Vector{f.x[i], f.y[i], f.z[i], 0});
#endif
}

// The left and right ends of rows of four cells, whose points follow each other: a lane has points
// k and k + 1 of its row. Results by reference: GCC 12 copies structs of packs by halves of 64 bits.

/// Two rows, from points `low` and `high` on.
inline void gather_rows(const float* low, const float* high, kernels::Vec3<Pack<float>>& left,
                        kernels::Vec3<Pack<float>>& right) {
#if defined(__AVX2__) && defined(__FMA__)
  const auto pair = [&](int k) {
    return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_load_ps(low + 4 * k)),
                                _mm_load_ps(high + 4 * k), 1);
  };
  const __m256 a = pair(0), b = pair(1), c = pair(2), d = pair(3), e = pair(4);
  const __m256 ab_low = _mm256_unpacklo_ps(a, b), ab_high = _mm256_unpackhi_ps(a, b);
  const __m256 cd_low = _mm256_unpacklo_ps(c, d), cd_high = _mm256_unpackhi_ps(c, d);
  left.x.v = _mm256_shuffle_ps(ab_low, cd_low, 0x44);
  left.y.v = _mm256_shuffle_ps(ab_low, cd_low, 0xEE);
  left.z.v = _mm256_shuffle_ps(ab_high, cd_high, 0x44);
  const __m256 bc_low = _mm256_unpacklo_ps(b, c), bc_high = _mm256_unpackhi_ps(b, c);
  const __m256 de_low = _mm256_unpacklo_ps(d, e), de_high = _mm256_unpackhi_ps(d, e);
  right.x.v = _mm256_shuffle_ps(bc_low, de_low, 0x44);
  right.y.v = _mm256_shuffle_ps(bc_low, de_low, 0xEE);
  right.z.v = _mm256_shuffle_ps(bc_high, de_high, 0x44);
#else
  for (int i = 0; i < 8; ++i) {
    const float* from = i < 4 ? low + 4 * i : high + 4 * (i - 4);
    for (int c = 0; c < 3; ++c) {
      left[c].set(i, from[c]);
      right[c].set(i, from[4 + c]);
    }
  }
#endif
}
/// One row of eight.
inline void gather_row(const float* first, kernels::Vec3<Pack<float>>& left,
                       kernels::Vec3<Pack<float>>& right) {
  gather_rows(first, first + 16, left, right);
}
inline void gather_row(const double* first, kernels::Vec3<Pack<double>>& left,
                       kernels::Vec3<Pack<double>>& right) {
#if defined(__AVX2__) && defined(__FMA__)
  const __m256d a = _mm256_load_pd(first), b = _mm256_load_pd(first + 4);
  const __m256d c = _mm256_load_pd(first + 8), d = _mm256_load_pd(first + 12);
  const __m256d e = _mm256_load_pd(first + 16);
  const __m256d ab_low = _mm256_unpacklo_pd(a, b), ab_high = _mm256_unpackhi_pd(a, b);
  const __m256d cd_low = _mm256_unpacklo_pd(c, d), cd_high = _mm256_unpackhi_pd(c, d);
  left.x.v = _mm256_permute2f128_pd(ab_low, cd_low, 0x20);
  left.y.v = _mm256_permute2f128_pd(ab_high, cd_high, 0x20);
  left.z.v = _mm256_permute2f128_pd(ab_low, cd_low, 0x31);
  const __m256d bc_low = _mm256_unpacklo_pd(b, c), bc_high = _mm256_unpackhi_pd(b, c);
  const __m256d de_low = _mm256_unpacklo_pd(d, e), de_high = _mm256_unpackhi_pd(d, e);
  right.x.v = _mm256_permute2f128_pd(bc_low, de_low, 0x20);
  right.y.v = _mm256_permute2f128_pd(bc_high, de_high, 0x20);
  right.z.v = _mm256_permute2f128_pd(bc_low, de_low, 0x31);
#else
  for (int i = 0; i < 4; ++i)
    for (int c = 0; c < 3; ++c) {
      left[c].set(i, first[4 * i + c]);
      right[c].set(i, first[4 * i + 4 + c]);
    }
#endif
}

/// Adds the ends of two rows to their points: what two cells give to a point is summed first.
inline void add_to_rows(float* low, float* high, const kernels::Vec3<Pack<float>>& left,
                        const kernels::Vec3<Pack<float>>& right) {
#if defined(__AVX2__) && defined(__FMA__)
  const auto merged = [](const Pack<float>& l, const Pack<float>& r) {
    const __m256 turned = _mm256_permute_ps(__m256(r.v), 0x93);  // lanes 3 0 1 2 of each half
    return _mm256_add_ps(__m256(l.v), _mm256_blend_ps(turned, _mm256_setzero_ps(), 0x11));
  };
  const __m256 x = merged(left.x, right.x), y = merged(left.y, right.y);
  const __m256 z = merged(left.z, right.z), zero = _mm256_setzero_ps();
  const __m256 xy_low = _mm256_unpacklo_ps(x, y), xy_high = _mm256_unpackhi_ps(x, y);
  const __m256 z0_low = _mm256_unpacklo_ps(z, zero), z0_high = _mm256_unpackhi_ps(z, zero);
  const auto add = [&](int point, __m256 both) {
    float *a = low + 4 * point, *b = high + 4 * point;
    _mm_store_ps(a, _mm_add_ps(_mm_load_ps(a), _mm256_castps256_ps128(both)));
    _mm_store_ps(b, _mm_add_ps(_mm_load_ps(b), _mm256_extractf128_ps(both, 1)));
  };
  add(0, _mm256_shuffle_ps(xy_low, z0_low, 0x44));
  add(1, _mm256_shuffle_ps(xy_low, z0_low, 0xEE));
  add(2, _mm256_shuffle_ps(xy_high, z0_high, 0x44));
  add(3, _mm256_shuffle_ps(xy_high, z0_high, 0xEE));
  add(4, _mm256_shuffle_ps(_mm256_unpackhi_ps(__m256(right.x.v), __m256(right.y.v)),
                           _mm256_unpackhi_ps(__m256(right.z.v), zero), 0xEE));
#else
  for (int half = 0; half < 2; ++half) {
    float* to = half == 0 ? low : high;
    for (int c = 0; c < 3; ++c) {
      to[c] += left[c][4 * half];
      for (int i = 1; i < 4; ++i) to[4 * i + c] += left[c][4 * half + i] + right[c][4 * half + i - 1];
      to[16 + c] += right[c][4 * half + 3];
    }
  }
#endif
}
/// The same for one row of eight.
inline void add_to_row(float* first, const kernels::Vec3<Pack<float>>& left,
                       const kernels::Vec3<Pack<float>>& right) {
#if defined(__AVX2__) && defined(__FMA__)
  const auto merged = [](const Pack<float>& low, const Pack<float>& high) {
    const __m256 h(high.v);
    const __m256 turned = _mm256_permutevar8x32_ps(h, _mm256_setr_epi32(7, 0, 1, 2, 3, 4, 5, 6));
    return _mm256_add_ps(__m256(low.v), _mm256_blend_ps(turned, _mm256_setzero_ps(), 1));
  };
  const __m256 x = merged(left.x, right.x), y = merged(left.y, right.y);
  const __m256 z = merged(left.z, right.z), zero = _mm256_setzero_ps();
  const __m256 xy_low = _mm256_unpacklo_ps(x, y), xy_high = _mm256_unpackhi_ps(x, y);
  const __m256 z0_low = _mm256_unpacklo_ps(z, zero), z0_high = _mm256_unpackhi_ps(z, zero);
  const __m256 r04 = _mm256_shuffle_ps(xy_low, z0_low, 0x44);
  const __m256 r15 = _mm256_shuffle_ps(xy_low, z0_low, 0xEE);
  const __m256 r26 = _mm256_shuffle_ps(xy_high, z0_high, 0x44);
  const __m256 r37 = _mm256_shuffle_ps(xy_high, z0_high, 0xEE);
  const auto add = [&](int point, __m256 two) {
    float* to = first + 4 * point;
    _mm256_storeu_ps(to, _mm256_add_ps(_mm256_loadu_ps(to), two));
  };
  add(0, _mm256_permute2f128_ps(r04, r15, 0x20));
  add(2, _mm256_permute2f128_ps(r26, r37, 0x20));
  add(4, _mm256_permute2f128_ps(r04, r15, 0x31));
  add(6, _mm256_permute2f128_ps(r26, r37, 0x31));
  // The last lane of the right ends: x, y, z, 0.
  const __m128 xh = _mm256_extractf128_ps(__m256(right.x.v), 1);
  const __m128 yh = _mm256_extractf128_ps(__m256(right.y.v), 1);
  const __m128 zh = _mm256_extractf128_ps(__m256(right.z.v), 1);
  const __m128 last = _mm_shuffle_ps(_mm_unpackhi_ps(xh, yh),
                                     _mm_unpackhi_ps(zh, _mm_setzero_ps()), 0xEE);
  _mm_store_ps(first + 32, _mm_add_ps(_mm_load_ps(first + 32), last));
#else
  for (int c = 0; c < 3; ++c) {
    first[c] += left[c][0];
    for (int i = 1; i < 8; ++i) first[4 * i + c] += left[c][i] + right[c][i - 1];
    first[32 + c] += right[c][7];
  }
#endif
}
inline void add_to_row(double* first, const kernels::Vec3<Pack<double>>& left,
                       const kernels::Vec3<Pack<double>>& right) {
#if defined(__AVX2__) && defined(__FMA__)
  const auto merged = [](const Pack<double>& low, const Pack<double>& high) {
    const __m256d turned = _mm256_permute4x64_pd(__m256d(high.v), 0x93);
    return _mm256_add_pd(__m256d(low.v), _mm256_blend_pd(turned, _mm256_setzero_pd(), 1));
  };
  const __m256d x = merged(left.x, right.x), y = merged(left.y, right.y);
  const __m256d z = merged(left.z, right.z), zero = _mm256_setzero_pd();
  const __m256d xy_low = _mm256_unpacklo_pd(x, y), xy_high = _mm256_unpackhi_pd(x, y);
  const __m256d z0_low = _mm256_unpacklo_pd(z, zero), z0_high = _mm256_unpackhi_pd(z, zero);
  const auto add = [&](int point, __m256d one) {
    double* to = first + 4 * point;
    _mm256_store_pd(to, _mm256_add_pd(_mm256_load_pd(to), one));
  };
  add(0, _mm256_permute2f128_pd(xy_low, z0_low, 0x20));
  add(1, _mm256_permute2f128_pd(xy_high, z0_high, 0x20));
  add(2, _mm256_permute2f128_pd(xy_low, z0_low, 0x31));
  add(3, _mm256_permute2f128_pd(xy_high, z0_high, 0x31));
  const __m256d last = _mm256_permute2f128_pd(
      _mm256_unpackhi_pd(__m256d(right.x.v), __m256d(right.y.v)),
      _mm256_unpackhi_pd(__m256d(right.z.v), zero), 0x31);
  add(4, last);
#else
  for (int c = 0; c < 3; ++c) {
    first[c] += left[c][0];
    for (int i = 1; i < 4; ++i) first[4 * i + c] += left[c][i] + right[c][i - 1];
    first[16 + c] += right[c][3];
  }
#endif
}

template <class S>
[[gnu::always_inline]] inline void put_points(S* x, const std::uint16_t* at,
                                              const kernels::Vec3<Pack<S>>& v) {
  for_records(v, [&](int lane, typename Record<S>::Vector record) {
    __builtin_memcpy(x + 4 * std::size_t(at[lane]), &record, sizeof record);
  });
}

/// In the order of the lanes, which may meet in a point.
template <class S>
[[gnu::always_inline]] inline void add_to_points(S* x, const std::uint16_t* at,
                                                 const kernels::Vec3<Pack<S>>& v) {
  for_records(v, [&](int lane, typename Record<S>::Vector record) {
    S* to = x + 4 * std::size_t(at[lane]);
    typename Record<S>::Vector sum;
    __builtin_memcpy(&sum, to, sizeof sum);
    sum += record;
    __builtin_memcpy(to, &sum, sizeof sum);
  });
}

}  // namespace kerf::cpu

namespace kerf::kernels {
template <class S>
struct Precision<cpu::Pack<S>> {
  static constexpr S kEpsilon = Precision<S>::kEpsilon;
};
}  // namespace kerf::kernels
