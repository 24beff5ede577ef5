// SPDX-License-Identifier: MIT
//
// Levels that follow a blade against levels that are built anew, for random blades. KERF_FUZZ sets
// how many blades.
#include <gtest/gtest.h>

#include "core/body/cut.hpp"
#include "core/levels/update.hpp"
#include "tests/support/cut_oracle.hpp"
#include "tests/support/level_match.hpp"
#include "tests/support/random_blades.hpp"
#include "tests/support/scenes.hpp"

namespace kerf {
namespace {

constexpr std::uint64_t kFirstSeed = 20261126;
constexpr int kBladesPerBody = 6;

/// Held here and there, in slabs that no coarse grid agrees with.
std::uint8_t held_at(const Vec3i& p) {
  return static_cast<std::uint8_t>((p[0] <= 3 ? 1 : 0) | (p[1] >= 5 ? 2 : 0) |
                                   ((p[0] + 2 * p[1] + 3 * p[2]) % 7 < 5 && p[2] < 6 ? 4 : 0));
}

Hierarchy build(const LinkedOctree& body, const HierarchyOptions& options) {
  Hierarchy out;
  out.levels.push_back(finest_level(body));
  Level& level = out.levels[0];
  for (std::int32_t v = 0; v < level.vertices(); ++v) level.fixed[v] = held_at(level.point[v]);
  build_coarse_levels(out, options);
  return out;
}

/// Corners of the leaves after a bend and a shake that opens cracks between them.
std::vector<Vec3d> deformed_corners(const LinkedOctree& body, test::Dice& dice) {
  const Lattice& lattice = body.lattice();
  const double bend = dice.between(-0.5, 0.5) / lattice.spacing / 14;
  const double shake = dice.roll(3) == 0 ? 0.2 * lattice.spacing : 0;
  return test::corners_of(body, [&](const Vec3d& x) {
    const Vec3d r = x - lattice.origin;
    return x + Vec3d{0, bend * r.x * r.x, 0} + shake * dice.direction();
  });
}

struct Counts {
  int updates = 0, rebuilds = 0;
};

void cut_one_body(std::uint64_t seed, int blades, Counts& counts) {
  test::Dice dice(seed);
  const Voxels voxels = test::random_body(dice);
  LinkedOctree body(voxels, dice.roll(4));
  const HierarchyOptions options{dice.roll(3) == 0 ? 40 : 8, dice.roll(4) == 0 ? 2 : 0, true};
  test::RandomBlades random(voxels.lattice, dice);
  Hierarchy levels = build(body, options);
  LevelUpdater updater;
  for (int i = 0; i < blades; ++i) {
    SCOPED_TRACE(::testing::Message() << "seed " << seed << ", blade " << i);
    std::vector<Vec3d> corners;
    if (dice.roll(3) == 0) corners = deformed_corners(body, dice);
    const CutEvent event = cut(body, corners, random.next(), i + 1);
    const Hierarchy before = levels;

    updater.update_finest(body, event, levels);
    Level& finest = levels.levels[0];
    for (std::int32_t v = before.levels[0].vertices(); v < finest.vertices(); ++v)
      finest.fixed[v] = held_at(finest.point[v]);
    const bool updated = updater.update_coarse(levels, options);
    if (!updated) build_coarse_levels(levels, options);

    ++(updated ? counts.updates : counts.rebuilds);
    const Hierarchy anew = build(body, options);
    ASSERT_NO_FATAL_FAILURE(test::expect_same_hierarchy(levels, anew));
    if (updated) {
      ASSERT_NO_FATAL_FAILURE(
          test::expect_change_tells_all(before, levels, updater.change()));
      // A rebuild is asked for only where the number of levels asks for it.
      ASSERT_EQ(before.levels.size(), anew.levels.size());
    }
    if (dice.roll(4) == 0) levels.pack();
  }
}

TEST(LevelUpdate, EqualsLevelsThatAreBuiltAnew) {
  const int count = test::blade_count(300);
  Counts counts;
  for (int done = 0, body = 0; done < count && !HasFatalFailure(); done += kBladesPerBody, ++body)
    ASSERT_NO_FATAL_FAILURE(cut_one_body(kFirstSeed + static_cast<std::uint64_t>(body),
                                         std::min(kBladesPerBody, count - done), counts));
  EXPECT_GT(counts.updates, counts.rebuilds);
}

}  // namespace
}  // namespace kerf
