// SPDX-License-Identifier: MIT
//
// The point of a dual cell that fits the surface points on its links best.
#pragma once

#include <span>

#include "core/geometry/vec.hpp"

namespace kerf {

/// A point of the surface and its unit normal there.
struct SurfaceHit {
  Vec3d point{};
  Vec3d normal{};
  bool firm = false;  ///< of a cut: it goes before those of the object's own surface
};

/// Minimises sum_i (n_i . (x - p_i))^2 over the cube [-1/2, 1/2]^3, near the mean of the points:
/// directions in which the sum hardly changes are left out, so that points of one plane give their
/// mean, those of an edge a point of the edge, those of a corner the corner. Where firm points meet
/// others, x fits the firm ones as well as it can, and among all such places the others. So the rim
/// of a planar cut lies in its plane.
///
/// Shapes  hits: at least one; in units in which the dual cell is the unit cube around 0.
/// Errors  points of one plane: x lies in it to rounding. Bent by an angle below about 0.1 between
///         normals, hits count as smooth. Never leaves the cube, never gives a NaN.
/// Source  Ju, Losasso, Schaefer, Warren 2002 [JLSW02], section 2.3. The bounds are exact, by the
///         faces, edges and corners of the cube, but where firm points meet others: there x stops
///         on its way out of the cube. Firm points are ours.
Vec3d fit_vertex(std::span<const SurfaceHit> hits);

}  // namespace kerf
