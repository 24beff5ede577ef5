// SPDX-License-Identifier: MIT
//
// A patch by itself, or what changes in one: cells in groups and points in order, before they have
// a place in the arrays of the level.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <new>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include "cpu/parallel_errors.hpp"
#include "cpu/patched_level.hpp"

namespace kerf::cpu {

/// What a patch is made from; or, if it is not to be made anew, what changes in it.
struct Draft {
  using Corners = std::array<std::uint16_t, 8>;

  std::int32_t patch = 0;
  bool anew = true;
  std::int32_t first_point = kNothings, new_points = 0;
  std::vector<std::int32_t> cells;          // to be grouped; then per lane, -1: none
  std::vector<std::uint16_t> kind_of;       // of the cells to be grouped
  std::vector<std::uint16_t> corners;       // [group][8][kGroup]
  std::vector<std::uint16_t> slots;         // the same, of the groups that are folded
  std::vector<std::uint8_t> folded;         // per group
  std::vector<std::uint16_t> kind;          // per group
  std::vector<std::int32_t> vertices;       // of the level, that come to the patch
  std::vector<std::uint16_t> vertex_point;  // rising, but for those that were there before
  std::vector<std::uint16_t> hanging_point;
  std::vector<HangingMasters> masters;

  Patch before;  // the ranges as they were; of one made anew, without what was in them

  // Of a patch that stays.
  std::vector<std::int32_t> changed;  // cells that stay where they are, with other corners or slots
  std::vector<Corners> changed_corners, changed_slots;  // points
  std::vector<std::int32_t> refilled;                   // cells that stay, with other children
  std::vector<std::int32_t> lost;                       // ascending: vertices that leave the patch
  std::size_t folding = 0;  // groups that have a folded cell now, and had none

  std::int32_t points() const { return first_point + new_points; }
  /// Whether cells get other lanes.
  bool moves_cells() const { return anew || !cells.empty(); }
};

/// Zeros, one for each of many numbers; of large bodies, those never touched cost nothing.
class Marks {
 public:
  explicit Marks(std::size_t size)
      : marks_(static_cast<std::int32_t*>(std::calloc(size + 1, sizeof(std::int32_t)))) {
    if (!marks_) throw std::bad_alloc();
  }
  std::int32_t& operator[](std::int32_t n) { return marks_.get()[n]; }

 private:
  struct Free {
    void operator()(std::int32_t* p) const { std::free(p); }
  };
  std::unique_ptr<std::int32_t[], Free> marks_;
};

/// Runs body(i, local) for i from begin to end on some threads, each with a `local` of its own that
/// make() gives.
template <class Make, class Body>
void for_parts(std::int32_t begin, std::int32_t end, int threads, const Make& make,
               const Body& body) {
  if (begin >= end) return;
  ParallelErrors errors;
#pragma omp parallel num_threads(std::min(threads, end - begin)) if (end - begin > 1)
  {
    decltype(make()) local{};
    errors.run([&] { local = make(); });
#pragma omp for schedule(dynamic, 1)
    for (std::int32_t i = begin; i < end; ++i)
      errors.run([&] {
        if (local) body(i, *local);
      });
  }
  errors.rethrow();
}

/// The points of one patch after the other.
class Numbering {
 public:
  using Corners = Draft::Corners;

  explicit Numbering(const PatchedLevel& patched)
      : patched_(patched), level_(*patched.level), point_(level_.point.size()) {}

  /// Corners and slots of some cells, as points. Those that the patch has, if it stays, or else
  /// new ones, which the draft gets.
  void number(Draft& draft, std::span<const std::int32_t> cells, std::vector<Corners>& corners,
              std::vector<Corners>& slots);

 private:
  void know(const Patch& patch);
  std::uint16_t vertex(std::int32_t v, Draft& draft);
  Corners corners_of(Draft& draft, std::int32_t cell, const Corners& slots);
  std::int32_t next(const Draft& draft) const;
  void sort(Draft& draft);
  static void sort_hanging(Draft& draft);

  const PatchedLevel& patched_;
  const Level& level_;
  Marks point_;                        // per vertex of the level: its point, 0: none yet
  std::vector<std::int32_t> known_;    // vertices that the patch has
  std::vector<std::uint64_t> places_;  // of new points as they were met: vertices, hanging ones
  std::vector<std::pair<std::uint64_t, std::uint64_t>> order_;
  std::vector<std::uint16_t> rank_;  // of new points
  std::unordered_map<std::uint64_t, std::int32_t> hanging_;
};

/// Groups and numbers the cells of a draft.
void make_draft(const Level& level, Draft& draft, Numbering& numbering);

/// How the points of a group lie: [8][kGroup] of corners. Lanes without a cell are pairs.
RowKind row_kind(const std::uint16_t* corners);

}  // namespace kerf::cpu
