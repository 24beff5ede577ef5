// SPDX-License-Identifier: MIT
#include "cpu/patched_level.hpp"

#include <algorithm>
#include <atomic>
#include <iterator>
#include <memory>
#include <numeric>
#include <span>
#include <utility>

#include "core/base/error.hpp"
#include "cpu/halving.hpp"
#include "cpu/patcher.hpp"
#include "kernels/transfer.hpp"

namespace kerf::cpu {
namespace {

std::int32_t size_of(std::size_t n) { return static_cast<std::int32_t>(n); }

/// Points of a patch, well below what 16 bits number; and those of a cell, at the most: its slots,
/// and all corners but one hanging.
constexpr std::size_t kCrowd = 60000, kCellPoints = 15;

/// Cells of a patch. Few patches share few vertices, but unless they would be tiny there is one for
/// each of sixteen threads, whatever there are: results must not depend on their number. And what
/// the cells of one touch fits a cache.
std::int32_t patch_cells(std::int32_t cells) {
  constexpr std::int32_t kMost = 32768, kLeast = 256, kEnough = 16;
  std::int32_t patches = 1;
  while (patches < kEnough && cells >= 2 * kLeast * patches) patches *= 2;
  while ((cells - 1) / kMost >= patches) patches *= 2;
  return std::max(1, (cells + patches - 1) / patches);
}

/// Cells in equal parts of `size` at the most.
std::vector<std::vector<std::int32_t>> divide(const Level& level,
                                              const std::vector<std::int32_t>& cells,
                                              std::int32_t size) {
  const auto most = static_cast<std::size_t>(size);
  return halved(level, cells, (cells.size() + most - 1) / most);
}

bool is_same(const Level& level, std::int32_t c, const CellBefore& before) {
  return level.corner[c] == before.corner && level.size_log2[c] == before.size_log2 &&
         level.fold[c] == before.fold && level.slots[c] == before.slots;
}

/// Makes patches, or changes them.
class Patcher {
 public:
  Patcher(const Hierarchy& hierarchy, std::size_t index, const PatchedLevel* finer, int threads,
          PatchedLevel& out)
      : hierarchy_(hierarchy),
        index_(index),
        level_(hierarchy.levels[index]),
        next_(index + 1 < hierarchy.levels.size() ? &hierarchy.levels[index + 1] : nullptr),
        finer_(finer),
        threads_(threads),
        out_(out),
        crowd_of_(level_.point.size()) {
    out_.level = &level_;
  }

  void make() {
    std::vector<std::int32_t> all(level_.corner.size());
    std::iota(all.begin(), all.end(), 0);
    extend();
    for (const std::int32_t c : all) out_.held[c] = held_of(c);
    for (auto& cells : without_crowds(divide(level_, all, patch_cells(level_.cells()))))
      add_patch(cells);
    make_drafts();
    place();
  }

  PatchMoves update(const HierarchyChange& change, const PatchMoves* below) {
    change_ = &change.levels[index_];
    extend();
    works_.resize(out_.patches.size());
    mark(next_ != nullptr ? &change.levels[index_ + 1] : nullptr, below);
    for (std::int32_t p = 0, count = size_of(works_.size()); p < count; ++p)
      if (works_[p].any()) draft_patch(p);
    make_drafts();
    // A vertex of another patch alone is now shared with it, so that one changes too.
    for (std::size_t n = 0, end = drafts_.size(); n < end; ++n)
      for (std::size_t i = 0; i < drafts_[n].vertices.size(); ++i)
        if (const std::int32_t home = home_of(drafts_[n].vertices[i]);
            home >= 0 && !works_[home].drafted)
          stay(home);
    std::sort(drafts_.begin(), drafts_.end(),
              [](const Draft& a, const Draft& b) { return a.patch < b.patch; });
    PatchPlacer placer = place();
    if (below != nullptr) placer.place_moved_children(*below);
    return std::move(moves_);
  }

 private:
  /// What happened to a patch.
  struct Work {
    std::vector<std::int32_t> arrived;   // new cells
    std::vector<std::int32_t> moved;     // cells of another kind
    std::vector<std::int32_t> changed;   // cells with other slots
    std::vector<std::int32_t> refilled;  // cells that stay
    bool drafted = false;
    char transfers = 0;  // whether vertices take other values; raised by any thread

    bool any() const {
      return !arrived.empty() || !moved.empty() || !changed.empty() || !refilled.empty();
    }
  };

  // --- what cells are -------------------------------------------------------------------------

