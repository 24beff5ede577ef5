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
#include "cpu/twin.hpp"
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

  /// Of the lanes from `first` on; those of a twin are of this tile and of the next one.
  template <class Q>
  void store(std::size_t tile, int first, const kernels::Sym3<Q>& inverse) {
    Entry* const to = entries_.data() + kOfTile * tile + first;
    if constexpr (kIsCoded) {
      encode(inverse, to);
    } else {
      const Q entries[] = {inverse.xx, inverse.xy, inverse.xz, inverse.yy, inverse.yz, inverse.zz};
      for (int e = 0; e < 6; ++e)
        for_each_pack(entries[e], [&](int n, const P& entry) {
          store_pack(to + kOfTile * std::size_t(n) + kGroup * e, entry);
        });
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

  template <class Q>
  static void encode(const kernels::Sym3<Q>& inverse, std::int16_t* to) {
    const auto put = [to](int e, const Q& code) {
      for_each_pack(code, [&](int n, const P& x) {
        store_narrowed(to + kOfTile * std::size_t(n) + kGroup * e, x);
      });
    };
    const Q none = Q(0), one = Q(1), least = Q(1e-30);  // a part of which has an inverse
    const auto root_of = [&](const Q& a) { return select(a > none, sqrt(a), none); };
    Q s[] = {root_of(inverse.xx), root_of(inverse.yy), root_of(inverse.zz)};
    const Q greatest = greater_size(s[0], greater_size(s[1], greater_size(s[2], least)));
    const Q unit = upper_part(greatest * Q(1 / kGreatestCode)), by = one / unit;
    for (int c = 0; c < 3; ++c) {
      const Q code = rounded(s[c] * by);
      put(1 + c, code);
      s[c] = unit * code;
    }
    const auto put_beside = [&](int e, const Q& entry, const Q& a, const Q& b) {
      const Q size = a * b, ratio = select(size > none, entry / size, none);
      const Q most = select(ratio > one, one, select(ratio < -one, -one, ratio));
      put(e, most * Q(kGreatestCode));
    };
    put_beside(4, inverse.xy, s[0], s[1]);
    put_beside(5, inverse.xz, s[0], s[2]);
    put_beside(6, inverse.yz, s[1], s[2]);
    // What is no number has to be seen: integers would hide it.
    const Q all = inverse.xx + inverse.xy + inverse.xz + inverse.yy + inverse.yz + inverse.zz;
    for_each_pack(unit + none * all,
                  [&](int n, const P& x) { store_upper(to + kOfTile * std::size_t(n), x); });
  }
  static P upper_part(const P& x) { return rounded_up(x); }
  static Twin<P> upper_part(const Twin<P>& x) { return {rounded_up(x.a), rounded_up(x.b)}; }
  /// To the nearest integer: behind 2^23 there are no others.
  template <class Q>
  static Q rounded(const Q& x) {
    const Q shift = Q(3 << 22);
    return (x + shift) - shift;
  }

  Array<Entry> entries_;
};

}  // namespace kerf::cpu
