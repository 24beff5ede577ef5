// SPDX-License-Identifier: MIT
#include "cpu/patched_level.hpp"

#include <algorithm>
#include <memory>
#include <numeric>
#include <utility>

#include "core/base/error.hpp"
#include "cpu/patch_draft.hpp"
#include "cpu/patch_transfer.hpp"

namespace kerf::cpu {
namespace {

template <class T>
std::size_t bytes_of(const std::vector<T>& array) {
  return array.capacity() * sizeof(T);
}

std::int32_t size_of(std::size_t n) { return static_cast<std::int32_t>(n); }

/// Cells of a patch of a full level; levels with few cells have smaller ones, for the threads.
std::int32_t patch_cells(std::int32_t cells) {
  constexpr std::int32_t kMost = 4096, kLeast = 256, kPatches = 16;
  std::int32_t size = kMost;
  while (size > kLeast && cells < kPatches * size) size /= 2;
  return size;
}

/// Cells along a curve that stays within cubes, in equal parts.
std::vector<std::vector<std::int32_t>> divide(const Level& level,
                                              const std::vector<std::int32_t>& cells,
                                              std::int32_t size) {
  std::vector<std::pair<std::uint64_t, std::int32_t>> order;
  order.reserve(cells.size());
  for (const std::int32_t c : cells) order.emplace_back(morton(level.corner[c]), c);
  std::sort(order.begin(), order.end());
  const auto most = static_cast<std::size_t>(size);
  std::vector<std::vector<std::int32_t>> parts((order.size() + most - 1) / most);
  for (std::size_t i = 0; i < order.size(); ++i) parts[i / most].push_back(order[i].second);
  return parts;
}

/// A packed vertex of a draft that has no place yet.
std::int32_t claim(std::int32_t patch) { return -2 - patch; }

template <class T>
void put(const std::vector<T>& from, std::ptrdiff_t first, std::vector<T>& to) {
  std::copy(from.begin(), from.end(), to.begin() + first);
}

/// Makes patches, or makes some of them again.
class Patcher {
 public:
  Patcher(const Hierarchy& hierarchy, std::size_t index, const PatchedLevel* finer, int threads,
          PatchedLevel& out)
      : hierarchy_(hierarchy),
        level_(hierarchy.levels[index]),
        next_(index + 1 < hierarchy.levels.size() ? &hierarchy.levels[index + 1] : nullptr),
        finer_(finer),
        threads_(threads),
        out_(out) {
    out_.level = &level_;
  }

  void make() {
    std::vector<std::int32_t> all(level_.corner.size());
    std::iota(all.begin(), all.end(), 0);
    extend();
    for (const std::int32_t c : all) out_.held[c] = held_of(c);
    for (auto& cells : divide(level_, all, patch_cells(level_.cells()))) add_patch(cells);
    make_drafts(0);
    anew_ = true;
    place();
  }

  PatchMoves update(const HierarchyChange& change, std::size_t index, const PatchMoves* below) {
    change_ = &change.levels[index];
    extend();
    mark(*change_, index + 1 < change.levels.size() ? &change.levels[index + 1] : nullptr, below);
    for (std::int32_t p = 0, count = size_of(dirty_.size()); p < count; ++p)
      if (dirty_[p]) draft_patch(p);
    make_drafts(0);
    // A vertex of another patch alone is now shared with it, so that one changes too.
    for (std::size_t done = 0; done < drafts_.size();) {
      const std::size_t end = drafts_.size();
      std::vector<std::int32_t> homes;
      for (; done < end; ++done)
        for (const std::int32_t v : drafts_[done].vertices)
          if (const std::int32_t home = home_of(v); home >= 0 && !dirty_[home]) {
            dirty_[home] = true;
            homes.push_back(home);
          }
      for (const std::int32_t home : homes) draft_patch(home);
      make_drafts(end);
    }
    std::sort(drafts_.begin(), drafts_.end(),
              [](const Draft& a, const Draft& b) { return a.patch < b.patch; });
    place();
    if (below != nullptr) place_moved_children(*below);
    return std::move(moves_);
  }

