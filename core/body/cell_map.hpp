// SPDX-License-Identifier: MIT
//
// Where the points of a leaf lie: the lattice, or the trilinear map of its eight corners.
//
// Layout  points of a leaf are named by integers q in [0, 2 side]^3, in half finest cells from its
//         low corner; the centre of finest cell v is at 2 v + 1, its faces' centres are 1 away.
#pragma once

#include "core/body/lattice.hpp"

namespace kerf {

struct CellMap {
  const Lattice* lattice = nullptr;
  Vec3i corner{};                  ///< low corner on the finest lattice
  std::int32_t side = 1;           ///< in finest cells
  const Vec3d* corners = nullptr;  ///< eight deformed positions, m; null for the reference state

  /// The position of point q, m. Leaves that share the corners of a face give the same bits on it,
  /// and so do all leaves in the reference state.
  Vec3d position(const Vec3i& q) const { return position_at({1.0 * q[0], 1.0 * q[1], 1.0 * q[2]}); }
  /// The same between such points, and a little beside the leaf.
  Vec3d position_at(const Vec3d& q) const {
    if (corners == nullptr) {
      Vec3d p;
      for (int d = 0; d < 3; ++d)
        p[d] = lattice->origin[d] +
               (corner[static_cast<std::size_t>(d)] + 0.5 * q[d]) * lattice->spacing;
      return p;
    }
    const double x = fraction(q.x), y = fraction(q.y), z = fraction(q.z);
    return mix(mix(mix(corners[0], corners[1], x), mix(corners[2], corners[3], x), y),
               mix(mix(corners[4], corners[5], x), mix(corners[6], corners[7], x), y), z);
  }

  /// F^T n with F the deformation gradient at point q: a normal carried to the reference state.
  Vec3d pull_back(const Vec3i& q, const Vec3d& n) const {
    if (corners == nullptr) return n;
    Vec3d out;
    for (int d = 0; d < 3; ++d) {
      const int u = (d + 1) % 3, v = (d + 2) % 3;
      const double s = fraction(q[static_cast<std::size_t>(u)]);
      const double t = fraction(q[static_cast<std::size_t>(v)]);
      const auto edge = [&](int at_u, int at_v) {
        const int low = at_u << u | at_v << v;
        return corners[low | 1 << d] - corners[low];
      };
      const Vec3d slope = mix(mix(edge(0, 0), edge(1, 0), s), mix(edge(0, 1), edge(1, 1), s), t);
      out[d] = dot(slope, n) / (side * lattice->spacing);
    }
    return out;
  }

 private:
  double fraction(double q) const { return 0.5 * q / side; }
  /// Exactly a at 0 and b at 1.
  static Vec3d mix(const Vec3d& a, const Vec3d& b, double t) { return (1 - t) * a + t * b; }
};

}  // namespace kerf
