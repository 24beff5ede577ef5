// SPDX-License-Identifier: MIT
//
// Time integration: free fall, momentum, and one degree of freedom against the closed forms of the
// discrete schemes.
// Source  Bathe 2002, section 9.2.4, for Newmark as the trapezoidal rule.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdio>
#include <limits>
#include <string>
#include <utility>

#include "core/body/cut.hpp"
#include "core/fem/motion.hpp"
#include "cpu/fast_backend.hpp"
#include "tests/support/blades.hpp"
#include "tests/support/physics.hpp"

namespace kerf {
namespace {

constexpr double kTight = 1e-12;  // relative residual of linear solves
// Some hundred steps, each rounded and solved to kTight.
constexpr double kSteps = 1e-9;

SimulationSetup falling_ball(TimeScheme scheme) {
  SimulationSetup setup;
  setup.body = {make_ellipsoid({0.5, 0.5, 0.5}, {0.5, 0.4, 0.5}), 12, 1};
  setup.material = {2e4, 0.35, 900, 0, 0.01};
  setup.loads = {Gravity{{0, -9.81, 1}}};
  setup.time.scheme = scheme;
  setup.time.step = 0.01;
  setup.time.duration = 0.2;
  setup.solver.tolerance = kTight;
  return setup;
}

class FreeFall : public testing::TestWithParam<TimeScheme> {};

TEST_P(FreeFall, FollowsTheParabolaAndKeepsItsShape) {
  Simulation simulation(falling_ball(GetParam()), test::cpu());

  while (!simulation.finished()) EXPECT_TRUE(simulation.step().converged);

  const double t = simulation.time();
  EXPECT_NEAR(t, 0.2, kTight);
  // The central scheme knows the velocity of the step before: a central difference.
  const double at = GetParam() == TimeScheme::central ? t - 0.01 : t;
  const Vec3d g{0, -9.81, 1};
  const Snapshot s = simulation.snapshot();
  for (std::size_t i = 0; i < s.points.size(); ++i) {
    ASSERT_LT(norm(s.displacement[i] - 0.5 * t * t * g), kSteps);
    ASSERT_LT(norm(s.velocity[i] - at * g), kSteps);
  }
}

// The cut is swept while the ball falls. Before it gravity is all there is, so that the halves fall
// side by side; momentum is what the load has given, before and after.
TEST_P(FreeFall, KeepsItsMomentumOverACut) {
  SimulationSetup setup = falling_ball(GetParam());
  CutSetup cut;
  cut.start = 0.05;
  cut.end = 0.12;
  cut.lines = test::straight_cut({0.52, 2, -1}, {0.52, -2, -1}, {0, 0, 3});
  setup.cuts = {cut};
  Simulation simulation(setup, test::cpu());
  const test::Totals before = test::totals(simulation);
  std::size_t events = 0;

  while (!simulation.finished()) {
    const StepReport report = simulation.step();
    EXPECT_EQ(report.pieces, simulation.pieces());
    if (report.pieces > report.pieces_before) ++events;
    const test::Totals now = test::totals(simulation);
    const double t = simulation.time();
    const double at = GetParam() == TimeScheme::central ? t - setup.time.step : t;
    ASSERT_NEAR(now.mass, before.mass, kTight * before.mass);
    ASSERT_LT(norm(now.momentum - at * before.force), kSteps * norm(before.force));
    ASSERT_LT(norm(now.centre - before.centre - 0.5 * t * t / before.mass * before.force), kSteps);
  }

  EXPECT_EQ(events, 1u);
  EXPECT_EQ(simulation.pieces(), 2u);
  EXPECT_GT(simulation.links_cut(), 50u);
}

// The corner cell of a beam that bends: a tolerance for the beam is a good part of its weight.
TEST_P(FreeFall, OfACrumbIsWithoutSpinWhateverTheTolerance) {
  SimulationSetup setup;
  constexpr double kSide = 0.01;
  const Vec3d size{24 * kSide, 12 * kSide, 12 * kSide};
  setup.body = {make_box({{0, 0, 0}, size}), 24, 1};
  setup.material = {2e5, 0.35, 1000, 0, 0.01};
  setup.supports = {{{{-1, -1, -1}, {kSide / 2, 1, 1}}, {}, {true, true, true}}};
  setup.loads = {Gravity{{0, -9.81, 0}}};
  setup.time.scheme = GetParam();
  setup.time.duration = 0.3;
  setup.solver.tolerance = 1e-2;
  CutSetup cut;
  cut.deformed = false;
  for (int axis = 0; axis < 3; ++axis) {
    Vec3d at = size - 0.4 * kSide * Vec3d{1, 1, 1}, normal;
    at[axis] -= 0.5 * kSide;
    normal[axis] = 1;
    cut.mesh = test::joined(cut.mesh, test::plane_blade(at, normal, 0.8 * kSide));
  }
  setup.cuts = {cut};
  Simulation simulation(setup, test::cpu());

  while (!simulation.finished()) EXPECT_TRUE(simulation.step().converged);

  ASSERT_EQ(simulation.pieces(), 2u);
  const Snapshot s = simulation.snapshot();
  ASSERT_EQ(std::count(s.piece.begin(), s.piece.end(), 1), 1);
  const double t = simulation.time();
  const double at = GetParam() == TimeScheme::central ? t - setup.time.step : t;
  const auto crumb =
      static_cast<std::size_t>(std::find(s.piece.begin(), s.piece.end(), 1) - s.piece.begin());
  for (const std::int32_t point : s.cells[crumb]) {
    EXPECT_LT(norm(s.velocity[point] - at * Vec3d{0, -9.81, 0}), kSteps);
    EXPECT_LT(norm(s.displacement[point] - 0.5 * t * t * Vec3d{0, -9.81, 0}), kSteps);
  }
}

INSTANTIATE_TEST_SUITE_P(Schemes, FreeFall,
                         testing::Values(TimeScheme::newmark, TimeScheme::central),
                         [](const auto& scheme) {
                           return scheme.param == TimeScheme::newmark ? "Newmark" : "Central";
                         });

/// A free body whose velocities a test sets; a Simulation starts at rest.
struct FreeBody {
  FreeBody(double step, const Vec3d& spin, int updates = 3)
      : octree(test::box_body({12, 4, 4}), 1), hierarchy(test::one_material(octree, material)) {
    time.step = step;
    solver_setup.tolerance = kTight;
    solver_setup.rotation_updates = updates;
    build_coarse_levels(hierarchy, {40, 0, true});
    state.displacement = backend->add_vector();
    state.velocity = backend->add_vector();
    state.memory = backend->add_vector();
    state.external = backend->add_vector();
    product = backend->add_vector();
    solver = std::make_unique<LinearSolver>(*backend, solver_setup);
    motion = std::make_unique<Motion>(*backend, *solver, time, material, solver_setup, state);
    backend->load(hierarchy);
    solver->set_structure(hierarchy);
    const Vec3d middle = octree.lattice().point({6, 2, 2});
    backend->write(0, state.velocity, test::at_vertices(octree, level(), [&](const Vec3d& x) {
                     return cross(spin, x - middle) + Vec3d{0.3, 0, -0.1};
                   }));
    motion->start();
  }