 private:
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

  std::uint16_t finest_kind(std::int32_t c) {
    const CellValues& v = hierarchy_.values[c];
    const CellKind kind{v.stiffness, v.mass, hierarchy_.spacing * (1 << level_.size_log2[c]),
                        v.material, out_.held[c] == kWhollyHeld};
    std::vector<CellKind>& kinds = out_.kinds;
    if (last_kind_ >= kinds.size() || !(kinds[last_kind_] == kind))
      last_kind_ =
          static_cast<std::size_t>(std::find(kinds.begin(), kinds.end(), kind) - kinds.begin());
    if (last_kind_ == kinds.size()) kinds.push_back(kind);
    expects(last_kind_ < 65535, "the body has more than 65535 kinds of cells");
    return static_cast<std::uint16_t>(last_kind_);
  }

  std::uint16_t stored_kind(std::int32_t c) const {
    if (out_.held[c] == kWhollyHeld) return kIdle;
    const auto children = level_.children_of(c);
    const bool passed = finer_->level->place[children[0]] == Level::kPassed;
    unsigned octants = 0;  // without duplication two children can have one
    bool twice = false;
    for (const std::int32_t child : children) {
      const unsigned bit = 1U << (finer_->level->place[child] % 8);
      twice = twice || (octants & bit) != 0;
      octants |= bit;
    }
    const bool held = out_.held[c] == kPartlyHeld;
    const bool masks = held && finer_->children.empty();  // children of level 0
    if (masks || twice || is_loose(c)) return kGeneral;
    if (held) return passed ? kHeldPassed : kHeldMerged;
    return passed ? kPassed : kMerged;
  }

  // A cell of level 1 that is a whole piece. Its mass alone tells how it turns, and that drowns in
  // the rounding of codes, which general cells do not have.
  bool is_loose(std::int32_t c) const {
    const bool has_links = !level_.link_begin.empty();  // else there are no loose cells
    return has_links && finer_->children.empty() && level_.links_of(c).empty();
  }

  // --- which patches are made ------------------------------------------------------------------

  void add_patch(const std::vector<std::int32_t>& cells) {
    out_.patches.emplace_back();
    add_draft(size_of(out_.patches.size()) - 1, cells);
  }
  void add_draft(std::int32_t patch, const std::vector<std::int32_t>& cells) {
    Draft draft;
    draft.patch = patch;
    draft.cells = cells;
    for (const std::int32_t c : cells) draft.kind_of.push_back(kind_of(c));
    drafts_.push_back(std::move(draft));
  }

  std::int32_t patch_of(std::int32_t c) const {
    const std::int32_t before = change_->cells_before;
    return out_.patch_of_cell(c < before ? c : change_->origin[c - before]);
  }

  void mark(const LevelChange& change, const LevelChange* above, const PatchMoves* below) {
    dirty_.assign(out_.patches.size(), false);
    arrived_.resize(out_.patches.size());
    for (std::int32_t c = change.cells_before; c < level_.cells(); ++c)
      arrived_[patch_of(c)].push_back(c);
    for (const std::int32_t c : change.cells) touch(c);
    for (const std::int32_t v : change.vertices)
      for (const std::int32_t item : level_.incidences_of(v)) touch(item / 8);
    if (below != nullptr)
      for (const std::int32_t child : below->held) touch(finer_->level->parent[child]);
    if (above != nullptr)  // rows of the transfer
      for (const std::int32_t parent : above->cells)
        for (const std::int32_t c : next_->children_of(parent)) dirty_[patch_of(c)] = true;
  }

  void touch(std::int32_t c) {
    dirty_[patch_of(c)] = true;
    const HeldCell held = held_of(c);
    if (held == out_.held[c] && c < change_->cells_before) return;
    out_.held[c] = held;
    moves_.held.push_back(c);
  }

