// SPDX-License-Identifier: MIT
//
// What a body costs in memory, all structures included: a bound for each kind of run.
#include <gtest/gtest.h>

#include "core/simulation.hpp"
#include "cpu/fast_backend.hpp"
#include "tests/support/physics.hpp"

namespace kerf {
namespace {

// A cube of 48^3 cells has 1.06 vertices a cell. Large bodies take some five per cent less.
SimulationSetup cube(TimeMode mode) {
  SimulationSetup setup;
  setup.body = {test::box_solid({1, 1, 1}), 48, 0};
  setup.material = {1e6, 0.4, 1000, 0, 0.01};
  setup.supports = {{{{-1, -1, -1}, {2, 1e-4, 2}}, {}, {true, true, true}}};
  setup.loads = {Gravity{{0, -9.81, 0}}};
  setup.time.mode = mode;
  setup.time.step = 0.01;
  setup.time.duration = 0.01;
  setup.surface = SurfaceMethod::none;
  return setup;
}

double bytes_a_cell(const SimulationSetup& setup, bool single_cycle) {
  Simulation simulation(setup, make_fast_backend({.threads = 2, .single_cycle = single_cycle}));
  while (!simulation.finished()) simulation.step();
  const double cells = static_cast<double>(simulation.cells());
  // What is assumed before anything is allocated must cover what is.
  EXPECT_LT(static_cast<double>(simulation.bytes()), simulation.backend().bytes_per_cell() * cells);
  return static_cast<double>(simulation.bytes()) / cells;
}

TEST(Memory, OfAUniformBodyInMixedPrecisionIsBounded) {
  // Statics keeps a pair of differences of each update: four of them here.
  EXPECT_LE(bytes_a_cell(cube(TimeMode::statics), true), 480);
  EXPECT_LE(bytes_a_cell(cube(TimeMode::dynamic), true), 440);
}

TEST(Memory, OfALargeUniformBodyWithItsSurfaceIsBelow400) {
  SimulationSetup setup = cube(TimeMode::dynamic);
  setup.body.resolution = 96;
  setup.surface = SurfaceMethod::dual_contouring;
  EXPECT_LE(bytes_a_cell(setup, true), 400);
}

TEST(Memory, OfAUniformBodyInDoublePrecisionIsBounded) {
  EXPECT_LE(bytes_a_cell(cube(TimeMode::dynamic), false), 900);
}

TEST(Memory, WithoutBladesNoLinksAreKept) {
  SimulationSetup setup = cube(TimeMode::dynamic);
  setup.body.resolution = 24;
  Simulation uncut(setup, make_fast_backend({.threads = 1, .single_cycle = true}));
  EXPECT_TRUE(uncut.hierarchy().levels[0].linked.empty());
  EXPECT_TRUE(uncut.hierarchy().levels[0].parent.empty());
  EXPECT_THROW(make_fast_backend({.threads = 1})->load(uncut.hierarchy()), Error);

  setup.cuts.emplace_back().lines = {{{0.5, 2, -1}, {0.5, 2, 2}}, {{0.5, -1, -1}, {0.5, -1, 2}}};
  Simulation cut(setup, make_fast_backend({.threads = 1, .single_cycle = true}));

  EXPECT_FALSE(cut.hierarchy().levels[0].linked.empty());
  EXPECT_FALSE(cut.hierarchy().levels[0].parent.empty());
  EXPECT_GT(cut.bytes(), uncut.bytes());
}

}  // namespace
}  // namespace kerf
