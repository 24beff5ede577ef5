// SPDX-License-Identifier: MIT
//
// Bars and beams in equilibrium against closed forms.
// Source  Timoshenko, Goodier 1970, article 21; Cowper 1966 for the shear coefficient.
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <functional>

#include "tests/support/physics.hpp"

namespace kerf {
namespace {

// Static mode stops at this relative residual; displacements follow to about the condition.
constexpr double kEquilibrium = 1e-12;
constexpr double kExact = 1e-9;
constexpr double kSlack = 1e-6;  // m, around boxes that pick vertices of a plane
constexpr double kFar = 1e3;     // m

/// The vertices with lo <= coordinate along `axis` <= hi.
Box3 slab(int axis, double lo, double hi) {
  Box3 box{{-kFar, -kFar, -kFar}, {kFar, kFar, kFar}};
  box.lo[axis] = lo - kSlack;
  box.hi[axis] = hi + kSlack;
  return box;
}

Support roller(int axis, double at, double displacement = 0) {
  Support support{slab(axis, at, at), {}, {false, false, false}};
  support.held[static_cast<std::size_t>(axis)] = true;
  support.displacement[axis] = displacement;
  return support;
}

SimulationSetup static_setup(const Vec3d& size, int resolution, int refinement) {
  SimulationSetup setup;
  setup.body = {test::box_solid(size), resolution, refinement};
  setup.time.mode = TimeMode::statics;
  setup.time.nonlinear_tolerance = kEquilibrium;
  setup.solver.tolerance = 1e-8;
  return setup;
}

double largest_error(const Snapshot& s, const std::function<Vec3d(const Vec3d&)>& exact) {
  double error = 0;
  for (std::size_t i = 0; i < s.points.size(); ++i)
    error = std::max(error, norm(s.displacement[i] - exact(s.points[i])));
  return error;
}

// Rollers on three sides, pulled at the fourth: uniaxial stress, exact on any grid, over level
// jumps, and beside a cut along the pull.
TEST(Bar, BetweenRollersStretchesExactly) {
  constexpr double kPull = 0.05;
  SimulationSetup setup = static_setup({2, 1, 1}, 32, 2);
  setup.material = {2e4, 0.3, 1000, 0, 0};
  setup.supports = {roller(0, 0), roller(0, 2, kPull), roller(1, 0), roller(2, 0)};
  CutSetup slit;
  slit.deformed = false;
  slit.lines = test::straight_cut({0.7, 0.51, -0.1}, {1.3, 0.51, -0.1}, {0, 0, 0.7});
  setup.cuts = {slit};
  Simulation simulation(setup, test::cpu());

  const StepReport report = simulation.step();

  EXPECT_TRUE(report.converged) << report.residual;
  EXPECT_GT(simulation.links_cut(), 0u);
  EXPECT_GT(simulation.hanging(), 0u);
  const double strain = kPull / 2;
  EXPECT_LT(largest_error(simulation.snapshot(),
                          [&](const Vec3d& x) {
                            return strain * Vec3d{x.x, -0.3 * x.y, -0.3 * x.z};
                          }),
            kExact * kPull);
}

// Two materials in series: each carries the same stress. No Poisson effect, so the field is
// piecewise linear and lies in the finite element space.
TEST(Bar, OfTwoMaterialsIsTwoSpringsInSeries) {
  constexpr double kPull = 0.04, kSoft = 1e4, kStiff = 7e4;
  SimulationSetup setup = static_setup({2, 0.5, 0.5}, 32, 1);
  setup.material = {kSoft, 0, 1000, 0, 0};
  setup.regions = {{make_box({{1.25, -1, -1}, {3, 1, 1}}), {kStiff, 0, 500, 0, 0}}};
  setup.supports = {{slab(0, 0, 0), {}, {true, true, true}}, roller(0, 2, kPull)};
  Simulation simulation(setup, test::cpu());

  const StepReport report = simulation.step();

  EXPECT_TRUE(report.converged) << report.residual;
  const double soft = 1.25 / kSoft, stiff = 0.75 / kStiff;  // compliances for a unit area
  const double middle = kPull * soft / (soft + stiff);
  EXPECT_LT(largest_error(simulation.snapshot(),
                          [&](const Vec3d& x) {
                            const double u = x.x <= 1.25
                                                 ? middle * x.x / 1.25
                                                 : middle + (kPull - middle) * (x.x - 1.25) / 0.75;
                            return Vec3d{u, 0, 0};
                          }),
            kExact * kPull);
  EXPECT_NEAR(test::totals(simulation).mass, 0.25 * (1.25 * 1000 + 0.75 * 500), kExact * 1000);
}

struct Beam {
  double length = 1, height = 0.1, young = 1e6, poisson = 0.3, force = 1e-4;
  double loaded = 0.025;  ///< the force is spread over this last part, on every grid
  bool plane_strain = false;

