// SPDX-License-Identifier: MIT
//
// Where the triangles of a mesh cross the lines through the cell centres of a lattice.
#pragma once

#include <cstdint>
#include <vector>

#include "core/body/lattice.hpp"
#include "core/geometry/triangle_mesh.hpp"

namespace kerf {

/// A triangle crosses a link.
struct MeshCrossing {
  LinkKey link = 0;
  double at = 0;             ///< in [0, 1] from the lower to the upper centre
  std::int32_t leaving = 0;  ///< +1: the normal points to the upper end; -1: to the lower end
  Vec3f normal{};            ///< unit normal of the triangle
  bool drawn = true;         ///< false: a cap that only serves to count
};

struct MeshCrossings {
  /// Ascending by link, then by place; of two at one place the one that leaves comes first, so
  /// that two solids that merely touch are apart.
  std::vector<MeshCrossing> crossings;
  /// For each row of cells along x (index y + ny z): the winding number at cell 0 of a mesh
  /// without boundary, the signed crossings between it and infinity.
  std::vector<std::int32_t> row_start;
};

/// Which links are crossed, and in which direction, is exact for the mesh with its points rounded
/// to a fraction 2^-24 of the spacing (coarser only if the mesh spans 2^15 cells or more), the
/// lattice being moved by the infinitesimal of core/geometry/predicates.hpp.
/// Triangles from index `drawn` on are caps.
/// @throws Error (bad_input) if the mesh is more than 2^37 cells large.
MeshCrossings cross_lattice(const TriangleMesh& mesh, std::size_t drawn, const Lattice& lattice);

}  // namespace kerf