  /// Again, and in several parts if it has grown much.
  void draft_patch(std::int32_t p) {
    dirty_[p] = true;
    std::vector<std::int32_t> cells;
    const Range groups = out_.patches[p].groups;
    for (std::int32_t lane = kGroup * groups.first; lane < kGroup * groups.end(); ++lane)
      if (out_.cell[lane] >= 0) cells.push_back(out_.cell[lane]);
    cells.insert(cells.end(), arrived_[p].begin(), arrived_[p].end());
    const std::int32_t most = patch_cells(level_.cells());
    if (size_of(cells.size()) <= most + most / 2) return add_draft(p, cells);
    const auto parts = divide(level_, cells, most);
    add_draft(p, parts[0]);
    for (std::size_t i = 1; i < parts.size(); ++i) add_patch(parts[i]);
    dirty_.resize(out_.patches.size(), true);
    arrived_.resize(out_.patches.size());
  }

  void make_drafts(std::size_t begin) {
    for_patches(
        size_of(begin), size_of(drafts_.size()), threads_,
        [&] { return std::make_unique<Numbering>(level_); },
        [&](std::int32_t i, Numbering& numbering) { make_draft(level_, drafts_[i], numbering); });
  }

  // --- vertices --------------------------------------------------------------------------------

  /// The patch that has a vertex alone, or less than zero.
  std::int32_t home_of(std::int32_t v) const {
    const std::int32_t packed = out_.packed[v];
    return packed < 0 ? -1 : out_.home[packed / kGroup];
  }

  /// Appends tiles; returns their first vertex.
  std::int32_t add_tiles(std::int32_t tiles, std::int32_t home) {
    const std::size_t size = out_.vertex.size() + static_cast<std::size_t>(kGroup * tiles);
    const auto first = size_of(out_.vertex.size());
    out_.vertex.resize(size, -1);
    out_.fixed.resize(size, 0);
    out_.own_point.resize(size, 0);
    out_.home.resize(size / kGroup, home);
    return first;
  }

  std::int32_t add_shared() {
    if (out_.shared % kGroup == 0)
      out_.shared_tiles.push_back(
          add_tiles(1, PatchedLevel::shared_home(out_.shared_tiles.size())) / kGroup);
    const std::int32_t tile = out_.shared_tiles.back();
    return kGroup * tile + out_.shared++ % kGroup;
  }

  void share(std::int32_t v) {
    const std::int32_t from = out_.packed[v], to = add_shared();
    if (from >= 0) {
      out_.vertex[from] = -1;
      out_.fixed[from] = 0;
      moves_.vertices.push_back({from, to});
    }
    out_.packed[v] = to;
    out_.vertex[to] = v;
  }

  /// A vertex that a second patch has becomes a shared one, and stays so.
  void find_shared() {
    for (const Draft& draft : drafts_)
      for (const std::int32_t v : draft.vertices) {
        const std::int32_t packed = out_.packed[v];
        if (packed == -1) {
          out_.packed[v] = claim(draft.patch);
        } else if (packed < 0) {
          share(v);
        } else if (const std::int32_t home = out_.home[packed / kGroup];
                   home >= 0 && home != draft.patch) {
          share(v);
        }
      }
  }

  /// New own vertices, in the places that others left where there are such.
  void place_own(const Draft& draft) {
    Range& own = out_.patches[draft.patch].own;
    std::vector<std::int32_t> fresh, kept;
    for (const std::int32_t v : draft.vertices)
      if (out_.packed[v] == claim(draft.patch)) fresh.push_back(v);
    for (std::int32_t at = own.first; at < own.end(); ++at)
      if (out_.vertex[at] >= 0) kept.push_back(at);
    const std::size_t need = (kept.size() + fresh.size() + kGroup - 1) / kGroup;
    if (size_of(kGroup * need) > own.room) move_own(draft.patch, need, kept);
    std::int32_t at = own.first;
    for (const std::int32_t v : fresh) {
      while (out_.vertex[at] >= 0) ++at;
      out_.vertex[at] = v;
      out_.packed[v] = at;
    }
    const std::int32_t end = fresh.empty() ? own.first : at / kGroup * kGroup + kGroup;
    own.size = std::max(own.size, end - own.first);
  }

