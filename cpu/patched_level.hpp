// SPDX-License-Identifier: MIT
//
// A level as the fast backend walks it: patches of some thousand cells that lie together, each with
// its own short numbers for the points of its cells, so that a product with the matrix of a patch
// runs in the cache and adds in a fixed order, whichever thread does it.
//
// Vertices  are numbered anew ("packed"), in tiles of kGroup: a tile has vertices of one patch
// alone, or
//           shared ones; one that was shared stays so. Vectors are [tile][component][kGroup]. What
//           is left of a tile is nothing, which is zero and stays so.
// Points    of a patch: first two that are nothing, then its vertices and its hanging corners by
//           place, with gaps before long rows, then those that came with cuts. A hanging corner is
//           the mean of four of the points (each of two counts twice on an edge).
// Cells     in groups of kGroup, one in each lane; a lane without a cell has the point that is
//           nothing for corners. The cells of a group are of one kind.
//
// Cuts and hanging corners need nothing beyond the numbers of points. After a cut, cells that have
// other corners get other points where they are, new ones come in groups at the end of their patch,
// and a patch that needs more room moves to the end of the arrays. One in which much has changed is
// made again.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/array.hpp"
#include "core/levels/hierarchy.hpp"
#include "core/levels/update.hpp"
#include "cpu/pack.hpp"

namespace kerf::cpu {

/// Cells of a group and vertices of a tile: those of the widest pack.
inline constexpr int kGroup = 16;
inline constexpr std::size_t kTileScalars = 3 * kGroup;
/// First points of quarters of a group, along four edges of its cells: PatchedLevel::heads.
inline constexpr std::size_t kHeads = 16;
/// The point of every patch that is nothing: what is read there is zero, and what is added there
/// goes nowhere; and how many there are, so that a pair of points can be nothing.
inline constexpr std::uint16_t kNothing = 0;
inline constexpr std::int32_t kNothings = 2;

/// How the matrix of a cell of a stored level comes about; cells of a group are alike.
enum StoredKind : std::uint16_t {
  kMerged,  ///< from children without held components, one an octant
  kPassed,  ///< from one cell of the same place and size above level 0, without held components
  kIdle,    ///< wholly held: its matrix is zero, and not stored
  // Where some cell of level 0 below is partly held:
  kHeldMerged,       ///< from children above level 0, one an octant
  kHeldPassed,       ///< from one cell above level 0
  kGeneral,          ///< from cells of level 0, or two children have one octant; or a loose cell
  kGeneralPassed,    ///< the same from one cell
  kOfFinest = 16,    ///< and on: from one cell of level 0 of some kind, or from 8, 64, ... of them
  kNoCells = 0xFFFF  ///< in every level: a group that no patch has
};
constexpr bool is_of_finest(std::uint16_t kind) { return kind >= kOfFinest && kind != kNoCells; }
/// How many times the side is that of the cells of level 0, as a power of two: a cell is from one
/// cell of the level before, or from eight of one kind, one an octant, and then no corner hangs. Of
/// one rotation these would be an element of twice the side.
inline constexpr int kMostDoublings = 7;
constexpr int doublings(std::uint16_t kind) { return (kind - kOfFinest) % (kMostDoublings + 1); }
constexpr bool is_of_eight(std::uint16_t kind) { return is_of_finest(kind) && doublings(kind) > 0; }
/// The kind of the cells of level 0 that it is from.
constexpr std::uint16_t finest_kind(std::uint16_t kind) {
  return static_cast<std::uint16_t>((kind - kOfFinest) / (kMostDoublings + 1));
}
constexpr std::uint16_t kind_of_finest(std::uint16_t finest, int doublings) {
  return static_cast<std::uint16_t>(kOfFinest + (kMostDoublings + 1) * finest + doublings);
}
/// Of cells of level 0.
inline constexpr std::size_t kMostKinds = (kNoCells - kOfFinest) / (kMostDoublings + 1);
static_assert(is_of_eight(kind_of_finest(kMostKinds - 1, kMostDoublings)));
/// Whether cells of level 0 below are partly held, or matrices are made as if they were.
constexpr bool is_held(std::uint16_t kind) { return kind >= kHeldMerged && kind < kOfFinest; }

/// Whether components of the vertices of a cell are held. A wholly held cell takes no part in any
/// product of the operator, so its matrix is zero to the levels above. Forces ask it too.
enum HeldCell : std::uint8_t { kFree, kPartlyHeld, kWhollyHeld };

/// How the points of a group lie.
enum RowKind : std::uint8_t {
  kScattered,
  kPairs,     ///< the right end of each edge along x is the point behind the left one
  kFourRows,  ///< each quarter of the group is a row: cells side by side along x, points in order
  kTwoRows,   ///< each half is
  kRow        ///< the whole group is one
};
/// Cells in a row of such a group; 1 where there are none.
constexpr int run_of(RowKind kind) {
  return kind <= kPairs      ? 1
         : kind == kFourRows ? kGroup / 4
         : kind == kTwoRows  ? kGroup / 2
                             : kGroup;
}

/// The part of an array that belongs to one patch. What lies between its size and its room is not
/// read.
struct Range {
  std::int32_t first = 0, size = 0, room = 0;