  void extend() {
    out_.lane.resize(level_.corner.size(), -1);
    out_.held.resize(level_.corner.size(), kFree);
    out_.packed.resize(level_.point.size(), -1);
  }

  HeldCell held_of(std::int32_t c) const {
    bool partly = false, wholly = true;
    if (finer_ == nullptr) {
      for (const std::int32_t v : level_.slots[c]) {
        partly = partly || level_.fixed[v] != 0;
        wholly = wholly && level_.fixed[v] == 7;
      }
    } else {
      for (const std::int32_t child : level_.children_of(c)) {
        partly = partly || finer_->held[child] == kPartlyHeld;
        wholly = wholly && finer_->held[child] == kWhollyHeld;
      }
    }
    return wholly ? kWhollyHeld : partly ? kPartlyHeld : kFree;
  }

  std::uint16_t kind_of(std::int32_t c) { return finer_ ? stored_kind(c) : finest_kind(c); }

  CellKind finest_values(std::int32_t c) const {
    const CellValues& v = hierarchy_.values[c];
    return {v.stiffness, v.mass, hierarchy_.spacing * (1 << level_.size_log2[c]), v.material,
            out_.held[c] == kWhollyHeld};
  }
  /// Whether a cell is of another kind than its group.
  bool left_its_kind(std::int32_t c) const {
    const std::uint16_t kind = out_.kind[out_.lane[c] / kGroup];
    return finer_ ? stored_kind(c) != kind : !(finest_values(c) == out_.kinds[kind]);
  }

  std::uint16_t finest_kind(std::int32_t c) {
    const CellKind kind = finest_values(c);
    std::vector<CellKind>& kinds = out_.kinds;
    if (last_kind_ >= kinds.size() || !(kinds[last_kind_] == kind))
      last_kind_ =
          static_cast<std::size_t>(std::find(kinds.begin(), kinds.end(), kind) - kinds.begin());
    if (last_kind_ == kinds.size()) {
      expects(last_kind_ < kMostKinds,
              text("the body has more than ", kMostKinds, " kinds of cells"));
      kinds.push_back(kind);
    }
    return static_cast<std::uint16_t>(last_kind_);
  }

  std::uint16_t stored_kind(std::int32_t c) const {
    if (out_.held[c] == kWhollyHeld) return kIdle;
    const auto children = level_.children_of(c);
    const bool passed = finer_->level->place[children[0]] == Level::kPassed;
    unsigned octants = 0;  // behind the end of a cut two children can have one
    bool twice = false;
    for (const std::int32_t child : children) {
      const unsigned bit = 1U << (finer_->level->place[child] % 8);
      twice = twice || (octants & bit) != 0;
      octants |= bit;
    }
    ensures(!(passed && twice), "a cell that is passed on is not the only child");
    const bool held = out_.held[c] == kPartlyHeld;
    const bool masks = held && finer_->children.empty();  // children of level 0
    if (masks || twice || is_loose(c)) return passed ? kGeneralPassed : kGeneral;
    if (held) return passed ? kHeldPassed : kHeldMerged;
    const std::uint16_t first = element_kind(children[0]);
    if (!is_of_finest(first)) return passed ? kPassed : kMerged;
    ensures(!passed || doublings(first) == 0, "a cell from eight is passed on");
    if (passed) return first;
    const bool alike = std::all_of(children.begin(), children.end(), [&](std::int32_t child) {
      return element_kind(child) == first;
    });
    const bool is_one = octants == 0xFF && alike && !kernels::has_hanging(level_.fold[c]) &&
                        doublings(first) < kMostDoublings;
    return is_one ? kind_of_finest(cpu::finest_kind(first), doublings(first) + 1)
                  : std::uint16_t{kMerged};
  }
  /// Of a cell of the level before, as the levels above level 0 number kinds.
  std::uint16_t element_kind(std::int32_t child) const {
    const std::uint16_t kind = finer_->kind[finer_->lane[child] / kGroup];
    return finer_->children.empty() ? kind_of_finest(kind, 0) : kind;
  }

  // A cell of level 1 that is a whole piece. Its mass alone tells how it turns, and that drowns in
  // the rounding of codes, which general cells do not have.
  bool is_loose(std::int32_t c) const {
    const bool has_links = !level_.link_begin.empty();  // else there are no loose cells
    return has_links && finer_->children.empty() && level_.links_of(c).empty();
  }

  // --- what a cut did --------------------------------------------------------------------------