  /// Deflection at the tip under a force spread over the end part: bending and shear, the mean of
  /// P s^2 (3 L - s) / (6 E I) + P s / (kappa A G) over s in [L - loaded, L].
  double timoshenko(double width) const {
    const double area = width * height, inertia = width * height * height * height / 12;
    const double stiff = plane_strain ? young / (1 - poisson * poisson) : young;
    const double shear = young / (2 * (1 + poisson));
    const double nu = plane_strain ? poisson / (1 - poisson) : poisson;
    const double kappa = 10 * (1 + nu) / (12 + 11 * nu);
    const auto bending = [&](double s) { return length * s * s * s - 0.25 * s * s * s * s; };
    const double a = length - loaded;
    return force * ((bending(length) - bending(a)) / (6 * loaded * stiff * inertia) +
                    0.5 * (length + a) / (kappa * area * shear));
  }

  /// Mean deflection of the end face by finite elements, `across` cells in the height.
  double solve(int across) const {
    const double h = height / across, width = plane_strain ? h : height;
    SimulationSetup setup =
        static_setup({length, height, width}, static_cast<int>(std::lround(length / h)), 0);
    setup.material = {young, poisson, 1000, 0, 0};
    setup.supports = {{slab(0, 0, 0), {}, {true, true, true}}};
    if (plane_strain) setup.supports.push_back({slab(2, 0, 1), {}, {false, false, true}});
    setup.loads = {BoxForce{slab(0, length - loaded, length), {0, -force, 0}}};
    Simulation simulation(setup, test::cpu());
    const StepReport report = simulation.step();
    EXPECT_TRUE(report.converged) << report.residual;
    const Snapshot s = simulation.snapshot();
    double sum = 0;
    int count = 0;
    for (std::size_t i = 0; i < s.points.size(); ++i) {
      if (s.points[i].x < length - kSlack) continue;
      sum -= s.displacement[i].y;
      ++count;
    }
    return sum / count;
  }
};

/// Errors against the value that the last two extrapolate to, and against the theory.
void expect_second_order(const Beam& beam, std::array<int, 3> across, double theory_tolerance) {
  double deflection[3], theory[3];
  for (std::size_t i = 0; i < 3; ++i) {
    const double width = beam.plane_strain ? beam.height / across[i] : beam.height;
    theory[i] = beam.timoshenko(width);
    deflection[i] = beam.solve(across[i]) / theory[i];
    SCOPED_TRACE(across[i]);
    EXPECT_LT(deflection[i], 1);  // displacement elements are too stiff
    if (i > 0) {
      EXPECT_GT(deflection[i], deflection[i - 1]);
    }
  }
  // Each grid halves the cells: differences fall by 2^order.
  const double order = std::log2((deflection[1] - deflection[0]) / (deflection[2] - deflection[1]));
  const double limit = deflection[2] + (deflection[2] - deflection[1]) / 3;
  testing::Test::RecordProperty("order", std::to_string(order));
  std::printf("  deflections over theory %.5f %.5f %.5f, order %.3f, limit %.5f\n", deflection[0],
              deflection[1], deflection[2], order, limit);
  // The singular edge of the clamp lowers it a little below 2.
  EXPECT_GT(order, 1.7);
  EXPECT_LT(order, 2.2);
  EXPECT_NEAR(limit, 1, theory_tolerance);
}

// One cell thick between rollers. The theory leaves out what the clamp does to the section, an
// effect of the order of (height / length)^2.
TEST(Cantilever, InPlaneStrainConvergesToTimoshenko) {
  Beam beam;
  beam.plane_strain = true;

  expect_second_order(beam, {4, 8, 16}, 0.01);
}

TEST(Cantilever, SolidConvergesToTimoshenko) {
  Beam beam;
  beam.loaded = 0.05;

  expect_second_order(beam, {2, 4, 8}, 0.01);
}

}  // namespace
}  // namespace kerf
