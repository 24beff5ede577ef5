// SPDX-License-Identifier: MIT
//
// From vertex values to corner values and back, on the host, for level 0.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/body/cut.hpp"
#include "core/geometry/vec.hpp"
#include "core/levels/hierarchy.hpp"
#include "core/levels/update.hpp"

namespace kerf {

/// Values at the eight corners of a cell, hanging corners interpolated.
void corner_values(const Level& level, std::int32_t cell, std::span<const double> vertex_values,
                   Vec3d (&out)[8]);

/// Of a vector of all vertices, what it holds at some: three each.
std::vector<double> values_at(std::span<const double> all, std::span<const std::int32_t> vertices);

/// Where new vertices take their values from after a cut, so that the field stays what it was:
/// vertex k of them is the sum of weight times source over [begin[k], begin[k + 1]).
struct NewVertices {
  std::vector<std::int32_t> begin{0}, source;  ///< old vertices
  std::vector<double> weight;

  /// Shapes  of_sources: three for each of `source`; out: three for each new vertex.
  std::vector<double> combine(std::span<const double> of_sources) const;
};
NewVertices new_vertices(const Level& level, const LevelChange& change);

/// What a blade may meet of the deformed body; positions count from the origin of the lattice.
struct NearCells {
  Box3 bounds;                      ///< of all vertices, m
  bool finite = true;               ///< whether all positions are
  std::vector<std::int32_t> cells;  ///< ascending: all that may be met, and few others
};
/// Of a cell that has cut links, whose eight vertices are deformed to these places.
bool may_meet_opened(const Vec3d (&vertices)[8], const BladeReach& reach);
/// Joins them to the cells, which come in any order.
void add_opened(std::span<const std::int32_t> opened, NearCells& out);

/// In two passes, each of which may be shared out: over vertices, then over cells; and, apart from
/// both, over those few whose links to other cells were cut, since these may reach beyond the cell.
class FindNear {
 public:
  FindNear(const Hierarchy& hierarchy, std::span<const double> displacement,
           const BladeReach& reach);
  void look_at_vertices(std::int32_t first, std::int32_t last, NearCells& out);
  void look_at_cells(std::int32_t first, std::int32_t last, NearCells& out) const;
  /// At last.
  void look_at_opened(std::span<const std::int32_t> cells, NearCells& out) const;

 private:
  Vec3d position(std::int32_t vertex) const;
  std::uint8_t sides_beyond(std::int32_t cell) const;

  const Level& level_;
  double spacing_;
  std::span<const double> displacement_;
  const BladeReach& reach_;
  std::vector<std::uint8_t> beside_;  // per vertex: a bit for each side of the box it lies beyond
};
/// `opened`: cells that have a link to another cell that was cut.
NearCells near_cells(const Hierarchy& hierarchy, std::span<const double> displacement,
                     const BladeReach& reach, std::span<const std::int32_t> opened);

}  // namespace kerf
