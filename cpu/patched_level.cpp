// SPDX-License-Identifier: MIT
#include "cpu/patched_level.hpp"

#include <algorithm>
#include <numeric>
#include <tuple>
#include <unordered_map>
#include <utility>

#include "core/base/error.hpp"
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
  constexpr std::int32_t kMost = 4096, kLeast = 256, kPatches = 32;
  std::int32_t size = kMost;
  while (size > kLeast && cells < kPatches * size) size /= 2;
  return size;
}

/// A patch before its numbers are known to the level.
struct Draft {
  std::vector<std::int32_t> cells;     // per lane, -1: none
  std::vector<std::uint16_t> corners;  // [group][8][8]
  std::vector<std::uint16_t> slots;    // the same, of the groups that are folded
  std::vector<std::uint8_t> row;       // per group
  std::vector<std::uint8_t> folded;    // per group
  std::vector<std::uint16_t> kind;     // per group
  std::vector<std::int32_t> vertices;  // of the level, ascending: points 0 ..
  std::vector<std::array<std::uint16_t, 4>> masters;
};

/// Points of the level's vertices within one patch after the other.
class Numbering {
 public:
  explicit Numbering(std::size_t vertices) : point_(vertices, -1) {}

  void begin(const Level& level, const std::vector<std::int32_t>& cells,
             std::vector<std::int32_t>& vertices) {
    for (const std::int32_t c : cells) {
      if (c < 0) continue;
      for (const std::int32_t v : level.slots[c]) {
        if (point_[v] >= 0) continue;
        point_[v] = 0;
        vertices.push_back(v);
      }
    }
    std::sort(vertices.begin(), vertices.end());
    for (std::size_t k = 0; k < vertices.size(); ++k) point_[vertices[k]] = size_of(k);
  }
  void end(const std::vector<std::int32_t>& vertices) {
    for (const std::int32_t v : vertices) point_[v] = -1;
  }
  std::uint16_t operator()(std::int32_t v) const { return static_cast<std::uint16_t>(point_[v]); }

 private:
  std::vector<std::int32_t> point_;
};

/// The points that a hanging corner is the mean of.
std::array<std::uint16_t, 4> masters_of(const std::array<std::uint16_t, 8>& slots, int octant,
                                        int corner) {
  std::array<std::uint16_t, 4> out{};
  std::size_t n = 0;
  for (int j = 0; j < 8; ++j)
    if (kernels::is_between(octant, corner, j)) out[n++] = slots[static_cast<std::size_t>(j)];
  if (n == 2) out[2] = out[0], out[3] = out[1];
  std::sort(out.begin(), out.end());
  return out;
}

/// Corners that hang, by their masters.
class HangingPoints {
 public:
  HangingPoints(std::size_t first, std::vector<std::array<std::uint16_t, 4>>& masters)
      : first_(first), masters_(masters) {}

  std::uint16_t operator()(const std::array<std::uint16_t, 4>& key) {
    const std::uint64_t bits = std::uint64_t{key[0]} | std::uint64_t{key[1]} << 16 |
                               std::uint64_t{key[2]} << 32 | std::uint64_t{key[3]} << 48;
    const auto [entry, added] = known_.try_emplace(bits, size_of(masters_.size()));
    if (added) masters_.push_back(key);
    return static_cast<std::uint16_t>(first_ + static_cast<std::size_t>(entry->second));
  }

 private:
  std::size_t first_;
  std::vector<std::array<std::uint16_t, 4>>& masters_;
  std::unordered_map<std::uint64_t, std::int32_t> known_;
};

/// Whether `next` lies beside `cell` along x, joined, and the vertices of both follow each other.
bool continues(const Level& level, std::int32_t cell, std::int32_t next) {
  const auto& a = level.slots[cell];
  const auto& b = level.slots[next];
  for (std::size_t i = 0; i < 8; i += 2)
    if (a[i + 1] != a[i] + 1 || b[i] != a[i + 1] || b[i + 1] != b[i] + 1) return false;
  return true;
}

