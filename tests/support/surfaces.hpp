// SPDX-License-Identifier: MIT
//
// Small surfaces built by hand.
#pragma once

#include <cmath>
#include <set>
#include <utility>

#include "core/surface/surface_mesh.hpp"

namespace kerf::test {

/// A unit vector whose parts are single precision, so that files keep it.
inline Vec3d float_normal(const Vec3d& direction) {
  Vec3d n = (1 / norm(direction)) * direction;
  for (int d = 0; d < 3; ++d) {
    // Through memory: GCC 12 forgets to round where it converts neighbours together.
    const volatile float rounded = static_cast<float>(n[d]);
    n[d] = rounded;
  }
  return n;
}

/// Adds a flat triangle; each corner has the triangle's normal.
inline void add_triangle(SurfaceMesh& s, const std::array<std::int32_t, 3>& points,
                         std::int32_t cut_id) {
  const Vec3d a = s.position(points[0]), b = s.position(points[1]), c = s.position(points[2]);
  const auto n = static_cast<std::int32_t>(s.normals.size());
  for (int k = 0; k < 3; ++k) s.normals.push_back(float_normal(cross(b - a, c - a)));
  s.triangles.push_back(points);
  s.normal_of.push_back({n, n + 1, n + 2});
  s.cut_id.push_back(cut_id);
}

/// A tetrahedron with legs of length `size` at `origin`; the face opposite to the origin belongs to
/// the cut. Its points are displaced by numbers that binary does not hold exactly.
inline void add_tetrahedron(SurfaceMesh& s, const Vec3d& origin, double size, std::int32_t cut_id,
                            std::int32_t piece) {
  const auto p = static_cast<std::int32_t>(s.reference.size());
  for (const Vec3d& leg : {Vec3d{0, 0, 0}, Vec3d{1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0, 0, 1}}) {
    s.reference.push_back(origin + size * leg);
    s.displacement.push_back(size * Vec3d{0.1 * leg.y, -1.0 / 3 * leg.z, 0.01 * leg.x});
    s.piece.push_back(piece);
  }
  add_triangle(s, {p, p + 2, p + 1}, 0);
  add_triangle(s, {p, p + 1, p + 3}, 0);
  add_triangle(s, {p, p + 3, p + 2}, 0);
  add_triangle(s, {p + 1, p + 2, p + 3}, cut_id);
}

/// Two pieces with a cut each.
inline SurfaceMesh two_tetrahedra(const Vec3d& origin = {0.3, -0.2, 1.7}) {
  SurfaceMesh s;
  add_tetrahedron(s, origin, 0.11, 2, 0);
  add_tetrahedron(s, origin + Vec3d{0.07, 0.3, -0.05}, 0.23, 1, 1);
  return s;
}

/// Whether every edge is passed once in each direction.
inline bool is_closed(const std::vector<std::array<std::int32_t, 3>>& triangles) {
  std::set<std::pair<std::int32_t, std::int32_t>> edges;
  for (const auto& t : triangles)
    for (std::size_t k = 0; k < 3; ++k)
      if (!edges.emplace(t[k], t[(k + 1) % 3]).second) return false;
  for (const auto& [a, b] : edges)
    if (!edges.contains({b, a})) return false;
  return true;
}

}  // namespace kerf::test
