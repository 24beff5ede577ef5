// SPDX-License-Identifier: MIT
//
// The finest lattice, and the links between the centres of its cells.
//
// Layout  cells are numbered x fastest: index = x + nx (y + ny z).
//         A link joins cell c to its neighbour at +1 along an axis; its key counts cells with one
//         more at each low side, so that links to cells outside the lattice have keys too:
//         c lies in [-1, size - 1] along each axis.
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/geometry/vec.hpp"

namespace kerf {

using LinkKey = std::uint64_t;

struct Lattice {
  Vec3d origin{};      ///< low corner of cell (0, 0, 0), m
  double spacing = 0;  ///< side of a finest cell, m
  Vec3i size{};        ///< finest cells along x, y, z

  std::size_t cells() const {
    return static_cast<std::size_t>(size[0]) * static_cast<std::size_t>(size[1]) *
           static_cast<std::size_t>(size[2]);
  }
  bool inside(const Vec3i& c) const {
    return c[0] >= 0 && c[0] < size[0] && c[1] >= 0 && c[1] < size[1] && c[2] >= 0 &&
           c[2] < size[2];
  }
  std::size_t index(const Vec3i& c) const {
    return static_cast<std::size_t>(c[0]) +
           static_cast<std::size_t>(size[0]) *
               (static_cast<std::size_t>(c[1]) +
                static_cast<std::size_t>(size[1]) * static_cast<std::size_t>(c[2]));
  }
  Vec3i cell(std::size_t index) const {
    const auto nx = static_cast<std::size_t>(size[0]);
    const auto ny = static_cast<std::size_t>(size[1]);
    return {static_cast<std::int32_t>(index % nx), static_cast<std::int32_t>(index / nx % ny),
            static_cast<std::int32_t>(index / nx / ny)};
  }
  /// Key of the link from `lower` to lower + 1 along `axis`.
  LinkKey link_key(const Vec3i& lower, int axis) const {
    const auto px = static_cast<LinkKey>(size[0]) + 1, py = static_cast<LinkKey>(size[1]) + 1;
    return 3 * (static_cast<LinkKey>(lower[0] + 1) +
                px * (static_cast<LinkKey>(lower[1] + 1) + py * static_cast<LinkKey>(lower[2] + 1))) +
           static_cast<LinkKey>(axis);
  }
  static int link_axis(LinkKey key) { return static_cast<int>(key % 3); }
  Vec3i link_lower(LinkKey key) const {
    const auto px = static_cast<LinkKey>(size[0]) + 1, py = static_cast<LinkKey>(size[1]) + 1;
    const LinkKey i = key / 3;
    return {static_cast<std::int32_t>(i % px) - 1, static_cast<std::int32_t>(i / px % py) - 1,
            static_cast<std::int32_t>(i / px / py) - 1};
  }
  /// Centre of a cell, m.
  Vec3d center(const Vec3i& c) const {
    return {origin.x + (c[0] + 0.5) * spacing, origin.y + (c[1] + 0.5) * spacing,
            origin.z + (c[2] + 0.5) * spacing};
  }
  /// A grid point of the finest lattice, m.
  Vec3d point(const Vec3i& p) const {
    return {origin.x + p[0] * spacing, origin.y + p[1] * spacing, origin.z + p[2] * spacing};
  }
};


/// One side of a disconnected link.
struct LinkEnd {
  float distance = 0;        ///< from this end's cell centre to the cut point nearest to it, m
  Vec3f normal{};            ///< unit normal of the surface there, reference state
  std::int32_t cut_id = 0;   ///< 0: the object's own surface; 1, 2, ...: blades in order
};

/// A disconnected link: end[0] is at the lower cell.
/// Source  [DGW11] section 7: two distances, normal and cut id.
struct LinkCut {
  LinkEnd end[2];
};

}  // namespace kerf
