// SPDX-License-Identifier: MIT
//
// Vertices, hanging corners and coarse levels against brute force over finest links, and against
// two cases drawn by hand (the pictures of figures 5 and 6 of [DGW11] show cases of the same kind).
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <string>

#include "core/base/error.hpp"
#include "core/levels/colours.hpp"
#include "core/levels/corners.hpp"
#include "core/levels/hierarchy.hpp"
#include "tests/oracle/levels_oracle.hpp"
#include "tests/support/scenes.hpp"

namespace kerf {
namespace {

using oracle::Grid;

// Random values of size 1 summed over at most 8 corners.
constexpr double kRounding = 1e-14;

Hierarchy hierarchy_of(const LinkedOctree& body, int coarsest_vertices, bool duplicate = true) {
  Hierarchy h;
  h.spacing = body.lattice().spacing;
  h.levels.push_back(finest_level(body));
  build_coarse_levels(h, {coarsest_vertices, 0, duplicate});
  return h;
}

/// Two (leaf, corner) pairs share a vertex iff the octants around their grid point are joined.
void expect_vertices_by_octants(const LinkedOctree& body, const Level& level) {
  const oracle::Sharing sharing = oracle::share_by_octants(body);
  ASSERT_EQ(sharing.group.size(), level.corner.size());
  std::map<int, int> vertex_of, group_of;
  for (std::size_t c = 0; c < sharing.group.size(); ++c)
    for (std::size_t i = 0; i < 8; ++i) {
      ASSERT_EQ(sharing.hangs[c][i], ((level.fold[c] >> i) & 1) != 0) << "cell " << c;
      if (sharing.hangs[c][i]) continue;
      const int group = sharing.group[c][i], vertex = level.slots[c][i];
      ASSERT_EQ(vertex_of.emplace(group, vertex).first->second, vertex) << "cell " << c;
      ASSERT_EQ(group_of.emplace(vertex, group).first->second, group) << "cell " << c;
    }
  ASSERT_EQ(group_of.size(), level.point.size());
}

/// The value at every corner, hanging ones from the larger cell's own vertices.
void expect_corner_values(const Level& level, const Grid& grid) {
  test::Dice dice(7);
  std::vector<double> values(3 * level.point.size());
  for (double& x : values) x = dice.between(-1, 1);
  for (std::int32_t c = 0; c < level.cells(); ++c) {
    Vec3d corners[8];
    corner_values(level, c, values, corners);
    for (std::size_t i = 0; i < 8; ++i)
      for (int d = 0; d < 3; ++d) {
        double expected = 0;
        for (const auto& [v, w] : grid.corner[c][i]) expected += w * values[3 * v + d];
        ASSERT_NEAR(corners[i][d], expected, kRounding) << "cell " << c << ", corner " << i;
      }
  }
}

/// No cell touches one of more than twice or less than half its size, linked or not.
void expect_two_to_one(const Grid& grid) {
  // Two cubes that touch have a point in common that is a corner of the smaller one.
  std::map<Vec3i, std::pair<int, int>> sizes;
  for (const oracle::Cell& cell : grid.cells)
    for (int i = 0; i < 8; ++i)
      sizes[{cell.corner[0] + (i & 1) * cell.size, cell.corner[1] + (i >> 1 & 1) * cell.size,
             cell.corner[2] + (i >> 2) * cell.size}] = {1 << 30, 0};
  for (const oracle::Cell& cell : grid.cells) {
    const int n = cell.size + 1;
    for (int k = 0; k < n * n * n; ++k) {
      const auto at = sizes.find(
          {cell.corner[0] + k % n, cell.corner[1] + k / n % n, cell.corner[2] + k / n / n});
      if (at == sizes.end()) continue;
      at->second.first = std::min(at->second.first, cell.size);
      at->second.second = std::max(at->second.second, cell.size);
    }
  }
  for (const auto& [p, size] : sizes)
    ASSERT_LE(size.second, 2 * size.first) << p[0] << ' ' << p[1] << ' ' << p[2];
}

void expect_valid_colours(const Level& level) {
  std::vector<int> colour(level.point.size(), -1);
  const Colours colours = colour_vertices(level);
  for (int c = 0; c < colours.count(); ++c) {
    ASSERT_LT(colours.begin[c], colours.begin[c + 1]) << "an empty colour";
    for (std::int32_t k = colours.begin[c]; k < colours.begin[c + 1]; ++k) {
      ASSERT_EQ(colour[colours.order[k]], -1) << "a vertex of two colours";
      colour[colours.order[k]] = c;
    }
  }
  for (const auto& slots : level.slots)
    for (std::size_t i = 0; i < 8; ++i)
      for (std::size_t j = 0; j < i; ++j) ASSERT_NE(colour[slots[i]], colour[slots[j]]);
  ASSERT_EQ(std::count(colour.begin(), colour.end(), -1), 0);
}

/// Incidences and children are the other direction of slots and parents, ascending.
void expect_indices_agree(const Hierarchy& h) {
  for (std::size_t l = 0; l < h.levels.size(); ++l) {
    const Level& level = h.levels[l];
    std::set<std::array<std::int32_t, 2>> expected, found;
    for (std::int32_t c = 0; c < level.cells(); ++c)
      for (std::int32_t i = 0; i < 8; ++i) expected.insert({level.slots[c][i], 8 * c + i});
    std::size_t entries = 0;
    for (std::int32_t v = 0; v < level.vertices(); ++v) {
      const auto row = level.incidences_of(v);
      ASSERT_TRUE(std::is_sorted(row.begin(), row.end()));
      for (const std::int32_t k : row) found.insert({v, k});
      entries += row.size();
    }
    ASSERT_EQ(found, expected);
    ASSERT_EQ(entries, expected.size());
    if (l == 0) continue;
    const Level& fine = h.levels[l - 1];
    std::vector<int> seen(fine.corner.size(), 0);
    for (std::int32_t c = 0; c < level.cells(); ++c) {
      const auto row = level.children_of(c);
      ASSERT_FALSE(row.empty());
      ASSERT_TRUE(std::is_sorted(row.begin(), row.end()));
      for (const std::int32_t child : row) {
        ASSERT_EQ(fine.parent[child], c);
        ++seen[child];
      }
    }
    ASSERT_EQ(std::count(seen.begin(), seen.end(), 1), static_cast<int>(seen.size()));
  }
}

/// Only cells of side 2^l merge; the others are their own parents.
void expect_pass_through(const Level& fine, const Level& coarse, int log2) {
  for (std::int32_t c = 0; c < fine.cells(); ++c) {
    const std::int32_t p = fine.parent[c];
    const bool passes = fine.size_log2[c] > log2;
    ASSERT_EQ(fine.place[c] == Level::kPassed, passes);
    ASSERT_EQ(coarse.size_log2[p], fine.size_log2[c] + (passes ? 0 : 1));
    int octant = 0;
    for (std::size_t d = 0; d < 3; ++d) {
      if (fine.corner[c][d] != coarse.corner[p][d]) octant |= 1 << d;
    }
    ASSERT_EQ(passes ? 0 : fine.place[c], octant);
  }
}

void expect_all(const LinkedOctree& body, bool duplicate = true) {
  const Hierarchy h = hierarchy_of(body, 8, duplicate);
  ASSERT_NO_FATAL_FAILURE(expect_vertices_by_octants(body, h.levels[0]));
  std::vector<Grid> grids;
  ASSERT_NO_THROW(grids = oracle::grids_like(body, h, duplicate));
  ASSERT_NO_FATAL_FAILURE(expect_indices_agree(h));
  for (std::size_t l = 0; l < h.levels.size(); ++l) {
    SCOPED_TRACE(::testing::Message() << "level " << l);
    ASSERT_NO_FATAL_FAILURE(expect_corner_values(h.levels[l], grids[l]));
    ASSERT_NO_FATAL_FAILURE(expect_two_to_one(grids[l]));
    ASSERT_NO_FATAL_FAILURE(expect_valid_colours(h.levels[l]));
    if (l == 0) continue;
    ASSERT_NO_FATAL_FAILURE(
        expect_pass_through(h.levels[l - 1], h.levels[l], static_cast<int>(l) - 1));
    ASSERT_EQ(oracle::parents(grids[l - 1], grids[l]),
              std::vector<int>(h.levels[l - 1].parent.begin(), h.levels[l - 1].parent.end()));
    ASSERT_NO_THROW(oracle::prolongation(grids[l - 1], grids[l]));
  }
}

class LevelsOfScene : public ::testing::TestWithParam<const char*> {};

TEST_P(LevelsOfScene, AreThoseOfTheLinks) { expect_all(test::scene(GetParam())); }

TEST_P(LevelsOfScene, MergedByPlaceAreThoseOfTheBlocks) {
  expect_all(test::scene(GetParam()), false);
}

INSTANTIATE_TEST_SUITE_P(Levels, LevelsOfScene,
                         ::testing::Values("one_cell", "uniform", "octree1", "octree2", "octree3",
                                           "ball", "limbs", "floating", "bar", "half_cut",
                                           "crossed", "arc"),
                         [](const auto& scene) { return std::string(scene.param); });

// What the scenes are for; operators are tested on the same ones.
TEST(Levels, ScenesHaveTheirFeatures) {
  const auto hanging = [](const Level& level) {
    return std::count_if(level.fold.begin(), level.fold.end(),
                         [](auto f) { return (f & 255) != 0; });
  };
  const auto shares_a_place = [](const Level& level) {
    return std::adjacent_find(level.point.begin(), level.point.end()) != level.point.end();
  };
  const auto duplicates = [](const Level& level) {
    return std::adjacent_find(level.corner.begin(), level.corner.end()) != level.corner.end();
  };
  for (const char* name : {"octree1", "octree2", "octree3", "half_cut", "arc", "limbs"})
    EXPECT_GT(hanging(finest_level(test::scene(name))), 0) << name;
  for (const char* name : {"octree2", "octree3"})
    EXPECT_GT(hanging(hierarchy_of(test::scene(name), 8).levels[1]), 0) << name;
  for (const char* name : {"bar", "half_cut", "crossed", "arc", "limbs"}) {
    const Hierarchy h = hierarchy_of(test::scene(name), 8);
    EXPECT_TRUE(shares_a_place(h.levels[0])) << name;
    EXPECT_TRUE(std::any_of(h.levels.begin(), h.levels.end(), duplicates)) << name;
  }
}

TEST(Levels, OfRandomCutsAreThoseOfTheLinks) {
  constexpr std::uint64_t kFirstSeed = 1105, kBodies = 25;
  for (std::uint64_t seed = kFirstSeed; seed < kFirstSeed + kBodies; ++seed) {
    SCOPED_TRACE(::testing::Message() << "seed " << seed);
    ASSERT_NO_FATAL_FAILURE(expect_all(test::randomly_cut(seed)));
  }
}

TEST(Levels, UniformBodiesNeedEightColours) {
  for (const char* name : {"uniform", "floating", "bar"}) {
    const Hierarchy h = hierarchy_of(test::scene(name), 8);
    for (const Level& level : h.levels) EXPECT_EQ(colour_vertices(level).count(), 8) << name;
  }
}

// ---- By hand ------------------------------------------------------------------------------------

using Links = std::vector<std::array<int, 3>>;  // {a, b, axis}

Links link_list(const Level& level) {
  Links out;
  for (const CellLink& link : links_of(level)) out.push_back({link.a, link.b, link.axis});
  return out;
}

// A slab of 6 x 4 x 1 cells, cut along an L (cell numbers as in leaves(): x, then y):
//
//     y=3   18  19  20 | 21  22  23       The upright of the L cuts the links along x between
//     y=2   12  13  14 | 15  16  17       x = 2 and 3 for y = 1, 2, 3; its foot the links along y
//     y=1    6   7   8 |  9  10  11       between y = 0 and 1 for x = 3, 4. Cell 11 stays joined
//                      +--------          to cell 5.
//     y=0    0   1   2    3   4   5
//           |-------|-------|-------|     blocks of 2^3, two rows of three
//
// Level 1. The upright runs inside the middle blocks, the foot's end inside the last one:
//   A = 0 {0 1 6 7}    B = 1 {2 3 8}  and  B' = 2 {9}          C = 3 {4 5 10 11}, over 5 and 11
//   D = 4 {12 13 18 19}  E = 5 {14 20}  and  E' = 6 {15 21}    F = 7 {16 17 22 23}
// Level 2, blocks of 4^3:  G = 0 {A B D E}  and  G' = 1 {B' E'};   H = 2 {C F}
// Level 3, one block: G - H - G' is joined, and the cut is seen no more.
LinkedOctree slab_with_l() {
  LinkedOctree body(test::box_body({6, 4, 1}), 0);
  for (int y = 1; y <= 3; ++y) test::disconnect(body, {2, y, 0}, 0);
  for (int x = 3; x <= 4; ++x) test::disconnect(body, {x, 0, 0}, 1);
  return body;
}

TEST(LevelsByHand, SlabWithAnL) {
  const Hierarchy h = hierarchy_of(slab_with_l(), 8);
  ASSERT_EQ(h.levels.size(), 4u);
  EXPECT_EQ(h.levels[0].parent, (std::vector<std::int32_t>{0, 0, 1, 1, 3, 3, 0, 0, 1, 2, 3, 3,
                                                           4, 4, 5, 6, 7, 7, 4, 4, 5, 6, 7, 7}));
  EXPECT_EQ(h.levels[1].parent, (std::vector<std::int32_t>{0, 0, 1, 2, 0, 0, 1, 2}));
  EXPECT_EQ(h.levels[2].parent, (std::vector<std::int32_t>{0, 0, 0}));
  EXPECT_EQ(h.levels[1].corner[1], h.levels[1].corner[2]);  // B and B' share their place
  EXPECT_EQ(h.levels[2].corner[0], h.levels[2].corner[1]);
  EXPECT_EQ(link_list(h.levels[1]), (Links{{0, 1, 0},     // A-B  over 1-2
                                           {0, 4, 1},     // A-D
                                           {1, 3, 0},     // B-C  over 3-4
                                           {1, 5, 1},     // B-E  over 8-14
                                           {2, 3, 0},     // B'-C over 9-10
                                           {2, 6, 1},     // B'-E' over 9-15
                                           {3, 7, 1},     // C-F
                                           {4, 5, 0},     // D-E
                                           {6, 7, 0}}));  // E'-F over 15-16; E has no link to E', F
  EXPECT_EQ(link_list(h.levels[2]), (Links{{0, 2, 0}, {1, 2, 0}}));
  EXPECT_TRUE(link_list(h.levels[3]).empty());

  // Of 7 x 5 grid points in a plane, those on the L have two vertices, but not its tip (5, 1):
  // (3, 4), (3, 3), (3, 2), the bend (3, 1), and (4, 1). Two planes.
  EXPECT_EQ(h.levels[0].vertices(), 2 * (7 * 5 + 5));
  // Level 1, 4 x 3 grid points: {A B} and {B'}; {A B D E} and {B' E'}; {D E} and {E'}; {E} and
  // {E' F}. Around the point between B, C, E, F all meet in C and F.
  EXPECT_EQ(h.levels[1].vertices(), 2 * (4 * 3 + 4));
  // Level 2, 3 x 2: the two points of G and G' at x = 0; at x = 4 both are joined to H.
  EXPECT_EQ(h.levels[2].vertices(), 2 * (3 * 2 + 2));
  EXPECT_EQ(h.levels[3].vertices(), 8);
}

TEST(LevelsByHand, SlabWithAnLMergedByPlace) {
  const Hierarchy h = hierarchy_of(slab_with_l(), 8, false);
  ASSERT_EQ(h.levels.size(), 4u);
  EXPECT_EQ(h.levels[1].cells(), 6);
  EXPECT_EQ(h.levels[1].vertices(), 24);
  EXPECT_EQ(link_list(h.levels[1]).size(), 7u);
  EXPECT_EQ(h.levels[2].cells(), 2);
}

// A box of 10 x 6 x 6 with one level of refinement: 5 x 3 x 3 blocks, and three leaves of side 2
// inside, at (2, 2, 2), (4, 2, 2), (6, 2, 2). An L in the last layer of blocks, seen along y:
//
//     z=5   .   .     .   . |  .          Upright: links along x between x = 8 and 9, z >= 2, all
//     y.
//      :                    |             Foot: links along z between z = 1 and 2 at x = 9, y <= 3.
//     z=2   .  ###   ###  . |  .          So the part x = 9, z >= 2 hangs on the two columns
//                           +----         y = 4, 5 alone. ### are the larger leaves.
//     z=1   .   .     .   .    .
//     z=0   .   .     .   .    .
//         x=0           x=8  x=9
//
// Level 1: the blocks bx = 4, bz = 1, 2 fall apart into a left (x = 8) and a right part, 6 more
//   cells than blocks. The three larger leaves pass through.
// Level 2: blocks of 4^3, 3 x 2 x 2. At bx = 2 the block (by, bz) = (0, 0) holds rights that no
// link
//   inside it joins to the base, (0, 1) and (1, 1) hold no base: two cells each. In (1, 0) the foot
//   is open: one cell.
// Level 3: 2 blocks of 8^3, and the cut is seen no more.
TEST(LevelsByHand, OctreeWithAnL) {
  LinkedOctree body(test::box_body({10, 6, 6}), 1);
  for (int y = 0; y < 6; ++y)
    for (int z = 2; z < 6; ++z) test::disconnect(body, {8, y, z}, 0);
  for (int y = 0; y < 4; ++y) test::disconnect(body, {9, y, 1}, 2);
  const Hierarchy h = hierarchy_of(body, 12);
  ASSERT_EQ(h.levels.size(), 4u);

  EXPECT_EQ(h.levels[0].cells(), 42 * 8 + 3);
  EXPECT_EQ(h.levels[1].cells(), 5 * 3 * 3 + 6);
  EXPECT_EQ(h.levels[2].cells(), 3 * 2 * 2 + 3);
  EXPECT_EQ(h.levels[3].cells(), 2);

  // Larger leaves come last. Each hides 1 grid point inside; the 3 x 3 x 7 points of all three
  // have 16 corners, 3 such, and 44 that hang.
  const Level &fine = h.levels[0], &one = h.levels[1];
  for (std::int32_t c = fine.cells() - 3; c < fine.cells(); ++c)
    EXPECT_EQ(fine.place[c], Level::kPassed);
  // 11 x 7 x 7 grid points, less those, and one more where the L is open. Upright, x = 9: 7 points
  // in y, 4 in z (3 .. 6). Bend, x = 9, z = 2, and foot, x = 10, z = 2: y = 0 .. 3; at y = 4 the
  // cells of y = 4 join those above the foot to those below.
  const int split_upright = 7 * 4, split_bend = 4, split_foot = 4;
  EXPECT_EQ(fine.vertices(), 11 * 7 * 7 - 3 - 44 + split_upright + split_bend + split_foot);

  // Links along x: 4 x 9 between blocks. Along y: 2 x 3 in each of four layers; in the last 2 for
  // bz = 0, and 4 each for bz = 1, 2. Along z: 2 x 3 in each of four; in the last 3 to the left
  // parts, 1 to a right part where the foot is open, and 6 above.
  std::array<int, 3> count{};
  for (const CellLink& link : links_of(one)) ++count[link.axis];
  EXPECT_EQ(count, (std::array<int, 3>{36, 34, 34}));
  EXPECT_EQ(link_list(h.levels[3]).size(), 1u);
}

// ---- Supports -----------------------------------------------------------------------------------

TEST(Levels, CoarseComponentIsHeldIffAllThatItMovesAreHeld) {
  for (const char* name : {"uniform", "octree2", "limbs", "half_cut", "crossed"}) {
    SCOPED_TRACE(name);
    const LinkedOctree body = test::scene(name);
    Hierarchy h;
    h.levels.push_back(finest_level(body));
    Level& finest = h.levels[0];
    test::Dice dice(3);
    // Held in x within a slab that no coarse grid agrees with; the rest here and there.
    for (std::int32_t v = 0; v < finest.vertices(); ++v)
      finest.fixed[v] =
          static_cast<std::uint8_t>((finest.point[v][0] <= 3 ? 1 : 0) |
                                    (finest.point[v][1] >= 5 || dice.roll(2) == 0 ? 2 : 0) |
                                    (finest.point[v][0] <= 5 && finest.point[v][2] <= 3 ? 4 : 0));
    build_coarse_levels(h, {8, 0, true});
    std::vector<Grid> grids;
    ASSERT_NO_THROW(grids = oracle::grids_like(body, h));
    int held = 0;
    for (std::size_t l = 1; l < h.levels.size(); ++l) {
      std::vector<std::uint8_t> expected(h.levels[l].point.size(), 7);
      const auto P = oracle::prolongation(grids[l - 1], grids[l]);
      for (std::size_t v = 0; v < P.size(); ++v)
        for (const auto& entry : P[v]) expected[entry.first] &= h.levels[l - 1].fixed[v];
      EXPECT_EQ(h.levels[l].fixed, expected) << "level " << l;
      held += static_cast<int>(
          std::count_if(expected.begin(), expected.end(), [](auto bits) { return bits != 0; }));
    }
    EXPECT_GT(held, 0);
  }
}

TEST(Levels, MoreCellsThanCornersHaveNumbersForAreAnErrorThatSaysHowManyMayBe) {
  EXPECT_NO_THROW(check_cell_count(268435455));
  try {
    check_cell_count(268435456);
    FAIL() << "their corners have no numbers";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::unavailable);
    EXPECT_NE(std::string(error.what()).find("at most 268435455"), std::string::npos);
  }
}

TEST(CellValueList, HoldsAnyNumberOfKinds) {
  const auto value = [](std::size_t kind) { return CellValues{1.0 + double(kind), 0.5, 3}; };
  for (const std::size_t kinds : {1u, 255u, 256u, 257u, 1000u}) {
    CellValueList list;
    list.resize(300, value(0));
    for (std::size_t i = 0; i < 300; ++i) list.set(i, value(7 * i % kinds));
    for (std::size_t i = 300; i < 2000; ++i) list.push_back(value(7 * i % kinds));
    list.resize(2100, value(kinds - 1));
    ASSERT_EQ(list.size(), 2100u);
    for (std::size_t i = 0; i < 2000; ++i) ASSERT_EQ(list[i], value(7 * i % kinds)) << i;
    for (std::size_t i = 2000; i < 2100; ++i) ASSERT_EQ(list[i], value(kinds - 1)) << i;
    list.clear();
    for (const std::size_t kind : {kinds - 1, std::size_t{2000}, std::size_t{0}})
      list.push_back(value(kind));
    EXPECT_EQ(list[0], value(kinds - 1));
    EXPECT_EQ(list[1], value(2000));
    EXPECT_EQ(list[2], value(0));
  }
}

TEST(LatticePoint, HoldsTheWholeLattice) {
  constexpr std::int32_t kLast = (1 << 21) - 1;
  const std::vector<Vec3i> all{
      {0, 0, 0}, {kLast, 0, 1}, {0, kLast, 2}, {3, 0, kLast}, {kLast, kLast, kLast}};
  const std::vector<LatticePoint> points(all.begin(), all.end());
  for (std::size_t i = 0; i < all.size(); ++i) {
    EXPECT_EQ(Vec3i(points[i]), all[i]);
    for (std::size_t axis = 0; axis < 3; ++axis) EXPECT_EQ(points[i][axis], all[i][axis]);
    EXPECT_TRUE(points[i] == all[i]);
    EXPECT_FALSE(points[i] == all[(i + 1) % all.size()]);
  }
}

TEST(NodeList, AreStoredOnceOneIsAnother) {
  NodeList nodes;
  for (std::int32_t n = 0; n < 9; ++n) nodes.push_back(n);
  EXPECT_EQ(nodes.bytes(), 0u);
  nodes.set(4, 4);
  EXPECT_EQ(nodes.bytes(), 0u);
  nodes.set(4, 20);
  nodes.push_back(9);
  EXPECT_GT(nodes.bytes(), 0u);
  const std::vector<std::int32_t> expected{0, 1, 2, 3, 20, 5, 6, 7, 8, 9};
  EXPECT_EQ(std::vector<std::int32_t>(nodes.begin(), nodes.end()), expected);

  NodeList others;
  for (const std::int32_t n : {3, 1}) others.push_back(n);
  EXPECT_EQ(others[0], 3);
  EXPECT_EQ(others[1], 1);
}

}  // namespace
}  // namespace kerf
