// SPDX-License-Identifier: MIT
//
// Fields on bodies, and sums over them, for the tests of the physics.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "core/levels/corners.hpp"
#include "core/simulation.hpp"
#include "cpu/cpu_backend.hpp"
#include "kernels/mat3.hpp"
#include "tests/support/bodies.hpp"

namespace kerf::test {

inline std::unique_ptr<Backend> cpu(int threads = 1) { return make_cpu_backend({threads, 0}); }

inline std::shared_ptr<const Solid> box_solid(const Vec3d& size) {
  return make_box({{0, 0, 0}, size});
}

/// Between the corners of two runs, m; infinite where they have not as many.
inline double worst_distance(const Simulation& a, const Simulation& b) {
  const std::vector<Vec3d> left = a.deformed_corners(), right = b.deformed_corners();
  double worst = left.size() == right.size() ? 0 : std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < std::min(left.size(), right.size()); ++i)
    worst = std::max(worst, norm(left[i] - right[i]));
  return worst;
}

using Rotation = kernels::Quat<double>;

inline Rotation turn(const Vec3d& axis, double angle) {
  const Vec3d n = (std::sin(0.5 * angle) / norm(axis)) * axis;
  return {std::cos(0.5 * angle), n.x, n.y, n.z};
}

/// Level 0 of a body of one material, with values but without supports.
inline Hierarchy one_material(const LinkedOctree& body, const Material& material) {
  Hierarchy hierarchy;
  hierarchy.spacing = body.lattice().spacing;
  hierarchy.poisson = {material.poisson};
  hierarchy.levels.push_back(finest_level(body));
  const Level& level = hierarchy.levels[0];
  for (const std::uint8_t log2 : level.size_log2) {
    const double side = hierarchy.spacing * (1 << log2);
    hierarchy.values.push_back({material.young * side, material.density * side * side * side, 0});
  }
  return hierarchy;
}

/// field(x) at the reference position of each vertex, three values a vertex.
template <class Field>
std::vector<double> at_vertices(const LinkedOctree& body, const Level& level, const Field& field) {
  std::vector<double> out;
  for (const Vec3i p : level.point) {
    const Vec3d value = field(body.lattice().point(p));
    out.insert(out.end(), {value.x, value.y, value.z});
  }
  return out;
}

inline Vec3d vertex_value(const std::vector<double>& x, std::size_t vertex) {
  return {x[3 * vertex], x[3 * vertex + 1], x[3 * vertex + 2]};
}

inline std::vector<double> read(const Backend& backend, int x, std::size_t vertices) {
  std::vector<double> out(3 * vertices);
  backend.read(0, x, out);
  return out;
}

/// Whether a grid point lies on the outside of the lattice.
inline bool on_outside(const Lattice& lattice, const Vec3i& p) {
  for (std::size_t d = 0; d < 3; ++d)
    if (p[d] == 0 || p[d] == lattice.size[d]) return true;
  return false;
}

inline std::size_t count_folded(const Level& level) {
  return static_cast<std::size_t>(
      std::count_if(level.fold.begin(), level.fold.end(), [](auto f) { return (f & 255) != 0; }));
}

/// Integrals over the cells of a snapshot; exact for trilinear fields.
struct Totals {
  double mass = 0;
  Vec3d momentum{}, centre{}, force{}, torque{};  ///< torque of the loads about the origin
};

inline Totals totals(const Simulation& simulation) {
  const Snapshot s = simulation.snapshot();
  const double h = simulation.body().lattice().spacing;
  Totals out;
  for (std::size_t c = 0; c < s.cells.size(); ++c) {
    const double side = h * (1 << s.size_log2[c]);
    const double mass = s.density[c] * side * side * side;
    out.mass += mass;
    for (const std::int32_t p : s.cells[c]) {
      const auto i = static_cast<std::size_t>(p);
      out.momentum += 0.125 * mass * s.velocity[i];
      out.centre += 0.125 * mass * (s.points[i] + s.displacement[i]);
    }
  }
  out.centre *= 1 / out.mass;
  for (std::size_t i = 0; i < s.points.size(); ++i) {
    out.force += s.external_force[i];
    out.torque += cross(s.points[i], s.external_force[i]);
  }
  return out;
}

/// The blade lines of an axis-aligned rectangle: the edge is along `edge`, and moves from `from`
/// to `to`, places of its low end.
inline std::vector<CutLine> straight_cut(const Vec3d& from, const Vec3d& to, const Vec3d& edge) {
  return {{from, from + edge}, {to, to + edge}};
}

}  // namespace kerf::test
