// SPDX-License-Identifier: MIT
//
// Packs without instructions of their own: cpu/pack.hpp says what these functions do.
#pragma once

#include "cpu/pack.hpp"

#if KERF_PACK_BITS == 0

namespace kerf::cpu {

template <class S>
bool all(const PackMask<S>& mask) {
  for (int i = 0; i < Pack<S>::kLanes; ++i)
    if (mask.v[i] == 0) return false;
  return true;
}

inline Pack<float> greater_size(const Pack<float>& a, const Pack<float>& b) {
  const Pack<float> size = select(a < Pack<float>(0), -a, a);
  return select(b < size, size, b);
}

template <class S>
Pack<S> fma(const Pack<S>& a, const Pack<S>& b, const Pack<S>& c) {
  Pack<S> out;
  for (int i = 0; i < Pack<S>::kLanes; ++i) out.v[i] = kernels::fma(a.v[i], b.v[i], c.v[i]);
  return out;
}
template <class S>
Pack<S> sqrt(const Pack<S>& a) {
  Pack<S> out;
  for (int i = 0; i < Pack<S>::kLanes; ++i) out.v[i] = kernels::sqrt(a.v[i]);
  return out;
}

template <class At>
Pack<double> records_of(const At& at, int k) {
  return load_pack(at(k));
}
inline void by_components(const Pack<double> (&r)[4], kernels::Vec3<Pack<double>>& out) {
  for (int i = 0; i < 4; ++i)
    for (int c = 0; c < 3; ++c) out[c].set(i, r[i][c]);
}

template <class S>
void gather_points(const S* x, const std::uint16_t* at, kernels::Vec3<Pack<S>>& out) {
  for (int i = 0; i < Pack<S>::kLanes; ++i)
    for (int c = 0; c < 3; ++c) out[c].set(i, x[4 * std::size_t(at[i]) + std::size_t(c)]);
}

template <class S>
void gather_in_order(const S* records, kernels::Vec3<Pack<S>>& out) {
  for (int i = 0; i < Pack<S>::kLanes; ++i)
    for (int c = 0; c < 3; ++c) out[c].set(i, records[4 * i + c]);
}

template <class S, class Body>
void for_records(const kernels::Vec3<Pack<S>>& f, const Body& body) {
  for (int i = 0; i < Pack<S>::kLanes; ++i)
    body(i, typename Record<S>::Vector{f.x[i], f.y[i], f.z[i], 0});
}

template <int kRun, class S>
void gather_runs(const S* x, const std::uint16_t* points, kernels::Vec3<Pack<S>>& left,
                 kernels::Vec3<Pack<S>>& right) {
  for (int i = 0; i < Pack<S>::kLanes; ++i) {
    const S* const at = at_lane<kRun>(x, points, i);
    for (int c = 0; c < 3; ++c) {
      left[c].set(i, at[c]);
      right[c].set(i, at[4 + c]);
    }
  }
}

template <int kRun, class S>
void add_runs(S* y, const std::uint16_t* points, const kernels::Vec3<Pack<S>>& left,
              const kernels::Vec3<Pack<S>>& right) {
  for (int begin = 0; begin < Pack<S>::kLanes; begin += kRun) {
    S* const first = y + 4 * std::size_t(points[begin / 4]);
    for (int c = 0; c < 3; ++c) {
      first[c] += left[c][begin];
      for (int i = 1; i < kRun; ++i)
        first[4 * i + c] += left[c][begin + i] + right[c][begin + i - 1];
      first[4 * kRun + c] += right[c][begin + kRun - 1];
    }
  }
}

template <class S>
void gather_pairs(const S* x, const std::uint16_t* at, kernels::Vec3<Pack<S>>& left,
                  kernels::Vec3<Pack<S>>& right) {
  gather_points(x, at, left);
  gather_points(x + 4, at, right);
}

template <class S>
void add_pairs(S* y, const std::uint16_t* at, const kernels::Vec3<Pack<S>>& left,
               const kernels::Vec3<Pack<S>>& right) {
  for (int i = 0; i < Pack<S>::kLanes; ++i) {
    S* const to = y + 4 * std::size_t(at[i]);
    for (int c = 0; c < 3; ++c) {
      to[c] += left[c][i];
      to[4 + c] += right[c][i];
    }
  }
}

}  // namespace kerf::cpu

#endif