  std::int32_t patch_of(std::int32_t c) const {
    const std::int32_t before = change_->cells_before;
    return out_.patch_of_cell(c < before ? c : change_->origin[c - before]);
  }

  // All of it asks memory for one cell after the other, so threads share it.
  void mark(const LevelChange* above, const PatchMoves* below) {
    moves_.tiles.resize(out_.tiles());
    const std::vector<std::int32_t>& cells = change_->cells;
    std::vector<std::int32_t> all = cells;
    for (const std::int32_t c : cells_beside(below))
      if (!std::binary_search(cells.begin(), cells.end(), c)) all.push_back(c);
    std::vector<CellMark> marks(all.size());
    in_chunks(all.size(), [&](std::size_t i) {
      marks[i].slots_changed = i < cells.size() && (i >= change_->before.size() ||
                                                    !is_same(level_, cells[i], change_->before[i]));
      touch(all[i], marks[i]);
    });
    for (std::size_t i = 0; i < all.size(); ++i) list(all[i], marks[i], i >= cells.size());
    if (above == nullptr) return;
    in_chunks(above->cells.size(), [&](std::size_t i) {  // rows of the transfer
      const std::int32_t parent = above->cells[i];
      if (i < above->before.size() && is_same(*next_, parent, above->before[i])) return;
      for (const std::int32_t c : next_->children_of(parent)) touch_transfers(c);
    });
  }

  static constexpr std::size_t kChunk = 512;
  static std::size_t chunks_of(std::size_t count) { return (count + kChunk - 1) / kChunk; }
  /// body(i) for i below `count`, on all threads; those of one chunk by one of them.
  template <class Body>
  void in_chunks(std::size_t count, const Body& body) const {
    for_parts(0, size_of(chunks_of(count)), threads_, [&](std::int32_t chunk) {
      const std::size_t first = kChunk * static_cast<std::size_t>(chunk);
      for (std::size_t i = first; i < std::min(first + kChunk, count); ++i) body(i);
    });
  }
  /// Threads may do so at once.
  static void raise(char& flag) { std::atomic_ref(flag).store(1, std::memory_order_relaxed); }

  /// Cells that change with vertices or with cells below, ascending.
  std::vector<std::int32_t> cells_beside(const PatchMoves* below) {
    const std::vector<std::int32_t>& vertices = change_->vertices;
    std::vector<std::vector<std::int32_t>> found(chunks_of(vertices.size()));
    Marks met(level_.corner.size());
    in_chunks(vertices.size(),
              [&](std::size_t i) { mark_vertex(vertices[i], met, found[i / kChunk]); });
    std::vector<std::int32_t> out;
    for (const auto& some : found) out.insert(out.end(), some.begin(), some.end());
    if (below != nullptr)
      for (const std::int32_t child : below->others) meet(finer_->level->parent[child], met, out);
    std::sort(out.begin(), out.end());
    return out;
  }
  /// Adds a cell to a list unless some thread has added it to one.
  static void meet(std::int32_t c, Marks& met, std::vector<std::int32_t>& list) {
    if (std::atomic_ref(met[c]).exchange(1, std::memory_order_relaxed) == 0) list.push_back(c);
  }

  /// The vertices of a cell may take other values.
  void touch_transfers(std::int32_t c) {
    raise(works_[patch_of(c)].transfers);
    for (const std::int32_t v : level_.slots[c]) touch_tile(v);
  }
  void touch_tile(std::int32_t v) {
    if (out_.packed[v] >= 0) raise(moves_.tiles[out_.packed[v] / kGroup]);  // else it gets a place
  }

  /// The row of a vertex is that of its first cell, which may be another now.
  void mark_vertex(std::int32_t v, Marks& met, std::vector<std::int32_t>& beside) {
    const bool is_fresh = v >= change_->vertices_before;
    const bool held_otherwise = !is_fresh && out_.fixed[out_.packed[v]] != level_.fixed[v];
    const bool may_be_loose = finer_ != nullptr && finer_->children.empty();
    touch_tile(v);
    for (const std::int32_t item : level_.incidences_of(v)) {
      raise(works_[patch_of(item / 8)].transfers);
      if (held_otherwise || may_be_loose) meet(item / 8, met, beside);
    }
  }

  struct CellMark {
    bool slots_changed = false;  // or the corner, or the fold
    bool held_changed = false;   // or the cell is new
    bool kind_changed = false;
  };

  bool is_new(std::int32_t c) const { return c >= change_->cells_before; }