  std::int32_t end() const { return first + size; }
  /// Room for `count` entries, at the `end` of the array where there is too little, and then some
  /// to spare.
  void fit(std::size_t count, std::int32_t& end);
  /// The same for so many more; when it is made, some to spare only if asked for.
  void grow(std::size_t count, bool spare, std::int32_t& end);
};

/// What cells of level 0 have in common.
struct CellKind {
  double stiffness = 0, mass = 0, side = 0;  // E side, density side^3, m
  std::uint8_t material = 0;
  bool idle = false;  // wholly held

  friend bool operator==(const CellKind&, const CellKind&) = default;
};

struct Patch {
  Range groups;
  Range own;      // packed vertices of this patch alone: whole tiles
  Range copies;   // points that are shared vertices
  Range hanging;  // hanging points
  Range folded;   // blocks of slots
  std::int32_t points = 0;
};

/// What the vertices of a patch take from those of the next level, in numbers of its own for
/// these: its points, by place. The vertices are in blocks: the tiles of its own, and then the
/// leads, which are shared vertices. What a shared vertex takes is in one patch: that of its first
/// cell.
struct TransferPart {
  Range points;  // after cuts some that no vertex takes
  Range runs, terms;
  Range more_runs, more_terms;  // of tiles that were made again since
  Range leads, lead_runs, lead_terms;
  Range lead_blocks;  // of kGroup leads, but for the last
  Range own;          // of the patch, as its tiles were made
};

/// Vertices of a block side by side along x that take from points side by side along x: from one
/// row of points, or from the mean of two or four rows. Every other vertex lies between two points
/// of a row, and takes the mean of them.
struct TransferRun {
  static constexpr int kIdentity = 0;  // rows: each vertex takes its own point of one row, alone

  std::uint8_t first = 0, size = 0;  // within the block
  std::uint8_t rows = kIdentity;
  std::uint8_t between = 0;     // 1: the first vertex lies between two points
  std::uint16_t point[4] = {};  // the first one of each row

  friend bool operator==(const TransferRun&, const TransferRun&) = default;
};

/// Its vertices in no run that have terms come in classes, so that what reads them need not ask
/// each: means of 1, 2, 4 and 8 points, and those with weights.
struct TransferBlock {
  static constexpr int kMeans = 4;

  std::int32_t first_run = 0, first_term = 0;
  std::uint8_t runs = 0;
  std::uint8_t means[kMeans] = {}, weighted = 0;  // vertices of each class
  bool gaps = false;                              // some place has no vertex

