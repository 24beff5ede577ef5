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
  Vector v;

  Pack() {}  // not zero, for members of Vec3 and Mat3 would be cleared before they are written
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
#if defined(__AVX2__) && defined(__FMA__)
  return _mm256_movemask_epi8(__m256i(mask.v)) == -1;
#else
  for (int i = 0; i < Pack<S>::kLanes; ++i)
    if (mask.v[i] == 0) return false;
  return true;
#endif
}

/// The greater of |a| and b, at least zero; b where a is not a number.
inline Pack<float> greater_size(const Pack<float>& a, const Pack<float>& b) {
#if defined(__AVX2__) && defined(__FMA__)
  const __m256 size = _mm256_andnot_ps(_mm256_set1_ps(-0.0F), __m256(a.v));
  return Pack<float>::Vector(_mm256_max_ps(size, __m256(b.v)));
#else
  const Pack<float> size = select(a < Pack<float>(0), -a, a);
  return select(b < size, size, b);
#endif
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
//
//   gather_points   one vector of each lane's point
//   for_records     body(lane, record) for the vectors of the lanes, in the order of the lanes
//   gather_row      the left and right ends of a row of cells whose points follow each other: lane
//   k
//                   has points k and k + 1 from `first` on
//   add_to_row      adds the ends of a row to its points; what two cells give to a point is summed
//                   first
//   gather_rows, add_to_rows   the same for two rows, each of half the lanes
//
// Results by reference: GCC 12 copies structs of packs by halves of 64 bits.
#if defined(__AVX2__) && defined(__FMA__)

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
inline void gather_row(const float* first, kernels::Vec3<Pack<float>>& left,
                       kernels::Vec3<Pack<float>>& right) {
  gather_rows(first, first + 16, left, right);
}
inline void gather_row(const double* first, kernels::Vec3<Pack<double>>& left,
                       kernels::Vec3<Pack<double>>& right) {
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
  for (int k = 0; k < 5; ++k) {
    const __m256 both = k < 4 ? r[k] : last;
    add_record(low + 4 * k, _mm256_castps256_ps128(both));
    add_record(high + 4 * k, _mm256_extractf128_ps(both, 1));
  }
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
inline void add_to_row(double* first, const kernels::Vec3<Pack<double>>& left,
                       const kernels::Vec3<Pack<double>>& right) {
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

#else

template <class S>
void gather_points(const S* x, const std::uint16_t* at, kernels::Vec3<Pack<S>>& out) {
  for (int i = 0; i < Pack<S>::kLanes; ++i)
    for (int c = 0; c < 3; ++c) out[c].set(i, x[4 * std::size_t(at[i]) + std::size_t(c)]);
}

template <class S, class Body>
void for_records(const kernels::Vec3<Pack<S>>& f, const Body& body) {
  for (int i = 0; i < Pack<S>::kLanes; ++i)
    body(i, typename Record<S>::Vector{f.x[i], f.y[i], f.z[i], 0});
}

/// A row in the lanes from `begin` to `end`.
template <class S>
void gather_part(const S* first, int begin, int end, kernels::Vec3<Pack<S>>& left,
                 kernels::Vec3<Pack<S>>& right) {
  for (int i = begin; i < end; ++i)
    for (int c = 0; c < 3; ++c) {
      left[c].set(i, first[4 * (i - begin) + c]);
      right[c].set(i, first[4 * (i - begin) + 4 + c]);
    }
}
template <class S>
void add_to_part(S* first, int begin, int end, const kernels::Vec3<Pack<S>>& left,
                 const kernels::Vec3<Pack<S>>& right) {
  for (int c = 0; c < 3; ++c) {
    first[c] += left[c][begin];
    for (int i = begin + 1; i < end; ++i)
      first[4 * (i - begin) + c] += left[c][i] + right[c][i - 1];
    first[4 * (end - begin) + c] += right[c][end - 1];
  }
}
template <class S>
void gather_row(const S* first, kernels::Vec3<Pack<S>>& left, kernels::Vec3<Pack<S>>& right) {
  gather_part(first, 0, Pack<S>::kLanes, left, right);
}
template <class S>
void gather_rows(const S* low, const S* high, kernels::Vec3<Pack<S>>& left,
                 kernels::Vec3<Pack<S>>& right) {
  gather_part(low, 0, Pack<S>::kLanes / 2, left, right);
  gather_part(high, Pack<S>::kLanes / 2, Pack<S>::kLanes, left, right);
}
template <class S>
void add_to_row(S* first, const kernels::Vec3<Pack<S>>& left, const kernels::Vec3<Pack<S>>& right) {
  add_to_part(first, 0, Pack<S>::kLanes, left, right);
}
template <class S>
void add_to_rows(S* low, S* high, const kernels::Vec3<Pack<S>>& left,
                 const kernels::Vec3<Pack<S>>& right) {
  add_to_part(low, 0, Pack<S>::kLanes / 2, left, right);
  add_to_part(high, Pack<S>::kLanes / 2, Pack<S>::kLanes, left, right);
}

#endif

template <class S>
kernels::Vec3<Pack<S>> gathered(const S* x, const std::uint16_t* at) {
  kernels::Vec3<Pack<S>> out;
  gather_points(x, at, out);
  return out;
}

/// Points that follow each other, one a lane.
template <class S>
kernels::Vec3<Pack<S>> gathered(const S* records) {
  static constexpr std::uint16_t kOrder[] = {0, 1, 2, 3, 4, 5, 6, 7};
  return gathered(records, kOrder);
}

template <class S>
[[gnu::always_inline]] inline void put_points(S* x, const std::uint16_t* at,
                                              const kernels::Vec3<Pack<S>>& v) {
  for_records(v, [&](int lane, const typename Record<S>::Vector& record) {
    __builtin_memcpy(x + 4 * std::size_t(at[lane]), &record, sizeof record);
  });
}

/// In the order of the lanes, which may meet in a point.
template <class S>
[[gnu::always_inline]] inline void add_to_points(S* x, const std::uint16_t* at,
                                                 const kernels::Vec3<Pack<S>>& v) {
  for_records(v, [&](int lane, const typename Record<S>::Vector& record) {
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
