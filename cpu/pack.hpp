// SPDX-License-Identifier: MIT
//
// A SIMD pack that the bodies of kernels/ take for a scalar: one cell in each lane.
//
// Layout  512 bits with AVX-512, else 256. Without AVX2 the compiler splits packs. Every lane does
//         what a scalar would, so what stays in its lane has the same bits whatever the width.
// Parts   What needs instructions of its own is in pack_avx512.hpp, pack_avx2.hpp and
//         pack_plain.hpp, one of which is included below.
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "kernels/fma.hpp"
#include "kernels/host_device.hpp"
#include "kernels/mat3.hpp"

#if KERF_PACK_BITS == 512
#include <immintrin.h>
#endif

namespace kerf::cpu {

inline constexpr int kPackBytes = KERF_PACK_BITS == 512 ? 64 : 32;

/// Lane by lane all ones or all zeros.
template <class S, int kBytes = kPackBytes>
struct PackMask {
  using Int = std::conditional_t<sizeof(S) == 4, std::int32_t, std::int64_t>;
  typedef Int Vector __attribute__((vector_size(kBytes)));
  Vector v;

  friend PackMask operator&&(const PackMask& a, const PackMask& b) { return {a.v & b.v}; }
  friend PackMask operator||(const PackMask& a, const PackMask& b) { return {a.v | b.v}; }
  friend PackMask operator!(const PackMask& a) { return {~a.v}; }
};

template <class S, int kBytes = kPackBytes>
struct Pack {
  using Scalar = S;
  using Mask = PackMask<S, kBytes>;
  static constexpr int kLanes = kBytes / static_cast<int>(sizeof(S));
  typedef S Vector __attribute__((vector_size(kBytes)));
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
  friend Mask operator<(const Pack& a, const Pack& b) { return {a.v < b.v}; }
  friend Mask operator>(const Pack& a, const Pack& b) { return {a.v > b.v}; }
  friend Mask operator<=(const Pack& a, const Pack& b) { return {a.v <= b.v}; }
};

template <class S, int kBytes>
Pack<S, kBytes> select(const PackMask<S, kBytes>& mask, const Pack<S, kBytes>& a,
                       const Pack<S, kBytes>& b) {
  return mask.v ? a.v : b.v;
}

/// Three components of one point, and a fourth scalar that is zero.
template <class S>
struct Record {
  typedef S Vector __attribute__((vector_size(4 * sizeof(S))));
};

template <class S, int kBytes = kPackBytes>
Pack<S, kBytes> load_pack(const S* from) {
  Pack<S, kBytes> out;
  __builtin_memcpy(&out.v, from, sizeof out.v);
  return out;
}
template <class S, int kBytes>
void store_pack(S* to, const Pack<S, kBytes>& pack) {
  __builtin_memcpy(to, &pack.v, sizeof pack.v);
}

/// Lane by lane in another precision. GCC 12 takes four instructions for one of
/// __builtin_convertvector from eight to eight lanes.
template <class To, class From>
[[gnu::always_inline]] inline To converted(const From& v) {
#if KERF_PACK_BITS == 512
  static_assert(std::is_floating_point_v<std::decay_t<decltype(From{}[0])>> &&
                std::is_floating_point_v<std::decay_t<decltype(To{}[0])>>);
  if constexpr (sizeof(From) == 32 && sizeof(To) == 64) return To(_mm512_cvtps_pd(__m256(v)));
  if constexpr (sizeof(From) == 64 && sizeof(To) == 32) return To(_mm512_cvtpd_ps(__m512d(v)));
#endif
  return __builtin_convertvector(v, To);
}

/// A pack from scalars of any precision.
template <class S, class From>
Pack<S> load_pack_as(const From* from) {
  typedef From Narrow __attribute__((vector_size(Pack<S>::kLanes * sizeof(From))));
  Narrow narrow;
  __builtin_memcpy(&narrow, from, sizeof narrow);
  return converted<typename Pack<S>::Vector>(narrow);
}
/// To scalars of any precision; returns what is there now.
template <class To, class S>
Pack<S> store_pack_as(To* to, const Pack<S>& pack) {
  typedef To Narrow __attribute__((vector_size(Pack<S>::kLanes * sizeof(To))));
  const auto narrow = converted<Narrow>(pack.v);
  __builtin_memcpy(to, &narrow, sizeof narrow);
  return converted<typename Pack<S>::Vector>(narrow);
}

/// Rounded, the lanes of `low` first.
inline Pack<float> joined(const Pack<double>& low, const Pack<double>& high) {
  typedef float Half __attribute__((vector_size(kPackBytes / 2)));
  const auto a = converted<Half>(low.v), b = converted<Half>(high.v);
#if KERF_PACK_BITS == 512
  return Pack<float>::Vector(_mm512_insertf32x8(_mm512_castps256_ps512(__m256(a)), __m256(b), 1));
#else
  return Pack<float>::Vector(__builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7));
#endif
}
/// The lanes of the first half, and of the second one.
inline void parted(const Pack<float>& pack, Pack<double>& low, Pack<double>& high) {
#if KERF_PACK_BITS == 512
  low.v = Pack<double>::Vector(_mm512_cvtps_pd(_mm512_castps512_ps256(__m512(pack.v))));
  high.v = Pack<double>::Vector(_mm512_cvtps_pd(_mm512_extractf32x8_ps(__m512(pack.v), 1)));
#else
  using To = Pack<double>::Vector;
  low.v = __builtin_convertvector(__builtin_shufflevector(pack.v, pack.v, 0, 1, 2, 3), To);
  high.v = __builtin_convertvector(__builtin_shufflevector(pack.v, pack.v, 4, 5, 6, 7), To);
#endif
}

