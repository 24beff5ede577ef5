// SPDX-License-Identifier: MIT
//
// A level as the fast backend walks it: patches of some thousand cells that lie together, each with
// its own short numbers for the points of its cells, so that a product with the matrix of a patch
// runs in the cache and adds in a fixed order, whichever thread does it.
//
// Vertices  are numbered anew ("packed"): those that only one patch has, patch by patch, then those
//           that patches share; each range is filled up to a multiple of eight with vertices that
//           are nothing, and one such tile is the last. What belongs to nothing is zero and stays
//           so. Vectors hold tiles of eight vertices:  [tile][component][8].
// Points    of a patch: its vertices, its hanging corners, and last one that is nothing. A hanging
//           corner is the mean of four of the points (each of two counts twice on an edge).
// Cells     in groups of eight, one in each lane; a lane without a cell has the point that is
//           nothing for corners. The cells of a group are of one kind.
//
// Cuts and hanging corners need nothing beyond the numbers of points.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/levels/hierarchy.hpp"
#include "cpu/pack.hpp"

namespace kerf::cpu {

inline constexpr int kGroup = 8;
inline constexpr std::size_t kTileScalars = 3 * kGroup;

/// What a vertex takes from those of another level: rows of a sparse matrix.
struct SparseWeights {
  std::vector<std::int32_t> begin;   // per row + 1
  std::vector<std::int32_t> vertex;  // packed, of the other level
  std::vector<std::uint8_t> weight;  // in 1 / kWhole: exact
  static constexpr int kWhole = 64;
};

/// How the matrix of a cell of a stored level comes about; cells of a group are alike.
enum StoredKind : std::uint16_t {
  kMerged,  ///< from children without held components, one an octant
  kPassed,  ///< from one cell of the same place and size, without held components
  // Where some cell of level 0 below is partly held:
  kHeldMerged,  ///< from children above level 0, one an octant
  kHeldPassed,  ///< from one cell above level 0
  kGeneral      ///< from cells of level 0, or two children have one octant
};

/// Whether components of the vertices of a cell are held. A wholly held cell takes no part in any
/// product, so its matrix is zero to the levels above.
enum HeldCell : std::uint8_t { kFree, kPartlyHeld, kWhollyHeld };

/// How the points of a group lie.
enum RowKind : std::uint8_t {
  kScattered,
  kTwoRows,  ///< each half of the group is a row: cells side by side along x, points in order
  kRow       ///< the whole group is one
};

/// What cells of level 0 have in common.
struct CellKind {
  double stiffness = 0, mass = 0, side = 0;  // E side, density side^3, m
  std::uint8_t material = 0;

  friend bool operator==(const CellKind&, const CellKind&) = default;
};

struct Patch {
  std::int32_t first_group = 0, groups = 0;
  std::int32_t first_own = 0, own = 0;          // packed vertices: multiples of eight
  std::int32_t first_copy = 0, copies = 0;      // points that are shared vertices
  std::int32_t first_hanging = 0, hanging = 0;  // into hanging_point
  std::int32_t points = 0;
};

struct PatchedLevel {
  const Level* level = nullptr;
  std::vector<Patch> patches;
  std::vector<CellKind> kinds;  // level 0

  std::vector<std::int32_t> cell;      // per lane, -1: none
  std::vector<std::int32_t> lane;      // per cell
  std::vector<std::uint16_t> corners;  // [group][8][8]: points
  std::vector<std::uint16_t> kind;     // per group: index into kinds on level 0, else StoredKind
  std::vector<std::uint8_t> row;       // per group: RowKind
  std::vector<std::int32_t> slots_at;  // per group: -1, or where its slots lie: some corner hangs
  std::vector<std::uint16_t> slots;    // [folded group][8][8]: points

  std::vector<std::int32_t> vertex;      // per packed vertex: that of the level, -1: none
  std::vector<std::int32_t> packed;      // per vertex of the level
  std::vector<std::uint8_t> fixed;       // per packed vertex, as Level::fixed
  std::vector<std::uint16_t> own_point;  // per packed vertex that is not shared
  std::vector<std::uint16_t> copy_point;
  std::vector<std::int32_t> copy_vertex;  // packed
  std::vector<std::uint16_t> hanging_point;
  std::vector<std::array<std::uint16_t, 4>> hanging_masters;
  std::int32_t first_shared = 0;           // packed
  std::vector<std::int32_t> copies_begin;  // per shared packed vertex + 1
  std::vector<std::int32_t> copies_of;     // ascending

  SparseWeights prolong;               // rows: packed vertices; columns: of the next level
  SparseWeights restrict_;             // rows: packed vertices of the next level
  std::vector<std::uint8_t> held;      // per cell: HeldCell, of it or of the cells below
  std::vector<std::int32_t> children;  // [group][octant][8], above level 0: lanes of the level
                                       // before, -1: none, or wholly held; passed: octant 0

  bool folded(std::size_t group) const { return slots_at[group] >= 0; }
  std::size_t groups() const { return cell.size() / kGroup; }
  std::size_t vertices() const { return vertex.size(); }
  std::size_t tiles() const { return vertex.size() / kGroup; }
  std::size_t bytes() const;
};

/// Where component 0 of a packed vertex lies in a vector; the others follow in steps of eight.
inline std::size_t scalar_of(std::int32_t packed) {
  const auto v = static_cast<std::size_t>(packed);
  return kTileScalars * (v / kGroup) + v % kGroup;
}

/// All but the weights between levels. `finer` is the level before, null for level 0.
PatchedLevel make_patches(const Hierarchy& hierarchy, std::size_t index, const PatchedLevel* finer,
                          int threads);

/// The weights from `fine` to the next level.
void fill_weights(const PatchedLevel& coarse, PatchedLevel& fine);

}  // namespace kerf::cpu