  const Level& level() const { return hierarchy.levels[0]; }

  /// Linear momentum and angular momentum about the origin: sums of M v and of x times M v.
  std::array<Vec3d, 2> momenta() {
    backend->apply_scaled({0, 1}, state.velocity, product);
    const std::size_t n = level().point.size();
    const std::vector<double> u = test::read(*backend, state.displacement, n);
    const std::vector<double> p = test::read(*backend, product, n);
    std::array<Vec3d, 2> sums{};
    for (std::size_t v = 0; v < n; ++v) {
      const Vec3d x = octree.lattice().point(level().point[v]) + test::vertex_value(u, v);
      sums[0] += test::vertex_value(p, v);
      sums[1] += cross(x, test::vertex_value(p, v));
    }
    return sums;
  }

  Material material{5e5, 0.3, 1000, 0, 0};
  TimeSetup time;
  SolverSetup solver_setup;
  LinkedOctree octree;
  Hierarchy hierarchy;
  std::unique_ptr<Backend> backend = test::cpu();
  StateVectors state;
  int product = -1;
  std::unique_ptr<LinearSolver> solver;
  std::unique_ptr<Motion> motion;
};

/// The greatest relative change of angular momentum in `duration` seconds.
double spin_drift(double step, double duration) {
  FreeBody body(step, {0.4, 1.5, 5});
  const std::array<Vec3d, 2> start = body.momenta();
  double drift = 0;
  for (int i = 0; i < static_cast<int>(std::lround(duration / step)); ++i) {
    body.motion->step();
    const std::array<Vec3d, 2> now = body.momenta();
    EXPECT_LT(norm(now[0] - start[0]), kSteps * norm(start[0]));
    drift = std::max(drift, norm(now[1] - start[1]) / norm(start[1]));
  }
  return drift;
}

// Newmark's rule conserves linear momentum, and angular momentum to second order in the step: over
// a turn the error stays small and falls with the square of the step.
TEST(Spinning, KeepsLinearMomentumAndNearlyAngularMomentum) {
  const double coarse = spin_drift(0.02, 1.2), fine = spin_drift(0.01, 1.2);

  std::printf("  drift of angular momentum %.3e and %.3e at half the step\n", coarse, fine);
  EXPECT_LT(coarse, 0.02);
  EXPECT_LT(fine, 0.35 * coarse);
}

// The last linear solve of a step goes to the tolerance, and those before it only as far as is
// left when the rotations have moved.
TEST(Spinning, EarlyUpdatesAreNotSolvedToTheEnd) {
  int cycles[2];
  for (const int updates : {1, 3}) {
    FreeBody body(0.02, {0.4, 1.5, 5}, updates);
    NonlinearStats stats;
    for (int i = 0; i < 3; ++i) stats = body.motion->step();
    EXPECT_TRUE(stats.converged);
    EXPECT_LE(stats.linear_residual, kTight);
    EXPECT_EQ(stats.rotation_updates, updates);
    cycles[updates == 1 ? 0 : 1] = stats.cycles;
  }

  std::printf("  %d cycles with one update, %d with three\n", cycles[0], cycles[1]);
  EXPECT_LT(cycles[1], 1.6 * cycles[0]);
}

/// One cell, its floor held, its top free to move up and down: a mass on a spring.
struct Oscillator {
  double young = 4e3, poisson = 0.3, density = 700, alpha = 0, beta = 0, gravity = -3;
  bool lumped = false;
  TimeScheme scheme = TimeScheme::newmark;
  double step = 0.02;

