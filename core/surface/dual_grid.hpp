// SPDX-License-Identifier: MIT
//
// The dual grid of links over a linked octree: keys of its parts, and what its links hold.
//
// Terms  grid point   a corner of finest cells, and the dual cell around it: [0, size] per axis
//        grid edge    from a grid point to the next along an axis; four links lie around it, which
//                     are a face between two dual cells
#pragma once

#include <array>
#include <cstdint>

#include "core/body/linked_octree.hpp"
#include "core/surface/dual_pattern.hpp"
#include "core/surface/quadric.hpp"

namespace kerf {

using GridKey = std::uint64_t;

/// Keys of grid points ascend by (z, y, x).
inline GridKey point_key(const Lattice& lattice, const Vec3i& p) {
  const auto nx = static_cast<GridKey>(lattice.size[0]) + 1;
  const auto ny = static_cast<GridKey>(lattice.size[1]) + 1;
  return static_cast<GridKey>(p[0]) +
         nx * (static_cast<GridKey>(p[1]) + ny * static_cast<GridKey>(p[2]));
}
inline Vec3i key_point(const Lattice& lattice, GridKey key) {
  const auto nx = static_cast<GridKey>(lattice.size[0]) + 1;
  const auto ny = static_cast<GridKey>(lattice.size[1]) + 1;
  return {static_cast<std::int32_t>(key % nx), static_cast<std::int32_t>(key / nx % ny),
          static_cast<std::int32_t>(key / nx / ny)};
}
inline Vec3i shifted(Vec3i c, int axis, std::int32_t by) {
  c[static_cast<std::size_t>(axis)] += by;
  return c;
}

/// The cell that is octant `o` of grid point `p`, and the octant that cell `c` is.
inline Vec3i octant_cell(const Vec3i& p, int o) {
  return {p[0] - 1 + (o & 1), p[1] - 1 + (o >> 1 & 1), p[2] - 1 + (o >> 2)};
}
inline int octant_of(const Vec3i& p, const Vec3i& c) {
  return (c[0] - p[0] + 1) | (c[1] - p[1] + 1) << 1 | (c[2] - p[2] + 1) << 2;
}

/// The four grid points around the face between `lower` and its neighbour along `axis`,
/// counter-clockwise seen from +axis.
std::array<Vec3i, 4> face_points(const Vec3i& lower, int axis);

/// One dual cell as the octree has it now.
struct DualCell {
  std::uint8_t present = 0;     ///< octants that hold material, a bit each
  std::uint16_t connected = 0;  ///< links, a bit each

  const DualPattern& pattern() const { return dual_pattern(connected); }
  bool is_present(int octant) const { return (present >> octant & 1) != 0; }
  /// Whether the sheet bounds material; sheets around absent octants do not count.
  bool has_sheet(int sheet) const {
    return (pattern().octants[static_cast<std::size_t>(sheet)] & present) != 0;
  }
};
DualCell read_dual_cell(const LinkedOctree& body, const Vec3i& point);

/// The place where a disconnected link meets the surface nearest to one of its ends, in cells from
/// the centre of its lower cell, in [0, 1]. If both ends saw one crossing, both give the same bits.
double crossing_of(const LinkCut& cut, int end, double spacing);

/// Everything about one end of a disconnected link.
struct LinkSide {
  Vec3d point{};   ///< in cells from the centre of the lower cell
  Vec3d normal{};  ///< unit
  std::int32_t cut_id = 0;
  bool facing = false;  ///< the normal points out of the material at this end
};
LinkSide link_side(const LinkCut& cut, int axis, int end, double spacing);

/// What the surface meets at one corner of a dual cell, in cells from the grid point.
/// @throws Error (internal) if the link has no record.
SurfaceHit corner_hit(const LinkedOctree& body, const Vec3i& point, int corner);

/// The octant of `octants` (bits) whose centre is nearest to x, in cells from the grid point; the
/// lowest of several.
int nearest_octant(unsigned octants, const Vec3d& x);

/// The place of a vertex on one sheet, in cells from the grid point. Two sheets that see the same
/// links from both sides get the same bits.
Vec3d sheet_place(const LinkedOctree& body, const Vec3i& point, const DualCell& cell, int sheet);

}  // namespace kerf
