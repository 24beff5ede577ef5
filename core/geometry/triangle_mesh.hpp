// SPDX-License-Identifier: MIT
//
// A triangle mesh and what can be said about it without a grid.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "core/geometry/vec.hpp"

namespace kerf {

/// Points in m; triangles index into points, counter-clockwise seen from outside.
struct TriangleMesh {
  std::vector<Vec3d> points;
  std::vector<std::array<std::int32_t, 3>> triangles;

  Box3 bounds() const;
};

/// What `inspect` finds. Edges are counted once each.
struct MeshReport {
  std::size_t boundary_edges = 0;      ///< edges of one triangle
  std::size_t nonmanifold_edges = 0;   ///< edges of three or more triangles
  std::size_t misoriented_edges = 0;   ///< edges that two triangles traverse in the same direction
  std::size_t degenerate_triangles = 0;///< triangles with a repeated vertex or no area
  std::size_t unbalanced_edges = 0;    ///< edges not traversed as often forth as back; none: the
                                       ///< winding number is an integer away from the surface
  double volume = 0;                   ///< signed, m^3; negative for an inverted closed mesh
  bool closed() const { return boundary_edges == 0; }
  bool oriented() const { return misoriented_edges == 0 && nonmanifold_edges == 0; }
};

MeshReport inspect(const TriangleMesh& mesh);

/// Merges points that have equal coordinates and drops triangles that repeat a vertex by it.
TriangleMesh weld(const TriangleMesh& mesh);

/// Throws Error (bad_input) if a point is not finite or a triangle refers outside the points;
/// `name` is used in the message.
void check_finite(const TriangleMesh& mesh, const std::string& name);

}  // namespace kerf
