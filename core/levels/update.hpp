// SPDX-License-Identifier: MIT
//
// Brings the levels up to date after a blade, at the cost of what it touched.
//
// Under a cut nothing is ever merged. So numbers are stable, and what is new is appended:
//   - a cell that is split leaves its number to its first child;
//   - a coarse cell that falls apart leaves it to the part with the smallest child;
//   - a vertex that falls apart leaves it to the part with the smallest cell;
//   - a hanging corner that becomes a vertex is a new one.
// The result equals a build from nothing up to the order of new cells and vertices.
//
// What a blade can change about a vertex, it changes around the corners of cells that are new, fell
// apart, or have other links: of old links (a, b) around a grid point, one was disconnected, or a
// or b has another number now. So only the components of cells around these corners are looked at.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/body/cut.hpp"
#include "core/levels/hierarchy.hpp"

namespace kerf {

/// Which corners of a level an update must look at.
struct Touched {
  struct Faces {
    std::int32_t cell;
    std::uint8_t faces;  ///< bit per face
  };
  std::vector<std::int32_t> whole;  ///< ascending: cells that are new or gave parts to new ones
  std::vector<Faces> relinked;      ///< old cells whose links through these faces changed
};

/// All zero between updates; one entry a cell.
struct UpdateScratch {
  std::vector<std::uint8_t> visited;  // bit per corner
  std::vector<std::int32_t> listed;   // place among the cells of the change, from 1; 0: none
};

/// A cell as it was.
struct CellBefore {
  Vec3i corner{};
  std::uint8_t size_log2 = 0;
  std::uint16_t fold = 0;
  std::array<std::int32_t, 8> slots{};
};

/// What one blade changed on a level. All else is as it was, numbers included.
struct LevelChange {
  std::int32_t cells_before = 0, vertices_before = 0;
  /// Ascending: new cells; those with another corner, size, fold, slot, parent, place or child; and
  /// the parents of all these.
  std::vector<std::int32_t> cells;
  std::vector<CellBefore> before;  ///< the first of `cells`, those below cells_before, as they were
  std::vector<std::int32_t> origin;  ///< of each new cell: the old one that it was a part of
  /// Ascending: new vertices, and those with another incidence or held otherwise.
  std::vector<std::int32_t> vertices;

  /// An old cell as it was, listed or not.
  CellBefore cell_before(const Level& level, std::int32_t cell) const;
};

struct HierarchyChange {
  std::vector<LevelChange> levels;
};

class ChangeLog;

class LevelUpdater {
 public:
  LevelUpdater();
  ~LevelUpdater();

  /// Level 0 after the blade pass `event`. New vertices have `fixed` 0.
  void update_finest(const LinkedOctree& body, const CutEvent& event, Hierarchy& hierarchy);
  /// All other levels, after the caller has set `fixed` of new vertices of level 0, and perhaps of
  /// others, which it names in `held`. Returns false if the hierarchy would have another number of
  /// levels, or merges cells by place: then the caller is to call build_coarse_levels.
  bool update_coarse(Hierarchy& hierarchy, const HierarchyOptions& options,
                     std::vector<std::int32_t> held = {});

  /// Of the last update; level 0 alone if update_coarse returned false.
  const HierarchyChange& change() const { return change_; }

 private:
  void coarsen(Hierarchy& hierarchy, std::size_t fine);

  HierarchyChange change_;
  std::vector<UpdateScratch> scratch_;  // per level
  std::vector<ChangeLog> logs_;         // per level, during an update
  Touched touched_;                     // of the last level that was done
};

}  // namespace kerf
