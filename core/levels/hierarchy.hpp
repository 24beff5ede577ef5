// SPDX-License-Identifier: MIT
//
// The structure of every multigrid level: cells, links, vertices, transfer. Values live in a
// backend. Level 0 is the finest; everything here changes only with cuts.
//
// A cell of level l + 1 is a connected component of the cells of size 2^l inside one block of
// 2^3; larger cells pass through unchanged. So cells of one level may share a place.
// Two cells share a vertex iff a chain of links around that grid point joins them.
// A hanging corner is interpolated from the larger cell that it meets through links; every cell
// then depends on exactly eight vertices, its slots (kernels/transfer.hpp).
//
// Source  [DGW11] sections 6.2 to 6.4.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/body/lattice.hpp"
#include "core/body/linked_octree.hpp"

namespace kerf {

/// A link between two cells of one level; a is on the low side along axis.
struct CellLink {
  std::int32_t a, b;
  std::uint8_t axis;
};

struct Level {
  static constexpr std::uint8_t kPassed = 8;

  // Cells, ascending by (size, z, y, x).
  std::vector<Vec3i> corner;            ///< low corner, finest lattice
  std::vector<std::uint8_t> size_log2;  ///< side, in finest cells: 1 << size_log2
  std::vector<std::int32_t> parent;     ///< cell of the next level; empty on the coarsest
  std::vector<std::uint8_t> place;      ///< octant in the parent, or kPassed; empty on the coarsest
  std::vector<std::uint16_t> fold;      ///< bits 0-7 hanging corners, bits 8-10 octant
  std::vector<std::array<std::int32_t, 8>> slots;  ///< the eight vertices
  std::vector<CellLink> links;                     ///< ascending by (a, b)
  std::vector<std::int32_t> child_begin;  ///< per cell + 1, into children; empty on level 0
  std::vector<std::int32_t> children;     ///< cells of the previous level, ascending

  // Vertices, ascending by (z, y, x) of their grid point, then by their first cell.
  std::vector<Vec3i> point;                   ///< finest lattice
  std::vector<std::uint8_t> fixed;            ///< bit c: component c is held
  std::vector<std::int32_t> incidence_begin;  ///< per vertex + 1
  std::vector<std::int32_t> incidence;        ///< 8 cell + slot, ascending
  std::vector<std::int32_t> colour_begin;     ///< per colour + 1, into colour_order
  std::vector<std::int32_t> colour_order;     ///< vertices; no two of one colour share a cell

  std::int32_t cells() const { return static_cast<std::int32_t>(corner.size()); }
  std::int32_t vertices() const { return static_cast<std::int32_t>(point.size()); }
  int colours() const { return static_cast<int>(colour_begin.size()) - 1; }
  std::size_t bytes() const;
};

/// What the element of a cell of level 0 needs, beside its rotation.
struct CellValues {
  double stiffness = 0;       ///< E * side, N/m
  double mass = 0;            ///< density * side^3, kg
  std::uint8_t material = 0;  ///< index into Hierarchy::poisson
};

struct HierarchyOptions {
  int coarsest_vertices = 1500;  ///< stop at the first level with at most so many vertices
  int max_levels = 0;            ///< 0: no limit
  bool duplicate_cells = true;   ///< false: merge by place alone, as without cuts (comparison)
};

struct Hierarchy {
  double spacing = 0;  ///< side of a finest cell, m
  std::vector<Level> levels;
  std::vector<CellValues> values;  ///< cells of level 0
  std::vector<double> poisson;     ///< Poisson ratio of each material
  bool lumped_mass = false;
  bool cut = false;  ///< some link between two cells is disconnected

  std::size_t bytes() const;
};

/// Level 0 without supports and values: cells in the order of body.leaves().
Level finest_level(const LinkedOctree& body);

/// Fills fold, slots, vertices, incidences and colours of a level from its cells and links.
/// @throws Error (internal) if some cell would not have exactly eight vertices.
void build_vertices(Level& level);

/// Builds all coarser levels over levels[0], whose `fixed` is set. A component of a coarse vertex
/// is held iff every fine component that it would move is.
void build_coarse_levels(Hierarchy& hierarchy, const HierarchyOptions& options);

}  // namespace kerf
