// SPDX-License-Identifier: MIT
//
// Random blades on small bodies; KERF_FUZZ sets how many. A failure names the seed of its body:
// the blades before it come from the same seed.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <unordered_map>

#include "core/body/cut.hpp"
#include "core/body/pieces.hpp"
#include "tests/support/bodies.hpp"
#include "tests/support/cut_oracle.hpp"
#include "tests/support/octree_invariants.hpp"
#include "tests/support/random_blades.hpp"

namespace kerf {
namespace {

using test::blade_count;
using test::Dice;
using test::random_body;

using Records = std::unordered_map<LinkKey, LinkCut>;

constexpr int kBladesPerBody = 8;
constexpr std::uint64_t kFirstSeed = 20110501;

/// Corners of the leaves after a bend, a stretch, and a jitter that opens cracks between leaves.
std::vector<Vec3d> deformed_corners(const LinkedOctree& body, Dice& dice) {
  const Lattice& lattice = body.lattice();
  const double bend = dice.between(-0.6, 0.6) / lattice.spacing / 14;
  const double stretch = dice.between(0.6, 1.6);
  const double jitter = dice.roll(3) == 0 ? 0.2 * lattice.spacing : 0;
  return test::corners_of(body, [&](const Vec3d& x) {
    const Vec3d r = x - lattice.origin, shake = jitter * dice.direction();
    return lattice.origin + Vec3d{stretch * r.x, r.y + bend * r.x * r.x, r.z - 0.3 * r.y} + shake;
  });
}

/// Cuts only add: links stay disconnected, points only come nearer; and the event says the rest.
void expect_cut_only_adds(const Records& before, const LinkedOctree& body, const CutEvent& event) {
  EXPECT_EQ(body.records().size(), before.size() + event.disconnected.size());
  EXPECT_GE(event.links_hit, event.disconnected.size());
  EXPECT_EQ(event.cells_after, body.leaf_count());
  for (const LinkKey key : event.disconnected) {
    EXPECT_EQ(before.count(key), 0u);
    EXPECT_EQ(body.records().count(key), 1u);
  }
  for (const auto& [key, cut] : before) {
    const auto now = body.records().find(key);
    ASSERT_NE(now, body.records().end());
    for (int end = 0; end < 2; ++end)
      EXPECT_LE(now->second.end[end].distance, cut.end[end].distance);
  }
}

/// Refinement then cut is the cut on the uniform finest grid, bit for bit in the reference state.
void expect_same_records(const LinkedOctree& a, const LinkedOctree& b) {
  ASSERT_EQ(a.records().size(), b.records().size());
  for (const auto& [key, cut] : a.records()) {
    const auto other = b.records().find(key);
    ASSERT_NE(other, b.records().end());
    for (int end = 0; end < 2; ++end) {
      EXPECT_EQ(cut.end[end].distance, other->second.end[end].distance);
      EXPECT_EQ(cut.end[end].normal, other->second.end[end].normal);
      EXPECT_EQ(cut.end[end].cut_id, other->second.end[end].cut_id);
    }
  }
}

void cut_one_body(std::uint64_t seed, int blades) {
  Dice dice(seed);
  const Voxels voxels = random_body(dice);
  const bool deformed = dice.roll(2) == 0;
  const int refinement = dice.roll(4);
  LinkedOctree body(voxels, refinement), uniform(voxels, 0);
  test::RandomBlades random(voxels.lattice, dice);
  std::size_t pieces = 0;
  label_pieces(body, &pieces);

  for (int i = 0; i < blades; ++i) {
    SCOPED_TRACE(::testing::Message() << "seed " << seed << ", blade " << i);
    const TriangleMesh blade = random.next();
    std::vector<Vec3d> corners;
    if (deformed) corners = deformed_corners(body, dice);
    const Records before = body.records();

    const CutEvent event = cut(body, corners, blade, i + 1);

    expect_cut_only_adds(before, body, event);
    EXPECT_TRUE(test::invariants_hold(body, voxels.label));
    const std::size_t pieces_before = pieces;
    label_pieces(body, &pieces);
    EXPECT_GE(pieces, pieces_before);
    if (!deformed) {
      cut(uniform, {}, blade, i + 1);
      expect_same_records(body, uniform);
      EXPECT_FALSE(cut(body, {}, blade, i + 1).changed());
      expect_same_records(body, uniform);
    }
    if (::testing::Test::HasFailure()) return;
  }
}

TEST(CutFuzz, RandomBladesKeepTheInvariants) {
  const int count = blade_count();
  ASSERT_GT(count, 0) << "KERF_FUZZ must be the number of blades";
  for (int done = 0, body = 0; done < count && !HasFailure(); done += kBladesPerBody, ++body)
    cut_one_body(kFirstSeed + static_cast<std::uint64_t>(body),
                 std::min(kBladesPerBody, count - done));
}

}  // namespace
}  // namespace kerf