  void touch(std::int32_t c, CellMark& mark) {
    const HeldCell held = held_of(c);
    mark.held_changed = is_new(c) || held != out_.held[c];
    out_.held[c] = held;
    mark.kind_changed = !is_new(c) && left_its_kind(c);
    raise(works_[patch_of(c)].transfers);
    if (is_new(c) || mark.slots_changed) touch_transfers(c);
  }

  void list(std::int32_t c, const CellMark& mark, bool beside) {
    const bool vertex_held_otherwise = beside && finer_ == nullptr;
    if (mark.held_changed || mark.kind_changed || vertex_held_otherwise) moves_.others.push_back(c);
    Work& work = works_[patch_of(c)];
    if (is_new(c)) {
      work.arrived.push_back(c);
    } else if (mark.kind_changed) {
      work.moved.push_back(c);
    } else {
      if (mark.slots_changed) work.changed.push_back(c);
      if (finer_ != nullptr) work.refilled.push_back(c);
    }
  }

  // --- drafts ----------------------------------------------------------------------------------

  Draft& add_draft(std::int32_t patch, const std::vector<std::int32_t>& cells) {
    Draft draft;
    draft.patch = patch;
    draft.cells = cells;
    for (const std::int32_t c : cells) draft.kind_of.push_back(kind_of(c));
    drafts_.push_back(std::move(draft));
    return drafts_.back();
  }
  /// Whether the points of some cells may be too many for their numbers.
  bool is_crowd(const std::vector<std::int32_t>& cells) {
    if (kCellPoints * cells.size() <= kCrowd) return false;
    ++crowd_;
    std::size_t points = 0;  // at the most: hanging corners may be of several cells
    for (const std::int32_t c : cells) {
      for (int i = 0; i < 8; ++i) points += kernels::is_hanging(level_.fold[c], i) ? 1 : 0;
      for (const std::int32_t v : level_.slots[c])
        if (std::exchange(crowd_of_[v], crowd_) != crowd_) ++points;
    }
    return points > kCrowd;
  }
  /// Parts of which some are halved, until none is a crowd: where cuts set many cells free.
  std::vector<std::vector<std::int32_t>> without_crowds(
      std::vector<std::vector<std::int32_t>> parts) {
    for (std::size_t i = 0; i < parts.size();) {
      if (!is_crowd(parts[i])) {
        ++i;
        continue;
      }
      auto halves = divide(level_, parts[i], size_of((parts[i].size() + 1) / 2));
      parts[i] = std::move(halves[0]);
      parts.push_back(std::move(halves[1]));
    }
    return parts;
  }
  void add_patch(const std::vector<std::int32_t>& cells) {
    out_.patches.emplace_back();
    add_draft(size_of(out_.patches.size()) - 1, cells);
  }

  void draft_patch(std::int32_t p) {
    Work& work = works_[p];
    const Range& groups = out_.patches[p].groups;
    const auto first = out_.cell.begin() + kGroup * groups.first,
               last = out_.cell.begin() + kGroup * groups.end();
    const auto is_cell = [](std::int32_t c) { return c >= 0; };
    if (may_stay(p, static_cast<std::size_t>(std::count_if(first, last, is_cell))))
      return change(stay(p), work);
    work.drafted = true;
    std::vector<std::int32_t> cells;
    std::copy_if(first, last, std::back_inserter(cells), is_cell);
    cells.insert(cells.end(), work.arrived.begin(), work.arrived.end());
    const std::int32_t most = patch_cells(level_.cells());
    std::vector<std::vector<std::int32_t>> parts;
    if (size_of(cells.size()) <= most + most / 2)
      parts.push_back(std::move(cells));
    else
      parts = divide(level_, cells, most);
    parts = without_crowds(std::move(parts));
    add_draft(p, parts[0]);
    for (std::size_t i = 1; i < parts.size(); ++i) add_patch(parts[i]);
    Work made;
    made.drafted = true;
    works_.resize(out_.patches.size(), made);
  }

  /// Whether a patch with so many cells is changed rather than made anew: where little changes,
  /// and cuts before have left few gaps.
  bool may_stay(std::int32_t p, std::size_t cells) const {
    const Work& work = works_[p];
    const Patch& patch = out_.patches[p];
    const std::size_t others = work.arrived.size() + work.moved.size() + work.changed.size();
    const auto most = static_cast<std::size_t>(patch_cells(level_.cells()));
    const auto of = [](std::int32_t n) { return static_cast<std::size_t>(n); };
    const std::size_t points = of(patch.own.size) + of(patch.copies.size) + of(patch.hanging.size);
    return 2 * others <= cells && cells + work.arrived.size() <= most + most / 2 &&
           of(patch.points) <= points + points / 2 + 64 &&
           std::max(of(patch.points), points) + kCellPoints * others <= kCrowd &&
           kGroup * of(patch.groups.size) <= cells + cells / 8 + 8 * kGroup &&
           2 * of(patch.folded.size) <= 3 * of(patch.groups.size);
  }

