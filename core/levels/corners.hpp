// SPDX-License-Identifier: MIT
//
// From vertex values to corner values and back, on the host, for level 0.
#pragma once

#include <span>
#include <vector>

#include "core/geometry/vec.hpp"
#include "core/levels/hierarchy.hpp"
#include "core/levels/update.hpp"

namespace kerf {

/// Values at the eight corners of a cell, hanging corners interpolated.
void corner_values(const Level& level, std::int32_t cell, std::span<const double> vertex_values,
                   Vec3d (&out)[8]);

/// Where new vertices take their values from after a cut, so that the field stays what it was:
/// vertex k of them is the sum of weight times source over [begin[k], begin[k + 1]).
struct NewVertices {
  std::vector<std::int32_t> begin{0}, source;  ///< old vertices
  std::vector<double> weight;

  /// Shapes  of_sources: three for each of `source`; out: three for each new vertex.
  std::vector<double> combine(std::span<const double> of_sources) const;
};
NewVertices new_vertices(const Level& level, const LevelChange& change);

/// What a blade may meet of the deformed body.
struct NearCells {
  Box3 bounds;                      ///< of all vertices, m
  bool finite = true;               ///< whether all positions are
  std::vector<std::int32_t> cells;  ///< ascending: all that may_meet finds
};
/// Looks at the cells in [first, last) and at their vertices. `reach` is that of the blade, and
/// positions count from the origin of the lattice.
NearCells near_cells(const Hierarchy& hierarchy, std::span<const double> displacement,
                     const Box3& reach, std::int32_t first, std::int32_t last);

}  // namespace kerf