/// Order and groups of the cells of a patch: by kind, then by fold, then as the level has them; of
/// each kind those first that make whole rows.
void order_cells(const Level& level, const std::vector<std::uint16_t>& kind_of, Draft& draft) {
  std::vector<std::int32_t> cells = std::move(draft.cells), rest;
  const auto kind = [&](std::int32_t c) { return kind_of.empty() ? std::uint16_t{0} : kind_of[c]; };
  const auto fold = [&](std::int32_t c) { return (level.fold[c] & 255) == 0 ? 0 : level.fold[c]; };
  std::sort(cells.begin(), cells.end(), [&](std::int32_t a, std::int32_t b) {
    return std::tuple(kind(a), fold(a), a) < std::tuple(kind(b), fold(b), b);
  });
  draft.cells.clear();
  const auto put = [&](std::int32_t c, bool row) {
    if (draft.cells.size() % kGroup == 0) {
      draft.kind.push_back(kind(c));
      draft.row.push_back(row);
    }
    draft.cells.push_back(c);
  };
  const auto put_rest = [&] {
    for (const std::int32_t c : rest) put(c, false);
    while (draft.cells.size() % kGroup != 0) draft.cells.push_back(-1);
    rest.clear();
  };
  for (std::size_t i = 0; i < cells.size();) {
    if (i > 0 && kind(cells[i]) != kind(cells[i - 1])) put_rest();
    std::size_t run = 1;
    while (run < kGroup && fold(cells[i]) == 0 && i + run < cells.size() &&
           kind(cells[i + run]) == kind(cells[i]) && fold(cells[i + run]) == 0 &&
           continues(level, cells[i + run - 1], cells[i + run]))
      ++run;
    const bool row = run == kGroup;
    for (std::size_t k = i; k < i + run; ++k)
      if (row)
        put(cells[k], true);
      else
        rest.push_back(cells[k]);
    i += run;
  }
  put_rest();
}

/// Points of all corners of a patch, and of the slots where some corner hangs.
void number_points(const Level& level, Numbering& point, Draft& draft) {
  point.begin(level, draft.cells, draft.vertices);
  HangingPoints hanging(draft.vertices.size(), draft.masters);
  constexpr std::uint16_t kNothing = 0xFFFF;
  draft.corners.assign(8 * draft.cells.size(), kNothing);
  for (std::size_t g = 0; g < draft.cells.size() / kGroup; ++g) {
    std::array<std::uint16_t, 64> slots;
    slots.fill(kNothing);
    bool folded = false;
    for (std::size_t k = 0; k < kGroup; ++k) {
      const std::int32_t c = draft.cells[kGroup * g + k];
      if (c < 0) continue;
      std::array<std::uint16_t, 8> of;
      for (std::size_t i = 0; i < 8; ++i) slots[kGroup * i + k] = of[i] = point(level.slots[c][i]);
      for (int i = 0; i < 8; ++i) {
        const bool hangs = kernels::is_hanging(level.fold[c], i);
        folded = folded || hangs;
        draft.corners[8 * kGroup * g + kGroup * static_cast<std::size_t>(i) + k] =
            hangs ? hanging(masters_of(of, kernels::fold_octant(level.fold[c]), i))
                  : of[static_cast<std::size_t>(i)];
      }
    }
    draft.folded.push_back(folded);
    if (folded) draft.slots.insert(draft.slots.end(), slots.begin(), slots.end());
  }
  point.end(draft.vertices);
  const std::size_t nothing = draft.vertices.size() + draft.masters.size();
  ensures(nothing < kNothing, "a patch has too many points");
  for (auto* numbers : {&draft.corners, &draft.slots})
    for (std::uint16_t& p : *numbers)
      if (p == kNothing) p = static_cast<std::uint16_t>(nothing);
}

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
      out.own_point.push_back(static_cast<std::uint16_t>(k));
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
      out.copy_point.push_back(static_cast<std::uint16_t>(k));
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

