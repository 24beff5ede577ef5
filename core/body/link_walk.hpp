// SPDX-License-Identifier: MIT
//
// What the solids share when they sample a lattice: a walk over the links that touch the inside,
// and the record of a crossing.
#pragma once

#include <cstdint>
#include <vector>

#include "core/body/lattice.hpp"

namespace kerf {

/// A point where a link meets a surface, and the unit normal there, outward.
struct LinkHit {
  double at = 0;  ///< in [0, 1] of the way from the lower to the upper cell centre
  Vec3d normal{};
};

/// The record of a link: `lower` is the hit nearest to the lower end, `upper` to the upper end.
inline LinkCut make_link_cut(const LinkHit& lower, const LinkHit& upper, double spacing) {
  const auto end = [](double distance, const Vec3d& n) {
    return LinkEnd{static_cast<float>(distance),
                   {static_cast<float>(n.x), static_cast<float>(n.y), static_cast<float>(n.z)},
                   0};
  };
  return {{end(lower.at * spacing, lower.normal), end((1 - upper.at) * spacing, upper.normal)}};
}

/// A surface half-way that nobody drew (the rim of a hole, the end of the lattice): its normal
/// points along the link from the inside to the outside.
inline LinkHit half_way(int axis, bool lower_inside) {
  LinkHit hit{0.5, {}};
  hit.normal[axis] = lower_inside ? 1 : -1;
  return hit;
}

/// Calls visit(key, lower, axis, lower_inside, upper_inside) for every link with an end inside, in
/// ascending order of key. Cells outside the lattice are outside.
/// Shapes  inside: one per lattice cell, 0 is outside.
template <class Visit>
void for_each_link(const Lattice& lattice, const std::vector<std::uint8_t>& inside, Visit&& visit) {
  const Vec3i n = lattice.size;
  const std::size_t stride[3] = {1, static_cast<std::size_t>(n[0]),
                                 static_cast<std::size_t>(n[0]) * static_cast<std::size_t>(n[1])};
  for (std::int32_t z = -1; z < n[2]; ++z)
    for (std::int32_t y = -1; y < n[1]; ++y)
      for (std::int32_t x = -1; x < n[0]; ++x) {
        const Vec3i c{x, y, z};
        const bool present = x >= 0 && y >= 0 && z >= 0;
        if (!present && (x < 0) + (y < 0) + (z < 0) > 1) continue;  // no neighbour in the lattice
        const std::size_t index = present ? lattice.index(c) : 0;
        const bool here = present && inside[index] != 0;
        for (unsigned axis = 0; axis < 3; ++axis) {
          bool there = false;
          if (present) {
            there = c[axis] + 1 < n[axis] && inside[index + stride[axis]] != 0;
          } else if (c[axis] < 0) {
            Vec3i upper = c;
            upper[axis] = 0;
            there = inside[lattice.index(upper)] != 0;
          }
          if (here || there)
            visit(lattice.link_key(c, static_cast<int>(axis)), c, static_cast<int>(axis), here,
                  there);
        }
      }
}

}  // namespace kerf
