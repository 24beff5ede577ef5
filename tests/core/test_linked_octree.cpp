// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <map>
#include <random>
#include <set>

#include "core/base/error.hpp"
#include "core/body/linked_octree.hpp"
#include "core/body/pieces.hpp"
#include "tests/support/bodies.hpp"
#include "tests/support/octree_invariants.hpp"

namespace kerf {
namespace {

using test::ball_body;
using test::box_body;
using test::halfway;
using test::invariants_hold;
using test::lattice_of;
using test::make_voxels;
using test::plus;

std::size_t connected_links(const LinkedOctree& body) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < body.lattice().cells(); ++i)
    for (int axis = 0; axis < 3; ++axis)
      count += body.connected(body.lattice().cell(i), axis) ? 1 : 0;
  return count;
}

/// Leaves by log2 of their size.
std::map<int, std::size_t> sizes(const LinkedOctree& body) {
  std::map<int, std::size_t> count;
  for (const std::int32_t leaf : body.leaves())
    ++count[body.nodes()[static_cast<std::size_t>(leaf)].size_log2];
  return count;
}

std::set<LinkKey> keys(const LinkedOctree& body) {
  std::set<LinkKey> out;
  for (const auto& entry : body.records()) out.insert(entry.first);
  return out;
}

TEST(LinkedOctree, BlockOfNHasThreeNSquaredNMinusOneLinks) {
  for (const int refinement : {0, 1, 2, 3})
    for (const int n : {1, 2, 5, 8, 16}) {
      const LinkedOctree body(box_body({n, n, n}), refinement);

      EXPECT_EQ(connected_links(body), static_cast<std::size_t>(3 * n * n * (n - 1)));
      EXPECT_EQ(body.records().size(), static_cast<std::size_t>(6 * n * n));
    }
}

TEST(LinkedOctree, HoldsItsInvariantsWhenBuilt) {
  for (const int refinement : {0, 1, 2, 3})
    for (const Voxels& voxels : {ball_body(8), ball_body(24), ball_body(33), box_body({3, 40, 17}),
                                 box_body({1, 1, 1}), test::two_limb_body({16, 8, 24})}) {
      const LinkedOctree body(voxels, refinement);

      EXPECT_TRUE(invariants_hold(body, voxels.label)) << "refinement " << refinement;
      EXPECT_EQ(body.splits().size(), 0u);
    }
}

TEST(LinkedOctree, AdaptiveCellCountsMatchCountsByHand) {
  // 4^3 cells of size 2; all but the inner 2^3 touch the surface: 56 * 8 + 8.
  EXPECT_EQ(sizes(LinkedOctree(box_body({8, 8, 8}), 1)),
            (std::map<int, std::size_t>{{0, 448}, {1, 8}}));
  // Of 4^3 roots of size 4 the outer 56 are split; of 8^3 cells of size 2 the outer 8^3 - 6^3 =
  // 296.
  EXPECT_EQ(sizes(LinkedOctree(box_body({16, 16, 16}), 2)),
            (std::map<int, std::size_t>{{0, 2368}, {1, 448 - 296}, {2, 8}}));
}

TEST(LinkedOctree, CutSplitsWhatBalanceAndItsNeighbourhoodAskFor) {
  // 6^3 roots of size 4, the inner 64 whole. The 18 cells around the link (8,9,9)-(9,9,9) lie in
  // four cells of size 2 at the low x side of root (2,2,2); these touch the 2 x 3 x 3 roots around.
  const Voxels voxels = box_body({24, 24, 24});
  LinkedOctree body(voxels, 2);
  const std::size_t finest = 8 * (12 * 12 * 12 - 10 * 10 * 10), middle = 8 * 152 - 728;
  ASSERT_EQ(sizes(body), (std::map<int, std::size_t>{{0, finest}, {1, middle}, {2, 64}}));

  EXPECT_TRUE(body.disconnect({8, 9, 9}, 0, halfway(body.lattice(), 0, 1)));

  EXPECT_EQ(sizes(body),
            (std::map<int, std::size_t>{{0, finest + 32}, {1, middle + 18 * 8 - 4}, {2, 64 - 18}}));
  EXPECT_EQ(body.splits().size(), 18u + 4u);
  EXPECT_TRUE(invariants_hold(body, voxels.label));
}