template <class T>
void append(std::vector<T>& to, const std::vector<T>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

/// Cells and hanging corners of all patches, one after the other.
void join(const std::vector<Draft>& drafts, PatchedLevel& out) {
  for (std::size_t p = 0; p < drafts.size(); ++p) {
    const Draft& draft = drafts[p];
    Patch& patch = out.patches[p];
    patch.first_group = size_of(out.groups());
    patch.groups = size_of(draft.cells.size() / kGroup);
    patch.first_hanging = size_of(out.hanging_masters.size());
    patch.hanging = size_of(draft.masters.size());
    patch.hanging_point = size_of(draft.vertices.size());
    patch.points = patch.hanging_point + patch.hanging + 1;
    std::int32_t at = size_of(out.slots.size() / (8 * kGroup));
    for (const std::uint8_t folded : draft.folded) out.slots_at.push_back(folded ? at++ : -1);
    append(out.cell, draft.cells);
    append(out.corners, draft.corners);
    append(out.slots, draft.slots);
    append(out.row, draft.row);
    append(out.folded, draft.folded);
    append(out.kind, draft.kind);
    append(out.hanging_masters, draft.masters);
  }
  out.lane.assign(out.level->corner.size(), -1);
  for (std::size_t lane = 0; lane < out.cell.size(); ++lane)
    if (out.cell[lane] >= 0) out.lane[out.cell[lane]] = size_of(lane);
}

using Weights = std::array<std::array<float, 8>, 8>;

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
      for (std::size_t i = 0; i < 8; ++i) std::copy_n(w[i], 8, entry->second[i].begin());
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
  return bytes_of(patches) + bytes_of(kinds) + bytes_of(cell) + bytes_of(lane) +
         bytes_of(corners) + bytes_of(kind) + bytes_of(row) + bytes_of(folded) + bytes_of(slots_at) +
         bytes_of(slots) + bytes_of(vertex) + bytes_of(packed) + bytes_of(fixed) +
         bytes_of(own_point) + bytes_of(copy_point) + bytes_of(copy_vertex) +
         bytes_of(hanging_masters) + bytes_of(copies_begin) + bytes_of(copies_of) +
         bytes_of(prolong.begin) + bytes_of(prolong.vertex) + bytes_of(prolong.weight) +
         bytes_of(restrict_.begin) + bytes_of(restrict_.vertex) + bytes_of(restrict_.weight) +
         bytes_of(has_fixed);
}

PatchedLevel make_patches(const Hierarchy& hierarchy, std::size_t index, int threads) {
  PatchedLevel out;
  out.level = &hierarchy.levels[index];
  const Level& level = *out.level;
  std::vector<std::uint16_t> kind_of;
  if (index == 0) kind_of = number_kinds(hierarchy, out);
  std::vector<Draft> drafts = divide(level);
  out.patches.resize(drafts.size());
  const auto count = size_of(drafts.size());
#pragma omp parallel num_threads(threads) if (count > 1)
  {
    Numbering point(level.point.size());
#pragma omp for schedule(dynamic, 1)
    for (std::int32_t p = 0; p < count; ++p) {
      order_cells(level, kind_of, drafts[p]);
      number_points(level, point, drafts[p]);
    }
  }
  number_vertices(drafts, out);
  number_copies(drafts, out);
  join(drafts, out);
  if (index > 0) return out;
  out.has_fixed.assign(level.corner.size(), 0);
  for (std::int32_t c = 0; c < level.cells(); ++c)
    for (const std::int32_t v : level.slots[c])
      out.has_fixed[c] = static_cast<std::uint8_t>(out.has_fixed[c] | level.fixed[v]);
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
  fine.restrict_ = transposed(rows, coarse.vertices());
}

}  // namespace kerf::cpu
