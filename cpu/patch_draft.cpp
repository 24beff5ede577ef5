// SPDX-License-Identifier: MIT
#include "cpu/patch_draft.hpp"

#include <algorithm>
#include <tuple>

#include "core/base/error.hpp"
#include "kernels/transfer.hpp"

namespace kerf::cpu {
namespace {

using Corners = Draft::Corners;
constexpr std::int32_t kMostPoints = 0xFFFF;
constexpr int kHalf = run_of(kTwoRows), kQuarter = run_of(kFourRows);

std::int32_t size_of(std::size_t n) { return static_cast<std::int32_t>(n); }

/// Orders points by z, then y, then x, so that rows of cells have rows of points.
std::uint64_t place_key(const Vec3i& p) {
  const auto at = [&](std::size_t d) { return static_cast<std::uint64_t>(p[d]) & 0x1FFFFF; };
  return at(2) << 42 | at(1) << 21 | at(0);
}

/// The same for all points of a row along x.
std::uint64_t row_key(std::uint64_t place) { return place >> 21; }

/// The points that a hanging corner is the mean of.
HangingMasters masters_of(const Corners& slots, int octant, int corner) {
  HangingMasters out{};
  std::size_t n = 0;
  for (int j = 0; j < 8; ++j)
    if (kernels::is_between(octant, corner, j)) out[n++] = slots[static_cast<std::size_t>(j)];
  if (n == 2) out[2] = out[0], out[3] = out[1];
  std::sort(out.begin(), out.end());
  return out;
}

/// Names a hanging corner.
std::uint64_t key_of(const HangingMasters& sorted) {
  return std::uint64_t{sorted[0]} | std::uint64_t{sorted[1]} << 16 |
         std::uint64_t{sorted[2]} << 32 | std::uint64_t{sorted[3]} << 48;
}

/// Cells of a patch in groups. Of each kind those first that make rows as long as a group, then
/// those in rows of half that length, then of a quarter, then the others: pairs first, by fold.
class Grouping {
 public:
  Grouping(const Level& level, Draft& draft, Numbering& numbering)
      : level_(level), draft_(draft), cells_(draft.cells) {
    sort_cells();
    number(numbering);
    draft.cells.clear();
    draft.cells.reserve(cells_.size() + cells_.size() / 4);
    draft.corners.reserve(8 * draft.cells.capacity());
    for (std::size_t begin = 0; begin < cells_.size();) {
      std::size_t end = begin + 1;
      while (end < cells_.size() && kind_of_[end] == kind_of_[begin]) ++end;
      group_kind(begin, end, kind_of_[begin]);
      begin = end;
    }
    put_slots();
  }

 private:
  void number(Numbering& numbering) {
    std::vector<std::int32_t> all = cells_;
    all.insert(all.end(), draft_.changed.begin(), draft_.changed.end());
    numbering.number(draft_, all, corners_, slots_);
    const auto end = static_cast<std::ptrdiff_t>(cells_.size());
    draft_.changed_corners.assign(corners_.begin() + end, corners_.end());
    draft_.changed_slots.assign(slots_.begin() + end, slots_.end());
  }

  /// By kind, then by place.
  void sort_cells() {
    std::vector<std::tuple<std::uint16_t, std::uint64_t, std::int32_t>> order(cells_.size());
    for (std::size_t n = 0; n < cells_.size(); ++n)
      order[n] = {draft_.kind_of[n], place_key(level_.corner[cells_[n]]), cells_[n]};
    std::sort(order.begin(), order.end());
    kind_of_.resize(order.size());
    for (std::size_t n = 0; n < order.size(); ++n) {
      kind_of_[n] = std::get<0>(order[n]);
      cells_[n] = std::get<2>(order[n]);
    }
  }

  /// Whether the right end of each edge along x is the point behind the left one.
  static bool is_paired(const Corners& of) {
    for (std::size_t i = 0; i < 8; i += 2)
      if (of[i + 1] != of[i] + 1) return false;
    return true;
  }
  /// Whether the points of the next cell continue those of cell n along x.
  bool continues(std::size_t n) const {
    const Corners &a = corners_[n], &b = corners_[n + 1];
    for (std::size_t i = 0; i < 8; i += 2)
      if (b[i] != a[i + 1]) return false;
    return is_paired(a) && is_paired(b);
  }

  /// What is left of whole groups goes to the next kind of them.
  static void pass_on(std::vector<std::size_t>& from, std::vector<std::size_t>& to) {
    const auto left = static_cast<std::ptrdiff_t>(from.size() % kGroup);
    to.insert(to.end(), from.end() - left, from.end());
    from.erase(from.end() - left, from.end());
  }