TEST(LinkedOctree, AdaptiveAndUniformHaveTheSameCutLinks) {
  for (const Voxels& voxels : {ball_body(24), test::two_limb_body({16, 8, 24})}) {
    const LinkedOctree uniform(voxels, 0);
    for (const int refinement : {1, 2, 3}) {
      const LinkedOctree body(voxels, refinement);

      EXPECT_EQ(keys(body), keys(uniform));
      EXPECT_LT(body.leaf_count(), uniform.leaf_count());
    }
  }
}

TEST(LinkedOctree, BoxesWithAGapThinnerThanACellStayApart) {
  const Voxels voxels = make_voxels(
      lattice_of({16, 8, 8}), [](const Vec3i&) { return 1; },
      [](const Vec3i& c, int axis) { return axis == 0 && c[0] == 7; });
  for (const int refinement : {0, 1, 2}) {
    const LinkedOctree body(voxels, refinement);

    std::size_t pieces = 0;
    label_pieces(body, &pieces);
    EXPECT_EQ(pieces, 2u);
    EXPECT_TRUE(invariants_hold(body, voxels.label));
  }
}

TEST(LinkedOctree, RefinesAtMaterialJumpsAndKeepsTheirLinksConnected) {
  // Jump between x = 11 and 12 of a 24^3 box: cells of size 2 at x = 10 and 12 are split.
  const Voxels voxels =
      make_voxels(lattice_of({24, 24, 24}), [](const Vec3i& c) { return c[0] < 12 ? 1 : 2; });
  const LinkedOctree body(voxels, 1);

  EXPECT_EQ(sizes(body),
            (std::map<int, std::size_t>{{0, 8 * (728 + 2 * 10 * 10)}, {1, 1000 - 2 * 10 * 10}}));
  EXPECT_EQ(connected_links(body), 3u * 24 * 24 * 23);
  EXPECT_TRUE(invariants_hold(body, voxels.label));
}

TEST(LinkedOctree, LinksToTheOutsideWithoutACrossingAreCutHalfway) {
  Voxels voxels = box_body({4, 4, 4});
  voxels.crossings.clear();
  const LinkedOctree body(voxels, 1);

  const LinkCut* low = body.record({-1, 2, 2}, 0);
  const LinkCut* high = body.record({2, 2, 3}, 2);
  ASSERT_TRUE(low != nullptr && high != nullptr);
  EXPECT_EQ(low->end[1].distance, static_cast<float>(0.5 * body.lattice().spacing));
  EXPECT_EQ(low->end[1].normal, (Vec3f{-1, 0, 0}));
  EXPECT_EQ(high->end[0].normal, (Vec3f{0, 0, 1}));
  EXPECT_TRUE(invariants_hold(body, voxels.label));
}

TEST(LinkedOctree, ListedCrossingsAreKeptAsTheyAre) {
  Voxels voxels = box_body({4, 4, 4});
  for (auto& crossing : voxels.crossings) {
    crossing.second.end[0].distance = 0.01f;
    crossing.second.end[1].distance = 0.06f;
  }
  const LinkedOctree body(voxels, 1);

  ASSERT_EQ(body.records().size(), voxels.crossings.size());
  for (const auto& entry : body.records()) {
    EXPECT_EQ(entry.second.end[0].distance, 0.01f);
    EXPECT_EQ(entry.second.end[1].distance, 0.06f);
  }
}