  void move_own(std::int32_t patch, std::size_t tiles, const std::vector<std::int32_t>& kept) {
    Range& own = out_.patches[patch].own;
    const Range before = own;
    const auto room = size_of(own.room == 0 ? tiles : tiles + tiles / 4);
    own.first = add_tiles(room, patch);
    own.room = kGroup * room;
    own.size = size_of(kGroup * ((kept.size() + kGroup - 1) / kGroup));
    std::int32_t to = own.first;
    for (const std::int32_t from : kept) {
      const std::int32_t v = out_.vertex[from];
      out_.vertex[to] = v;
      out_.packed[v] = to;
      moves_.vertices.push_back({from, to++});
    }
    for (std::int32_t at = before.first; at < before.first + before.room; ++at) {
      out_.vertex[at] = -1;
      out_.fixed[at] = 0;
      out_.home[at / kGroup] = PatchedLevel::kNowhere;
    }
  }

  // --- arrays ----------------------------------------------------------------------------------

  void place() {
    if (!anew_) leave();
    find_shared();
    for (const Draft& draft : drafts_) place_own(draft);
    fit_ranges();
    const std::int32_t count = size_of(drafts_.size());
#pragma omp parallel for num_threads(threads_) schedule(static) if (count > 1)
    for (std::int32_t i = 0; i < count; ++i) {
      write_cells(drafts_[i]);
      write_points(drafts_[i]);
    }
    list_copies();
    if (finer_ != nullptr) place_children();
    std::vector<std::int32_t> made;
    for (const Draft& draft : drafts_) made.push_back(draft.patch);
    if (next_ != nullptr) place_transfers(made, *next_, threads_, out_);
  }

  /// Notes where cells were; takes copies off the lists, and cells off the arrays.
  void leave() {
    Rows copies(out_.copies_begin, out_.copies_of, out_.copy_rows);
    for (const Draft& draft : drafts_) {
      const Patch& patch = out_.patches[draft.patch];
      for (std::int32_t k = patch.copies.first; k < patch.copies.end(); ++k)
        copies.remove(out_.shared_number(out_.copy_vertex[k]), k);
      moves_.groups.push_back(patch.groups);
      for (std::int32_t g = patch.groups.first; g < patch.groups.first + patch.groups.room; ++g)
        empty_group(g);
    }
    const std::int32_t before = change_->cells_before;
    for (const Draft& draft : drafts_)
      for (const std::int32_t c : draft.cells)
        if (c >= 0)
          moves_.cells.push_back({out_.lane[c < before ? c : change_->origin[c - before]], c});
  }

  void empty_group(std::int32_t g) {
    std::fill_n(out_.cell.begin() + kGroup * g, kGroup, -1);
    out_.kind[g] = kNoCells;
    out_.row[g] = kScattered;
    out_.slots_at[g] = -1;
    out_.patch_of[g] = -1;
  }

  void fit_ranges() {
    std::int32_t groups = size_of(out_.groups()), copies = size_of(out_.copy_point.size()),
                 hanging = size_of(out_.hanging_point.size()),
                 folded = size_of(out_.slots.size() / (8 * kGroup));
    for (const Draft& draft : drafts_) {
      Patch& patch = out_.patches[draft.patch];
      const auto shared =
          std::count_if(draft.vertices.begin(), draft.vertices.end(), [&](std::int32_t v) {
            return PatchedLevel::is_shared(out_.home[out_.packed[v] / kGroup]);
          });
      patch.groups.fit(draft.row.size(), groups);
      patch.copies.fit(static_cast<std::size_t>(shared), copies);
      patch.hanging.fit(draft.masters.size(), hanging);
      patch.folded.fit(draft.slots.size() / (8 * kGroup), folded);
      patch.points = draft.points();
      moves_.groups.push_back(patch.groups);
    }
    const auto all = static_cast<std::size_t>(groups);
    out_.cell.resize(kGroup * all, -1);
    out_.corners.resize(8 * kGroup * all, 0);
    out_.kind.resize(all, kNoCells);
    out_.row.resize(all, kScattered);
    out_.slots_at.resize(all, -1);
    out_.patch_of.resize(all, -1);
    if (finer_ != nullptr) out_.children.resize(8 * kGroup * all, -1);
    out_.copy_point.resize(static_cast<std::size_t>(copies));
    out_.copy_vertex.resize(static_cast<std::size_t>(copies));
    out_.hanging_point.resize(static_cast<std::size_t>(hanging));
    out_.hanging_masters.resize(static_cast<std::size_t>(hanging));
    out_.slots.resize(8 * kGroup * static_cast<std::size_t>(folded));
    if (anew_) out_.groups_built = all, out_.tiles_built = out_.tiles();
  }

