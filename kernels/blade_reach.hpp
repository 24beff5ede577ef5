// SPDX-License-Identifier: MIT
//
// Whether a blade may meet what lies in a box: near its own box, and near one of its triangles.
//
// Units  m, from any one origin.
#pragma once

#include <cstdint>

#include "kernels/mat3.hpp"

namespace kerf::kernels {

/// The neighbourhood of a triangle: a box, and of it what is near a plane.
struct BladeSlab {
  Vec3<double> lo, hi;
  Vec3<double> normal, point;  ///< of the plane; a normal of zero: all in the box
};

/// Where a blade is, rounding included.
struct BladeNeighbourhood {
  Vec3<double> lo, hi;
  double margin = 0;  ///< around planes
  std::int32_t slabs = 0;
  const BladeSlab* slab = nullptr;  ///< around triangles; none: all in the box
};

KERF_HD bool boxes_overlap(const Vec3<double>& lo, const Vec3<double>& hi,
                           const Vec3<double>& other_lo, const Vec3<double>& other_hi) {
  for (int d = 0; d < 3; ++d)
    if (!(lo[d] <= other_hi[d] && other_lo[d] <= hi[d])) return false;
  return true;
}

/// Whether the box [lo, hi], larger by `beyond` of its extent to each side, may be met.
KERF_HD bool may_meet(const BladeNeighbourhood& blade, Vec3<double> lo, Vec3<double> hi,
                      double beyond) {
  constexpr double kHalf = 0.5001;  // a little more, for rounding
  if (beyond > 0) {
    const Vec3<double> by = beyond * (hi - lo);
    lo = lo - by;
    hi = hi + by;
  }
  if (!boxes_overlap(lo, hi, blade.lo, blade.hi)) return false;
  for (std::int32_t k = 0; k < blade.slabs; ++k) {
    const BladeSlab& s = blade.slab[k];
    if (!boxes_overlap(lo, hi, s.lo, s.hi)) continue;
    const Vec3<double> to_center = 0.5 * lo + 0.5 * hi - s.point;
    double reach = blade.margin;
    for (int d = 0; d < 3; ++d) {
      const double n = s.normal[d];
      reach += kHalf * (n < 0 ? -n : n) * (hi[d] - lo[d]);
    }
    const double distance = dot(s.normal, to_center);
    if ((distance < 0 ? -distance : distance) <= reach) return true;
  }
  return blade.slabs == 0;
}

}  // namespace kerf::kernels
