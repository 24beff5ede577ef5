// SPDX-License-Identifier: MIT
#include "core/levels/hierarchy.hpp"

#include <algorithm>
#include <numeric>
#include <tuple>

#include "core/base/error.hpp"
#include "core/body/pieces.hpp"
#include "core/levels/union_find.hpp"
#include "kernels/transfer.hpp"

namespace kerf {
namespace {

template <class T>
std::size_t bytes_of(const std::vector<T>& v) {
  return v.capacity() * sizeof(T);
}

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
    for (const CellLink& link : fine.links)
      if (merges(link.a) && merges(link.b) && same_block(link.a, link.b))
        sets.unite(link.a, link.b);
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
  std::vector<std::int32_t> coarse_of(fine.corner.size(), -1);
  for (const Entry& e : entries) {
    coarse_of[e.first] = coarse.cells();
    coarse.corner.push_back(e.corner);
    coarse.size_log2.push_back(e.size_log2);
  }
  fine.parent.resize(fine.corner.size());
  fine.place.resize(fine.corner.size());
  coarse.child_begin.assign(entries.size() + 1, 0);
  for (std::int32_t c = 0; c < fine.cells(); ++c) {
    fine.parent[c] = coarse_of[group[c]];
    int octant = 0;
    for (int d = 0; d < 3; ++d) octant |= ((fine.corner[c][d] >> log2) & 1) << d;
    fine.place[c] = fine.size_log2[c] == log2 ? static_cast<std::uint8_t>(octant) : Level::kPassed;
    ++coarse.child_begin[fine.parent[c] + 1];
  }
  for (std::size_t i = 0; i < entries.size(); ++i)
    coarse.child_begin[i + 1] += coarse.child_begin[i];
  coarse.children.resize(fine.corner.size());
  std::vector<std::int32_t> next(coarse.child_begin.begin(), coarse.child_begin.end() - 1);
  for (std::int32_t c = 0; c < fine.cells(); ++c) coarse.children[next[fine.parent[c]]++] = c;
  return coarse;
}

void sort_links(std::vector<CellLink>& links) {
  const auto key = [](const CellLink& l) { return std::tuple(l.a, l.b, l.axis); };
  std::sort(links.begin(), links.end(), [&](auto& x, auto& y) { return key(x) < key(y); });
  links.erase(
      std::unique(links.begin(), links.end(), [&](auto& x, auto& y) { return key(x) == key(y); }),
      links.end());
}

void coarsen_links(const Level& fine, Level& coarse) {
  for (const CellLink& link : fine.links) {
    const std::int32_t a = fine.parent[link.a], b = fine.parent[link.b];
    if (a != b) coarse.links.push_back({a, b, link.axis});
  }
  sort_links(coarse.links);
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
  for (const std::int32_t a : order)
    for (std::uint8_t axis = 0; axis < 3; ++axis) {
      Vec3i p = coarse.corner[a];
      p[axis] += 1 << log2;
      const auto b = std::lower_bound(order.begin(), order.end(), p, less);
      if (b != order.end() && coarse.corner[*b] == p) coarse.links.push_back({a, *b, axis});
    }
  sort_links(coarse.links);
}

void coarsen_supports(const Level& fine, Level& coarse) {
  std::fill(coarse.fixed.begin(), coarse.fixed.end(), std::uint8_t{7});
  for (std::int32_t c = 0; c < fine.cells(); ++c) {
    const std::int32_t parent = fine.parent[c];
    double w[8][8];
    kernels::transfer_weights(fine.fold[c], fine.place[c], coarse.fold[parent], w);
    for (int i = 0; i < 8; ++i)
      for (int m = 0; m < 8; ++m)
        if (w[i][m] != 0) coarse.fixed[coarse.slots[parent][m]] &= fine.fixed[fine.slots[c][i]];
  }
}

}  // namespace

std::size_t Level::bytes() const {
  return bytes_of(corner) + bytes_of(size_log2) + bytes_of(parent) + bytes_of(place) +
         bytes_of(fold) + bytes_of(slots) + bytes_of(links) + bytes_of(child_begin) +
         bytes_of(children) + bytes_of(point) + bytes_of(fixed) + bytes_of(incidence_begin) +
         bytes_of(incidence) + bytes_of(colour_begin) + bytes_of(colour_order);
}

std::size_t Hierarchy::bytes() const {
  std::size_t sum = bytes_of(values);
  for (const Level& level : levels) sum += level.bytes();
  return sum;
}

Level finest_level(const LinkedOctree& body) {
  Level level;
  for (const std::int32_t leaf : body.leaves()) {
    const LinkedOctree::Node& cell = body.nodes()[leaf];
    level.corner.push_back(cell.corner);
    level.size_log2.push_back(cell.size_log2);
  }
  for (const LeafLink& link : leaf_links(body)) level.links.push_back({link.a, link.b, link.axis});
  build_vertices(level);
  return level;
}

void build_coarse_levels(Hierarchy& hierarchy, const HierarchyOptions& options) {
  expects(!hierarchy.levels.empty(), "build_coarse_levels needs level 0");
  hierarchy.levels.resize(1);
  hierarchy.levels[0].parent.clear();
  hierarchy.levels[0].place.clear();
  for (int log2 = 0; log2 < 30; ++log2) {
    Level& fine = hierarchy.levels.back();
    if (fine.vertices() <= options.coarsest_vertices) break;
    if (options.max_levels > 0 && static_cast<int>(hierarchy.levels.size()) >= options.max_levels)
      break;
    Level coarse = merge_cells(fine, log2, options.duplicate_cells);
    coarsen_links(fine, coarse);
    if (!options.duplicate_cells) link_by_place(coarse, log2 + 1);
    build_vertices(coarse);
    // Many small pieces cannot be merged further; the sparse factor handles them well.
    constexpr double kWorthIt = 0.8;
    const bool larger_cells_wait = coarse.size_log2.back() > log2 + 1;
    if (coarse.vertices() > kWorthIt * fine.vertices() && !larger_cells_wait) {
      fine.parent.clear();
      fine.place.clear();
      break;
    }
    coarsen_supports(fine, coarse);
    hierarchy.levels.push_back(std::move(coarse));
  }
}

}  // namespace kerf
