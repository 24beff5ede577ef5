// SPDX-License-Identifier: MIT
//
// Whole runs with cuts on the mirror of a device: against the reference, updates against loads, and
// what a cut sends.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "core/simulation.hpp"
#include "tests/support/physics.hpp"
#include "tests/support/problem.hpp"

namespace kerf {
namespace {

using test::counters_of;
using test::make_mirror_backend;
using test::MirrorOptions;
using test::Problem;
using test::ProblemOptions;
using test::worst_distance;

/// A block that sags and is cut on its way.
SimulationSetup block(int refinement) {
  SimulationSetup setup;
  setup.body = {test::box_solid({1, 1, 0.5}), 8, refinement};
  setup.material = {1e5, 0.4, 1000, 0, 0.01};
  setup.supports = {{{{-9, -9, -9}, {9, 0.001, 9}}, {}, {true, true, true}}};
  setup.loads = {Gravity{{3, -9.81, 0}}};
  setup.time.step = 0.01;
  setup.time.duration = 0.1;
  setup.solver.tolerance = 1e-9;
  setup.solver.coarsest_vertices = 40;
  CutSetup cut;
  cut.start = 0.02;
  cut.end = 0.08;
  cut.lines = {{{0.53, 1.5, -1}, {0.57, 1.6, 2}}, {{0.48, 0.4, -1}, {0.52, 0.5, 2}}};
  setup.cuts = {cut};
  return setup;
}

TEST(MirrorRuns, UpdatesAndLoadsGiveTheSameBits) {
  for (const int refinement : {0, 1, 2}) {
    SCOPED_TRACE(::testing::Message() << "refinement " << refinement);
    SimulationSetup setup = block(refinement);
    setup.body.resolution = 10;
    setup.time.scheme = refinement == 1 ? TimeScheme::central : TimeScheme::newmark;
    setup.supports.push_back({{{-9, 0.99, -9}, {0.3, 9, 9}}, {0.01, 0, 0}, {true, false, false}});
    setup.regions = {{make_box({{0.3, 0.2, 0}, {0.7, 0.6, 0.3}}), {1e5, 0.3, 500, 0, 0}}};
    setup.solver.smoother = refinement == 0 ? SmootherType::gauss_seidel : SmootherType::chebyshev;
    MirrorOptions loads;
    loads.backend.updates = false;
    Simulation updated(setup, make_mirror_backend(refinement == 1));
    Simulation loaded(setup, make_mirror_backend(refinement == 1, loads));
    while (!updated.finished()) {
      updated.step();
      loaded.step();
      ASSERT_EQ(updated.state_hash(), loaded.state_hash());
    }
    EXPECT_GT(updated.links_cut(), 20u);
    const SurfaceMesh a = updated.surface_mesh(), b = loaded.surface_mesh();
    EXPECT_EQ(a.displacement, b.displacement);
    EXPECT_EQ(a.normals, b.normals);
  }
}

// A hundred steps, the blade in half of them.
TEST(MirrorRuns, EndWhereTheReferenceEnds) {
  constexpr double kOfTheSolver = 1e-5;  // m of a block of 1 m: the tolerance times the steps
  SimulationSetup setup = block(1);
  setup.time.duration = 1;
  setup.cuts[0].start = 0.2;
  setup.cuts[0].end = 0.7;
  Simulation expected(setup, test::cpu());
  ASSERT_EQ(expected.steps_planned(), 100);
  while (!expected.finished()) EXPECT_TRUE(expected.step().converged);
  EXPECT_GT(expected.links_cut(), 10u);
  for (const char* machine : {"mirror", "mirror_mixed", "cuda", "cuda_mixed"}) {
    SCOPED_TRACE(machine);
    if (!test::why_missing(machine).empty()) {
      EXPECT_FALSE(test::is_required(machine)) << test::why_missing(machine);
      continue;
    }
    Simulation found(setup, test::make_backend(machine));
    while (!found.finished()) EXPECT_TRUE(found.step().converged);

    EXPECT_EQ(found.links_cut(), expected.links_cut());
    EXPECT_EQ(found.pieces(), expected.pieces());
    EXPECT_LE(worst_distance(found, expected), kOfTheSolver);
  }
}

TEST(MirrorRuns, RecordTheCycleOnceForEachCut) {
  SimulationSetup setup = block(1);
  Simulation simulation(setup, make_mirror_backend(true));
  std::size_t cuts = 0;
  while (!simulation.finished()) {
    const StepReport step = simulation.step();
    cuts += std::any_of(step.cuts.begin(), step.cuts.end(),
                        [](const CutEvent& event) { return event.changed(); });
  }
  EXPECT_GT(cuts, 2u);
  EXPECT_LE(counters_of(const_cast<Backend&>(simulation.backend())).recordings, cuts + 1);
}

// 200 million cells are to fit into 139 GiB, with 2 per cent for the coarsest level: 730 bytes a
// cell. This small body has more vertices a cell than a large one, and takes 732.
TEST(MirrorRuns, TakeFewBytesACell) {
  constexpr double kMost = 735;
  SimulationSetup setup = block(0);
  setup.body = {test::box_solid({1, 1, 1}), 32, 0};
  setup.surface = SurfaceMethod::none;
  setup.cuts.clear();
  setup.time.duration = 0.02;
  Simulation simulation(setup, make_mirror_backend(true));
  while (!simulation.finished()) EXPECT_TRUE(simulation.step().converged);
  const auto cells = static_cast<double>(simulation.cells());
  const auto& coarsest = simulation.hierarchy().levels.back();
  const double unknowns = 3.0 * static_cast<double>(coarsest.vertices());
  const double inverse = 12 * unknowns * unknowns;  // in double while it is made, then in single
  const auto most =
      static_cast<double>(counters_of(const_cast<Backend&>(simulation.backend())).bytes_most);
  EXPECT_LE((most - inverse) / cells, kMost);
  EXPECT_GE((most - inverse) / cells, 0.8 * kMost);  // else the bound says nothing
}

TEST(MirrorRuns, StaticRunEndsWhereTheReferenceEnds) {
  constexpr double kOfTheSolver = 1e-6;  // m
  SimulationSetup setup = block(0);
  setup.time.mode = TimeMode::statics;
  setup.time.step = 0.05;
  setup.cuts[0].end.reset();
  Simulation expected(setup, test::cpu()), found(setup, make_mirror_backend(true));
  while (!expected.finished()) {
    EXPECT_TRUE(expected.step().converged);
    EXPECT_TRUE(found.step().converged);
  }
  EXPECT_LE(worst_distance(found, expected), kOfTheSolver);
}

/// A backend before and after small cuts, beside one that is loaded anew.
struct Cuts {
  static constexpr double kPart = 0.2;  // of what a load sends, at most