/// Where a lane of cells in rows lies: its point, from that of the first cell in its row.
template <int kRun, class S>
S* at_lane(S* x, const std::uint16_t* points, int lane) {
  return x + 4 * (std::size_t(points[lane / kRun * kRun / 4]) + std::size_t(lane % kRun));
}

/// Asks memory for `count` scalars from x[first] on, which need not be there. What fetches ahead by
/// itself begins anew with every page, and a pass over a level meets many.
template <bool to_write = false, class S>
[[gnu::always_inline]] inline void prefetch(const S* x, std::size_t first, std::size_t count) {
  constexpr std::size_t kLine = 64;
  const auto at = reinterpret_cast<std::uintptr_t>(x) + first * sizeof(S);
  for (std::size_t k = 0; k < count * sizeof(S); k += kLine)
    __builtin_prefetch(reinterpret_cast<const void*>(at + k), to_write ? 1 : 0);
}

}  // namespace kerf::cpu

// fma, sqrt, all (lanes of a mask) and greater_size (the greater of |a| and b, at least zero; b
// where a is not a number) of packs, and what brings points into lanes and back. Points are records
// of four scalars, the fourth of them zero, aligned to their size.
//
//   gather_points    one vector of each lane's point
//   for_records      body(lane, record) for the vectors of the lanes, in the order of the lanes
//   gather_in_order  the points from one on, one in each lane
//   records_of       in double, register k of four that hold the records of all lanes in their
//                    order: at(lane) is where one lies. Sums over points cost less so
//   by_components    brings four such registers into lanes
//   gather_pairs     each lane's point, and the one behind it
//   add_pairs        adds to these, in the order of the lanes, which may meet in a point
//   gather_runs<n>   the left and right ends of cells in rows of n: a lane has the points k and
//                    k + 1 where the lane before has k - 1 and k. `points` has the first point of
//                    every fourth lane; that of the first one in each row is read
//   add_runs<n>      adds the ends of such cells to their points; what two cells of a row give to a
//                    point is summed first
//
// Results by reference: GCC 12 copies structs of packs by halves of 64 bits.
#if KERF_PACK_BITS == 512
#include "cpu/pack_avx512.hpp"
#elif KERF_PACK_BITS == 256
#include "cpu/pack_avx2.hpp"
#else
#include "cpu/pack_plain.hpp"
#endif

namespace kerf::cpu {

template <class S>
kernels::Vec3<Pack<S>> gathered(const S* x, const std::uint16_t* at) {
  kernels::Vec3<Pack<S>> out;
  gather_points(x, at, out);
  return out;
}

/// Points that follow each other, one a lane.
template <class S>
kernels::Vec3<Pack<S>> gathered(const S* records) {
  kernels::Vec3<Pack<S>> out;
  gather_in_order(records, out);
  return out;
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
