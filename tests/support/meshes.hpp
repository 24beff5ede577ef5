// SPDX-License-Identifier: MIT
//
// Triangle meshes made by formula.
#pragma once

#include <cmath>
#include <functional>
#include <numbers>
#include <utility>

#include "core/geometry/triangle_mesh.hpp"

namespace kerf::test {

inline void append(TriangleMesh& mesh, const TriangleMesh& other) {
  const auto first = static_cast<std::int32_t>(mesh.points.size());
  mesh.points.insert(mesh.points.end(), other.points.begin(), other.points.end());
  for (const auto& t : other.triangles)
    mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
}

inline TriangleMesh flipped(TriangleMesh mesh) {
  for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

/// A grid of (m + 1)(n + 1) points; u and v run from 0 to 1. The normal is along du x dv.
inline TriangleMesh patch(int m, int n, const std::function<Vec3d(double u, double v)>& point) {
  TriangleMesh mesh;
  for (int j = 0; j <= n; ++j)
    for (int i = 0; i <= m; ++i)
      mesh.points.push_back(point(static_cast<double>(i) / m, static_cast<double>(j) / n));
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < m; ++i) {
      const std::int32_t a = i + (m + 1) * j, b = a + 1, d = a + m + 1, c = d + 1;
      mesh.triangles.push_back({a, b, c});
      mesh.triangles.push_back({a, c, d});
    }
  return mesh;
}

/// A closed box, each face of n x n x 2 triangles.
inline TriangleMesh box_mesh(const Box3& box, int n = 1) {
  TriangleMesh mesh;
  for (int axis = 0; axis < 3; ++axis)
    for (int side = 0; side < 2; ++side) {
      const int i = side == 1 ? (axis + 1) % 3 : (axis + 2) % 3, j = 3 - axis - i;
      append(mesh, patch(n, n, [&](double u, double v) {
               Vec3d p = side == 1 ? box.hi : box.lo;
               p[i] = u == 1 ? box.hi[i] : box.lo[i] + u * (box.hi[i] - box.lo[i]);
               p[j] = v == 1 ? box.hi[j] : box.lo[j] + v * (box.hi[j] - box.lo[j]);
               return p;
             }));
    }
  return weld(mesh);
}

/// Angles at multiples of 1/n of a turn; a full turn gives the bits of none, so that seams weld.
inline double turn(double u) { return u == 1 ? 0 : 2 * std::numbers::pi * u; }

inline TriangleMesh sphere_mesh(const Vec3d& center, double radius, int n) {
  return weld(patch(2 * n, n, [&](double u, double v) {
    const double latitude = std::numbers::pi * (v - 0.5);
    const double r = v == 0 || v == 1 ? 0 : radius * std::cos(latitude);
    const double h = v == 0 ? -radius : (v == 1 ? radius : radius * std::sin(latitude));
    return center + Vec3d{r * std::cos(turn(u)), r * std::sin(turn(u)), h};
  }));
}

/// Around z, through circles of radius `ring`.
inline TriangleMesh torus_mesh(const Vec3d& center, double ring, double tube, int m, int n) {
  return weld(patch(m, n, [&](double u, double v) {
    const double r = ring + tube * std::cos(turn(v));
    return center + Vec3d{r * std::cos(turn(u)), r * std::sin(turn(u)), tube * std::sin(turn(v))};
  }));
}

}  // namespace kerf::test
