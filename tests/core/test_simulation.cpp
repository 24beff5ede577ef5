// SPDX-License-Identifier: MIT
//
// The public face as a whole: cuts on their way through moving bodies, and what stays the same.
#include <gtest/gtest.h>

#include <map>
#include <set>
#include <string>

#include "core/base/error.hpp"
#include "cpu/fast_backend.hpp"
#include "tests/support/blades.hpp"
#include "tests/support/physics.hpp"

namespace kerf {
namespace {

constexpr double kRounding = 1e-12;
const Support kFloor{{{-9, -9, -9}, {9, 0.001, 9}}, {}, {true, true, true}};

/// A block of 1 x 1 x 0.5 m that sags from its floor, cut downwards between 0.05 and 0.15 s.
SimulationSetup block(int refinement) {
  SimulationSetup setup;
  setup.body = {test::box_solid({1, 1, 0.5}), 16, refinement};
  setup.material = {2e4, 0.4, 1000, 0, 0.01};
  setup.supports = {kFloor};
  setup.loads = {Gravity{{3, -9.81, 0}}};
  setup.time.duration = 0.2;
  CutSetup cut;
  cut.start = 0.05;
  cut.end = 0.15;
  cut.lines = test::straight_cut({0.53, 1.5, -1}, {0.48, 0.4, -1}, {0.04, 0.1, 3});
  setup.cuts = {cut};
  return setup;
}

struct Outcome {
  std::uint64_t hash = 0;
  double volume = 0;
  std::size_t links_cut = 0;
};

Outcome run(const SimulationSetup& setup, int threads) {
  Simulation simulation(setup, test::cpu(threads));
  while (!simulation.finished()) simulation.step();
  return {simulation.state_hash(), simulation.volume(), simulation.links_cut()};
}

class Refined : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Levels, Refined, testing::Values(0, 2));

TEST_P(Refined, GivesTheSameBitsForAnyThreadsAndAgain) {
  // Large enough that loops over cells and vertices are shared out, see kWorthVertices.
  SimulationSetup setup = block(GetParam());
  setup.body.resolution = 24;
  setup.cuts[0].start = 0;
  setup.cuts[0].end = 0.1;
  setup.time.step = 0.05;
  setup.time.duration = 0.1;

  const Outcome one = run(setup, 1);

  EXPECT_GT(one.links_cut, 50u);
  EXPECT_EQ(run(setup, 1).hash, one.hash);
  EXPECT_EQ(run(setup, 2).hash, one.hash);
  EXPECT_EQ(run(setup, 4).hash, one.hash);
  SimulationSetup other = setup;
  other.cuts.clear();
  other.time.duration = 0.05;
  EXPECT_NE(run(other, 1).hash, one.hash);  // the hash sees the cut
}

TEST_P(Refined, KeepsItsVolumeAndConvergesWhileItIsCut) {
  Simulation simulation(block(GetParam()), test::cpu());
  const std::size_t cells = simulation.cells();
  std::size_t links = 0;

  EXPECT_EQ(simulation.steps_planned(), 10);
  for (int i = 1; !simulation.finished(); ++i) {
    const StepReport report = simulation.step();
    EXPECT_TRUE(report.converged);
    EXPECT_EQ(report.step, i);
    EXPECT_NEAR(report.time, 0.02 * i, kRounding);
    EXPECT_EQ(report.cells, simulation.cells());
    EXPECT_EQ(report.vertices, simulation.vertices());
    EXPECT_NEAR(simulation.volume(), 0.5, kRounding);
    // Steps 3 to 8 overlap [0.05, 0.15].
    EXPECT_EQ(report.cuts.size(), i >= 3 && i <= 8 ? 1u : 0u) << i;
    for (const CutEvent& event : report.cuts) links += event.disconnected.size();
  }

  EXPECT_EQ(simulation.links_cut(), links);
  EXPECT_EQ(simulation.cells_before_cuts(), cells);
  EXPECT_EQ(simulation.cells() > cells, GetParam() > 0);
  EXPECT_EQ(simulation.pieces(), 1u);
  const Snapshot s = simulation.snapshot();
  EXPECT_EQ(s.cells.size(), simulation.cells());
  std::set<std::int32_t> ids;
  for (const Snapshot::Face& face : s.boundary) ids.insert(face.cut_id);
  EXPECT_EQ(ids, (std::set<std::int32_t>{0, 1}));
}

// Old vertices keep their values to the bit, new ones lie on the old field.
TEST(Transfer, KeepsTheFieldOverACut) {
  LinkedOctree body(test::ball_body(16), 2);
  Hierarchy levels;
  levels.levels.push_back(finest_level(body));
  const Level before = levels.levels[0];
  const auto wave = [](const Vec3d& x) {
    return Vec3d{std::sin(9 * x.x + x.y), std::cos(7 * x.y * x.z), x.x * x.z};
  };
  const std::vector<double> values = test::at_vertices(body, before, wave);
  const Lattice lattice = body.lattice();
  std::map<Vec3i, std::size_t> old_vertex;
  for (std::size_t v = 0; v < before.point.size(); ++v) old_vertex[before.point[v]] = v;
  ASSERT_EQ(old_vertex.size(), before.point.size());  // no two share a place yet
  std::map<Vec3i, std::int32_t> old_cell;             // by finest cell
  for (std::int32_t c = 0; c < before.cells(); ++c) {
    const int size = 1 << before.size_log2[c];
    for (int i = 0; i < size * size * size; ++i)
      old_cell[{before.corner[c][0] + i % size, before.corner[c][1] + i / size % size,
                before.corner[c][2] + i / size / size}] = c;
  }

  const CutEvent event = cut(
      body, {}, test::plane_blade(lattice.point({8, 9, 8}), {1, 0.2, 0.1}, 5 * lattice.spacing), 1);
  LevelUpdater updater;
  updater.update_finest(body, event, levels);
  updater.update_coarse(levels, {});
  const Level& after = levels.levels[0];
  std::vector<std::int32_t> origin;
  for (const Vec3i corner : after.corner) origin.push_back(old_cell.at(corner));
  const NewVertices fresh = new_vertices(after, updater.change().levels[0]);
  std::vector<double> carried = values, sources;
  for (const std::int32_t v : fresh.source)
    for (std::size_t d = 0; d < 3; ++d)
      sources.push_back(values[3 * static_cast<std::size_t>(v) + d]);
  for (const double x : fresh.combine(sources)) carried.push_back(x);

  ASSERT_TRUE(event.changed());
  ASSERT_GT(after.cells(), before.cells());
  ASSERT_GT(after.point.size(), before.point.size());
  std::size_t kept = 0;
  for (std::size_t v = 0; v < after.point.size(); ++v) {
    const auto found = old_vertex.find(after.point[v]);
    if (found == old_vertex.end()) continue;
    ++kept;
    EXPECT_EQ(test::vertex_value(carried, v), test::vertex_value(values, found->second));
  }
  EXPECT_GT(kept, before.point.size());  // those on the cut twice
  // The corners of the new cells lie on the trilinear field of the cell they came from.
  for (std::int32_t c = 0; c < after.cells(); ++c) {
    Vec3d now[8], then[8];
    corner_values(after, c, carried, now);
    corner_values(before, origin[static_cast<std::size_t>(c)], values, then);
    const auto o = static_cast<std::size_t>(origin[static_cast<std::size_t>(c)]);
    const double size = 1 << before.size_log2[o];
    for (int i = 0; i < 8; ++i) {
      Vec3d expected{};
      for (int k = 0; k < 8; ++k) {
        double weight = 1;
        for (std::size_t d = 0; d < 3; ++d) {
          const auto cell = static_cast<std::size_t>(c);
          const int at = after.corner[cell][d] + ((i >> d) & 1) * (1 << after.size_log2[cell]);
          const double t = (at - before.corner[o][d]) / size;
          weight *= ((k >> d) & 1) != 0 ? t : 1 - t;
        }
        expected += weight * then[k];
      }
      EXPECT_LT(norm(now[i] - expected), kRounding);
    }
  }
}

// What a backend keeps is what it would be given again. The patches of the fast one after a cut are
// not those of a body that was cut before, so its sums have another order; but not by threads.
TEST(Simulation, UpdatesAndLoadsGiveTheSameBits) {
  for (const TimeMode mode : {TimeMode::dynamic, TimeMode::statics})
    for (const int refinement : {0, 1, 2}) {
      SCOPED_TRACE(testing::Message() << "refinement " << refinement);
      SimulationSetup setup = block(refinement);
      setup.body.resolution = 16;
      setup.time.mode = mode;
      setup.time.scheme = refinement == 1 ? TimeScheme::central : TimeScheme::newmark;
      setup.loads.push_back(BoxForce{{{0.4, 0.4, 0.1}, {0.6, 0.7, 0.4}}, {1, 2, 3}});
      setup.supports.push_back({{{-9, 0.99, -9}, {0.3, 9, 9}}, {0.01, 0, 0}, {true, false, false}});
      setup.regions = {{make_box({{0.3, 0.2, 0}, {0.7, 0.6, 0.3}}), {1e5, 0.3, 500, 0, 0}}};
      setup.solver.coarsest_vertices = 30;
      setup.solver.duplicate_cells = refinement != 2;  // else coarse levels are built anew
      CutSetup crumb;  // off an upper corner, which statics holds where it is
      crumb.mesh = test::plane_blade({0.95, 0.95, 0.45}, {1, 1, 1}, 0.3);
      crumb.deformed = setup.cuts[0].deformed = false;
      setup.cuts.push_back(crumb);
      if (mode == TimeMode::statics) {
        setup.loads[0] = Gravity{{0.03, -0.1, 0}};
        setup.cuts[0].end.reset();
      }
      Simulation updated(setup, make_cpu_backend({1, 0, true}));
      Simulation loaded(setup, make_cpu_backend({1, 0, false}));
      Simulation one(setup, make_fast_backend({1, refinement == 1, true}));
      Simulation two(setup, make_fast_backend({2, refinement == 1, true}));
      while (!updated.finished()) {
        for (Simulation* s : {&updated, &loaded, &one, &two}) s->step();
        ASSERT_EQ(updated.state_hash(), loaded.state_hash());
        ASSERT_EQ(one.state_hash(), two.state_hash());
      }
      EXPECT_EQ(one.links_cut(), updated.links_cut());
      EXPECT_GT(updated.links_cut(), 20u);
      EXPECT_EQ(updated.pieces(), loaded.pieces());
      EXPECT_GT(updated.pieces(), 1u);
      const SurfaceMesh a = updated.surface_mesh(), b = loaded.surface_mesh();
      EXPECT_EQ(a.displacement, b.displacement);
    }
}

// In the reference state the body does not move under the blade.
TEST(Simulation, CutsInStepsAsAtOnceInTheReferenceState) {
  for (const int refinement : {0, 1}) {
    SimulationSetup steps = block(refinement);
    steps.cuts[0].deformed = false;
    SimulationSetup once = steps;
    once.cuts[0].end.reset();
    Simulation a(steps, test::cpu()), b(once, test::cpu());
    while (!a.finished()) a.step();
    while (!b.finished()) b.step();

    EXPECT_EQ(a.links_cut(), b.links_cut());
    ASSERT_EQ(a.cells(), b.cells());
    for (const auto& [key, record] : a.body().records()) {
      const Vec3i lower = a.body().lattice().link_lower(key);
      const LinkCut* other = b.body().record(lower, Lattice::link_axis(key));
      ASSERT_NE(other, nullptr);
      for (int end = 0; end < 2; ++end) {
        EXPECT_NEAR(record.end[end].distance, other->end[end].distance, 1e-6);
        EXPECT_EQ(record.end[end].cut_id, other->end[end].cut_id);
      }
    }
  }
}

// Cut in two: each half stands on its own floor, and a force on one moves only that one.
TEST(Simulation, HalvesAfterAFullCutDoNotKnowEachOther) {
  for (const int refinement : {0, 1}) {
    SimulationSetup setup;
    setup.body = {test::box_solid({1, 0.5, 0.5}), 16, refinement};
    setup.supports = {kFloor};
    setup.loads = {BoxForce{{{0.6, 0.3, 0}, {1, 0.5, 0.5}}, {20, 30, 10}}};
    setup.time.mode = TimeMode::statics;
    CutSetup cut;
    cut.deformed = false;
    cut.lines = test::straight_cut({0.5, 1, -1}, {0.5, -1, -1}, {0, 0, 3});
    setup.cuts = {cut};
    Simulation simulation(setup, test::cpu());

    const StepReport report = simulation.step();

    EXPECT_TRUE(report.converged);
    EXPECT_EQ(report.pieces_before, 1u);
    EXPECT_EQ(report.pieces, 2u);
    const Snapshot s = simulation.snapshot();
    double left = 0, right = 0;
    for (std::size_t c = 0; c < s.cells.size(); ++c) {
      double x = 0;
      for (const std::int32_t p : s.cells[c]) x += 0.125 * s.points[static_cast<std::size_t>(p)].x;
      EXPECT_EQ(s.piece[c], s.piece[0] == (x < 0.5) ? 1 : 0) << x;
      for (const std::int32_t p : s.cells[c]) {
        double& most = x < 0.5 ? left : right;
        most = std::max(most, norm(s.displacement[static_cast<std::size_t>(p)]));
      }
    }
    EXPECT_GT(right, 1e-4);
    EXPECT_LT(left, 1e-7 * right);
  }
}

std::string error_of(const SimulationSetup& setup, ErrorKind kind, int steps = 1) {
  try {
    Simulation simulation(setup, test::cpu());
    for (int i = 0; i < steps; ++i) simulation.step();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), kind) << error.what();
    return error.what();
  }
  ADD_FAILURE() << "no error";
  return {};
}

