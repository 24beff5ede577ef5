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
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/body/lattice.hpp"
#include "core/body/lattice_point.hpp"
#include "core/body/linked_octree.hpp"
#include "core/levels/rows.hpp"

namespace kerf {

/// Arrays grow in place when a blade passes, and numbers stay: nothing is ever merged, so a cell
/// that is split or falls apart leaves its number to one of its parts, a vertex to one of its own,
/// and the others are appended (update.hpp). The order of a build is therefore that of the start
/// alone.
struct Level {
  static constexpr std::uint8_t kPassed = 8;

  // Cells; built in the order of body.leaves() on level 0, ascending by (size, z, y, x) above.
  std::vector<LatticePoint> corner;     ///< low corner, finest lattice
  std::vector<std::uint8_t> size_log2;  ///< side, in finest cells: 1 << size_log2
  std::vector<std::int32_t> parent;  ///< cell of the next level; empty on the coarsest, and after
                                     ///< Hierarchy::forget_transfers
  std::vector<std::uint8_t> place;   ///< octant in the parent, or kPassed; empty on the coarsest
  std::vector<std::uint16_t> fold;   ///< bits 0-7 hanging corners, bits 8-10 octant
  /// The eight vertices. After Hierarchy::forget_transfers of the finest and the coarsest level
  /// alone.
  std::vector<std::array<std::int32_t, 8>> slots;

  // Vertices; built ascending by (z, y, x) of their grid point, then by their first cell.
  std::vector<LatticePoint> point;  ///< finest lattice
  std::vector<std::uint8_t> fixed;  ///< bit c: component c is held

  // Lists, to be read by the functions below: these arrays lie packed only after a build and
  // pack(). Those of links and incidences are empty after Hierarchy::forget_neighbours.
  std::vector<std::int32_t> link_begin, linked;
  std::vector<std::int32_t> child_begin, children;  ///< empty on level 0
  std::vector<std::int32_t> incidence_begin, incidence;
  RowState link_rows, child_rows, incidence_rows;

  /// Cells that are linked to one: 8 cell + face, ascending; face 2 axis + side as seen from the
  /// cell whose list it is, side 1 towards larger coordinates.
  std::span<const std::int32_t> links_of(std::int32_t cell) const {
    return row_of(link_begin, linked, link_rows, cell);
  }
  /// Cells of the previous level, ascending. Not on level 0.
  std::span<const std::int32_t> children_of(std::int32_t cell) const {
    return row_of(child_begin, children, child_rows, cell);
  }
  /// 8 cell + slot, ascending.
  std::span<const std::int32_t> incidences_of(std::int32_t vertex) const {
    return row_of(incidence_begin, incidence, incidence_rows, vertex);
  }
  /// Lists in one piece again: row r of X is X[X_begin[r]] .. X[X_begin[r + 1]]. Linear time.
  void pack();

  std::int32_t cells() const { return static_cast<std::int32_t>(corner.size()); }
  std::int32_t vertices() const { return static_cast<std::int32_t>(point.size()); }
  std::size_t bytes() const;
};

/// A link between two cells of one level; a is on the low side along axis.
struct CellLink {
  std::int32_t a, b;
  std::uint8_t axis;
};
/// Every link once, ascending by (a, b).
std::vector<CellLink> links_of(const Level& level);

/// What the element of a cell of level 0 needs, beside its rotation.
struct CellValues {
  double stiffness = 0;       ///< E * side, N/m
  double mass = 0;            ///< density * side^3, kg
  std::uint8_t material = 0;  ///< index into Hierarchy::poisson

  friend bool operator==(const CellValues&, const CellValues&) = default;
};

/// One for each cell. Few are different, so that a cell costs a byte, and two where there are more
/// than 256.
class CellValueList {
 public:
  const CellValues& operator[](std::size_t cell) const { return kinds_[kind(cell)]; }
  /// Its place in kinds(); later kinds come behind.
  std::uint16_t kind(std::size_t cell) const {
    return static_cast<std::uint16_t>(low_[cell] + (is_wide() ? 256U * high_[cell] : 0U));
  }
  const std::vector<CellValues>& kinds() const { return kinds_; }
  std::size_t size() const { return low_.size(); }
  void reserve(std::size_t size) { low_.reserve(size); }
  void clear() { resize(0); }
  void push_back(const CellValues& values) { resize(size() + 1, values); }
  void resize(std::size_t size, const CellValues& values = {}) {
    const std::uint16_t kind = kind_of(values);
    low_.resize(size, static_cast<std::uint8_t>(kind % 256));
    if (is_wide()) high_.resize(size, static_cast<std::uint8_t>(kind / 256));
  }
  void set(std::size_t cell, const CellValues& values);
  std::size_t bytes() const;

 private:
  std::uint16_t kind_of(const CellValues& values);
  bool is_wide() const { return kinds_.size() > 256; }

  std::vector<std::uint8_t> low_, high_;  // bytes of the number of each; no high ones if not wide
  std::vector<CellValues> kinds_;
  std::uint16_t last_ = 0;  // mostly the next one too
};

struct HierarchyOptions {
  int coarsest_vertices = 1500;  ///< stop at the first level with at most so many vertices
  int max_levels = 0;            ///< 0: no limit
  bool duplicate_cells = true;   ///< false: merge by place alone, as without cuts (comparison)
};

struct Hierarchy {
  double spacing = 0;  ///< side of a finest cell, m
  std::vector<Level> levels;
  CellValueList values;         ///< cells of level 0
  std::vector<double> poisson;  ///< Poisson ratio of each material
  bool lumped_mass = false;
  bool cut = false;  ///< some link between two cells is disconnected

  void pack();  ///< all levels
  /// Gives back what blades, and some backends, ask for alone: links, and incidences of all levels
  /// but the coarsest. The hierarchy cannot be updated then.
  void forget_neighbours();
  /// Gives back what a backend without neighbours reads at a load alone: parents, and the slots of
  /// all levels but the finest and the coarsest. The hierarchy cannot be loaded again then.
  void forget_transfers();
  bool has_transfers() const { return levels.size() < 2 || !levels[0].parent.empty(); }
  /// Whether neighbours are there, so that it can be updated.
  bool has_neighbours() const { return !levels.empty() && !levels[0].link_begin.empty(); }
  std::size_t bytes() const;
};

/// Corners of cells are numbered by 31 bits.
/// @throws Error (unavailable) for more cells than that allows.
void check_cell_count(std::size_t cells);

/// Level 0 without supports and values: cells in the order of body.leaves().
/// @throws as check_cell_count.
Level finest_level(const LinkedOctree& body);

/// The links of a leaf, as in Level::links_of; numbers are places in body.leaves().
void add_links_of_leaf(const LinkedOctree& body, std::int32_t number,
                       std::vector<std::int32_t>& out);

/// Fills fold, slots, vertices and incidences of a level from its cells and links.
/// @throws Error (internal) if some cell would not have exactly eight vertices.
void build_vertices(Level& level);

/// Builds all coarser levels over levels[0], whose `fixed` is set. A component of a coarse vertex
/// is held iff every fine component that it would move is.
void build_coarse_levels(Hierarchy& hierarchy, const HierarchyOptions& options);

/// Whether build_coarse_levels would stop at the levels that the hierarchy has.
bool has_all_levels(const Hierarchy& hierarchy, const HierarchyOptions& options);

/// Bit 8 i + m: slot i of a child takes something from slot m of its parent.
std::uint64_t transfer_pattern(std::uint16_t child, std::uint8_t place, std::uint16_t parent);

}  // namespace kerf