  /// An empty draft of a patch that stays.
  Draft& stay(std::int32_t p) {
    works_[p].drafted = true;
    Draft& draft = add_draft(p, {});
    draft.anew = false;
    draft.first_point = out_.patches[p].points;
    return draft;
  }

  void change(Draft& draft, Work& work) {
    draft.cells = std::move(work.moved);
    draft.cells.insert(draft.cells.end(), work.arrived.begin(), work.arrived.end());
    for (const std::int32_t c : draft.cells) draft.kind_of.push_back(kind_of(c));
    if (!draft.cells.empty()) take_gaps(draft);
    draft.changed = std::move(work.changed);
    draft.refilled = std::move(work.refilled);
    std::vector<std::int32_t> folding;
    for (const std::int32_t c : draft.changed)
      if (const std::int32_t group = out_.lane[c] / kGroup;
          kernels::has_hanging(level_.fold[c]) && !out_.folded(static_cast<std::size_t>(group)))
        folding.push_back(group);
    std::sort(folding.begin(), folding.end());
    draft.folding =
        static_cast<std::size_t>(std::unique(folding.begin(), folding.end()) - folding.begin());
  }

  /// Groups with empty lanes are made again with what comes to their kind, so that cuts leave few
  /// such groups.
  void take_gaps(Draft& draft) {
    std::vector<std::uint16_t> kinds = draft.kind_of;
    std::sort(kinds.begin(), kinds.end());
    std::vector<std::int32_t> listed = draft.cells;
    std::sort(listed.begin(), listed.end());
    const Range& groups = out_.patches[draft.patch].groups;
    for (std::int32_t g = groups.first; g < groups.end(); ++g) {
      const std::span<const std::int32_t> cells(&out_.cell[kGroup * g], kGroup);
      if (std::find(cells.begin(), cells.end(), -1) == cells.end() ||
          !std::binary_search(kinds.begin(), kinds.end(), out_.kind[g]))
        continue;
      for (const std::int32_t c : cells)
        if (c >= 0 && !std::binary_search(listed.begin(), listed.end(), c)) {
          draft.cells.push_back(c);
          draft.kind_of.push_back(out_.kind[g]);
        }
    }
  }

  void make_drafts() {
    for_parts(
        0, size_of(drafts_.size()), threads_, [&] { return std::make_unique<Numbering>(out_); },
        [&](std::int32_t i, Numbering& numbering) {
          if (!drafts_[i].anew) find_lost(drafts_[i]);
          make_draft(level_, drafts_[i], numbering);
        });
  }

  /// The vertices that cells had which have others now, where no cell of the patch is left.
  void find_lost(Draft& draft) const {
    const auto look = [&](std::int32_t c) {
      if (c >= change_->cells_before) return;
      for (const std::int32_t v : change_->cell_before(level_, c).slots)
        if (!has_cell_of(v, draft.patch)) draft.lost.push_back(v);
    };
    for (const std::int32_t c : draft.cells) look(c);
    for (const std::int32_t c : draft.changed) look(c);
    std::sort(draft.lost.begin(), draft.lost.end());
    draft.lost.erase(std::unique(draft.lost.begin(), draft.lost.end()), draft.lost.end());
  }
  bool has_cell_of(std::int32_t v, std::int32_t patch) const {
    const auto cells = level_.incidences_of(v);
    return std::any_of(cells.begin(), cells.end(),
                       [&](std::int32_t item) { return patch_of(item / 8) == patch; });
  }

  /// The patch that has a vertex alone, or less than zero.
  std::int32_t home_of(std::int32_t v) const {
    const std::int32_t packed = out_.packed[v];
    return packed < 0 ? -1 : out_.home[packed / kGroup];
  }

  PatchPlacer place() {
    std::vector<std::int32_t> transfers;
    for (const Draft& draft : drafts_) transfers.push_back(draft.patch);
    for (std::size_t p = 0; p < works_.size(); ++p)
      if (works_[p].transfers && !works_[p].drafted) transfers.push_back(size_of(p));
    std::sort(transfers.begin(), transfers.end());
    PatchPlacer placer(hierarchy_, index_, finer_, change_, threads_, out_);
    placer.place(drafts_, transfers, moves_);
    return placer;
  }

