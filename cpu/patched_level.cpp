// SPDX-License-Identifier: MIT
#include "cpu/patched_level.hpp"

#include <algorithm>
#include <numeric>
#include <tuple>
#include <unordered_map>
#include <utility>

#include "core/base/error.hpp"
#include "cpu/number_table.hpp"
#include "kernels/transfer.hpp"

namespace kerf::cpu {
namespace {

template <class T>
std::size_t bytes_of(const std::vector<T>& array) {
  return array.capacity() * sizeof(T);
}

std::int32_t size_of(std::size_t n) { return static_cast<std::int32_t>(n); }

/// Bits of x with two zeros after each.
std::uint64_t spread(std::uint64_t x) {
  x &= 0x1FFFFF;
  x = (x | x << 32) & 0x1F00000000FFFF;
  x = (x | x << 16) & 0x1F0000FF0000FF;
  x = (x | x << 8) & 0x100F00F00F00F00F;
  x = (x | x << 4) & 0x10C30C30C30C30C3;
  x = (x | x << 2) & 0x1249249249249249;
  return x;
}

std::uint64_t morton(const Vec3i& c) {
  const auto at = [&](std::size_t d) { return spread(static_cast<std::uint64_t>(c[d])); };
  return at(0) | at(1) << 1 | at(2) << 2;
}

/// Cells of a patch of a full level; levels with few cells have smaller ones, for the threads.
std::int32_t patch_cells(std::int32_t cells) {
  constexpr std::int32_t kMost = 4096, kLeast = 256, kPatches = 16;
  std::int32_t size = kMost;
  while (size > kLeast && cells < kPatches * size) size /= 2;
  return size;
}

using Corners = std::array<std::uint16_t, 8>;
constexpr std::uint16_t kNothing = 0xFFFF;

/// A patch before its numbers are known to the level.
struct Draft {
  std::vector<std::int32_t> cells;          // per lane, -1: none
  std::vector<std::uint16_t> corners;       // [group][8][8]
  std::vector<std::uint16_t> slots;         // the same, of the groups that are folded
  std::vector<std::uint8_t> folded;         // per group
  std::vector<std::uint8_t> row;            // per group
  std::vector<std::uint16_t> kind;          // per group
  std::vector<std::int32_t> vertices;       // of the level, ascending by their points
  std::vector<std::uint16_t> vertex_point;  // rising
  std::vector<std::uint16_t> hanging_point;
  std::vector<std::array<std::uint16_t, 4>> masters;
};

/// Orders points by z, then y, then x, so that rows of cells have rows of points.
std::uint64_t place_key(const Vec3i& p) {
  const auto at = [&](std::size_t d) { return static_cast<std::uint64_t>(p[d]) & 0x1FFFFF; };
  return at(2) << 42 | at(1) << 21 | at(0);
}

/// The points of one patch after the other.
class Numbering {
 public:
  explicit Numbering(const Level& level) : level_(level) {}

  /// Corners and slots of the draft's cells, as points.
  void number(Draft& draft, std::vector<Corners>& corners, std::vector<Corners>& slots) {
    places_.clear();
    hanging_.clear();
    for (const std::int32_t c : draft.cells) {
      slots.emplace_back();
      for (std::size_t i = 0; i < 8; ++i) slots.back()[i] = vertex(level_.slots[c][i], draft);
    }
    const std::size_t vertices = draft.vertices.size();
    for (std::size_t n = 0; n < draft.cells.size(); ++n)
      corners.push_back(corners_of(draft, n, slots[n]));
    first_.clear();
    sort(draft, vertices);
    for (auto* all : {&corners, &slots})
      for (Corners& of : *all)
        for (std::uint16_t& point : of) point = rank_[point];
  }

 private:
  std::uint16_t vertex(std::int32_t v, Draft& draft) {
    std::int32_t& first = first_[v];
    if (first < 0) {
      first = size_of(draft.vertices.size());
      draft.vertices.push_back(v);
      places_.push_back(place_key(level_.point[v]));
    }
    return static_cast<std::uint16_t>(first);
  }

