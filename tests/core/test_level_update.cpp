// SPDX-License-Identifier: MIT
//
// Levels that follow a blade against levels that are built anew, for random blades. KERF_FUZZ sets
// how many blades.
#include <gtest/gtest.h>

#include <map>
#include <numeric>
#include <set>

#include "core/body/cut.hpp"
#include "core/body/pieces.hpp"
#include "core/fem/loads.hpp"
#include "core/levels/corners.hpp"
#include "core/levels/piece_labels.hpp"
#include "core/levels/update.hpp"
#include "core/snapshot.hpp"
#include "core/surface/surface.hpp"
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

/// Anew, and held as the vertices of `like` are, whose cells have the same numbers.
Hierarchy build_like(const LinkedOctree& body, const HierarchyOptions& options, const Level& like) {
  Hierarchy out;
  out.levels.push_back(finest_level(body));
  Level& level = out.levels[0];
  for (std::int32_t c = 0; c < level.cells(); ++c)
    for (std::size_t i = 0; i < 8; ++i)
      level.fixed[level.slots[c][i]] = like.fixed[like.slots[c][i]];
  build_coarse_levels(out, options);
  return out;
}

/// Holds all vertices of a piece, as static mode holds crumbs; the old ones that were free.
std::vector<std::int32_t> freeze_piece(const LinkedOctree& body, Level& level,
                                       std::int32_t old_vertices, test::Dice& dice) {
  std::size_t pieces = 0;
  const std::vector<std::int32_t> piece = label_pieces(body, &pieces);
  const int frozen = dice.roll(static_cast<int>(pieces));
  std::set<std::int32_t> held;
  for (std::int32_t c = 0; c < level.cells(); ++c)
    for (const std::int32_t v : level.slots[c])
      if (piece[c] == frozen && pieces > 1 && level.fixed[v] != 7) {
        level.fixed[v] = 7;
        if (v < old_vertices) held.insert(v);
      }
  return {held.begin(), held.end()};
}

/// A bend, and a shake that is different at every vertex.
std::vector<double> random_displacement(const LinkedOctree& body, const Level& level,
                                        test::Dice& dice) {
  const Lattice& lattice = body.lattice();
  const double bend = dice.between(-0.5, 0.5) / lattice.spacing / 14;
  const double shake = dice.roll(3) == 0 ? 0.4 * lattice.spacing : 0;
  std::vector<double> out;
  for (const Vec3i p : level.point) {
    const Vec3d r = lattice.point(p) - lattice.origin;
    const Vec3d u = Vec3d{0.3 * r.z, bend * r.x * r.x, 0} + shake * dice.direction();
    out.insert(out.end(), {u.x, u.y, u.z});
  }
  return out;
}

/// Cuts `body` in a deformed state, from the leaves near the blade, as from all leaves.
CutEvent cut_deformed(LinkedOctree& body, Hierarchy& levels, const TriangleMesh& blade,
                      std::int32_t id, test::Dice& dice) {
  const Level& level = levels.levels[0];
  const Vec3d origin = body.lattice().origin;
  levels.spacing = body.lattice().spacing;
  const std::vector<double> u = random_displacement(body, level, dice);
  std::vector<std::int32_t> opened = opened_cells(body);
  std::sort(opened.begin(), opened.end());
  const NearCells near = near_cells(levels, u, BladeReach(blade, origin), opened);
  std::vector<double> of_slots;
  for (const std::int32_t c : near.cells)
    for (const std::int32_t v : level.slots[c])
      for (std::size_t d = 0; d < 3; ++d)
        of_slots.push_back(u[3 * static_cast<std::size_t>(v) + d]);
  LinkedOctree other = body;
  const CutEvent all = cut(other, cell_corners(body.lattice(), level, u), blade, id);
  const CutEvent event = cut_near(body,
                                  {{near.bounds.lo + origin, near.bounds.hi + origin},
                                   near.cells,
                                   corners_of_cells(body.lattice(), level, near.cells, of_slots)},
                                  blade, id);
  EXPECT_TRUE(near.finite);
  EXPECT_EQ(event.disconnected, all.disconnected);
  EXPECT_EQ(event.moved, all.moved);
  EXPECT_EQ(event.split, all.split);
  EXPECT_EQ(event.links_hit, all.links_hit);
  return event;
}

/// Every vertex of the surface moves with the leaf around its finest cell.
void expect_bound_where_they_lie(const LinkedOctree& body, const Surface& surface) {
  const SurfaceView view = surface.view();
  for (std::size_t v = 0; v < view.points.size(); ++v) {
    const bool used = surface.store().used[v] != 0;
    ASSERT_EQ(view.points[v].cell >= 0, used);
    if (!used) continue;
    const std::int32_t leaf = body.leaf_at(surface.store().finest_cell[v]);
    ASSERT_EQ(view.points[v].cell, body.leaf_number(leaf)) << "vertex " << v;
    const auto& node = body.nodes()[static_cast<std::size_t>(leaf)];
    const double side = body.lattice().spacing * (1 << node.size_log2);
    const Vec3d& x = surface.store().reference[v];
    ASSERT_EQ(view.points[v].reference, x);
    ASSERT_EQ(view.points[v].local, (1 / side) * (x - body.lattice().point(node.corner)));
  }
}