  const Hierarchy& hierarchy_;
  std::size_t index_;
  const Level& level_;
  const Level* next_;
  const PatchedLevel* finer_;
  int threads_;
  PatchedLevel& out_;
  const LevelChange* change_ = nullptr;  // null: patches are made
  std::vector<Work> works_;              // per patch
  std::vector<Draft> drafts_;
  PatchMoves moves_;
  std::size_t last_kind_ = 0;
  Marks crowd_of_;  // per vertex: the last crowd that it was counted in
  std::int32_t crowd_ = 0;
};

}  // namespace

PatchedLevel make_patches(const Hierarchy& hierarchy, std::size_t index, const PatchedLevel* finer,
                          int threads) {
  PatchedLevel out;
  Patcher(hierarchy, index, finer, threads, out).make();
  return out;
}

namespace {

/// The same for a level whose arrays have become long beside what is in them.
PatchMoves remake_patches(const Hierarchy& hierarchy, const LevelChange& change, std::size_t index,
                          const PatchedLevel* finer, int threads, PatchedLevel& level) {
  const PatchedLevel before = std::move(level);
  level = make_patches(hierarchy, index, finer, threads);
  PatchMoves moves;
  for (std::size_t v = 0; v < before.packed.size(); ++v)
    moves.vertices.push_back({before.packed[v], level.packed[v]});
  for (std::int32_t c = 0; c < level.level->cells(); ++c) {
    const std::int32_t old = change.cells_before;
    moves.cells.push_back({before.lane[c < old ? c : change.origin[c - old]], c});
    moves.others.push_back(c);
  }
  for (const Patch& patch : level.patches) moves.groups.push_back(patch.groups);
  return moves;
}

}  // namespace

void PatchedLevel::set_heads(std::size_t group) {
  for (std::size_t edge = 0; edge < 4; ++edge)
    for (std::size_t quarter = 0; quarter < 4; ++quarter)
      heads[kHeads * group + 4 * edge + quarter] =
          corners[8 * kGroup * group + 2 * kGroup * edge + kGroup / 4 * quarter];
}

void PatchedLevel::empty_group(std::int32_t g) {
  std::fill_n(cell.begin() + kGroup * g, kGroup, -1);
  if (!children.empty())
    std::fill_n(children.begin() + 8 * kGroup * std::ptrdiff_t{g}, 8 * kGroup, -1);
  kind[g] = kNoCells;
  row[g] = kScattered;
  slots_at[g] = -1;
  patch_of[g] = -1;
}

void Range::fit(std::size_t count, std::int32_t& end) {
  size = 0;
  grow(count, true, end);
}

void Range::grow(std::size_t count, bool spare, std::int32_t& end) {
  size += size_of(count);
  if (size <= room) return;
  first = end;
  room = size + (room > 0 ? size / 4 : spare ? size / 8 : 0);
  end += room;
}

std::size_t PatchedLevel::bytes() const {
  return bytes_of(patches) + bytes_of(kinds) + bytes_of(cell) + bytes_of(lane) + bytes_of(corners) +
         bytes_of(corners_at) + bytes_of(heads) + bytes_of(kind) + bytes_of(row) +
         bytes_of(slots_at) + bytes_of(patch_of) + bytes_of(slots) + bytes_of(vertex) +
         bytes_of(packed) + bytes_of(fixed) + bytes_of(own_point) + bytes_of(home) +
         bytes_of(copy_point) + bytes_of(copy_vertex) + bytes_of(hanging_point) +
         bytes_of(hanging_masters) + bytes_of(shared_tiles) + bytes_of(copies_begin) +
         bytes_of(copies_of) + bytes_of(copy_rows.count) + transfer.bytes() + bytes_of(held) +
         bytes_of(children);
}

PatchMoves update_patches(const Hierarchy& hierarchy, const HierarchyChange& change,
                          std::size_t index, const PatchedLevel* finer, const PatchMoves* below,
                          int threads, PatchedLevel& level) {
  ensures(level.corners_at.empty(), "a level that forgot its rows is asked to follow a cut");
  if (level.groups() > 2 * level.groups_built || level.tiles() > 2 * level.tiles_built)
    return remake_patches(hierarchy, change.levels[index], index, finer, threads, level);
  return Patcher(hierarchy, index, finer, threads, level).update(change, below);
}

}  // namespace kerf::cpu
