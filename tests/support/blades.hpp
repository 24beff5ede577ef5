// SPDX-License-Identifier: MIT
//
// Blades for tests.
#pragma once

#include <cmath>
#include <vector>

#include "core/geometry/blade.hpp"
#include "core/geometry/triangle_mesh.hpp"

namespace kerf::test {

/// Two triangles over a square of half side `reach` around `center`, with the given normal.
inline TriangleMesh plane_blade(const Vec3d& center, const Vec3d& normal, double reach) {
  const Vec3d n = (1 / norm(normal)) * normal;
  const Vec3d other = std::abs(n.x) < 0.6 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
  Vec3d u = cross(n, other);
  u *= reach / norm(u);
  const Vec3d v = cross(n, u);
  return {{center - u - v, center + u - v, center + u + v, center - u + v}, {{0, 1, 2}, {0, 2, 3}}};
}

/// A wall over a closed polygon of `sides` in the plane z, from z0 to z1.
inline TriangleMesh stamp_blade(double x, double y, double radius, double z0, double z1,
                                int sides = 24) {
  std::vector<CutLine> lines(2);
  for (int i = 0; i <= sides; ++i) {
    const double angle = 2 * 3.14159265358979323846 * (i % sides + 0.3) / sides;
    const Vec3d p{x + radius * std::cos(angle), y + radius * std::sin(angle), 0};
    lines[0].push_back(p + Vec3d{0, 0, z0});
    lines[1].push_back(p + Vec3d{0, 0, z1});
  }
  return sweep(lines);
}

/// An arc that opens along x with radius of curvature `radius`, as cut lines along z.
inline std::vector<CutLine> arc_lines(const Vec3d& center, double radius, double half_height,
                                      int steps) {
  std::vector<CutLine> lines;
  for (int i = 0; i <= steps; ++i) {
    const double angle = -1.3 + 2.6 * i / steps;
    const Vec3d p = center + radius * Vec3d{1 - std::cos(angle), std::sin(angle), 0};
    lines.push_back({p - Vec3d{0, 0, half_height}, p + Vec3d{0.1 * radius, 0, half_height}});
  }
  return lines;
}

inline TriangleMesh joined(TriangleMesh a, const TriangleMesh& b) {
  const auto shift = static_cast<std::int32_t>(a.points.size());
  a.points.insert(a.points.end(), b.points.begin(), b.points.end());
  for (const auto& t : b.triangles)
    a.triangles.push_back({t[0] + shift, t[1] + shift, t[2] + shift});
  return a;
}

}  // namespace kerf::test