  LinkedOctree body;
  Hierarchy hierarchy;
  LevelUpdater updater;
  HierarchyOptions options{60, 0, true};

  Cuts() : body(test::box_body({24, 20, 18}), 1) {
    ProblemOptions given;
    given.with_oracle = false;
    hierarchy = Problem(LinkedOctree(body), given).hierarchy;
  }

  /// A sheet of `reach` cells into the body. Returns whether levels could be updated in place.
  bool cut(double x, double reach) {
    const Lattice& l = body.lattice();
    const CutEvent event = kerf::cut(body, {},
                                     test::plane_blade(l.origin + l.spacing * Vec3d{x, 9.3, 8.2},
                                                       {1, 0.2, 0.1}, reach * l.spacing),
                                     1);
    updater.update_finest(body, event, hierarchy);
    while (hierarchy.values.size() < hierarchy.levels[0].corner.size())
      hierarchy.values.push_back(hierarchy.values[static_cast<std::size_t>(
          updater.change().levels[0].origin[hierarchy.values.size() -
                                            static_cast<std::size_t>(
                                                updater.change().levels[0].cells_before)])]);
    return updater.update_coarse(hierarchy, options);
  }
};

TEST(MirrorUpdates, SendWhatTheCutTouchedAndLeaveWhatALoadLeaves) {
  Cuts cuts;
  const auto updated = make_mirror_backend(false);
  const int u = updated->add_vector();
  updated->load(cuts.hierarchy);
  const std::size_t sent_by_load = counters_of(*updated).bytes_up;
  std::vector<double> values(3 * cuts.hierarchy.levels[0].point.size());
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = 1e-3 * static_cast<double>(i % 7);
  updated->write(0, u, values);
  updated->rotate_cells(u);

  int in_place = 0;
  for (const double x : {7.3, 15.6, 16.1}) {
    const std::size_t before = counters_of(*updated).bytes_up;
    if (!cuts.cut(x, 2.2)) continue;
    ++in_place;
    updated->update(cuts.hierarchy, cuts.updater.change());
    EXPECT_LE(static_cast<double>(counters_of(*updated).bytes_up - before),
              Cuts::kPart * static_cast<double>(sent_by_load));

    const std::size_t kept = values.size();
    values.resize(3 * cuts.hierarchy.levels[0].point.size());  // zero at new vertices
    std::vector<double> found(values.size()), rotations(4 * cuts.hierarchy.values.size());
    updated->read(0, u, found);
    EXPECT_GT(values.size(), kept);
    EXPECT_EQ(found, values);

    const auto loaded = make_mirror_backend(false);
    const int v = loaded->add_vector();
    loaded->load(cuts.hierarchy);
    loaded->write(0, v, values);
    updated->read_rotations(rotations);
    loaded->write_rotations(rotations);
    const int levels = static_cast<int>(cuts.hierarchy.levels.size());
    for (int l = 0; l < levels; ++l) {
      std::vector<double> product[2], share[2];
      for (int i = 0; i < 2; ++i) {
        Backend& backend = i == 0 ? *updated : *loaded;
        if (l == 0) backend.set_operator({1, 100});
        const std::size_t size =
            3 * cuts.hierarchy.levels[static_cast<std::size_t>(l)].point.size();
        product[i].resize(size);
        share[i].resize(size);
        backend.write_noise(l, kSolution, size);
        backend.apply(l, kSolution, kScratch);
        backend.read(l, kScratch, product[i]);
        if (l + 1 == levels) continue;
        backend.coarsen(l);
        backend.copy(l, kScratch, kResidual);
        backend.restrict_residual(l);
        backend.write_noise(
            l + 1, kSolution,
            3 * cuts.hierarchy.levels[static_cast<std::size_t>(l) + 1].point.size());
        backend.prolong_correction(l);
        backend.read(l, kSolution, share[i]);
      }
      EXPECT_EQ(product[0], product[1]) << "level " << l;
      EXPECT_EQ(share[0], share[1]) << "level " << l;
    }
  }
  EXPECT_GE(in_place, 2);
}

// What a blade may meet is looked for on the device, which tells a bit a cell: as the host finds
// it, also after cuts, and of places that are no numbers.
TEST(MirrorUpdates, CellsNearABladeAreThoseOfTheHost) {
  for (const int refinement : {0, 2}) {
    ProblemOptions options;
    options.coarsest_vertices = 60;
    options.with_oracle = false;
    Problem p(LinkedOctree(test::box_body({24, 20, 18}), refinement), options);
    const auto device = make_mirror_backend(refinement == 2);
    const int u = device->add_vector();
    device->load(p.hierarchy);
    LevelUpdater updater;
    const Lattice l = p.body.lattice();
    std::size_t met = 0, opened_met = 0;
    for (const double x : {7.3, 15.6, 16.1}) {
      for (const double reach : {1.3, 6.0, 40.0}) {
        const oracle::Vector at = p.deformation();
        test::write(*device, 0, u, at);
        const BladeReach blade(test::plane_blade(l.origin + l.spacing * Vec3d{x, 9.3, 8.2},
                                                 {1, 0.2, 0.1}, reach * l.spacing),
                               l.origin);
        const std::vector<std::int32_t> opened = opened_cells(p.body);
        const NearCells expected = near_cells(p.hierarchy, test::span_of(at), blade, opened);
        const std::size_t down = counters_of(*device).bytes_down;
        const NearCells found = device->find_near(u, blade, opened);
        EXPECT_EQ(found.cells, expected.cells);
        EXPECT_EQ(found.finite, expected.finite);
        EXPECT_EQ(found.bounds.lo, expected.bounds.lo);
        EXPECT_EQ(found.bounds.hi, expected.bounds.hi);
        EXPECT_LT(counters_of(*device).bytes_down - down,
                  8000 + p.hierarchy.values.size() / 8 + 4 + opened.size());
        met += found.cells.size();
        opened_met += opened.size();
      }
      const CutEvent event = kerf::cut(p.body, {},
                                       test::plane_blade(l.origin + l.spacing * Vec3d{x, 9.3, 8.2},
                                                         {1, 0.2, 0.1}, 4 * l.spacing),
                                       1);
      if (!p.update(updater, event)) break;
      device->update(p.hierarchy, updater.change());
    }
    EXPECT_GT(met, 500u);
    EXPECT_GT(opened_met, 100u);
    for (const double bad : {std::nan(""), HUGE_VAL}) {
      oracle::Vector at = p.deformation();
      at[3 * 77 + 1] = bad;
      test::write(*device, 0, u, at);
      const BladeReach blade(test::plane_blade(l.origin, {1, 0, 0}, l.spacing), l.origin);
      EXPECT_FALSE(device->find_near(u, blade, {}).finite);
    }
  }
}

TEST(MirrorUpdates, ABodyThatIsTooLargeForTheDeviceIsAnErrorAndTheCpuTakesIt) {
  MirrorOptions small;
  small.memory = 200000;
  const SimulationSetup setup = block(0);
  try {
    Simulation simulation(setup, make_mirror_backend(false, small));
    FAIL() << "200 kB held " << simulation.bytes();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::unavailable);
  }
  Simulation simulation(setup, test::cpu());
  EXPECT_TRUE(simulation.step().converged);
}

}  // namespace
}  // namespace kerf