TEST(LinkedOctree, LinkCutTwiceKeepsTheNearerPointAtEachEnd) {
  LinkedOctree body(box_body({8, 8, 8}), 1);
  LinkCut first = halfway(body.lattice(), 1, 1), second = halfway(body.lattice(), 1, 2);
  first.end[0].distance = 0.01f;
  first.end[1].distance = 0.06f;
  second.end[0].distance = 0.05f;
  second.end[1].distance = 0.02f;

  EXPECT_TRUE(body.disconnect({3, 3, 3}, 1, first));
  EXPECT_FALSE(body.disconnect({3, 3, 3}, 1, second));

  const LinkCut* record = body.record({3, 3, 3}, 1);
  ASSERT_NE(record, nullptr);
  EXPECT_EQ(record->end[0].distance, 0.01f);
  EXPECT_EQ(record->end[0].cut_id, 1);
  EXPECT_EQ(record->end[1].distance, 0.02f);
  EXPECT_EQ(record->end[1].cut_id, 2);
}

TEST(LinkedOctree, HoldsItsInvariantsUnderRandomCutsInAnyOrder) {
  const Voxels voxels = ball_body(40);
  std::mt19937 random(7);
  std::uniform_int_distribution<int> cell(0, 39), axis(0, 2);
  LinkedOctree forward(voxels, 3), backward(voxels, 3);
  std::vector<std::pair<Vec3i, int>> links;
  while (links.size() < 12) {
    const Vec3i c{cell(random), cell(random), cell(random)};
    const int a = axis(random);
    if (forward.leaf_at(c) >= 0 && forward.leaf_at(plus(c, a, 1)) >= 0) links.emplace_back(c, a);
  }

  for (std::size_t i = 0; i < links.size(); ++i) {
    const auto& [c, a] = links[i];
    const auto& [d, b] = links[links.size() - 1 - i];
    forward.disconnect(c, a, halfway(voxels.lattice, a, 1));
    backward.disconnect(d, b, halfway(voxels.lattice, b, 1));
    EXPECT_TRUE(invariants_hold(forward, voxels.label)) << "after link " << i;
  }

  EXPECT_EQ(sizes(forward), sizes(backward));
  EXPECT_EQ(keys(forward), keys(backward));
}

TEST(LinkedOctree, RefinementAtOnePlaceKeepsTheBalance) {
  const Voxels voxels = box_body({64, 64, 64});
  LinkedOctree body(voxels, 4);
  ASSERT_GT(sizes(body)[4], 0u);
  const std::size_t before = body.leaf_count();

  body.refine_to_finest({31, 31, 31});
  body.refine_to_finest({31, 31, 31});
  body.refine_to_finest({-1, 31, 31});

  EXPECT_TRUE(invariants_hold(body, voxels.label));
  EXPECT_EQ(body.leaf_count(), before + 7 * body.splits().size());
}

TEST(LinkedOctree, RejectsBadInputWithTheRemedy) {
  Voxels none = box_body({4, 4, 4});
  none.label.assign(none.label.size(), 0);
  Voxels short_labels = box_body({4, 4, 4});
  short_labels.label.pop_back();
  LinkedOctree body(box_body({4, 4, 4}), 1);
  const LinkCut cut = halfway(body.lattice(), 0, 1);

  EXPECT_THROW(LinkedOctree(none, 1), Error);
  EXPECT_THROW(LinkedOctree(short_labels, 1), Error);
  EXPECT_THROW(LinkedOctree(box_body({4, 4, 4}), -1), Error);
  EXPECT_THROW(body.disconnect({3, 0, 0}, 0, cut), Error);
  EXPECT_THROW(body.disconnect({-1, 0, 0}, 0, cut), Error);
  EXPECT_EQ(body.leaf_at({4, 0, 0}), -1);
  EXPECT_EQ(body.record({9, 0, 0}, 0), nullptr);
  EXPECT_FALSE(body.connected({3, 0, 0}, 0));
}

}  // namespace
}  // namespace kerf