  /// What is written is freed, since drafts together are as large as the level.
  void write_cells(Draft& draft) {
    const Patch& patch = out_.patches[draft.patch];
    const std::int32_t first = patch.groups.first;
    put(draft.cells, kGroup * first, out_.cell);
    put(draft.corners, 8 * kGroup * std::ptrdiff_t{first}, out_.corners);
    put(draft.kind, first, out_.kind);
    put(draft.row, first, out_.row);
    put(draft.slots, 8 * kGroup * std::ptrdiff_t{patch.folded.first}, out_.slots);
    std::int32_t slots = patch.folded.first;
    for (std::size_t g = 0; g < draft.folded.size(); ++g) {
      out_.slots_at[static_cast<std::size_t>(first) + g] = draft.folded[g] != 0 ? slots++ : -1;
      out_.patch_of[static_cast<std::size_t>(first) + g] = draft.patch;
    }
    for (std::size_t k = 0; k < draft.cells.size(); ++k)
      if (draft.cells[k] >= 0) out_.lane[draft.cells[k]] = kGroup * first + size_of(k);
    draft.corners = {};
    draft.slots = {};
  }

  void write_points(const Draft& draft) {
    const Patch& patch = out_.patches[draft.patch];
    std::fill_n(out_.own_point.begin() + patch.own.first, patch.own.size, draft.nothing());
    std::int32_t k = patch.copies.first;
    for (std::size_t n = 0; n < draft.vertices.size(); ++n) {
      const std::int32_t packed = out_.packed[draft.vertices[n]];
      if (out_.home[packed / kGroup] == draft.patch) {
        out_.own_point[packed] = draft.vertex_point[n];
      } else {
        out_.copy_point[k] = draft.vertex_point[n];
        out_.copy_vertex[k++] = packed;
      }
    }
    put(draft.hanging_point, patch.hanging.first, out_.hanging_point);
    put(draft.masters, patch.hanging.first, out_.hanging_masters);
  }

  /// The copies of each shared vertex.
  void list_copies() {
    for (const Draft& draft : drafts_)
      for (const std::int32_t v : draft.vertices) out_.fixed[out_.packed[v]] = level_.fixed[v];
    if (anew_) return list_all_copies();
    Rows copies(out_.copies_begin, out_.copies_of, out_.copy_rows);
    while (size_of(out_.copies_begin.size()) - 1 < out_.shared) copies.append({});
    for (const Draft& draft : drafts_) {
      const Range& range = out_.patches[draft.patch].copies;
      for (std::int32_t k = range.first; k < range.end(); ++k)
        copies.insert(out_.shared_number(out_.copy_vertex[k]), k);
    }
    copies.pack_if_wasteful();
  }

  // Ranges that were just made have no gaps.
  void list_all_copies() {
    out_.copies_begin.assign(static_cast<std::size_t>(out_.shared) + 1, 0);
    for (const std::int32_t v : out_.copy_vertex)
      ++out_.copies_begin[static_cast<std::size_t>(out_.shared_number(v)) + 1];
    std::partial_sum(out_.copies_begin.begin(), out_.copies_begin.end(), out_.copies_begin.begin());
    std::vector<std::int32_t> next(out_.copies_begin.begin(), out_.copies_begin.end() - 1);
    out_.copies_of.resize(out_.copy_vertex.size());
    for (std::size_t k = 0; k < out_.copy_vertex.size(); ++k)
      out_.copies_of[next[out_.shared_number(out_.copy_vertex[k])]++] = size_of(k);
  }