  void group_kind(std::size_t begin, std::size_t end, std::uint16_t kind) {
    std::vector<std::size_t> halves, quarters, rest;
    for (std::size_t i = begin; i < end;) {
      std::size_t run = 1;
      while (run < kGroup && i + run < end && continues(i + run - 1)) ++run;
      for (std::size_t k = 0; k < run; ++k) {
        if (run == kGroup)
          put(i + k, kind);
        else if (k < run / kHalf * kHalf)
          halves.push_back(i + k);
        else
          (k < run / kQuarter * kQuarter ? quarters : rest).push_back(i + k);
      }
      i += run;
    }
    pass_on(halves, quarters);
    pass_on(quarters, rest);
    for (const std::size_t n : halves) put(n, kind);
    for (const std::size_t n : quarters) put(n, kind);
    // Octants are part of a fold, so that cells side by side, which would add to a point one right
    // after the other, lie apart.
    const auto order = [&](std::size_t n) {
      return std::pair(!is_paired(corners_[n]), level_.fold[cells_[n]]);
    };
    std::stable_sort(rest.begin(), rest.end(),
                     [&](std::size_t a, std::size_t b) { return order(a) < order(b); });
    for (const std::size_t n : rest) put(n, kind);
    while (draft_.cells.size() % kGroup != 0) draft_.cells.push_back(-1);
    index_.resize(draft_.cells.size());
  }

  void put(std::size_t n, std::uint16_t kind) {
    const std::size_t k = draft_.cells.size() % kGroup, group = draft_.cells.size() / kGroup;
    if (k == 0) {
      draft_.kind.push_back(kind);
      draft_.folded.push_back(0);
      draft_.corners.resize(draft_.corners.size() + 8 * kGroup, kNothing);
    }
    draft_.cells.push_back(cells_[n]);
    index_.push_back(n);
    for (std::size_t i = 0; i < 8; ++i)
      draft_.corners[8 * kGroup * group + kGroup * i + k] = corners_[n][i];
    if (!kernels::has_hanging(level_.fold[cells_[n]])) return;
    draft_.folded[group] = 1;
  }

  /// Slots of the groups in which some corner hangs.
  void put_slots() {
    for (std::size_t g = 0; g < draft_.folded.size(); ++g) {
      if (draft_.folded[g] == 0) continue;
      const std::size_t at = draft_.slots.size();
      draft_.slots.resize(at + 8 * kGroup, kNothing);
      for (std::size_t k = 0; k < kGroup; ++k) {
        const std::int32_t c = draft_.cells[kGroup * g + k];
        if (c < 0) continue;
        const Corners& from = slots_[index_[kGroup * g + k]];
        for (std::size_t i = 0; i < 8; ++i) draft_.slots[at + kGroup * i + k] = from[i];
      }
    }
  }