  Corners corners_of(Draft& draft, std::size_t n, const Corners& slots) {
    const std::int32_t cell = draft.cells[n];
    const kernels::FoldCode fold = level_.fold[cell];
    Corners out = slots;
    if (!kernels::has_hanging(fold)) return out;
    for (int i = 0; i < 8; ++i) {
      if (!kernels::is_hanging(fold, i)) continue;
      const auto masters = masters_of(slots, kernels::fold_octant(fold), i);
      const std::uint64_t key = std::uint64_t{masters[0]} | std::uint64_t{masters[1]} << 16 |
                                std::uint64_t{masters[2]} << 32 | std::uint64_t{masters[3]} << 48;
      const auto [entry, added] = hanging_.try_emplace(key, size_of(places_.size()));
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

  /// The points that a hanging corner is the mean of.
  static std::array<std::uint16_t, 4> masters_of(const Corners& slots, int octant, int corner) {
    std::array<std::uint16_t, 4> out{};
    std::size_t n = 0;
    for (int j = 0; j < 8; ++j)
      if (kernels::is_between(octant, corner, j)) out[n++] = slots[static_cast<std::size_t>(j)];
    if (n == 2) out[2] = out[0], out[3] = out[1];
    std::sort(out.begin(), out.end());
    return out;
  }

  /// From the order in which points were met to that of their places.
  void sort(Draft& draft, std::size_t vertices) {
    ensures(places_.size() < kNothing, "a patch has too many points");
    order_.resize(places_.size());
    for (std::size_t k = 0; k < places_.size(); ++k)
      order_[k] = {places_[k], k < vertices ? draft.vertices[k] : INT32_MAX,
                   static_cast<std::uint16_t>(k)};
    std::sort(order_.begin(), order_.end());
    rank_.resize(places_.size());
    std::vector<std::int32_t> sorted;
    sorted.reserve(vertices);
    draft.hanging_point.resize(draft.masters.size());
    for (std::size_t rank = 0; rank < order_.size(); ++rank) {
      const std::size_t k = std::get<2>(order_[rank]);
      rank_[k] = static_cast<std::uint16_t>(rank);
      if (k < vertices) {
        sorted.push_back(draft.vertices[k]);
        draft.vertex_point.push_back(rank_[k]);
      } else {
        draft.hanging_point[k - vertices] = rank_[k];
      }
    }
    draft.vertices = std::move(sorted);
    for (auto& masters : draft.masters)
      for (std::uint16_t& m : masters) m = rank_[m];
  }

  const Level& level_;
  NumberTable first_;  // of vertices, in the order in which they are met
  std::vector<std::uint64_t> places_;  // of points as they were met: vertices, then hanging ones
  std::vector<std::tuple<std::uint64_t, std::int32_t, std::uint16_t>> order_;
  std::vector<std::uint16_t> rank_;
  std::unordered_map<std::uint64_t, std::int32_t> hanging_;
};

/// Cells of a patch in groups. Of each kind those first that make rows of eight, then pairs of rows
/// of four, then the others by fold.
class Grouping {
 public:
  Grouping(const Level& level, const std::vector<std::uint16_t>& kind_of, Draft& draft,
           Numbering& numbering)
      : level_(level), draft_(draft), cells_(draft.cells) {
    std::sort(cells_.begin(), cells_.end(), [&](std::int32_t a, std::int32_t b) {
      return std::tuple(kind_of[a], place_key(level.corner[a]), a) <
             std::tuple(kind_of[b], place_key(level.corner[b]), b);
    });
    draft.cells = cells_;
    numbering.number(draft, corners_, slots_);
    nothing_ = static_cast<std::uint16_t>(draft.vertices.size() + draft.masters.size());
    draft.cells.clear();
    for (std::size_t begin = 0; begin < cells_.size();) {
      std::size_t end = begin + 1;
      while (end < cells_.size() && kind_of[cells_[end]] == kind_of[cells_[begin]]) ++end;
      group_kind(begin, end, kind_of[cells_[begin]]);
      begin = end;
    }
    put_slots();
  }

 private:
  /// Whether the points of the next cell continue those of cell n along x.
  bool continues(std::size_t n) const {
    const Corners &a = corners_[n], &b = corners_[n + 1];
    for (std::size_t i = 0; i < 8; i += 2)
      if (a[i + 1] != a[i] + 1 || b[i] != a[i + 1] || b[i + 1] != b[i] + 1) return false;
    return true;
  }

  void group_kind(std::size_t begin, std::size_t end, std::uint16_t kind) {
    std::vector<std::size_t> halves, rest;
    for (std::size_t i = begin; i < end;) {
      std::size_t run = 1;
      while (run < kGroup && i + run < end && continues(i + run - 1)) ++run;
      if (run == kGroup)
        for (std::size_t k = 0; k < run; ++k) put(i + k, kind, kRow);
      else
        for (std::size_t k = 0; k < run; ++k) (k < run / 4 * 4 ? halves : rest).push_back(i + k);
      i += run;
    }
    if (halves.size() % kGroup != 0) {
      rest.insert(rest.end(), halves.end() - 4, halves.end());
      halves.erase(halves.end() - 4, halves.end());
    }
    for (const std::size_t n : halves) put(n, kind, kTwoRows);
    const auto fold = [&](std::size_t n) { return level_.fold[cells_[n]]; };
    std::stable_sort(rest.begin(), rest.end(),
                     [&](std::size_t a, std::size_t b) { return fold(a) < fold(b); });
    for (const std::size_t n : rest) put(n, kind, kScattered);
    while (draft_.cells.size() % kGroup != 0) draft_.cells.push_back(-1);
    index_.resize(draft_.cells.size());
  }

  void put(std::size_t n, std::uint16_t kind, RowKind row) {
    const std::size_t k = draft_.cells.size() % kGroup, group = draft_.cells.size() / kGroup;
    if (k == 0) {
      draft_.kind.push_back(kind);
      draft_.row.push_back(row);
      draft_.folded.push_back(0);
      draft_.corners.resize(draft_.corners.size() + 8 * kGroup, nothing_);
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
      draft_.slots.resize(at + 8 * kGroup, nothing_);
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
  std::vector<Corners> corners_, slots_;
  std::vector<std::size_t> index_;  // per lane, into these
  std::uint16_t nothing_ = 0;
};

std::vector<std::uint16_t> number_kinds(const Hierarchy& hierarchy, PatchedLevel& out) {
  std::vector<std::uint16_t> kind_of(hierarchy.values.size());
  for (std::size_t c = 0; c < kind_of.size(); ++c) {
    const CellValues& v = hierarchy.values[c];
    const CellKind kind{v.stiffness, v.mass, hierarchy.spacing * (1 << out.level->size_log2[c]),
                        v.material};
    std::size_t k = c > 0 ? kind_of[c - 1] : 0;
    if (k >= out.kinds.size() || !(out.kinds[k] == kind))
      k = static_cast<std::size_t>(std::find(out.kinds.begin(), out.kinds.end(), kind) -
                                   out.kinds.begin());
    if (k == out.kinds.size()) out.kinds.push_back(kind);
    expects(k < 65535, "the body has more than 65535 kinds of cells");
    kind_of[c] = static_cast<std::uint16_t>(k);
  }
  return kind_of;
}

void find_held(const PatchedLevel* finer, PatchedLevel& out) {
  const Level& level = *out.level;
  out.held.assign(level.corner.size(), kFree);
  for (std::int32_t c = 0; c < level.cells(); ++c) {
    bool partly = false, wholly = true;
    if (finer == nullptr) {
      for (const std::int32_t v : level.slots[c]) {
        partly = partly || level.fixed[v] != 0;
        wholly = wholly && level.fixed[v] == 7;
      }
    } else {
      for (const std::int32_t child : level.children_of(c)) {
        partly = partly || finer->held[child] == kPartlyHeld;
        wholly = wholly && finer->held[child] == kWhollyHeld;
      }
    }
    out.held[c] = wholly ? kWhollyHeld : partly ? kPartlyHeld : kFree;
  }
}

std::vector<std::uint16_t> stored_kinds(const PatchedLevel& finer, const PatchedLevel& out) {
  const Level& level = *out.level;
  std::vector<std::uint16_t> kind_of(level.corner.size(), kMerged);
  for (std::int32_t c = 0; c < level.cells(); ++c) {
    const auto children = level.children_of(c);
    if (finer.level->place[children[0]] == kernels::kPassed) kind_of[c] = kPassed;
    unsigned octants = 0;  // without duplication two children can have one
    bool twice = false;
    for (const std::int32_t child : children) {
      const unsigned bit = 1U << (finer.level->place[child] % 8);
      twice = twice || (octants & bit) != 0;
      octants |= bit;
    }
    const bool held = out.held[c] == kPartlyHeld;
    const bool masks = held && finer.children.empty();  // children of level 0
    if (held) kind_of[c] = kind_of[c] == kPassed ? kHeldPassed : kHeldMerged;
    if (masks || twice) kind_of[c] = kGeneral;
  }
  return kind_of;
}

void place_children(const PatchedLevel& finer, PatchedLevel& out) {
  const Level& level = *out.level;
  out.children.assign(8 * out.cell.size(), -1);
  for (std::size_t lane = 0; lane < out.cell.size(); ++lane) {
    const std::int32_t c = out.cell[lane];
    if (c < 0) continue;
    for (const std::int32_t child : level.children_of(c)) {
      if (finer.held[child] == kWhollyHeld) continue;
      const std::size_t octant = finer.level->place[child] % 8;  // kPassed: 0
      out.children[8 * kGroup * (lane / kGroup) + kGroup * octant + lane % kGroup] =
          finer.lane[child];
    }
  }
}

/// Cells along a curve that stays within cubes, cut into patches.
std::vector<Draft> divide(const Level& level) {
  std::vector<std::pair<std::uint64_t, std::int32_t>> order(level.corner.size());
  for (std::int32_t c = 0; c < level.cells(); ++c) order[c] = {morton(level.corner[c]), c};
  std::sort(order.begin(), order.end());
  const std::int32_t size = patch_cells(level.cells());
  std::vector<Draft> drafts(static_cast<std::size_t>((level.cells() + size - 1) / size));
  for (std::size_t i = 0; i < order.size(); ++i)
    drafts[i / static_cast<std::size_t>(size)].cells.push_back(order[i].second);
  return drafts;
}

void fill_to_tile(std::vector<std::int32_t>& vertices) {
  while (vertices.size() % kGroup != 0) vertices.push_back(-1);
}

/// Packed numbers: own vertices patch by patch, shared ones, one tile of nothing.
void number_vertices(std::vector<Draft>& drafts, PatchedLevel& out) {
  const Level& level = *out.level;
  constexpr std::int32_t kNone = -1, kShared = -2;
  std::vector<std::int32_t> owner(level.point.size(), kNone);
  for (std::size_t p = 0; p < drafts.size(); ++p)
    for (const std::int32_t v : drafts[p].vertices)
      owner[v] = owner[v] == kNone ? size_of(p) : kShared;
  for (std::size_t p = 0; p < drafts.size(); ++p) {
    Patch& patch = out.patches[p];
    patch.first_own = size_of(out.vertex.size());
    const std::vector<std::int32_t>& vertices = drafts[p].vertices;
    const auto nothing = static_cast<std::uint16_t>(vertices.size() + drafts[p].masters.size());
    for (std::size_t k = 0; k < vertices.size(); ++k) {
      if (owner[vertices[k]] != size_of(p)) continue;
      out.vertex.push_back(vertices[k]);
      out.own_point.push_back(drafts[p].vertex_point[k]);
    }
    fill_to_tile(out.vertex);
    out.own_point.resize(out.vertex.size(), nothing);
    patch.own = size_of(out.vertex.size()) - patch.first_own;
  }
  out.first_shared = size_of(out.vertex.size());
  for (std::int32_t v = 0; v < level.vertices(); ++v)
    if (owner[v] == kShared) out.vertex.push_back(v);
  fill_to_tile(out.vertex);
  out.vertex.resize(out.vertex.size() + kGroup, -1);
  out.vertex.shrink_to_fit();
  out.own_point.shrink_to_fit();
  out.packed.assign(level.point.size(), -1);
  out.fixed.assign(out.vertex.size(), 0);
  for (std::size_t k = 0; k < out.vertex.size(); ++k) {
    if (out.vertex[k] < 0) continue;
    out.packed[out.vertex[k]] = size_of(k);
    out.fixed[k] = level.fixed[out.vertex[k]];
  }
}

/// Which points of patches are the shared vertices, and back.
void number_copies(const std::vector<Draft>& drafts, PatchedLevel& out) {
  const std::size_t shared = out.vertex.size() - static_cast<std::size_t>(out.first_shared);
  out.copies_begin.assign(shared + 1, 0);
  for (std::size_t p = 0; p < drafts.size(); ++p) {
    Patch& patch = out.patches[p];
    patch.first_copy = size_of(out.copy_point.size());
    const std::vector<std::int32_t>& vertices = drafts[p].vertices;
    for (std::size_t k = 0; k < vertices.size(); ++k) {
      const std::int32_t packed = out.packed[vertices[k]];
      if (packed < out.first_shared) continue;
      out.copy_point.push_back(drafts[p].vertex_point[k]);
      out.copy_vertex.push_back(packed);
      ++out.copies_begin[static_cast<std::size_t>(packed - out.first_shared) + 1];
    }
    patch.copies = size_of(out.copy_point.size()) - patch.first_copy;
  }
  std::partial_sum(out.copies_begin.begin(), out.copies_begin.end(), out.copies_begin.begin());
  std::vector<std::int32_t> next(out.copies_begin.begin(), out.copies_begin.end() - 1);
  out.copies_of.resize(out.copy_vertex.size());
  for (std::size_t k = 0; k < out.copy_vertex.size(); ++k)
    out.copies_of[next[out.copy_vertex[k] - out.first_shared]++] = size_of(k);
}

/// What drafts have under `part`, one after the other.
template <class T>
void join(std::vector<Draft>& drafts, std::vector<T> Draft::* part, std::vector<T>& to) {
  std::size_t size = 0;
  for (const Draft& draft : drafts) size += (draft.*part).size();
  to.reserve(size);
  for (Draft& draft : drafts) {
    to.insert(to.end(), (draft.*part).begin(), (draft.*part).end());
    draft.*part = {};
  }
}

/// Cells and hanging corners of all patches, one after the other.
void join(std::vector<Draft>& drafts, PatchedLevel& out) {
  std::int32_t group = 0, hanging = 0, folds = 0;
  for (std::size_t p = 0; p < drafts.size(); ++p) {
    const Draft& draft = drafts[p];
    Patch& patch = out.patches[p];
    patch.first_group = group;
    patch.groups = size_of(draft.cells.size() / kGroup);
    patch.first_hanging = hanging;
    patch.hanging = size_of(draft.masters.size());
    patch.points = size_of(draft.vertices.size()) + patch.hanging + 1;
    group += patch.groups;
    hanging += patch.hanging;
    for (const std::uint8_t folded : draft.folded) out.slots_at.push_back(folded ? folds++ : -1);
  }
  join(drafts, &Draft::cells, out.cell);
  join(drafts, &Draft::corners, out.corners);
  join(drafts, &Draft::slots, out.slots);
  join(drafts, &Draft::row, out.row);
  join(drafts, &Draft::kind, out.kind);
  join(drafts, &Draft::hanging_point, out.hanging_point);
  join(drafts, &Draft::masters, out.hanging_masters);
  out.lane.assign(out.level->corner.size(), -1);
  for (std::size_t lane = 0; lane < out.cell.size(); ++lane)
    if (out.cell[lane] >= 0) out.lane[out.cell[lane]] = size_of(lane);
}

using Weights = std::array<std::array<std::uint8_t, 8>, 8>;  // in 1 / SparseWeights::kWhole

/// The weights between slots of a child and of its parent; there are few different ones.
class WeightTable {
 public:
  const Weights& operator()(kernels::FoldCode child, int place, kernels::FoldCode parent) {
    const std::uint64_t key = std::uint64_t{child} | std::uint64_t{parent} << 16 |
                              std::uint64_t(static_cast<unsigned>(place)) << 32;
    const auto [entry, added] = known_.try_emplace(key);
    if (added) {
      float w[8][8];
      kernels::transfer_weights(child, place, parent, w);
      for (std::size_t i = 0; i < 8; ++i)
        for (std::size_t m = 0; m < 8; ++m) {
          const float parts = SparseWeights::kWhole * w[i][m];
          entry->second[i][m] = static_cast<std::uint8_t>(parts);
          ensures(static_cast<float>(entry->second[i][m]) == parts, "a weight is no part of 64");
        }
    }
    return entry->second;
  }

 private:
  std::unordered_map<std::uint64_t, Weights> known_;
};

/// The columns of `rows`, as rows: what coarse vertices take from fine ones.
SparseWeights transposed(const SparseWeights& rows, std::size_t columns) {
  SparseWeights out;
  out.begin.assign(columns + 1, 0);
  for (const std::int32_t c : rows.vertex) ++out.begin[static_cast<std::size_t>(c) + 1];
  std::partial_sum(out.begin.begin(), out.begin.end(), out.begin.begin());
  std::vector<std::int32_t> next(out.begin.begin(), out.begin.end() - 1);
  out.vertex.resize(rows.vertex.size());
  out.weight.resize(rows.weight.size());
  for (std::size_t v = 0; v + 1 < rows.begin.size(); ++v)
    for (std::int32_t k = rows.begin[v]; k < rows.begin[v + 1]; ++k) {
      const std::int32_t at = next[rows.vertex[k]]++;
      out.vertex[at] = size_of(v);
      out.weight[at] = rows.weight[k];
    }
  return out;
}

}  // namespace

std::size_t PatchedLevel::bytes() const {
  return bytes_of(patches) + bytes_of(kinds) + bytes_of(cell) + bytes_of(lane) + bytes_of(corners) +
         bytes_of(kind) + bytes_of(row) + bytes_of(slots_at) + bytes_of(slots) + bytes_of(vertex) +
         bytes_of(packed) + bytes_of(fixed) + bytes_of(own_point) + bytes_of(copy_point) +
         bytes_of(copy_vertex) + bytes_of(hanging_point) + bytes_of(hanging_masters) +
         bytes_of(copies_begin) + bytes_of(copies_of) + bytes_of(prolong.begin) +
         bytes_of(prolong.vertex) + bytes_of(prolong.weight) + bytes_of(restrict_.begin) +
         bytes_of(restrict_.vertex) + bytes_of(restrict_.weight) + bytes_of(held) +
         bytes_of(children);
}

PatchedLevel make_patches(const Hierarchy& hierarchy, std::size_t index, const PatchedLevel* finer,
                          int threads) {
  PatchedLevel out;
  out.level = &hierarchy.levels[index];
  const Level& level = *out.level;
  find_held(finer, out);
  const std::vector<std::uint16_t> kind_of =
      finer == nullptr ? number_kinds(hierarchy, out) : stored_kinds(*finer, out);
  std::vector<Draft> drafts = divide(level);
  out.patches.resize(drafts.size());
  const auto count = size_of(drafts.size());
#pragma omp parallel num_threads(threads) if (count > 1)
  {
    Numbering numbering(level);
#pragma omp for schedule(dynamic, 1)
    for (std::int32_t p = 0; p < count; ++p) Grouping(level, kind_of, drafts[p], numbering);
  }
  number_vertices(drafts, out);
  number_copies(drafts, out);
  join(drafts, out);
  if (finer != nullptr) place_children(*finer, out);
  return out;
}

// By the first cell that meets each vertex; all of them agree.
void fill_weights(const PatchedLevel& coarse, PatchedLevel& fine) {
  const Level& level = *fine.level;
  std::vector<std::int32_t> first(level.point.size(), -1);
  for (std::int32_t c = 0; c < level.cells(); ++c)
    for (std::size_t i = 0; i < 8; ++i)
      if (first[level.slots[c][i]] < 0) first[level.slots[c][i]] = 8 * c + size_of(i);
  WeightTable table;
  SparseWeights& rows = fine.prolong;
  rows.begin.reserve(fine.vertex.size() + 1);
  rows.begin.push_back(0);
  for (const std::int32_t v : fine.vertex) {
    if (v >= 0) {
      const std::int32_t child = first[v] / 8, parent = level.parent[child];
      const auto& w = table(level.fold[child], level.place[child],
                            coarse.level->fold[parent])[static_cast<std::size_t>(first[v] % 8)];
      for (std::size_t m = 0; m < 8; ++m) {
        if (w[m] == 0) continue;
        rows.vertex.push_back(coarse.packed[coarse.level->slots[parent][m]]);
        rows.weight.push_back(w[m]);
      }
    }
    rows.begin.push_back(size_of(rows.vertex.size()));
  }
  rows.vertex.shrink_to_fit();
  rows.weight.shrink_to_fit();
  fine.restrict_ = transposed(rows, coarse.vertices());
}

}  // namespace kerf::cpu