  // --- children --------------------------------------------------------------------------------

  void place_child(std::int32_t child) {
    const std::int32_t lane = out_.lane[level_of_finer().parent[child]];
    const std::size_t octant = level_of_finer().place[child] % 8;  // kPassed: 0
    const auto group = static_cast<std::size_t>(lane / kGroup);
    out_.children[8 * kGroup * group + kGroup * octant + lane % kGroup] =
        finer_->held[child] == kWhollyHeld ? -1 : finer_->lane[child];
  }
  const Level& level_of_finer() const { return *finer_->level; }

  void place_children() {
    for (const Draft& draft : drafts_) {
      const Range& groups = out_.patches[draft.patch].groups;
      std::fill_n(out_.children.begin() + 8 * kGroup * std::ptrdiff_t{groups.first},
                  8 * kGroup * std::ptrdiff_t{groups.size}, -1);
      for (const std::int32_t c : draft.cells) {
        if (c < 0) continue;
        for (const std::int32_t child : level_.children_of(c)) place_child(child);
      }
    }
  }

  /// Those of patches that stayed as they were.
  void place_moved_children(const PatchMoves& below) {
    for (const Range& groups : below.groups)
      for (std::int32_t lane = kGroup * groups.first; lane < kGroup * groups.end(); ++lane)
        if (const std::int32_t child = finer_->cell[lane]; child >= 0) place_child(child);
  }

  const Hierarchy& hierarchy_;
  const Level& level_;
  const Level* next_;
  const PatchedLevel* finer_;
  int threads_;
  PatchedLevel& out_;
  bool anew_ = false;
  const LevelChange* change_ = nullptr;
  std::vector<bool> dirty_;                         // per patch
  std::vector<std::vector<std::int32_t>> arrived_;  // new cells, per patch
  std::vector<Draft> drafts_;
  PatchMoves moves_;
  std::size_t last_kind_ = 0;
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
    moves.held.push_back(c);
  }
  for (const Patch& patch : level.patches) moves.groups.push_back(patch.groups);
  return moves;
}

}  // namespace

void Range::fit(std::size_t count, std::int32_t& end) {
  size = size_of(count);
  if (size <= room) return;
  const std::int32_t more = room == 0 ? size : size + size / 4;
  first = end;
  room = more;
  end += more;
}

std::size_t PatchedLevel::bytes() const {
  return bytes_of(patches) + bytes_of(kinds) + bytes_of(cell) + bytes_of(lane) + bytes_of(corners) +
         bytes_of(kind) + bytes_of(row) + bytes_of(slots_at) + bytes_of(patch_of) +
         bytes_of(slots) + bytes_of(vertex) + bytes_of(packed) + bytes_of(fixed) +
         bytes_of(own_point) + bytes_of(home) + bytes_of(copy_point) + bytes_of(copy_vertex) +
         bytes_of(hanging_point) + bytes_of(hanging_masters) + bytes_of(shared_tiles) +
         bytes_of(copies_begin) + bytes_of(copies_of) + bytes_of(copy_rows.count) +
         transfer.bytes() + bytes_of(held) + bytes_of(children);
}

PatchMoves update_patches(const Hierarchy& hierarchy, const HierarchyChange& change,
                          std::size_t index, const PatchedLevel* finer, const PatchMoves* below,
                          int threads, PatchedLevel& level) {
  if (level.groups() > 2 * level.groups_built || level.tiles() > 2 * level.tiles_built)
    return remake_patches(hierarchy, change.levels[index], index, finer, threads, level);
  return Patcher(hierarchy, index, finer, threads, level).update(change, index, below);
}

}  // namespace kerf::cpu
