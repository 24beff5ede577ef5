// SPDX-License-Identifier: MIT
//
// Whether two hierarchies are the same but for the numbers of cells and vertices, and whether a
// change tells all that became different.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "core/levels/update.hpp"

namespace kerf::test {

using Map = std::vector<std::int32_t>;

/// Sets map[a] = b, both of which must not stand for anything else.
inline bool maps(Map& map, Map& back, std::int32_t a, std::int32_t b) {
  if (map[a] < 0 && back[b] < 0) {
    map[a] = b;
    back[b] = a;
  }
  return map[a] == b && back[b] == a;
}

/// A list of `key * 8 + k` with other keys, ascending.
inline std::vector<std::int32_t> mapped(std::span<const std::int32_t> row, const Map& map) {
  std::vector<std::int32_t> out;
  for (const std::int32_t item : row) out.push_back(8 * map[item / 8] + item % 8);
  std::sort(out.begin(), out.end());
  return out;
}
inline std::vector<std::int32_t> list(std::span<const std::int32_t> row) {
  return {row.begin(), row.end()};
}

/// One level, whose cells `cell` maps to those of the other.
inline void expect_same_level(const Level& a, const Level& b, const Map& cell) {
  ASSERT_EQ(a.cells(), b.cells());
  ASSERT_EQ(a.vertices(), b.vertices());
  Map vertex(a.point.size(), -1), back(a.point.size(), -1);
  for (std::int32_t c = 0; c < a.cells(); ++c) {
    ASSERT_EQ(a.corner[c], b.corner[cell[c]]) << "cell " << c;
    ASSERT_EQ(a.size_log2[c], b.size_log2[cell[c]]) << "cell " << c;
    ASSERT_EQ(a.fold[c], b.fold[cell[c]]) << "cell " << c;
    for (std::size_t i = 0; i < 8; ++i)
      ASSERT_TRUE(maps(vertex, back, a.slots[c][i], b.slots[cell[c]][i]))
          << "cell " << c << ", slot " << i;
    ASSERT_TRUE(std::is_sorted(a.links_of(c).begin(), a.links_of(c).end()));
    ASSERT_EQ(mapped(a.links_of(c), cell), list(b.links_of(cell[c]))) << "cell " << c;
  }
  ASSERT_EQ(std::count(vertex.begin(), vertex.end(), -1), 0) << "a vertex without cells";
  for (std::int32_t v = 0; v < a.vertices(); ++v) {
    ASSERT_EQ(a.point[v], b.point[vertex[v]]) << "vertex " << v;
    ASSERT_EQ(a.fixed[v], b.fixed[vertex[v]]) << "vertex " << v;
    const auto row = a.incidences_of(v);
    ASSERT_TRUE(std::is_sorted(row.begin(), row.end()));
    ASSERT_EQ(mapped(row, cell), list(b.incidences_of(vertex[v]))) << "vertex " << v;
  }
}

/// Cells of level 0 have the same numbers in both.
inline void expect_same_hierarchy(const Hierarchy& a, const Hierarchy& b) {
  ASSERT_EQ(a.levels.size(), b.levels.size());
  ASSERT_EQ(a.levels[0].cells(), b.levels[0].cells());
  Map cell(a.levels[0].corner.size());
  for (std::size_t c = 0; c < cell.size(); ++c) cell[c] = static_cast<std::int32_t>(c);
  for (std::size_t l = 0; l < a.levels.size(); ++l) {
    SCOPED_TRACE(::testing::Message() << "level " << l);
    const Level &x = a.levels[l], &y = b.levels[l];
    ASSERT_NO_FATAL_FAILURE(expect_same_level(x, y, cell));
    ASSERT_EQ(x.parent.size(), y.parent.size());
    ASSERT_EQ(x.place.size(), y.place.size());
    if (l + 1 == a.levels.size()) break;
    const Level& coarse = a.levels[l + 1];
    ASSERT_EQ(coarse.cells(), b.levels[l + 1].cells());
    Map above(coarse.corner.size(), -1), back(coarse.corner.size(), -1);
    for (std::int32_t c = 0; c < x.cells(); ++c) {
      ASSERT_EQ(x.place[c], y.place[cell[c]]) << "cell " << c;
      ASSERT_TRUE(maps(above, back, x.parent[c], y.parent[cell[c]])) << "cell " << c;
    }
    std::size_t children = 0;
    for (std::int32_t c = 0; c < coarse.cells(); ++c) {
      const auto row = coarse.children_of(c);
      ASSERT_TRUE(std::is_sorted(row.begin(), row.end()));
      for (const std::int32_t child : row) ASSERT_EQ(x.parent[child], c);
      children += row.size();
    }
    ASSERT_EQ(children, x.corner.size());
    cell = above;
  }
}

inline void expect_listed(const Level& before, const Level& after, const LevelChange& change) {
  ASSERT_EQ(change.cells_before, before.cells());
  ASSERT_EQ(change.vertices_before, before.vertices());
  ASSERT_EQ(change.origin.size(), after.corner.size() - before.corner.size());
  ASSERT_TRUE(std::is_sorted(change.cells.begin(), change.cells.end()));
  ASSERT_TRUE(std::is_sorted(change.vertices.begin(), change.vertices.end()));
  for (const std::int32_t c : change.origin) ASSERT_LT(c, before.cells());
  const auto is_listed = [](const std::vector<std::int32_t>& all, std::int32_t i) {
    return std::binary_search(all.begin(), all.end(), i);
  };
  for (std::int32_t c = 0; c < before.cells(); ++c) {
    const CellBefore was = change.cell_before(after, c);
    ASSERT_EQ(was.corner, before.corner[c]);
    ASSERT_EQ(was.size_log2, before.size_log2[c]);
    ASSERT_EQ(was.fold, before.fold[c]);
    ASSERT_EQ(was.slots, before.slots[c]);
    if (is_listed(change.cells, c)) continue;
    ASSERT_EQ(after.corner[c], before.corner[c]);
    ASSERT_EQ(after.size_log2[c], before.size_log2[c]);
    if (!before.parent.empty()) {
      ASSERT_EQ(after.parent[c], before.parent[c]) << "cell " << c;
      ASSERT_EQ(after.place[c], before.place[c]);
    }
    if (before.child_begin.empty()) continue;
    ASSERT_EQ(list(after.children_of(c)), list(before.children_of(c))) << "cell " << c;
  }
  for (std::int32_t c = before.cells(); c < after.cells(); ++c)
    ASSERT_TRUE(is_listed(change.cells, c));
  for (std::int32_t v = 0; v < after.vertices(); ++v) {
    if (is_listed(change.vertices, v)) continue;
    ASSERT_LT(v, before.vertices());
    ASSERT_EQ(after.point[v], before.point[v]);
    ASSERT_EQ(after.fixed[v], before.fixed[v]);
    ASSERT_EQ(list(after.incidences_of(v)), list(before.incidences_of(v))) << "vertex " << v;
  }
}

/// The change lists all that differs, and the parents of the cells that it lists.
inline void expect_change_tells_all(const Hierarchy& before, const Hierarchy& after,
                                    const HierarchyChange& change) {
  ASSERT_EQ(change.levels.size(), after.levels.size());
  for (std::size_t l = 0; l < change.levels.size(); ++l) {
    SCOPED_TRACE(::testing::Message() << "change of level " << l);
    ASSERT_NO_FATAL_FAILURE(expect_listed(before.levels[l], after.levels[l], change.levels[l]));
    if (l + 1 == change.levels.size()) break;
    const std::vector<std::int32_t>& above = change.levels[l + 1].cells;
    for (const std::int32_t c : change.levels[l].cells)
      ASSERT_TRUE(std::binary_search(above.begin(), above.end(), after.levels[l].parent[c]));
  }
}

}  // namespace kerf::test
