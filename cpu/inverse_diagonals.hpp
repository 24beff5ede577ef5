// SPDX-License-Identifier: MIT
//
// Inverses of the diagonal blocks of a level, which its smoother reads once for every sweep.
//
// Layout  [tile][xx xy xz yy yz zz][kGroup], in m/N.
// Codes   In single precision 16-bit integers, multiples of one number a vertex, its seventh: the
//         greatest entry over 32767, rounded up to 8 bits. Each entry is off by at most 1.6e-5 of
//         the greatest one, so a block of a condition below 2e4 stays definite; that of a sum over
//         cells is below 100.
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
    const P entries[] = {inverse.xx, inverse.xy, inverse.xz, inverse.yy, inverse.yz, inverse.zz};
    if constexpr (kIsCoded) {
      const P greatest = greater_size(
          greater_size(entries[0], greater_size(entries[3], entries[5])),
          greater_size(entries[1], greater_size(entries[2], greater_size(entries[4], P(0)))));
      const P least = P(1e-33);  // a multiple of which is a normal number, and its inverse one
      const P unit =
          rounded_up(select(greatest > least, greatest, least) * P(1.0F / kGreatestCode));
      const P by = P(1) / unit;
      for (int e = 0; e < 6; ++e) store_narrowed(to + kGroup * e, entries[e] * by);
      store_upper(to + 6 * kGroup, unit);
    } else {
      for (int e = 0; e < 6; ++e) store_pack(to + kGroup * e, entries[e]);
    }
  }

  /// D^-1 r.
  kernels::Vec3<P> times(std::size_t tile, int first, const kernels::Vec3<P>& r) const {
    if (first == 0) prefetch_tile(entries_.data(), tile, kOfVertex);
    const Entry* const at = entries_.data() + kOfTile * tile + first;
    const auto entry = [&](int e) {
      if constexpr (kIsCoded)
        return widened(at + kGroup * e);
      else
        return load_pack(at + kGroup * e);
    };
    const P xy = entry(1), xz = entry(2), yz = entry(4);
    const kernels::Vec3<P> out{fma(entry(0), r.x, fma(xy, r.y, xz * r.z)),
                               fma(xy, r.x, fma(entry(3), r.y, yz * r.z)),
                               fma(xz, r.x, fma(yz, r.y, entry(5) * r.z))};
    if constexpr (kIsCoded)
      return load_upper(at + 6 * kGroup) * out;
    else
      return out;
  }

  std::size_t bytes() const { return entries_.size() * sizeof(Entry); }

 private:
  static constexpr bool kIsCoded = std::is_same_v<S, float>;
  using Entry = std::conditional_t<kIsCoded, std::int16_t, S>;
  static constexpr std::size_t kOfVertex = kIsCoded ? 7 : 6, kOfTile = kGroup * kOfVertex;
  static constexpr float kGreatestCode = 32767;

  Array<Entry> entries_;
};

}  // namespace kerf::cpu
