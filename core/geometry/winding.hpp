// SPDX-License-Identifier: MIT
//
// The generalised winding number of a triangle mesh: 1 inside and 0 outside a closed mesh, and a
// smooth field between where the mesh has holes.
//
// Source  Jacobson, Kavan, Sorkine-Hornung 2013, Robust inside-outside segmentation;
//         Barill et al. 2018, Fast winding numbers (far field by dipoles).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/geometry/triangle_mesh.hpp"

namespace kerf {

/// Solid angle of a triangle seen from p over 4 pi, positive if seen from behind its normal.
double solid_angle_fraction(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& p);

/// The sum over all triangles: linear in their number, exact but for rounding.
double winding_number(const TriangleMesh& mesh, const Vec3d& p);

/// The same by a tree, with clusters of triangles that are far away taken as one dipole each.
class WindingTree {
 public:
  explicit WindingTree(const TriangleMesh& mesh);

  double operator()(const Vec3d& p) const;

  /// Whether the bounding box of a triangle overlaps `box`.
  bool touches(const Box3& box) const;

 private:
  struct Cluster {
    Box3 box;
    Vec3d center{};    // mean of the triangles' centroids by area
    Vec3d dipole{};    // sum of area normals, m^2
    double area = 0;   // m^2
    double reach = 0;  // square of the distance beyond which the dipole will do, m^2
  };
  struct Entry {
    std::size_t level, index;
  };
  static constexpr std::size_t kFan = 4;
  static constexpr std::size_t kStack = 24 * (kFan - 1) + 1;

  std::vector<std::array<Vec3d, 3>> triangles_;  // along a space-filling curve
  std::vector<std::size_t> level_begin_;         // first cluster of each level, leaves first
  std::vector<Cluster> clusters_;                // leaf i holds triangles kFan i ... kFan i + 3
};

}  // namespace kerf