  const Level& level_;
  Draft& draft_;
  std::vector<std::int32_t> cells_;  // in the order of corners_ and slots_
  std::vector<std::uint16_t> kind_of_;
  std::vector<Corners> corners_, slots_;
  std::vector<std::size_t> index_;  // per lane, into these
};

}  // namespace

void Numbering::number(Draft& draft, std::span<const std::int32_t> cells,
                       std::vector<Corners>& corners, std::vector<Corners>& slots) {
  places_.clear();
  hanging_.clear();
  known_.clear();
  if (!draft.anew) know(patched_.patches[draft.patch]);
  corners.reserve(cells.size());
  slots.reserve(cells.size());
  for (const std::int32_t c : cells) {
    slots.emplace_back();
    for (std::size_t i = 0; i < 8; ++i) slots.back()[i] = vertex(level_.slots[c][i], draft);
  }
  for (std::size_t n = 0; n < cells.size(); ++n)
    corners.push_back(corners_of(draft, cells[n], slots[n]));
  for (const auto* all : {&draft.vertices, &known_})
    for (const std::int32_t v : *all) point_[v] = 0;
  sort(draft);
  for (auto* all : {&corners, &slots})
    for (Corners& of : *all)
      for (std::uint16_t& point : of)
        if (point >= draft.first_point) point = rank_[point - draft.first_point];
}

/// The points of a patch as it is.
void Numbering::know(const Patch& patch) {
  const auto add = [&](std::int32_t v, std::uint16_t point) {
    if (v < 0) return;
    point_[v] = point;
    known_.push_back(v);
  };
  for (std::int32_t at = patch.own.first; at < patch.own.end(); ++at)
    add(patched_.vertex[at], patched_.own_point[at]);
  for (std::int32_t k = patch.copies.first; k < patch.copies.end(); ++k)
    add(patched_.vertex[patched_.copy_vertex[k]], patched_.copy_point[k]);
  for (std::int32_t h = patch.hanging.first; h < patch.hanging.end(); ++h) {
    auto masters = patched_.hanging_masters[h];
    std::sort(masters.begin(), masters.end());
    hanging_.emplace(key_of(masters), patched_.hanging_point[h]);
  }
}

/// The point that the next new one gets until they are sorted.
std::int32_t Numbering::next(const Draft& draft) const {
  const std::int32_t point = draft.first_point + size_of(places_.size());
  ensures(point < kMostPoints, "a patch has too many points");
  return point;
}

std::uint16_t Numbering::vertex(std::int32_t v, Draft& draft) {
  std::int32_t& point = point_[v];
  if (point == kNothing) {
    point = next(draft);
    draft.vertices.push_back(v);
    places_.push_back(place_key(level_.point[v]));
  }
  return static_cast<std::uint16_t>(point);
}

Corners Numbering::corners_of(Draft& draft, std::int32_t cell, const Corners& slots) {
  const kernels::FoldCode fold = level_.fold[cell];
  Corners out = slots;
  if (!kernels::has_hanging(fold)) return out;
  for (int i = 0; i < 8; ++i) {
    if (!kernels::is_hanging(fold, i)) continue;
    const auto masters = masters_of(slots, kernels::fold_octant(fold), i);
    const auto [entry, added] = hanging_.try_emplace(key_of(masters), next(draft));
    if (added) {
      Vec3i p = level_.corner[cell];
      for (int d = 0; d < 3; ++d) p[d] += ((i >> d) & 1) << level_.size_log2[cell];
      places_.push_back(place_key(p));
      draft.masters.push_back(masters);
    }
    out[static_cast<std::size_t>(i)] = static_cast<std::uint16_t>(entry->second);
  }
  return out;
}

/// New points from the order in which they were met to that of their places; hanging ones come last
/// of those of one place. Long rows start where a line of memory does, so that four points that are
/// read or written together lie in one.
void Numbering::sort(Draft& draft) {
  const std::size_t vertices = draft.vertices.size(), count = places_.size();
  order_.resize(count);
  for (std::size_t k = 0; k < count; ++k) {
    const std::int32_t v = k < vertices ? draft.vertices[k] : INT32_MAX;
    order_[k] = {places_[k], static_cast<std::uint64_t>(v) << 16 | k};
  }
  std::sort(order_.begin(), order_.end());
  rank_.resize(count);
  std::vector<std::int32_t> sorted;
  sorted.reserve(vertices);
  draft.vertex_point.reserve(vertices);
  draft.hanging_point.resize(draft.masters.size());
  constexpr std::int32_t kLine = 4, kLongRow = kGroup + 1;
  const bool aligned = draft.anew && count < kMostPoints - kMostPoints / kLongRow * kLine;
  std::int32_t next = draft.first_point;
  for (std::size_t n = 0, end = 0; n < count; ++n, ++next) {
    if (n == end) {  // a row begins
      while (end < count && row_key(order_[end].first) == row_key(order_[n].first)) ++end;
      if (aligned && end - n >= kLongRow) next = (next + kLine - 1) / kLine * kLine;
    }
    const std::size_t k = order_[n].second & 0xFFFF;
    rank_[k] = static_cast<std::uint16_t>(next);
    if (k < vertices) {
      sorted.push_back(draft.vertices[k]);
      draft.vertex_point.push_back(rank_[k]);
    } else {
      draft.hanging_point[k - vertices] = rank_[k];
    }
  }
  draft.vertices = std::move(sorted);
  draft.new_points = next - draft.first_point;
  for (auto& masters : draft.masters)
    for (std::uint16_t& m : masters)
      if (m >= draft.first_point) m = rank_[m - draft.first_point];
  sort_hanging(draft);
}

/// Those on edges first, which are worked on otherwise: processors foresee what comes next.
void Numbering::sort_hanging(Draft& draft) {
  using Hanging = std::pair<std::uint16_t, HangingMasters>;
  std::vector<Hanging> all;
  all.reserve(draft.masters.size());
  for (std::size_t n = 0; n < draft.masters.size(); ++n)
    all.emplace_back(draft.hanging_point[n], draft.masters[n]);
  std::stable_partition(all.begin(), all.end(),
                        [](const Hanging& h) { return is_on_edge(h.second); });
  for (std::size_t n = 0; n < all.size(); ++n)
    std::tie(draft.hanging_point[n], draft.masters[n]) = all[n];
}

RowKind row_kind(const std::uint16_t* corners) {
  RowKind best = kRow;
  for (int i = 0; i < 8; i += 2)
    for (int k = 0; k < kGroup; ++k) {
      const std::uint16_t *a = corners + kGroup * i, *b = a + kGroup;
      const bool none = a[k] == kNothing && b[k] == kNothing;
      if (!none && b[k] != a[k] + 1) return kScattered;
      if (!none && (k == 0 || a[k] == b[k - 1])) continue;
      const RowKind most = none || k % kQuarter != 0 ? kPairs
                           : k % kHalf != 0          ? kFourRows
                                                     : kTwoRows;
      best = std::min(best, most);
    }
  return best;
}

void make_draft(const Level& level, Draft& draft, Numbering& numbering) {
  Grouping(level, draft, numbering);
}

}  // namespace kerf::cpu
