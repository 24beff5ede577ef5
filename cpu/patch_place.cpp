// SPDX-License-Identifier: MIT
#include <numeric>
#include <span>

#include "core/base/error.hpp"
#include "cpu/patch_transfer.hpp"
#include "cpu/patcher.hpp"

namespace kerf::cpu {
namespace {

std::int32_t size_of(std::size_t n) { return static_cast<std::int32_t>(n); }

/// A packed vertex of a draft that has no place yet; and whose it is.
std::int32_t claim(std::int32_t patch) { return -2 - patch; }

}  // namespace

void PatchPlacer::place(std::vector<Draft>& drafts, const std::vector<std::int32_t>& transfers,
                        PatchMoves& moves) {
  drafts_ = &drafts;
  moves_ = &moves;
  draft_of_.assign(out_.patches.size(), -1);
  for (std::size_t i = 0; i < drafts.size(); ++i) draft_of_[drafts[i].patch] = size_of(i);
  if (change_ != nullptr) leave();
  find_shared();
  for (const Draft& draft : drafts) place_own(draft);
  set_fixed();
  fit_ranges();
  for_parts(0, size_of(drafts.size()), threads_,
            [&](std::int32_t i) { PatchWriter(level_, drafts[i], out_).write(); });
  for (const Draft& draft : drafts)
    if (draft.moves_cells()) moves.groups.push_back(out_.patches[draft.patch].groups);
  list_copies();
  if (finer_ != nullptr) place_children();
  if (next_ != nullptr) place_transfers(transfers, moves, *next_, threads_, out_);
}

// --- vertices ------------------------------------------------------------------------------------

/// Appends tiles; returns their first vertex.
std::int32_t PatchPlacer::add_tiles(std::int32_t tiles, std::int32_t home) {
  const std::size_t size = out_.vertex.size() + static_cast<std::size_t>(kGroup * tiles);
  const auto first = size_of(out_.vertex.size());
  out_.vertex.resize(size, -1);
  out_.fixed.resize(size, 0);
  out_.own_point.resize(size, kNothing);
  out_.home.resize(size / kGroup, home);
  return first;
}

std::int32_t PatchPlacer::add_shared() {
  if (out_.shared % kGroup == 0)
    out_.shared_tiles.push_back(add_tiles(1, PatchedLevel::shared_home(out_.shared_tiles.size())) /
                                kGroup);
  const std::int32_t tile = out_.shared_tiles.back();
  return kGroup * tile + out_.shared++ % kGroup;
}

/// Where a patch that stays had it alone, it has a copy from now on.
void PatchPlacer::share(std::int32_t v) {
  const std::int32_t from = out_.packed[v], to = add_shared();
  if (from >= 0) {
    Draft& home = (*drafts_)[draft_of_[out_.home[from / kGroup]]];
    if (!home.anew && !std::binary_search(home.lost.begin(), home.lost.end(), v)) {
      home.vertices.push_back(v);
      home.vertex_point.push_back(out_.own_point[from]);
    }
    out_.vertex[from] = -1;
    out_.fixed[from] = 0;
    out_.own_point[from] = kNothing;
    moves_->vertices.push_back({from, to});
    moves_->touch(from);
  }
  out_.packed[v] = to;
  out_.vertex[to] = v;
  out_.fixed[to] = level_.fixed[v];
}

/// A vertex that a second patch has becomes a shared one, and stays so. Those of the same two
/// patches get numbers one after the other, so that what these have of them is read in order.
void PatchPlacer::find_shared() {
  std::vector<std::pair<std::int32_t, std::int32_t>> found;  // first patch, vertex
  for (const Draft& draft : *drafts_) {
    found.clear();
    for (const std::int32_t v : draft.vertices) {
      const std::int32_t packed = out_.packed[v];
      if (packed == -1) {
        out_.packed[v] = claim(draft.patch);
      } else if (packed < 0) {
        found.emplace_back(claim(packed), v);
      } else if (const std::int32_t home = out_.home[packed / kGroup];
                 home >= 0 && home != draft.patch) {
        found.emplace_back(home, v);
      }
    }
    std::stable_sort(found.begin(), found.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    for (const auto& [patch, v] : found) share(v);
  }
}

/// New own vertices, in the places that others left where there are such. Where a patch has no room
/// for all, some take places among the shared ones, with one copy: every sweep passes them apart
/// from now on, but to make room would be to move all vertices of the patch in all vectors. It does
/// where the patch would have more shared vertices than own ones.
void PatchPlacer::place_own(const Draft& draft) {
  std::vector<std::int32_t> fresh;
  for (const std::int32_t v : draft.vertices)
    if (out_.packed[v] == claim(draft.patch)) fresh.push_back(v);
  if (fresh.empty() && !draft.anew) return;
  Patch& patch = out_.patches[draft.patch];
  Range& own = patch.own;
  const auto kept = static_cast<std::size_t>(std::count_if(out_.vertex.begin() + own.first,
                                                           out_.vertex.begin() + own.end(),
                                                           [](std::int32_t v) { return v >= 0; }));
  const std::size_t need = (kept + fresh.size() + kGroup - 1) / kGroup;
  if (size_of(kGroup * need) > own.room) {
    const std::size_t fit = static_cast<std::size_t>(own.room) - kept;
    const std::size_t shared = static_cast<std::size_t>(patch.copies.size) + fresh.size() - fit;
    if (draft.anew || shared > kept) {
      move_own(draft.patch, need);
    } else {
      for (std::size_t n = fit; n < fresh.size(); ++n) share(fresh[n]);
      fresh.resize(fit);
    }
  }
  std::int32_t at = own.first;
  for (const std::int32_t v : fresh) {
    while (out_.vertex[at] >= 0) ++at;
    out_.vertex[at] = v;
    out_.packed[v] = at;
    moves_->touch(at);
  }
  const std::int32_t end = fresh.empty() ? own.first : at / kGroup * kGroup + kGroup;
  own.size = std::max(own.size, end - own.first);
}

void PatchPlacer::move_own(std::int32_t patch, std::size_t tiles) {
  Range& own = out_.patches[patch].own;
  const Range before = own;
  std::vector<std::int32_t> kept;
  for (std::int32_t at = before.first; at < before.end(); ++at)
    if (out_.vertex[at] >= 0) kept.push_back(at);
  const auto room = size_of(own.room == 0 ? tiles : tiles + tiles / 4);
  own.first = add_tiles(room, patch);
  own.room = kGroup * room;
  own.size = size_of(kGroup * ((kept.size() + kGroup - 1) / kGroup));
  std::int32_t to = own.first;
  for (const std::int32_t from : kept) {
    const std::int32_t v = out_.vertex[from];
    out_.vertex[to] = v;
    out_.own_point[to] = out_.own_point[from];
    out_.fixed[to] = level_.fixed[v];
    out_.packed[v] = to;
    moves_->vertices.push_back({from, to++});
  }
  for (std::int32_t at = before.first; at < before.first + before.room; ++at) {
    out_.vertex[at] = -1;
    out_.fixed[at] = 0;
    out_.own_point[at] = kNothing;
    out_.home[at / kGroup] = PatchedLevel::kNowhere;
  }
}

void PatchPlacer::set_fixed() {
  for (const Draft& draft : *drafts_)
    for (const std::int32_t v : draft.vertices) out_.fixed[out_.packed[v]] = level_.fixed[v];
  if (change_ == nullptr) return;
  for (const std::int32_t v : change_->vertices) out_.fixed[out_.packed[v]] = level_.fixed[v];
}

// --- arrays --------------------------------------------------------------------------------------

/// Notes where cells were; takes copies off the lists, and cells of patches made anew off the
/// arrays.
void PatchPlacer::leave() {
  const std::int32_t before = change_->cells_before;
  for (Draft& draft : *drafts_) {
    const Patch& patch = out_.patches[draft.patch];
    leave_copies(draft);
    if (!draft.moves_cells()) continue;
    moves_->groups.push_back(patch.groups);
    for (std::int32_t at = kGroup * patch.groups.first; at < kGroup * patch.groups.end(); ++at)
      if (out_.cell[at] >= 0) moves_->cells.push_back({at, out_.cell[at]});
    for (const std::int32_t c : draft.cells)
      if (c >= before) moves_->cells.push_back({out_.lane[change_->origin[c - before]], c});
  }
  for (const Draft& draft : *drafts_) {
    const Range& groups = out_.patches[draft.patch].groups;
    if (draft.anew)
      for (std::int32_t g = groups.first; g < groups.first + groups.room; ++g) out_.empty_group(g);
  }
}

void PatchPlacer::leave_copies(const Draft& draft) {
  Patch& patch = out_.patches[draft.patch];
  if (draft.anew) {
    Rows copies(out_.copies_begin, out_.copies_of, out_.copy_rows);
    for (std::int32_t k = patch.copies.first; k < patch.copies.end(); ++k)
      copies.remove(out_.shared_number(out_.copy_vertex[k]), k);
    return;
  }
  for (const std::int32_t v : draft.lost)
    if (PatchedLevel::is_shared(out_.home[out_.packed[v] / kGroup])) {
      lose_copy(patch, out_.packed[v]);
      --patch.copies.size;
    }
}

/// The last copy of the patch takes the place of that of a vertex.
void PatchPlacer::lose_copy(const Patch& patch, std::int32_t vertex) {
  Rows copies(out_.copies_begin, out_.copies_of, out_.copy_rows);
  const auto of = copies[out_.shared_number(vertex)];
  const auto at = std::lower_bound(of.begin(), of.end(), patch.copies.first);
  ensures(at != of.end() && *at < patch.copies.end(), "a patch has no copy of what it loses");
  const std::int32_t gap = *at, last = patch.copies.end() - 1;
  copies.remove(out_.shared_number(vertex), gap);
  if (gap == last) return;
  const std::int32_t moved = out_.shared_number(out_.copy_vertex[last]);
  copies.remove(moved, last);
  copies.insert(moved, gap);
  out_.copy_vertex[gap] = out_.copy_vertex[last];
  out_.copy_point[gap] = out_.copy_point[last];
}

void PatchPlacer::fit_ranges() {
  const bool all_anew = change_ == nullptr;
  std::int32_t groups = size_of(out_.groups()), copies = size_of(out_.copy_point.size()),
               hanging = size_of(out_.hanging_point.size()),
               folded = size_of(out_.slots.size() / (8 * kGroup));
  for (Draft& draft : *drafts_) {
    Patch& patch = out_.patches[draft.patch];
    const auto shared = static_cast<std::size_t>(
        std::count_if(draft.vertices.begin(), draft.vertices.end(), [&](std::int32_t v) {
          return PatchedLevel::is_shared(out_.home[out_.packed[v] / kGroup]);
        }));
    if (draft.anew)
      patch.groups.size = patch.copies.size = patch.hanging.size = patch.folded.size = 0;
    draft.before = patch;
    // Cuts bring parts of cells to stored levels, and copies to all.
    patch.groups.grow(draft.kind.size(), finer_ != nullptr, groups);
    patch.copies.grow(shared, true, copies);
    patch.hanging.grow(draft.masters.size(), false, hanging);
    patch.folded.grow(draft.slots.size() / (8 * kGroup) + draft.folding, false, folded);
    patch.points = draft.points();
  }
  const auto all = static_cast<std::size_t>(groups);
  out_.cell.resize(kGroup * all, -1);
  out_.corners.resize(8 * kGroup * all, kNothing);
  out_.heads.resize(kHeads * all, kNothing);
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
  if (all_anew) out_.groups_built = all, out_.tiles_built = out_.tiles();
}

/// The copies of each shared vertex.
void PatchPlacer::list_copies() {
  if (change_ == nullptr) return list_all_copies();
  Rows copies(out_.copies_begin, out_.copies_of, out_.copy_rows);
  while (size_of(out_.copies_begin.size()) - 1 < out_.shared) copies.append({});
  for (const Draft& draft : *drafts_) {
    const Range &range = out_.patches[draft.patch].copies, &before = draft.before.copies;
    const bool moved = range.first != before.first;
    const std::int32_t first = moved ? range.first : before.end();
    for (std::int32_t k = before.first; moved && k < before.end(); ++k)
      copies.remove(out_.shared_number(out_.copy_vertex[k]), k);
    for (std::int32_t k = first; k < range.end(); ++k)
      copies.insert(out_.shared_number(out_.copy_vertex[k]), k);
  }
  copies.pack_if_wasteful();
}

void PatchPlacer::list_all_copies() {
  const auto for_copies = [&](const auto& body) {
    for (const Patch& patch : out_.patches)
      for (std::int32_t k = patch.copies.first; k < patch.copies.end(); ++k)
        body(out_.shared_number(out_.copy_vertex[k]), k);
  };
  out_.copies_begin.assign(static_cast<std::size_t>(out_.shared) + 1, 0);
  std::size_t count = 0;
  for_copies([&](std::int32_t number, std::int32_t) {
    ++out_.copies_begin[static_cast<std::size_t>(number) + 1];
    ++count;
  });
  std::partial_sum(out_.copies_begin.begin(), out_.copies_begin.end(), out_.copies_begin.begin());
  std::vector<std::int32_t> next(out_.copies_begin.begin(), out_.copies_begin.end() - 1);
  out_.copies_of.resize(count);
  for_copies([&](std::int32_t number, std::int32_t k) { out_.copies_of[next[number]++] = k; });
}

// --- children ------------------------------------------------------------------------------------

void PatchPlacer::place_child(std::int32_t child) {
  const Level& finer = *finer_->level;
  const std::int32_t lane = out_.lane[finer.parent[child]];
  const std::size_t octant = finer.place[child] % 8;  // kPassed: 0
  const auto group = static_cast<std::size_t>(lane / kGroup);
  out_.children[8 * kGroup * group + kGroup * octant + lane % kGroup] =
      finer_->held[child] == kWhollyHeld ? -1 : finer_->lane[child];
}

/// All children of a cell.
void PatchPlacer::fill(std::int32_t cell) {
  const auto lane = static_cast<std::size_t>(out_.lane[cell]);
  for (std::size_t octant = 0; octant < 8; ++octant)
    out_.children[8 * kGroup * (lane / kGroup) + kGroup * octant + lane % kGroup] = -1;
  for (const std::int32_t child : level_.children_of(cell)) place_child(child);
}

void PatchPlacer::place_children() {
  for_parts(0, size_of(drafts_->size()), threads_, [&](std::int32_t i) {
    const Draft& draft = (*drafts_)[i];
    for (const auto* cells : {&draft.cells, &draft.refilled})
      for (const std::int32_t c : *cells)
        if (c >= 0) fill(c);
  });
}

void PatchPlacer::place_moved_children(const PatchMoves& below) {
  for (const Range& groups : below.groups)
    for (std::int32_t lane = kGroup * groups.first; lane < kGroup * groups.end(); ++lane)
      if (const std::int32_t child = finer_->cell[lane]; child >= 0) place_child(child);
}

}  // namespace kerf::cpu