  double stiffness() const {  // (lambda + 2 mu) area / height
    return young * (1 - poisson) / ((1 + poisson) * (1 - 2 * poisson));
  }
  double mass() const { return density * (lumped ? 0.5 : 1.0 / 3); }
  double damping() const { return alpha * mass() + beta * stiffness(); }
  double force() const { return 0.5 * density * gravity; }
  double rest() const { return force() / stiffness(); }

  SimulationSetup setup() const {
    SimulationSetup out;
    out.body = {test::box_solid({1, 1, 1}), 1, 0};
    out.material = {young, poisson, density, alpha, beta};
    out.supports = {{{{-1, -1, -1}, {2, 0.1, 2}}, {}, {true, true, true}},
                    {{{-1, -1, -1}, {2, 2, 2}}, {}, {true, false, true}}};
    out.loads = {Gravity{{0, gravity, 0}}};
    out.time.scheme = scheme;
    out.time.step = step;
    out.time.duration = 200 * step;
    out.time.lumped_mass = lumped;
    out.solver.tolerance = kTight;
    return out;
  }

  /// Displacement of the top after each step.
  std::vector<double> run() const {
    Simulation simulation(setup(), test::cpu());
    std::vector<double> top;
    while (!simulation.finished()) {
      EXPECT_TRUE(simulation.step().converged);
      const Snapshot s = simulation.snapshot();
      double low = 1e9, high = -1e9;
      for (std::size_t i = 0; i < s.points.size(); ++i) {
        if (s.points[i].y < 0.5) continue;
        low = std::min(low, s.displacement[i].y);
        high = std::max(high, s.displacement[i].y);
      }
      EXPECT_NEAR(low, high, kTight);  // the top stays level
      top.push_back(low);
    }
    return top;
  }
};

// The trapezoidal rule turns exp(s t) into ((1 + s dt / 2) / (1 - s dt / 2))^n, with s a root of
// m s^2 + c s + k = 0. It starts at rest away from the equilibrium.
std::vector<double> newmark_closed_form(const Oscillator& o, std::size_t steps) {
  const std::complex<double> root =
      std::sqrt(std::complex<double>(o.damping() * o.damping() - 4 * o.mass() * o.stiffness()));
  const std::complex<double> s = (-o.damping() + root) / (2 * o.mass());
  const std::complex<double> factor = (1.0 + 0.5 * o.step * s) / (1.0 - 0.5 * o.step * s);
  std::vector<double> out;
  for (std::size_t n = 1; n <= steps; ++n) {
    // w = A z^n + conj, with w_0 = -rest and w' = 0: A = -rest conj(s) / (conj(s) - s)
    const std::complex<double> a = -o.rest() * std::conj(s) / (std::conj(s) - s);
    out.push_back(o.rest() + 2 * (a * std::pow(factor, n)).real());
  }
  return out;
}

// (m / dt^2 + c / 2 dt + k) z^2 - 2 m / dt^2 z + (m / dt^2 - c / 2 dt) = 0.
std::vector<double> central_closed_form(const Oscillator& o, std::size_t steps) {
  const double m = o.mass() / (o.step * o.step), c = 0.5 * o.damping() / o.step;
  const std::complex<double> root =
      std::sqrt(std::complex<double>(m * m - (m + c + o.stiffness()) * (m - c)));
  const std::complex<double> z = (m + root) / (m + c + o.stiffness());
  // w_0 = -rest; u_{-1} = dt^2 / 2 f / m from rest.
  const double before = 0.5 * o.step * o.step * o.force() / o.mass() - o.rest();
  // A + conj = w_0 and A / z + conj = w_{-1}
  const std::complex<double> y = 1.0 / z;
  const double re = -0.5 * o.rest();
  const double im = (re * y.real() - 0.5 * before) / y.imag();
  const std::complex<double> a(re, im);
  std::vector<double> out;
  for (std::size_t n = 1; n <= steps; ++n)
    out.push_back(o.rest() + 2 * (a * std::pow(z, n)).real());
  return out;
}

void expect_close(const std::vector<double>& found, const std::vector<double>& expected,
                  double scale) {
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i)
    ASSERT_NEAR(found[i], expected[i], kSteps * std::abs(scale)) << "step " << i + 1;
}

struct Ending {
  const char* name;
  bool fast;
  TimeScheme scheme;
  double gravity;     // m/s^2
  bool in_an_update;  // else before the first one
};
class BlowsUp : public testing::TestWithParam<Ending> {};

// Squares of forces come to the end of the numbers. What is left is the step before, or the last
// update that was finite.
TEST_P(BlowsUp, AndLeavesTheLastStateThatWasFinite) {
  SimulationSetup setup = falling_ball(GetParam().scheme);
  setup.supports = {{{{-1, -1, -1}, {0.3, 2, 2}}, {}, {true, true, true}}};
  setup.loads = {Gravity{{0, -GetParam().gravity, 0}}};
  setup.solver.tolerance = 1e-6;
  setup.time.duration = 1;
  Simulation simulation(setup, GetParam().fast ? make_fast_backend({.threads = 2}) : test::cpu());
  Snapshot last = simulation.snapshot(), before = last;  // step before: u_n; and before that
  StepReport report;
  while (!simulation.finished()) {
    before = std::exchange(last, simulation.snapshot());
    report = simulation.step();
  }

  ASSERT_EQ(report.residual, std::numeric_limits<double>::max());
  EXPECT_FALSE(report.converged);
  EXPECT_GT(report.step, 1);
  ASSERT_FALSE(simulation.warnings().empty());
  EXPECT_NE(simulation.warnings().back().find("blew up"), std::string::npos);
  EXPECT_EQ(report.rotation_updates > 0, GetParam().in_an_update);
  const Snapshot s = simulation.snapshot();
  double moved = 0, size = 0, speed = 0;
  for (std::size_t i = 0; i < s.points.size(); ++i) {
    moved = std::max(moved, norm(s.displacement[i] - last.displacement[i]));
    size = std::max(size, norm(s.displacement[i]));
    speed = std::max(speed, norm(s.velocity[i]));
  }
  ASSERT_TRUE(std::isfinite(size) && std::isfinite(speed));
  EXPECT_GT(size, 0);
  EXPECT_EQ(moved > 0, GetParam().in_an_update);
  const double dt = setup.time.step;
  for (std::size_t i = 0; i < s.points.size(); ++i) {
    const bool newmark = GetParam().scheme == TimeScheme::newmark;
    const Vec3d since = s.displacement[i] - before.displacement[i];
    const Vec3d expected =
        newmark ? last.velocity[i] : (GetParam().in_an_update ? 0.5 / dt : 1 / dt) * since;
    ASSERT_LT(norm(s.velocity[i] - expected), kSteps * speed);
  }
}

INSTANTIATE_TEST_SUITE_P(
    All, BlowsUp,
    testing::Values(Ending{"newmark", false, TimeScheme::newmark, 1e152, false},
                    Ending{"newmark_later", false, TimeScheme::newmark, 5e151, false},
                    Ending{"central", false, TimeScheme::central, 1e152, false},
                    Ending{"central_update", false, TimeScheme::central, 5e151, true},
                    Ending{"fast_newmark", true, TimeScheme::newmark, 1e152, false},
                    Ending{"fast_central_update", true, TimeScheme::central, 5e151, true}),
    [](const auto& ending) { return ending.param.name; });

// The cycle runs out of numbers before forces do, and the first acceleration with it.
TEST(BlowsUp, AtOnceInSinglePrecision) {
  for (const TimeScheme scheme : {TimeScheme::newmark, TimeScheme::central})
    for (const double gravity : {1e40, 1e120, 1e152}) {
      SimulationSetup setup = falling_ball(scheme);
      setup.supports = {{{{-1, -1, -1}, {0.3, 2, 2}}, {}, {true, true, true}}};
      setup.loads = {Gravity{{0, -gravity, 0}}};
      setup.solver.tolerance = 1e-6;
      Simulation simulation(setup, make_fast_backend({.threads = 2, .single_cycle = true}));

      const StepReport report = simulation.step();

      EXPECT_FALSE(report.converged);
      const Snapshot s = simulation.snapshot();
      for (std::size_t i = 0; i < s.points.size(); ++i) {
        ASSERT_TRUE(std::isfinite(norm(s.displacement[i]))) << gravity;
        ASSERT_TRUE(std::isfinite(norm(s.velocity[i]))) << gravity;
      }
    }
}

// The first update moves the body by so much that, with the rotations of that, no force is a
// number; and what was there would drown in it.
TEST(BlowsUp, FromAnIncrementThatWentFar) {
  FreeBody body(10, {}, 1);  // of a long step, so that stiffness is most of the matrix
  const auto field = [&](double size) {
    return test::at_vertices(body.octree, body.level(), [&](const Vec3d& x) {
      return size * Vec3d{std::sin(9 * x.x), std::cos(7 * x.x), 2 + x.y};
    });
  };
  const std::vector<double> u = field(1e-7), v = field(1e-6);
  body.backend->write(0, body.state.displacement, u);
  body.backend->write(0, body.state.velocity, v);
  body.motion->start();
  body.backend->write(0, body.state.external, field(1e151));

  const NonlinearStats stats = body.motion->step();

  EXPECT_EQ(stats.residual, std::numeric_limits<double>::infinity());
  ASSERT_EQ(stats.rotation_updates, 1);
  const std::size_t n = body.level().point.size();
  EXPECT_EQ(test::read(*body.backend, body.state.displacement, n), u);
  const std::vector<double> velocity = test::read(*body.backend, body.state.velocity, n);
  for (std::size_t i = 0; i < v.size(); ++i) EXPECT_NEAR(velocity[i], v[i], 1e-6 * kSteps);
}

TEST(Newmark, OfOneDegreeOfFreedomHasItsDiscretePeriod) {
  for (const bool lumped : {false, true}) {
    Oscillator o;
    o.lumped = lumped;
    const std::vector<double> top = o.run();

    expect_close(top, newmark_closed_form(o, top.size()), o.rest());
    // Undamped: the amplitude stays, and the frequency is 2 / dt atan(omega dt / 2).
    EXPECT_NEAR(*std::min_element(top.begin(), top.end()), 2 * o.rest(), 0.02 * -o.rest());
    const double omega = std::sqrt(o.stiffness() / o.mass());
    const double period = M_PI * o.step / std::atan(0.5 * omega * o.step);
    const auto turns = static_cast<double>(top.size()) * o.step / period;
    int crossings = 0;
    for (std::size_t i = 1; i < top.size(); ++i)
      crossings += (top[i - 1] - o.rest()) * (top[i] - o.rest()) < 0;
    EXPECT_NEAR(crossings, 2 * turns, 1);
    ASSERT_GT(turns, 2);
  }
}

TEST(Newmark, DecaysByRayleighDamping) {
  for (const auto& [alpha, beta] : {std::pair{0.4, 0.0}, {0.0, 0.02}, {0.3, 0.01}}) {
    Oscillator o;
    o.alpha = alpha;
    o.beta = beta;
    const std::vector<double> top = o.run();

    expect_close(top, newmark_closed_form(o, top.size()), o.rest());
    // The logarithmic decrement of the continuous equation, near it for this step.
    const double omega = std::sqrt(o.stiffness() / o.mass());
    const double zeta = 0.5 * (alpha / omega + beta * omega);
    const double damped = omega * std::sqrt(1 - zeta * zeta);
    std::vector<double> peaks;
    for (std::size_t i = 1; i + 1 < top.size(); ++i)
      if (top[i] > top[i - 1] && top[i] > top[i + 1]) peaks.push_back(top[i] - o.rest());
    ASSERT_GE(peaks.size(), 2u);
    EXPECT_NEAR(std::log(peaks[0] / peaks[1]), zeta * omega * 2 * M_PI / damped, 0.05);
  }
}

TEST(CentralScheme, OfOneDegreeOfFreedomFollowsItsRecurrence) {
  for (const auto& [alpha, beta] : {std::pair{0.0, 0.0}, {0.4, 0.0}, {0.2, 0.01}}) {
    Oscillator o;
    o.scheme = TimeScheme::central;
    o.alpha = alpha;
    o.beta = beta;
    const std::vector<double> top = o.run();

    expect_close(top, central_closed_form(o, top.size()), o.rest());
    // Stiffness at the new time damps, whatever the step.
    EXPECT_LT(std::abs(top.back() - o.rest()), std::abs(o.rest()));
  }
}

}  // namespace
}  // namespace kerf