  friend bool operator==(const TransferBlock&, const TransferBlock&) = default;
};

/// A vertex in no run: its place in the block, and how many terms it has.
struct TransferVertex {
  std::uint8_t code = 0;

  static TransferVertex of(int place, int terms) {
    return {static_cast<std::uint8_t>(place | (terms - 1) << 4)};
  }
  int place() const { return code & 15; }
  int terms() const { return (code >> 4) + 1; }
  friend bool operator==(const TransferVertex&, const TransferVertex&) = default;
};

/// Between the vertices of a level and of the next.
struct Transfer {
  std::vector<TransferPart> parts;   // per patch
  std::vector<std::int32_t> point;   // the vertex of the next level, in its own numbers
  std::vector<TransferBlock> tiles;  // of own vertices
  std::vector<TransferBlock> lead_blocks;
  Array<TransferRun> runs;
  Array<std::uint16_t> term_point;  // within the part
  Array<std::uint8_t> term_weight;  // 64ths: exact
  // Those of a tile from its first vertex on, in classes, with their terms in that order; and
  // those of a block of leads from its first lead on.
  std::vector<TransferVertex> others, lead_others;
  std::vector<std::int32_t> lead;                 // packed
  std::vector<std::int32_t> giver_begin, givers;  // per vertex of the next level: its points
  RowState giver_rows;

  /// The points that stand for a vertex of the next level.
  std::span<const std::int32_t> givers_of(std::int32_t next_vertex) const {
    return row_of(giver_begin, givers, giver_rows, next_vertex);
  }
  std::size_t bytes() const;
};

/// The points that a hanging one is the mean of: four, or two on an edge, each twice, side by side.
using HangingMasters = std::array<std::uint16_t, 4>;
constexpr bool is_on_edge(const HangingMasters& masters) { return masters[0] == masters[1]; }

struct PatchedLevel {
  const Level* level = nullptr;
  std::vector<Patch> patches;
  std::vector<CellKind> kinds;  // level 0

  std::vector<std::int32_t> cell;        // per lane, -1: none
  std::vector<std::int32_t> lane;        // per cell
  Array<std::uint16_t> corners;          // [group][8][kGroup]: points; or as corners_at says
  std::vector<std::int32_t> corners_at;  // per group: where its corners lie, -1: nowhere, for it is
                                         // in rows; empty: each group's in its place
  Array<std::uint16_t> heads;            // [group][4][4]: those of corner 0, 2, 4 or 6 in the first
                                         // lane of each quarter, all that is read of rows
  std::vector<std::uint16_t> kind;       // per group: index into kinds on level 0, else StoredKind
  std::vector<std::uint8_t> row;         // per group: RowKind
  std::vector<std::int32_t> slots_at;    // per group: -1, or where its slots lie: some corner hangs
  std::vector<std::int32_t> patch_of;    // per group, -1: none
  std::vector<std::uint16_t> slots;      // [folded group][8][kGroup]: points

  std::vector<std::int32_t> vertex;  // per packed vertex: that of the level, -1: none
  std::vector<std::int32_t> packed;  // per vertex of the level
  std::vector<std::uint8_t> fixed;   // per packed vertex, as Level::fixed
  Array<std::uint16_t> own_point;  // per packed vertex that is not shared; kNothing where there is
                                   // no vertex
  std::vector<std::int32_t> home;  // per tile: its patch, kNowhere, or shared_home(n)
  std::vector<std::uint16_t> copy_point;
  std::vector<std::int32_t> copy_vertex;  // packed
  std::vector<std::uint16_t> hanging_point;
  std::vector<HangingMasters> hanging_masters;
  std::vector<std::int32_t> shared_tiles;  // filled one after the other
  std::int32_t shared = 0;                 // vertices: a place in these tiles, its number
  std::vector<std::int32_t> copies_begin, copies_of;  // per shared vertex, ascending
  RowState copy_rows;