/// Forces at vertices by themselves have the bits of those at all, and only vertices of changed
/// cells see other forces than before.
void expect_same_forces(const LinkedOctree& body, Hierarchy levels, Hierarchy before,
                        const LevelChange& change) {
  const auto set_values = [&](Hierarchy& h) {
    h.spacing = body.lattice().spacing;
    h.values.clear();
    for (const std::uint8_t log2 : h.levels[0].size_log2) {
      const double side = h.spacing * (1 << log2);
      h.values.push_back({side, side * side * side, 0});
    }
  };
  set_values(levels);
  set_values(before);
  const Vec3d o = body.lattice().origin;
  const ExternalForce force(body.lattice(),
                            {Gravity{{1, 2, 3}}, BoxForce{{o, o + Vec3d{0.4, 9, 9}}, {1, 2, 3}},
                             RadialForce{{0, 0, 0}, {0, 1, 0}, 2}},
                            levels.levels[0]);
  const std::vector<double> all = force.on_all(levels), old = force.on_all(before);
  std::vector<std::int32_t> vertices(levels.levels[0].point.size());
  std::iota(vertices.begin(), vertices.end(), 0);
  ASSERT_EQ(force.on(levels, vertices), all);
  std::set<std::int32_t> touched(change.vertices.begin(), change.vertices.end());
  for (const std::int32_t c : change.cells)
    for (const std::int32_t v : levels.levels[0].slots[c]) touched.insert(v);
  for (std::size_t k = 0; k < old.size(); ++k)
    if (touched.count(static_cast<std::int32_t>(k / 3)) == 0) {
      ASSERT_EQ(all[k], old[k]) << "vertex " << k / 3;
    }
}

struct Counts {
  int updates = 0, rebuilds = 0;
};

/// The pieces of at most kSmall cells, whatever their order.
void expect_small_pieces(const PieceLabels& labels) {
  std::map<std::int32_t, std::vector<std::int32_t>> cells;
  const std::vector<std::int32_t> piece = labels.by_first_cell();
  for (std::size_t c = 0; c < piece.size(); ++c)
    cells[piece[c]].push_back(static_cast<std::int32_t>(c));
  std::set<std::vector<std::int32_t>> expected;
  for (auto& [number, of] : cells)
    if (of.size() <= PieceLabels::kSmall) expected.insert(std::move(of));
  const auto small = labels.small();
  ASSERT_EQ(small.size(), expected.size());
  ASSERT_EQ((std::set<std::vector<std::int32_t>>(small.begin(), small.end())), expected);
}

void cut_one_body(std::uint64_t seed, int blades, Counts& counts) {
  test::Dice dice(seed);
  const Voxels voxels = test::random_body(dice);
  LinkedOctree body(voxels, dice.roll(4));
  const HierarchyOptions options{dice.roll(3) == 0 ? 40 : 8, dice.roll(4) == 0 ? 2 : 0, true};
  test::RandomBlades random(voxels.lattice, dice);
  Hierarchy levels = build(body, options);
  LevelUpdater updater;
  PieceLabels labels;
  labels.build(levels.levels[0]);
  Surface surface(body, SurfaceMethod::dual_contouring);
  surface.bind(body);
  for (int i = 0; i < blades; ++i) {
    SCOPED_TRACE(::testing::Message() << "seed " << seed << ", blade " << i);
    const TriangleMesh blade = random.next();
    const CutEvent event = dice.roll(2) == 0 ? cut_deformed(body, levels, blade, i + 1, dice)
                                             : cut(body, {}, blade, i + 1);
    ASSERT_FALSE(::testing::Test::HasFailure());
    const Hierarchy before = levels;

    updater.update_finest(body, event, levels);
    Level& finest = levels.levels[0];
    for (std::int32_t v = before.levels[0].vertices(); v < finest.vertices(); ++v)
      finest.fixed[v] = held_at(finest.point[v]);
    std::vector<std::int32_t> held;
    if (dice.roll(3) == 0) held = freeze_piece(body, finest, before.levels[0].vertices(), dice);
    const bool updated = updater.update_coarse(levels, options, held);
    if (!updated) build_coarse_levels(levels, options);

    ++(updated ? counts.updates : counts.rebuilds);
    const Hierarchy anew = build_like(body, options, levels.levels[0]);
    ASSERT_NO_FATAL_FAILURE(test::expect_same_hierarchy(levels, anew));
    if (updated) {
      ASSERT_NO_FATAL_FAILURE(test::expect_change_tells_all(before, levels, updater.change()));
      // A rebuild is asked for only where the number of levels asks for it.
      ASSERT_EQ(before.levels.size(), anew.levels.size());
    }
    labels.update(body, event, levels.levels[0], updater.change().levels[0]);
    std::size_t pieces = 0;
    ASSERT_EQ(labels.by_first_cell(), label_pieces(body, &pieces));
    ASSERT_EQ(labels.count(), pieces);
    expect_small_pieces(labels);
    surface.update(body, event);
    surface.bind(body);
    ASSERT_NO_FATAL_FAILURE(expect_bound_where_they_lie(body, surface));
    ASSERT_NO_FATAL_FAILURE(expect_same_forces(body, levels, before, updater.change().levels[0]));
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
