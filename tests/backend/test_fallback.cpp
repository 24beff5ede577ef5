// SPDX-License-Identifier: MIT
//
// A device that has no memory left in the middle of a run: whichever allocation fails, the run goes
// on on the host and ends where it would have ended.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <string>

#include "core/simulation.hpp"
#include "tests/support/mirror_backend.hpp"
#include "tests/support/physics.hpp"

namespace kerf {
namespace {

using test::counters_of;
using test::make_mirror_backend;
using test::MirrorOptions;
using test::worst_distance;

/// A block that sags and is cut in two of its steps.
SimulationSetup block(TimeMode mode, TimeScheme scheme, int refinement) {
  SimulationSetup setup;
  setup.body = {test::box_solid({1, 1, 0.5}), 6, refinement};
  setup.material = {1e5, 0.4, 1000, 0, 0.01};
  setup.supports = {{{{-9, -9, -9}, {9, 0.001, 9}}, {}, {true, true, true}}};
  setup.supports.push_back({{{-9, 0.99, -9}, {0.3, 9, 9}}, {0.01, 0, 0}, {true, false, false}});
  setup.loads = {Gravity{{3, -9.81, 0}}};
  setup.time.mode = mode;
  setup.time.scheme = scheme;
  setup.time.step = 0.01;
  setup.time.duration = 0.07;
  setup.solver.tolerance = 1e-9;
  setup.solver.coarsest_vertices = 40;
  CutSetup cut;
  cut.start = 0.025;
  cut.end = 0.045;
  cut.lines = {{{0.53, 1.5, -1}, {0.57, 1.6, 2}}, {{0.48, 0.4, -1}, {0.52, 0.5, 2}}};
  if (mode == TimeMode::statics) cut.end.reset();
  setup.cuts = {cut};
  setup.surface = SurfaceMethod::dual_contouring;
  return setup;
}

double worst_velocity(const Simulation& a, const Simulation& b) {
  const std::vector<Vec3d> left = a.snapshot().velocity, right = b.snapshot().velocity;
  EXPECT_EQ(left.size(), right.size());
  double worst = 0;
  for (std::size_t i = 0; i < std::min(left.size(), right.size()); ++i)
    worst = std::max(worst, norm(left[i] - right[i]));
  return worst;
}

bool is_told(const Simulation& simulation) {
  return std::any_of(
      simulation.warnings().begin(), simulation.warnings().end(),
      [](const std::string& w) { return w.find("goes on with backend") != std::string::npos; });
}

std::size_t allocations(const Simulation& simulation) {
  return counters_of(const_cast<Backend&>(simulation.backend())).allocations;
}

struct Case {
  const char* name;
  TimeMode mode;
  TimeScheme scheme;
  int refinement;
  bool single, updates;
  bool damped = true;  ///< else the velocity takes its memory in the first step
};

class Fallback : public ::testing::TestWithParam<Case> {};

INSTANTIATE_TEST_SUITE_P(
    Mirror, Fallback,
    ::testing::Values(
        Case{"newmark", TimeMode::dynamic, TimeScheme::newmark, 1, false, true},
        Case{"undamped", TimeMode::dynamic, TimeScheme::newmark, 0, false, true, false},
        Case{"centralUndamped", TimeMode::dynamic, TimeScheme::central, 0, false, true, false},
        Case{"central", TimeMode::dynamic, TimeScheme::central, 0, true, true},
        Case{"loads", TimeMode::dynamic, TimeScheme::newmark, 0, true, false},
        Case{"statics", TimeMode::statics, TimeScheme::newmark, 1, true, true}),
    [](const auto& parameters) { return parameters.param.name; });

TEST_P(Fallback, WhicheverAllocationFailsTheRunEndsWhereItWould) {
  constexpr double kOfTheSolver = 1e-6;  // m of a block of 1 m: the tolerance times the steps
  constexpr double kVelocity = 4 * kOfTheSolver / 0.01;  // m/s, of some; its change is 2 / step
  const Case& c = GetParam();
  SimulationSetup setup = block(c.mode, c.scheme, c.refinement);
  if (!c.damped) setup.material.stiffness_damping = setup.material.mass_damping = 0;
  MirrorOptions options;
  options.backend.updates = c.updates;
  Simulation expected(setup, make_mirror_backend(c.single, options));
  const std::size_t at_start = allocations(expected);
  while (!expected.finished()) EXPECT_TRUE(expected.step().converged);
  const std::size_t at_end = allocations(expected);
  EXPECT_FALSE(is_told(expected));
  ASSERT_GT(expected.links_cut(), 5u);
  ASSERT_GT(at_end, at_start + 10);

  std::set<int> failed_in;
  for (std::size_t k = at_start; k < at_end; ++k) {
    SCOPED_TRACE(::testing::Message() << "allocation " << k);
    options.allocations = k;
    Simulation found(setup, make_mirror_backend(c.single, options));
    found.set_fallback([] { return test::cpu(); });
    while (!found.finished()) {
      const bool was_told = is_told(found);
      const StepReport step = found.step();
      EXPECT_TRUE(step.converged);
      if (!was_told && is_told(found)) failed_in.insert(step.step);
    }
    EXPECT_TRUE(is_told(found));
    EXPECT_STREQ(found.backend().name(), "reference");
    EXPECT_EQ(found.links_cut(), expected.links_cut());
    EXPECT_EQ(found.pieces(), expected.pieces());
    EXPECT_LE(worst_distance(found, expected), kOfTheSolver);
    if (c.mode == TimeMode::dynamic) {
      EXPECT_LE(worst_velocity(found, expected), kVelocity);
    }
    EXPECT_EQ(found.surface_mesh().displacement.size(),
              expected.surface_mesh().displacement.size());
  }
  EXPECT_GT(failed_in.size(), 1u);
}

TEST(NoMemory, WithoutAFallbackTheStepThrowsAndSaysWhatIsMissing) {
  const SimulationSetup setup = block(TimeMode::dynamic, TimeScheme::newmark, 0);
  MirrorOptions options;
  Simulation whole(setup, make_mirror_backend(false, options));
  options.allocations = allocations(whole);
  Simulation simulation(setup, make_mirror_backend(false, options));
  try {
    while (!simulation.finished()) simulation.step();
    FAIL() << "no memory was asked for";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::unavailable);
  }
  EXPECT_THROW(simulation.step(), Error);
}

TEST(NoMemory, AFallbackIsTakenOnce) {
  const SimulationSetup setup = block(TimeMode::dynamic, TimeScheme::newmark, 0);
  MirrorOptions options;
  Simulation whole(setup, make_mirror_backend(false, options));
  options.allocations = allocations(whole);
  Simulation simulation(setup, make_mirror_backend(false, options));
  simulation.set_fallback([&] { return make_mirror_backend(false, options); });
  EXPECT_THROW(
      {
        while (!simulation.finished()) simulation.step();
      },
      Error);
}

}  // namespace
}  // namespace kerf