  Transfer transfer;               // to the next level
  std::vector<std::uint8_t> held;  // per cell: HeldCell, of it or of the cells below
  Array<std::int32_t> children;    // [group][octant][kGroup], above level 0: lanes of the level
                                   // before, -1: none, or wholly held; passed: octant 0
  std::size_t groups_built = 0, tiles_built = 0;  // when patches were last made from nothing

  static constexpr std::int32_t kNowhere = -1;
  static std::int32_t shared_home(std::size_t n) { return -2 - static_cast<std::int32_t>(n); }
  static bool is_shared(std::int32_t home) { return home < kNowhere; }

  bool folded(std::size_t group) const { return slots_at[group] >= 0; }
  /// Not of groups in rows once these are forgotten.
  const std::uint16_t* corners_of(std::size_t group) const {
    const std::size_t at = corners_at.empty() ? group : static_cast<std::size_t>(corners_at[group]);
    return corners.data() + 8 * kGroup * at;
  }
  /// Where no cut is to come: groups in rows keep what is read of them, their heads; and on level 0
  /// nothing asks for `vertex`.
  void forget_rows();
  /// Whether the cells of a group are wholly held.
  bool idle(std::size_t group) const {
    return kinds.empty() ? kind[group] == kIdle : kinds[kind[group]].idle;
  }
  std::size_t groups() const { return cell.size() / kGroup; }
  std::size_t vertices() const { return fixed.size(); }
  std::size_t tiles() const { return fixed.size() / kGroup; }
  void set_heads(std::size_t group);
  /// As if it had never had cells: of no patch, and in no sum.
  void empty_group(std::int32_t g);
  std::int32_t patch_of_cell(std::int32_t c) const {
    return patch_of[static_cast<std::size_t>(lane[c] / kGroup)];
  }
  /// The number of a shared vertex.
  std::int32_t shared_number(std::int32_t packed_vertex) const {
    return kGroup * (-2 - home[packed_vertex / kGroup]) + packed_vertex % kGroup;
  }
  /// The copies of a shared vertex.
  std::span<const std::int32_t> copies(std::int32_t number) const {
    return row_of(copies_begin, copies_of, copy_rows, number);
  }
  std::size_t bytes() const;
};

/// Where component 0 of a packed vertex lies in a vector; the others follow in steps of kGroup.
inline std::size_t scalar_of(std::int32_t packed) {
  const auto v = static_cast<std::size_t>(packed);
  return kTileScalars * (v / kGroup) + v % kGroup;
}

/// `finer` is the level before, null for level 0.
PatchedLevel make_patches(const Hierarchy& hierarchy, std::size_t index, const PatchedLevel* finer,
                          int threads);

/// What an update moved.
struct PatchMoves {
  struct Move {
    std::int32_t from, to;
  };
  std::vector<Move> vertices;  ///< packed numbers
  std::vector<Move> cells;     ///< lane (of a new cell: that of its origin), and the cell
  std::vector<Range> groups;   ///< whose lanes are others now
  /// Cells that are new, or have another HeldCell or kind; of level 0 those too that have a vertex
  /// held otherwise.
  std::vector<std::int32_t> others;
  std::vector<char> tiles;  ///< whether vertices of a tile are others, or take other values

  void touch(std::int32_t packed) {
    const auto tile = static_cast<std::size_t>(packed / kGroup);
    if (tile >= tiles.size()) tiles.resize(tile + 1);
    tiles[tile] = 1;
  }
};

/// Brings the patches up to date after a cut: numbers stay where nothing changed, and what is new
/// gets new ones. `finer` has been updated, and moved as `below` says.
PatchMoves update_patches(const Hierarchy& hierarchy, const HierarchyChange& change,
                          std::size_t index, const PatchedLevel* finer, const PatchMoves* below,
                          int threads, PatchedLevel& level);

}  // namespace kerf::cpu
