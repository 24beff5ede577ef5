// SPDX-License-Identifier: MIT
//
// Makes the patches of a level, and changes them after cuts.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "cpu/patch_draft.hpp"

namespace kerf::cpu {

/// Where drafts get their place in the arrays of a level.
class PatchPlacer {
 public:
  /// `change`: null where all patches are made.
  PatchPlacer(const Hierarchy& hierarchy, std::size_t index, const PatchedLevel* finer,
              const LevelChange* change, int threads, PatchedLevel& out)
      : level_(hierarchy.levels[index]),
        next_(index + 1 < hierarchy.levels.size() ? &hierarchy.levels[index + 1] : nullptr),
        finer_(finer),
        change_(change),
        threads_(threads),
        out_(out) {}

  /// Drafts by patch; and all patches whose transfers are made, ascending.
  void place(std::vector<Draft>& drafts, const std::vector<std::int32_t>& transfers,
             PatchMoves& moves);
  /// Children of patches that stayed as they were.
  void place_moved_children(const PatchMoves& below);

 private:
  // Vertices.
  std::int32_t add_tiles(std::int32_t tiles, std::int32_t home);
  std::int32_t add_shared();
  void share(std::int32_t vertex);
  void find_shared();
  void place_own(const Draft& draft);
  void move_own(std::int32_t patch, std::size_t tiles);
  void set_fixed();

  // Arrays.
  void leave();
  void leave_copies(const Draft& draft);
  void lose_copy(const Patch& patch, std::int32_t vertex);
  void fit_ranges();
  void list_copies();
  void list_all_copies();
  void place_child(std::int32_t child);
  void place_children();
  void fill(std::int32_t cell);

  const Level& level_;
  const Level* next_;
  const PatchedLevel* finer_;
  const LevelChange* change_;
  int threads_;
  PatchedLevel& out_;
  std::vector<Draft>* drafts_ = nullptr;
  std::vector<std::int32_t> draft_of_;  // per patch, -1: none
  PatchMoves* moves_ = nullptr;
};

/// Writes a draft into the ranges of its patch: all of it, or what changes in one that stays.
/// Touches nothing of other patches.
class PatchWriter {
 public:
  PatchWriter(const Level& level, Draft& draft, PatchedLevel& out)
      : level_(level), draft_(draft), patch_(out.patches[draft.patch]), out_(out) {}
  void write();

 private:
  void move_ranges();
  void remove_cells();
  void add_groups();
  void close_gaps();
  void move_group(std::int32_t from, std::int32_t to);
  void change_cells();
  void fold_group(std::int32_t group);
  void add_points();
  void drop_hanging();
  void set_row(std::int32_t group);

  const Level& level_;
  Draft& draft_;
  Patch& patch_;
  PatchedLevel& out_;
  std::vector<std::int32_t> touched_;  // groups whose kind of row may be another
  std::vector<std::int32_t> empty_;    // ascending
  std::int32_t next_block_ = 0;        // of slots
};

}  // namespace kerf::cpu