bool holds(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

TEST(Simulation, NamesAPieceThatFloatsInStatics) {
  SimulationSetup setup;
  setup.body = {test::box_solid({0.5, 1, 0.5}), 8, 0};
  setup.supports = {kFloor};
  setup.loads = {Gravity{{0, -1, 0}}};
  setup.time.mode = TimeMode::statics;
  CutSetup cut;
  cut.lines = test::straight_cut({-1, 0.75, -1}, {1, 0.75, -1}, {0, 0, 3});
  setup.cuts = {cut};  // in the deformed state: the first equilibrium is of the whole

  const std::string message = error_of(setup, ErrorKind::bad_input, 2);

  EXPECT_TRUE(holds(message, "piece 1 of 2 (32 cells")) << message;
  EXPECT_TRUE(holds(message, "y = 0.75")) << message;
  EXPECT_TRUE(holds(message, "no support")) << message;
  EXPECT_TRUE(holds(message, "dynamic")) << message;
}

TEST(Simulation, NamesAPieceThatItsSupportsLetSlideOrTurn) {
  SimulationSetup setup;
  setup.body = {test::box_solid({1, 1, 1}), 4, 0};
  setup.time.mode = TimeMode::statics;
  setup.supports = {{{{-1, -1, -1}, {2, 0.01, 2}}, {}, {false, true, false}}};  // slides
  EXPECT_TRUE(holds(error_of(setup, ErrorKind::bad_input), "slide or turn"));
  setup.supports = {{{{-1, -1, -1}, {0.01, 0.01, 2}}, {}, {true, true, true}}};  // a hinge
  EXPECT_TRUE(holds(error_of(setup, ErrorKind::bad_input), "slide or turn"));
  setup.supports.push_back({{{0.9, -1, -1}, {2, 0.01, 0.01}}, {}, {false, true, false}});
  Simulation simulation(setup, test::cpu());
  EXPECT_TRUE(simulation.step().converged);  // one more point stops the hinge
}

// Blades cut corners off: such crumbs stay, with a warning.
TEST(Simulation, FreezesCrumbsInStatics) {
  SimulationSetup setup;
  setup.body = {test::box_solid({1, 1, 1}), 12, 0};
  setup.supports = {kFloor};
  setup.loads = {Gravity{{0, -9.81, 0}}};
  setup.time.mode = TimeMode::statics;
  CutSetup cut;
  cut.lines = test::straight_cut({0.9, 1.01, 0.9}, {0.9, 0.9, 0.9}, {0, 0, 1});
  setup.cuts = {cut, cut, cut};
  setup.cuts[1].lines = test::straight_cut({0.9, 1.01, 0.92}, {0.9, 0.9, 0.92}, {1, 0, 0});
  setup.cuts[2].lines = test::straight_cut({0.9, 0.92, 0.9}, {1.1, 0.92, 0.9}, {0, 0, 1});
  for (CutSetup& c : setup.cuts) c.deformed = false;
  Simulation simulation(setup, test::cpu());

  const StepReport report = simulation.step();

  EXPECT_EQ(report.pieces, 2u);
  EXPECT_TRUE(report.converged);
  ASSERT_EQ(simulation.warnings().size(), 1u);
  EXPECT_TRUE(holds(simulation.warnings()[0], "1 crumbs of 1 cells")) << simulation.warnings()[0];
}

TEST(Simulation, WarnsOfASupportThatHoldsNothing) {
  SimulationSetup setup = block(0);
  setup.supports.push_back({{{5, 5, 5}, {6, 6, 6}}, {}, {true, true, true}});
  const Simulation simulation(setup, test::cpu());

  ASSERT_EQ(simulation.warnings().size(), 1u);
  EXPECT_TRUE(holds(simulation.warnings()[0], "support 1")) << simulation.warnings()[0];
}

TEST(Simulation, RefusesABodyThatIsTooLargeBeforeItTakesMemory) {
  SimulationSetup setup = block(0);
  setup.body.resolution = 1000000;  // 5e17 cells

  const std::string message = error_of(setup, ErrorKind::unavailable);

  EXPECT_TRUE(holds(message, "needs")) << message;
  EXPECT_TRUE(holds(message, "GiB")) << message;
  EXPECT_TRUE(holds(message, "resolution")) << message;
}

TEST(Simulation, MovesHeldVerticesToTheirPlace) {
  for (const TimeMode mode : {TimeMode::statics, TimeMode::dynamic}) {
    SimulationSetup setup = block(1);
    setup.time.mode = mode;
    setup.loads.clear();
    setup.supports.push_back({{{-9, 0.99, -9}, {9, 9, 9}}, {0.01, 0.03, 0}, {true, true, true}});
    Simulation simulation(setup, test::cpu());
    while (!simulation.finished()) EXPECT_TRUE(simulation.step().converged);

    const Snapshot s = simulation.snapshot();
    std::size_t top = 0;
    for (std::size_t i = 0; i < s.points.size(); ++i) {
      if (s.masters[i][0] >= 0) continue;
      if (s.points[i].y < 0.001) {
        EXPECT_EQ(norm(s.displacement[i]), 0);
      }
      if (s.points[i].y < 0.99) continue;
      ++top;
      EXPECT_EQ(s.fixed[i], 7);
      EXPECT_EQ(s.displacement[i], (Vec3d{0.01, 0.03, 0}));
      EXPECT_EQ(norm(s.velocity[i]), 0);
    }
    EXPECT_GT(top, 17u * 9u);  // the cut doubles some
  }
}

TEST(Loads, SpreadTheirWholeForceOnAnyGrid) {
  for (const int refinement : {0, 2}) {
    SimulationSetup setup;
    setup.body = {test::box_solid({1, 1, 0.5}), 16, refinement};
    setup.material.density = 500;
    setup.loads = {BoxForce{{{0.3, 0.3, 0.1}, {0.62, 0.71, 0.4}}, {3, -2, 7}}};
    const test::Totals pushed = test::totals(Simulation(setup, test::cpu()));
    EXPECT_LT(norm(pushed.force - Vec3d{3, -2, 7}), kRounding);
    // The mean of the finest centres inside: x of cells 5 to 9, y of 5 to 10, z of 2 to 5.
    const Vec3d place = (1.0 / 16) * Vec3d{7.5, 8, 4};
    EXPECT_LT(norm(pushed.torque - cross(place, pushed.force)), kRounding);

    setup.loads = {Gravity{{1, -9.81, 0.5}}};
    const test::Totals heavy = test::totals(Simulation(setup, test::cpu()));
    EXPECT_LT(norm(heavy.force - 250.0 * Vec3d{1, -9.81, 0.5}), 1e-9);

    // About the middle all directions cancel; about an edge they point to the same quadrant.
    setup.loads = {RadialForce{{0.5, 0, 0.25}, {0, 2, 0}, 4}};
    EXPECT_LT(norm(test::totals(Simulation(setup, test::cpu())).force), 1e-9);
    setup.loads = {RadialForce{{0, 0, 0}, {0, -1, 0}, 4}};
    const test::Totals away = test::totals(Simulation(setup, test::cpu()));
    EXPECT_EQ(away.force.y, 0);
    // Integral of x / sqrt(x^2 + z^2) over [0, 1] x [0, 1/2] is 0.3951, of z / sqrt 0.2395 (by
    // quadrature); the sum has one point a cell.
    EXPECT_NEAR(away.force.x / (4 * 500), 0.3951, 0.003);
    EXPECT_NEAR(away.force.z / (4 * 500), 0.2395, 0.003);
  }
}

// A box that holds the centre of a large cell and of none of its children must not lose its force,
// nor may refinement at a cut move it.
TEST(Loads, StayWhereTheyAreWhenACutRefinesTheGrid) {
  SimulationSetup setup = block(2);
  setup.loads = {BoxForce{{{0.4, 0.4, 0.1}, {0.6, 0.7, 0.4}}, {1, 2, 3}}};
  setup.cuts[0].end.reset();
  setup.cuts[0].start = 0;
  Simulation simulation(setup, test::cpu());
  const test::Totals before = test::totals(simulation);

  simulation.step();

  const test::Totals after = test::totals(simulation);
  EXPECT_GT(simulation.links_cut(), 0u);
  EXPECT_LT(norm(after.force - before.force), kRounding);
  EXPECT_LT(norm(after.torque - before.torque), kRounding);
}

}  // namespace
}  // namespace kerf
