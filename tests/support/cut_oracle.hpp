// SPDX-License-Identifier: MIT
//
// Which links a blade crosses, by testing all half links against all triangles in doubles.
// Shares neither maps nor predicates with core/body/cut.cpp, so blades must be in general position.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <vector>

#include "core/geometry/triangle_mesh.hpp"
#include "tests/support/octree_invariants.hpp"

namespace kerf::test {

/// The corners of all leaves, in the order that cut() asks for, carried by `map`.
template <class Map>
std::vector<Vec3d> corners_of(const LinkedOctree& body, const Map& map) {
  std::vector<Vec3d> corners;
  for (const std::int32_t leaf : body.leaves()) {
    const auto& n = body.nodes()[static_cast<std::size_t>(leaf)];
    const int size = 1 << n.size_log2;
    for (int i = 0; i < 8; ++i)
      corners.push_back(
          map(body.lattice().point({n.corner[0] + (i & 1) * size, n.corner[1] + (i >> 1 & 1) * size,
                                    n.corner[2] + (i >> 2) * size})));
  }
  return corners;
}

/// Where the segment pq meets the triangle, 0 at p and 1 at q.
inline std::optional<double> meet(const Vec3d& p, const Vec3d& q, const Vec3d& a, const Vec3d& b,
                                  const Vec3d& c) {
  const Vec3d n = cross(b - a, c - a);
  const double at_p = dot(n, p - a), at_q = dot(n, q - a);
  if ((at_p < 0) == (at_q < 0)) return {};
  const double t = at_p / (at_p - at_q);
  const Vec3d x = p + t * (q - p);
  for (const auto& [u, v] : {std::pair(a, b), std::pair(b, c), std::pair(c, a)})
    if (dot(n, cross(v - u, x - u)) < 0) return {};
  return t;
}

/// Distances from both ends of each link between inside cells to the nearest crossing, m.
inline std::map<LinkKey, std::array<double, 2>> crossed_links(const LinkedOctree& body,
                                                              const std::vector<Vec3d>& corners,
                                                              const TriangleMesh& blade) {
  const PaintedLeaves p(body);
  const double h = body.lattice().spacing;
  // Point of the cell with centre offset `q` half cells.
  const auto carried = [&](const Vec3i& cell, const std::array<int, 3>& q) {
    const std::int32_t leaf = p.at(cell);
    const auto& n = p.node(leaf);
    double s[3];
    for (std::size_t d = 0; d < 3; ++d)
      s[d] = (cell[d] - n.corner[d] + 0.5 + 0.5 * q[d]) / (1 << n.size_log2);
    Vec3d x;
    for (int i = 0; i < 8; ++i)
      x += (((i & 1) != 0 ? s[0] : 1 - s[0]) * ((i & 2) != 0 ? s[1] : 1 - s[1]) *
            ((i & 4) != 0 ? s[2] : 1 - s[2])) *
           corners[8 * static_cast<std::size_t>(leaf) + static_cast<std::size_t>(i)];
    return x;
  };
  std::map<LinkKey, std::array<double, 2>> found;
  p.for_each_link([&](const Vec3i& c, int axis) {
    if (p.at(c) < 0 || p.at(plus(c, axis, 1)) < 0) return;
    for (std::size_t end = 0; end < 2; ++end) {
      std::array<int, 3> face{};
      face[static_cast<std::size_t>(axis)] = end == 0 ? 1 : -1;
      const Vec3i cell = plus(c, axis, static_cast<int>(end));
      const Vec3d from = carried(cell, {0, 0, 0}), to = carried(cell, face);
      for (const auto& t : blade.triangles) {
        const auto at = meet(from, to, blade.points[static_cast<std::size_t>(t[0])],
                             blade.points[static_cast<std::size_t>(t[1])],
                             blade.points[static_cast<std::size_t>(t[2])]);
        if (!at) continue;
        auto& best =
            found.try_emplace(body.lattice().link_key(c, axis), std::array{h, h}).first->second;
        best[end] = std::min(best[end], 0.5 * h * *at);
        best[1 - end] = std::min(best[1 - end], h - 0.5 * h * *at);
      }
    }
  });
  return found;
}

}  // namespace kerf::test
