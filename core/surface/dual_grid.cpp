// SPDX-License-Identifier: MIT
#include "core/surface/dual_grid.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/error.hpp"

namespace kerf {

std::array<Vec3i, 4> face_points(const Vec3i& lower, int axis) {
  const int u = (axis + 1) % 3, v = (axis + 2) % 3;
  const Vec3i p = shifted(lower, axis, 1);
  return {p, shifted(p, u, 1), shifted(shifted(p, u, 1), v, 1), shifted(p, v, 1)};
}

DualCell read_dual_cell(const LinkedOctree& body, const Vec3i& point) {
  DualCell out;
  std::uint8_t cut[8] = {};
  for (int o = 0; o < 8; ++o) {
    const std::int32_t leaf = body.leaf_at(octant_cell(point, o));
    if (leaf < 0) continue;
    out.present = static_cast<std::uint8_t>(out.present | 1 << o);
    cut[o] = body.nodes()[static_cast<std::size_t>(leaf)].cut_mask;
  }
  for (int axis = 0; axis < 3; ++axis)
    for (int o = 0; o < 8; ++o) {
      if ((o >> axis & 1) != 0 || !out.is_present(o) || !out.is_present(o | 1 << axis)) continue;
      if ((cut[o] >> (2 * axis + 1) & 1) == 0)
        out.connected = static_cast<std::uint16_t>(out.connected | 1 << dual_link(o, axis));
    }
  return out;
}

double crossing_of(const LinkCut& cut, int end, double spacing) {
  const LinkEnd &low = cut.end[0], &high = cut.end[1];
  // Distances are floats; two crossings nearer than this are one.
  constexpr double kRounding = 1e-6;
  const double from_low = low.distance / spacing, from_high = 1 - high.distance / spacing;
  const bool one = low.cut_id == high.cut_id && low.normal == high.normal &&
                   std::abs(from_low - from_high) < kRounding;
  return std::clamp(end == 0 || one ? from_low : from_high, 0.0, 1.0);
}

LinkSide link_side(const LinkCut& cut, int axis, int end, double spacing) {
  const LinkEnd& side = cut.end[end];
  LinkSide out;
  out.point[axis] = crossing_of(cut, end, spacing);
  out.normal = {side.normal.x, side.normal.y, side.normal.z};
  out.cut_id = side.cut_id;
  out.facing = (side.normal[axis] > 0) == (end == 0);
  return out;
}

SurfaceHit corner_hit(const LinkedOctree& body, const Vec3i& point, int corner) {
  const int octant = corner / 3, axis = corner % 3, end = octant >> axis & 1;
  const int low = octant & ~(1 << axis);
  const LinkCut* cut = body.record(octant_cell(point, low), axis);
  ensures(cut != nullptr, "a disconnected link has no record");
  const LinkSide side = link_side(*cut, axis, end, body.lattice().spacing);
  SurfaceHit hit{side.point, side.normal, side.cut_id != 0};
  for (int d = 0; d < 3; ++d) hit.point[d] += (low >> d & 1) - 0.5;
  return hit;
}

int nearest_octant(unsigned octants, const Vec3d& x) {
  int best = -1;
  double least = std::numeric_limits<double>::infinity();
  for (int o = 0; o < 8; ++o) {
    if ((octants >> o & 1) == 0) continue;
    Vec3d away = x;
    for (int d = 0; d < 3; ++d) away[d] -= (o >> d & 1) - 0.5;
    const double distance = dot(away, away);
    if (!(distance < least)) continue;
    least = distance;
    best = o;
  }
  return best;
}

Vec3d sheet_place(const LinkedOctree& body, const Vec3i& point, const DualCell& cell, int sheet) {
  const DualPattern& pattern = cell.pattern();
  std::array<SurfaceHit, kDualCorners> hits;
  std::size_t count = 0;
  // By link, so that the two sides of a cut add up the same numbers in the same order.
  for (int axis = 0; axis < 3; ++axis)
    for (int low = 0; low < 8; ++low) {
      if ((low >> axis & 1) != 0) continue;
      for (const int octant : {low, low | 1 << axis}) {
        const int corner = dual_corner(octant, axis);
        if (pattern.sheet[static_cast<std::size_t>(corner)] == sheet)
          hits[count++] = corner_hit(body, point, corner);
      }
    }
  return fit_vertex({hits.data(), count});
}

}  // namespace kerf
