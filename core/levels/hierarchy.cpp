// SPDX-License-Identifier: MIT
#include "core/levels/hierarchy.hpp"

#include <algorithm>
#include <bit>
#include <tuple>

#include "core/base/array.hpp"
#include "core/base/error.hpp"
#include "core/levels/union_find.hpp"
#include "kernels/transfer.hpp"

namespace kerf {
namespace {

// For each fine cell the first cell of its group; groups become coarse cells.
std::vector<std::int32_t> group_cells(const Level& fine, int log2, bool duplicate) {
  UnionFind sets(fine.corner.size());
  const auto same_block = [&](std::int32_t a, std::int32_t b) {
    for (int d = 0; d < 3; ++d)
      if (fine.corner[a][d] >> (log2 + 1) != fine.corner[b][d] >> (log2 + 1)) return false;
    return true;
  };
  const auto merges = [&](std::int32_t c) { return fine.size_log2[c] == log2; };
  if (duplicate) {
    for (std::int32_t a = 0; a < fine.cells(); ++a) {
      if (!merges(a)) continue;
      for (const std::int32_t item : fine.links_of(a)) {
        const std::int32_t b = item / 8;
        if ((item & 1) != 0 && merges(b) && same_block(a, b)) sets.unite(a, b);
      }
    }
  } else {
    std::vector<std::int32_t> order;
    for (std::int32_t c = 0; c < fine.cells(); ++c)
      if (merges(c)) order.push_back(c);
    const auto key = [&](std::int32_t c) {
      return std::tuple(fine.corner[c][2] >> (log2 + 1), fine.corner[c][1] >> (log2 + 1),
                        fine.corner[c][0] >> (log2 + 1), c);
    };
    std::sort(order.begin(), order.end(), [&](auto a, auto b) { return key(a) < key(b); });
    for (std::size_t i = 1; i < order.size(); ++i)
      if (same_block(order[i - 1], order[i])) sets.unite(order[i - 1], order[i]);
  }
  std::vector<std::int32_t> group(fine.corner.size());
  for (std::int32_t c = 0; c < fine.cells(); ++c) group[c] = sets.find(c);
  return group;
}

void fill_children(const Level& fine, Level& coarse) {
  coarse.child_begin.reserve(with_room(coarse.corner.size()));
  coarse.child_begin.assign(coarse.corner.size() + 1, 0);
  for (const std::int32_t parent : fine.parent) ++coarse.child_begin[parent + 1];
  for (std::size_t i = 0; i < coarse.corner.size(); ++i)
    coarse.child_begin[i + 1] += coarse.child_begin[i];
  coarse.children.reserve(with_room(fine.corner.size()));
  coarse.children.resize(fine.corner.size());
  std::vector<std::int32_t> next(coarse.child_begin.begin(), coarse.child_begin.end() - 1);
  for (std::int32_t c = 0; c < fine.cells(); ++c) coarse.children[next[fine.parent[c]]++] = c;
}

// Cells of the coarse level, and parent and place of the fine ones.
Level merge_cells(Level& fine, int log2, bool duplicate) {
  const std::vector<std::int32_t> group = group_cells(fine, log2, duplicate);
  struct Entry {
    Vec3i corner;
    std::uint8_t size_log2;
    std::int32_t first;
  };
  std::vector<Entry> entries;
  for (std::int32_t c = 0; c < fine.cells(); ++c) {
    if (group[c] != c) continue;
    Entry e{fine.corner[c], fine.size_log2[c], c};
    if (e.size_log2 == log2) {
      ++e.size_log2;
      for (int d = 0; d < 3; ++d) e.corner[d] = (e.corner[d] >> e.size_log2) << e.size_log2;
    }
    entries.push_back(e);
  }
  std::sort(entries.begin(), entries.end(), [](const Entry& a, const Entry& b) {
    return std::tuple(a.size_log2, a.corner[2], a.corner[1], a.corner[0], a.first) <
           std::tuple(b.size_log2, b.corner[2], b.corner[1], b.corner[0], b.first);
  });

  Level coarse;
  coarse.corner.reserve(with_room(entries.size()));
  coarse.size_log2.reserve(with_room(entries.size()));
  std::vector<std::int32_t> coarse_of(fine.corner.size(), -1);
  for (const Entry& e : entries) {
    coarse_of[e.first] = coarse.cells();
    coarse.corner.push_back(e.corner);
    coarse.size_log2.push_back(e.size_log2);
  }
  fine.parent.reserve(with_room(fine.corner.size()));
  fine.place.reserve(with_room(fine.corner.size()));
  fine.parent.resize(fine.corner.size());
  fine.place.resize(fine.corner.size());
  for (std::int32_t c = 0; c < fine.cells(); ++c) {
    fine.parent[c] = coarse_of[group[c]];
    int octant = 0;
    for (int d = 0; d < 3; ++d) octant |= ((fine.corner[c][d] >> log2) & 1) << d;
    fine.place[c] = fine.size_log2[c] == log2 ? static_cast<std::uint8_t>(octant) : Level::kPassed;
  }
  fill_children(fine, coarse);
  return coarse;
}

// Appends a row of links, in any order and some of them twice, to a level whose other rows lie
// before.
void append_links(std::vector<std::int32_t>& row, Level& level) {
  std::sort(row.begin(), row.end());
  row.erase(std::unique(row.begin(), row.end()), row.end());
  level.linked.insert(level.linked.end(), row.begin(), row.end());
  level.link_begin.push_back(static_cast<std::int32_t>(level.linked.size()));
  row.clear();
}

void coarsen_links(const Level& fine, Level& coarse) {
  coarse.link_begin.reserve(with_room(coarse.corner.size()));
  coarse.linked.reserve(with_room(6 * coarse.corner.size()));
  coarse.link_begin.assign(1, 0);
  std::vector<std::int32_t> row;
  for (std::int32_t c = 0; c < coarse.cells(); ++c) {
    for (const std::int32_t child : coarse.children_of(c))
      for (const std::int32_t item : fine.links_of(child)) {
        const std::int32_t other = fine.parent[item / 8];
        if (other != c) row.push_back(8 * other + item % 8);
      }
    append_links(row, coarse);
  }
}

// Without duplication cells that lie side by side are joined, whatever was cut between them.
void link_by_place(Level& coarse, int log2) {
  std::vector<std::int32_t> order;
  for (std::int32_t c = 0; c < coarse.cells(); ++c)
    if (coarse.size_log2[c] == log2) order.push_back(c);  // ascending by (z, y, x) already
  const auto less = [&](std::int32_t a, const Vec3i& p) {
    for (int d = 2; d >= 0; --d)
      if (coarse.corner[a][d] != p[d]) return coarse.corner[a][d] < p[d];
    return false;
  };
  Level linked;
  linked.link_begin.assign(1, 0);
  std::vector<std::int32_t> row;
  for (std::int32_t a = 0; a < coarse.cells(); ++a) {
    const auto old = coarse.links_of(a);
    row.assign(old.begin(), old.end());
    for (int face = 0; face < 6 && coarse.size_log2[a] == log2; ++face) {
      Vec3i p = coarse.corner[a];
      p[static_cast<std::size_t>(face / 2)] += (face % 2 == 1 ? 1 : -1) << log2;
      const auto b = std::lower_bound(order.begin(), order.end(), p, less);
      if (b != order.end() && coarse.corner[*b] == p) row.push_back(8 * *b + face);
    }
    append_links(row, linked);
  }
  coarse.link_begin = std::move(linked.link_begin);
  coarse.linked = std::move(linked.linked);
}

void coarsen_supports(const Level& fine, Level& coarse) {
  std::fill(coarse.fixed.begin(), coarse.fixed.end(), std::uint8_t{7});
  for (std::int32_t c = 0; c < fine.cells(); ++c) {
    const std::int32_t parent = fine.parent[c];
    const std::uint64_t takes = transfer_pattern(fine.fold[c], fine.place[c], coarse.fold[parent]);
    for (int i = 0; i < 8; ++i) {
      const std::uint8_t fixed = fine.fixed[fine.slots[c][i]];
      if (fixed == 7) continue;
      for (std::uint64_t slots = takes >> (8 * i) & 255; slots != 0; slots &= slots - 1)
        coarse.fixed[coarse.slots[parent][std::countr_zero(slots)]] &= fixed;
    }
  }
}

std::uint64_t pattern_of_weights(std::uint16_t child, std::uint8_t place, std::uint16_t parent) {
  double w[8][8];
  kernels::transfer_weights(child, place, parent, w);
  std::uint64_t out = 0;
  for (int i = 0; i < 8; ++i)
    for (int m = 0; m < 8; ++m)
      if (w[i][m] != 0) out |= std::uint64_t{1} << (8 * i + m);
  return out;
}

bool may_coarsen(const Level& fine, std::size_t levels, const HierarchyOptions& options) {
  constexpr std::size_t kMostLevels = 31;
  if (fine.vertices() <= options.coarsest_vertices || levels >= kMostLevels) return false;
  return options.max_levels <= 0 || levels < static_cast<std::size_t>(options.max_levels);
}

// Many small pieces cannot be merged further; the sparse factor handles them well.
bool worth_coarsening(const Level& fine, const Level& coarse, std::size_t levels) {
  constexpr double kWorthIt = 0.8;
  if (coarse.vertices() <= kWorthIt * fine.vertices()) return true;
  const auto merged = static_cast<std::uint8_t>(levels);
  return std::any_of(coarse.size_log2.begin(), coarse.size_log2.end(),
                     [merged](std::uint8_t log2) { return log2 > merged; });  // larger ones wait
}

// The level above `fine`, which is the last of `levels`.
Level build_above(Level& fine, std::size_t levels, const HierarchyOptions& options) {
  const int log2 = static_cast<int>(levels) - 1;
  Level coarse = merge_cells(fine, log2, options.duplicate_cells);
  coarsen_links(fine, coarse);
  if (!options.duplicate_cells) link_by_place(coarse, log2 + 1);
  build_vertices(coarse);
  return coarse;
}

}  // namespace

std::uint64_t transfer_pattern(std::uint16_t child, std::uint8_t place, std::uint16_t parent) {
  static const std::array<std::uint64_t, 9> regular = [] {
    std::array<std::uint64_t, 9> out{};
    for (std::uint8_t p = 0; p <= Level::kPassed; ++p) out[p] = pattern_of_weights(0, p, 0);
    return out;
  }();
  if (((child | parent) & 255) == 0) return regular[place];
  return pattern_of_weights(child, place, parent);
}

void Level::pack() {
  if (!link_rows.count.empty()) Rows(link_begin, linked, link_rows).pack();
  if (!incidence_rows.count.empty()) Rows(incidence_begin, incidence, incidence_rows).pack();
  if (!child_rows.count.empty()) Rows(child_begin, children, child_rows).pack();
}

void Hierarchy::pack() {
  for (Level& level : levels) level.pack();
}

void Hierarchy::forget_neighbours() {
  for (Level& level : levels) {
    level.link_begin = {};
    level.linked = {};
    level.link_rows = {};
    if (&level == &levels.back()) break;
    level.incidence_begin = {};
    level.incidence = {};
    level.incidence_rows = {};
  }
}

void Hierarchy::forget_transfers() {
  for (std::size_t l = 0; l + 1 < levels.size(); ++l) {
    levels[l].parent = {};
    if (l > 0) levels[l].slots = {};
  }
}

std::vector<CellLink> links_of(const Level& level) {
  std::vector<CellLink> out;
  for (std::int32_t a = 0; a < level.cells(); ++a)
    for (const std::int32_t item : level.links_of(a))
      if ((item & 1) != 0) out.push_back({a, item / 8, static_cast<std::uint8_t>(item % 8 / 2)});
  return out;
}

std::size_t Level::bytes() const {
  return bytes_of(corner) + bytes_of(size_log2) + bytes_of(parent) + bytes_of(place) +
         bytes_of(fold) + bytes_of(slots) + bytes_of(link_begin) + bytes_of(linked) +
         bytes_of(child_begin) + bytes_of(children) + bytes_of(point) + bytes_of(fixed) +
         bytes_of(incidence_begin) + bytes_of(incidence) + bytes_of(link_rows.count) +
         bytes_of(child_rows.count) + bytes_of(incidence_rows.count);
}

std::uint16_t CellValueList::kind_of(const CellValues& values) {
  if (last_ < kinds_.size() && kinds_[last_] == values) return last_;
  const auto found = std::find(kinds_.begin(), kinds_.end(), values);
  last_ = static_cast<std::uint16_t>(found - kinds_.begin());
  if (found != kinds_.end()) return last_;
  expects(kinds_.size() < 65535, "the body has more than 65535 kinds of cells");
  kinds_.push_back(values);
  if (is_wide() && last_ == 256) {
    high_.reserve(low_.capacity());
    high_.assign(low_.size(), 0);
  }
  return last_;
}

void CellValueList::set(std::size_t cell, const CellValues& values) {
  const std::uint16_t kind = kind_of(values);
  low_[cell] = static_cast<std::uint8_t>(kind % 256);
  if (is_wide()) high_[cell] = static_cast<std::uint8_t>(kind / 256);
}

std::size_t CellValueList::bytes() const {
  return bytes_of(low_) + bytes_of(high_) + bytes_of(kinds_);
}

std::size_t Hierarchy::bytes() const {
  std::size_t sum = values.bytes();
  for (const Level& level : levels) sum += level.bytes();
  return sum;
}

void add_links_of_leaf(const LinkedOctree& body, std::int32_t number,
                       std::vector<std::int32_t>& out) {
  const std::vector<LinkedOctree::Node>& nodes = body.nodes();
  const LinkedOctree::Node& leaf = nodes[body.leaves()[number]];
  const int size = 1 << leaf.size_log2;
  for (int face = 0; face < 6; ++face) {
    if ((leaf.cut_mask >> face & 1) != 0) continue;
    const auto axis = static_cast<std::size_t>(face / 2);
    Vec3i c = leaf.corner;
    c[axis] += face % 2 == 1 ? size : -1;
    const std::int32_t other = body.leaf_at(c);
    if (other >= 0 && nodes[other].size_log2 >= leaf.size_log2) {
      out.push_back(8 * body.leaf_number(other) + face);
      continue;
    }
    // Four neighbours of half the size, some of which may hold no material.
    for (int k = 0; k < 4 && size > 1; ++k) {
      Vec3i part = c;
      part[(axis + 1) % 3] += (k & 1) * size / 2;
      part[(axis + 2) % 3] += (k >> 1) * size / 2;
      const std::int32_t small = k == 0 ? other : body.leaf_at(part);
      if (small >= 0) out.push_back(8 * body.leaf_number(small) + face);
    }
  }
}

void check_cell_count(std::size_t cells) {
  constexpr std::size_t kMost = (std::size_t{1} << 28) - 1;
  if (cells <= kMost) return;
  throw Error(ErrorKind::unavailable,
              text("a body of ", cells, " cells: at most ", kMost,
                   " are possible; lower body.resolution or raise body.refinement"));
}

Level finest_level(const LinkedOctree& body) {
  Level level;
  const std::size_t cells = body.leaf_count();
  check_cell_count(cells);
  level.corner.reserve(with_room(cells));
  level.size_log2.reserve(with_room(cells));
  level.link_begin.reserve(with_room(cells));
  level.linked.reserve(with_room(6 * cells));
  level.link_begin.push_back(0);
  std::vector<std::int32_t> row;
  for (std::int32_t number = 0; number < static_cast<std::int32_t>(cells); ++number) {
    const LinkedOctree::Node& cell = body.nodes()[body.leaves()[number]];
    level.corner.push_back(cell.corner);
    level.size_log2.push_back(cell.size_log2);
    add_links_of_leaf(body, number, row);
    append_links(row, level);
  }
  build_vertices(level);
  return level;
}

void build_coarse_levels(Hierarchy& hierarchy, const HierarchyOptions& options) {
  expects(!hierarchy.levels.empty(), "build_coarse_levels needs level 0");
  hierarchy.levels.resize(1);
  hierarchy.levels[0].parent.clear();
  hierarchy.levels[0].place.clear();
  while (may_coarsen(hierarchy.levels.back(), hierarchy.levels.size(), options)) {
    Level& fine = hierarchy.levels.back();
    Level coarse = build_above(fine, hierarchy.levels.size(), options);
    if (!worth_coarsening(fine, coarse, hierarchy.levels.size())) {
      fine.parent.clear();
      fine.place.clear();
      break;
    }
    coarsen_supports(fine, coarse);
    hierarchy.levels.push_back(std::move(coarse));
  }
}

bool has_all_levels(const Hierarchy& hierarchy, const HierarchyOptions& options) {
  const std::vector<Level>& levels = hierarchy.levels;
  for (std::size_t l = 0; l + 1 < levels.size(); ++l)
    if (!may_coarsen(levels[l], l + 1, options) ||
        !worth_coarsening(levels[l], levels[l + 1], l + 1))
      return false;
  if (!may_coarsen(levels.back(), levels.size(), options)) return true;
  Level last = levels.back();
  const Level next = build_above(last, levels.size(), options);
  return !worth_coarsening(last, next, levels.size());
}

}  // namespace kerf
