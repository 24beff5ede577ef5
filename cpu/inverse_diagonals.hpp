// SPDX-License-Identifier: MIT
//
// Inverses of the diagonal blocks of a level, which its smoother reads once for every sweep.
//
// Layout  [tile][entry][kGroup]. In double the entries are xx xy xz yy yz zz, in m/N.
// Codes   In single precision 16 bits each: a unit, which is the upper half of a number; the roots
//         s of the entries on the diagonal, in units; and what is beside it as xy / (s_x s_y) and
//         the like, from -1 to 1. So an entry is off by at most 3.2e-5 of the root of the greatest
//         entry times that on the diagonal of its row: where supports leave a millionth of one
//         component, it stays, to 3 per cent.
//         A block stays definite if, scaled to ones on its diagonal, its condition is below 2e4.
//         Where supports hold all components or none, that of a sum over cells of one kind is at
//         most (2 - 2 nu) / (1 - 2 nu): 51 for nu = 0.49, 2e4 for 0.49995.
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "core/base/array.hpp"
#include "cpu/codes.hpp"
#include "cpu/patch_sweep.hpp"
#include "kernels/mat3.hpp"

namespace kerf::cpu {

template <class S>
class InverseDiagonals {
 public:
  using P = Pack<S>;

  /// All zero. `grow`: with room.
  void assign(std::size_t tiles, bool grow) {
    if (grow) entries_.reserve(with_room(kOfTile * tiles));
    entries_.assign(kOfTile * tiles, Entry(0));
  }
  /// What was there stays, and new ones are zero.
  void resize(std::size_t tiles) { resize_with_room(entries_, kOfTile * tiles, Entry(0)); }

  /// Of the lanes from `first` on.
  void store(std::size_t tile, int first, const kernels::Sym3<P>& inverse) {
    Entry* const to = entries_.data() + kOfTile * tile + first;
    if constexpr (kIsCoded) {
      encode(inverse, to);
    } else {
      const P entries[] = {inverse.xx, inverse.xy, inverse.xz, inverse.yy, inverse.yz, inverse.zz};
      for (int e = 0; e < 6; ++e) store_pack(to + kGroup * e, entries[e]);
    }
  }

  /// D^-1 r.
  kernels::Vec3<P> times(std::size_t tile, int first, const kernels::Vec3<P>& r) const {
    if (first == 0) prefetch_tile(entries_.data(), tile, kOfVertex);
    const Entry* const at = entries_.data() + kOfTile * tile + first;
    if constexpr (kIsCoded) {
      const P unit = load_upper(at), part = P(1 / kGreatestCode);
      const auto root = [&](int e) { return unit * widened(at + kGroup * e); };
      const auto beside = [&](int e) { return part * widened(at + kGroup * e); };
      const P sx = root(1), sy = root(2), sz = root(3);
      const P xy = beside(4), xz = beside(5), yz = beside(6);
      const P x = sx * r.x, y = sy * r.y, z = sz * r.z;
      return {sx * fma(xy, y, fma(xz, z, x)), sy * fma(xy, x, fma(yz, z, y)),
              sz * fma(xz, x, fma(yz, y, z))};
    } else {
      const auto entry = [&](int e) { return load_pack(at + kGroup * e); };
      const P xy = entry(1), xz = entry(2), yz = entry(4);
      return {fma(entry(0), r.x, fma(xy, r.y, xz * r.z)),
              fma(xy, r.x, fma(entry(3), r.y, yz * r.z)),
              fma(xz, r.x, fma(yz, r.y, entry(5) * r.z))};
    }
  }

  std::size_t bytes() const { return entries_.size() * sizeof(Entry); }

 private:
  static constexpr bool kIsCoded = std::is_same_v<S, float>;
  using Entry = std::conditional_t<kIsCoded, std::int16_t, S>;
  static constexpr std::size_t kOfVertex = kIsCoded ? 7 : 6, kOfTile = kGroup * kOfVertex;

  static void encode(const kernels::Sym3<P>& inverse, std::int16_t* to) {
    const P none = P(0), least = P(1e-30);  // a part of which has an inverse
    const auto root_of = [&](const P& a) { return select(a > none, sqrt(a), none); };
    P s[] = {root_of(inverse.xx), root_of(inverse.yy), root_of(inverse.zz)};
    const P greatest = greater_size(s[0], greater_size(s[1], greater_size(s[2], least)));
    const P unit = rounded_up(greatest * P(1 / kGreatestCode));
    const P by = P(1) / unit;
    for (int c = 0; c < 3; ++c) {
      store_narrowed(to + kGroup * (1 + c), s[c] * by);
      s[c] = unit * widened(to + kGroup * (1 + c));
    }
    const auto put = [&](int e, const P& entry, const P& a, const P& b) {
      const P size = a * b, ratio = select(size > none, entry / size, none);
      const P most = select(ratio > P(1), P(1), select(ratio < P(-1), P(-1), ratio));
      store_narrowed(to + kGroup * e, most * P(kGreatestCode));
    };
    put(4, inverse.xy, s[0], s[1]);
    put(5, inverse.xz, s[0], s[2]);
    put(6, inverse.yz, s[1], s[2]);
    // What is no number has to be seen: integers would hide it.
    const P all = inverse.xx + inverse.xy + inverse.xz + inverse.yy + inverse.yz + inverse.zz;
    store_upper(to, unit + P(0) * all);
  }

  Array<Entry> entries_;
};

}  // namespace kerf::cpu
