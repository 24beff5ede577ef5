// SPDX-License-Identifier: MIT
//
// Plane blades. A blade through grid planes lies a little beside them, so that it meets the cells
// on one side alone: then a method that removes or duplicates the cells it meets has a choice.
#pragma once

#include <cmath>
#include <numbers>

#include "core/geometry/triangle_mesh.hpp"

namespace kerf::cutting {

inline constexpr double kBeside = 1e-6;  // m; bodies are a few metres large

/// Unit vectors across a unit normal.
inline std::pair<Vec3d, Vec3d> across(const Vec3d& normal) {
  const Vec3d other = std::abs(normal.y) < 0.5 ? Vec3d{0, 1, 0} : Vec3d{1, 0, 0};
  Vec3d u = cross(other, normal);
  u = (1 / norm(u)) * u;
  return {u, cross(normal, u)};
}

/// A square of side 2 `half`.
inline TriangleMesh plane_blade(const Vec3d& middle, const Vec3d& normal, double half) {
  const auto [u, v] = across(normal);
  const Vec3d a = half * u, b = half * v;
  return {{middle - a - b, middle + a - b, middle + a + b, middle - a + b}, {{0, 1, 2}, {0, 2, 3}}};
}

/// A disk, as a polygon of the same area.
inline TriangleMesh disk_blade(const Vec3d& middle, const Vec3d& normal, double radius) {
  constexpr int kSides = 96;
  const double turn = 2 * std::numbers::pi / kSides;
  const double reach = radius * std::sqrt(turn / std::sin(turn));
  const auto [u, v] = across(normal);
  TriangleMesh out{{middle}, {}};
  for (int i = 0; i < kSides; ++i) {
    out.points.push_back(middle + reach * (std::cos(turn * i) * u + std::sin(turn * i) * v));
    out.triangles.push_back({0, i + 1, (i + 1) % kSides + 1});
  }
  return out;
}

}  // namespace kerf::cutting
