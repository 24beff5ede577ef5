// SPDX-License-Identifier: MIT
//
// The fast backend with a single-precision cycle against the double reference: operation by
// operation, whole solves, and runs with cuts. That its double twin is right is for
// test_operators.cpp, against the oracle.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "core/simulation.hpp"
#include "core/solve/linear_solver.hpp"
#include "tests/support/as_one.hpp"
#include "tests/support/physics.hpp"
#include "tests/support/solves.hpp"

namespace kerf {
namespace {

using oracle::Vector;
using test::AsOne;
using test::Loaded;
using test::Problem;
using test::ProblemOptions;
using test::relative;
using test::Solved;

constexpr OperatorScale kDynamic{0.8, 400};
// Some ten roundings of single precision, of sums whose terms are as large as the largest entry.
constexpr double kSingle = 2e-6;
// Matrices of level 1 are integers of 16 bits, and those above are made from them.
constexpr double kCoded = 5e-5;
constexpr double kCodedSmoothed = 2e-2;
// Diagonal blocks are inverted; those of lone corners are ill-conditioned by a factor of tens.
constexpr double kSmoothed = 1e-4;

/// A cut octree of three materials, with held components and hanging corners.
Problem cut_octree() { return test::cut_block({21, 14, 11}, {9.3, 5.2, 4.1}, 5, 60); }

/// Values of all levels for some rotations of level 0, four numbers each.
void turn_to(const Problem& p, Backend& backend, const std::vector<double>& rotations) {
  backend.write_rotations(rotations);
  for (int l = 0; l < p.levels(); ++l) {
    if (l > 0) backend.coarsen(l - 1);
    backend.prepare(l);
  }
}

/// Products, and what a sweep of smoothing leaves, of level 0 as in the first reference, and of the
/// others as in the second with the rotations for each.
void expect_operators_alike(const Problem& p, Backend& finest, Backend& coarse,
                            const std::vector<std::vector<double>>& rotations, Backend& mixed) {
  for (int l = 0; l < p.levels(); ++l) {
    SCOPED_TRACE(::testing::Message() << "level " << l);
    Backend& exact = l == 0 ? finest : coarse;
    if (l > 0) turn_to(p, coarse, rotations[static_cast<std::size_t>(l)]);
    const Vector x = p.free_vector(l, 7), f = p.free_vector(l, 8);
    for (Backend* backend : {&exact, &mixed}) {
      test::write(*backend, l, kKrylovX, x);
      backend->apply(l, kKrylovX, kKrylovV);
    }
    EXPECT_LE(relative(p.read(mixed, l, kKrylovV), p.read(exact, l, kKrylovV)),
              l == 0 ? kSingle : kCoded);
    if (l + 1 == p.levels()) continue;
    for (Backend* backend : {&exact, &mixed}) {
      test::write(*backend, l, kRight, f);
      backend->zero(l, kSolution);
      backend->smooth(l, SweepOrder::forward, 2);
      backend->restrict_from_solution(l);
    }
    EXPECT_LE(relative(p.read(mixed, l, kSolution), p.read(exact, l, kSolution)),
              l == 0 ? kSmoothed : kCodedSmoothed);
    EXPECT_LE(relative(p.read(mixed, l + 1, kRight), p.read(exact, l + 1, kRight)),
              l == 0 ? kSmoothed : kCodedSmoothed);
  }
}

// Where the children of a cell have nearly one rotation, it has the matrix of their mean: from
// eight of one kind, and from whatever else a cut and hanging corners leave.
TEST(MixedPrecision, OperatorsAreThoseOfTheReferenceToSinglePrecision) {
  const Problem p = cut_octree();
  const Vector u = p.deformation();
  const Loaded exact(p, test::make_backend("cpu"), kDynamic, {}, u);
  const Loaded mean(p, test::make_backend("cpu"), kDynamic, {}, u);
  const Loaded mixed(p, test::make_backend("mixed"), kDynamic, {}, u);
  ASSERT_GE(p.levels(), 3);
  std::vector<double> rotations(4 * p.hierarchy.values.size());
  exact.backend->read_rotations(rotations);
  const AsOne ones = test::as_one(p, rotations);
  EXPECT_GT(ones.count[0][1], 4);
  EXPECT_GT(ones.count[1][1], 10);
  for (const auto& farthest : ones.farthest)
    EXPECT_LT(*std::max_element(farthest.begin(), farthest.end()), 0.1);
  expect_operators_alike(p, *exact.backend, *mean.backend, ones.rotations, *mixed.backend);
}

// Rotations that differ from parent to parent, and by a little or somewhat more within one, or in
// one of the parents; every other one as its negative, which is the same.
TEST(MixedPrecision, CellsTurnAsOneUpToATenthOfARadian) {
  ProblemOptions options;
  options.holds = test::Holds::one_side;
  options.coarsest_vertices = 60;
  options.materials = 1;
  options.with_oracle = false;
  for (const int refinement : {0, 1}) {
    const Problem p(LinkedOctree(test::box_body({72, 16, 16}), refinement), options);
    ASSERT_GE(p.levels(), 3);
    const Loaded exact(p, test::make_backend("cpu"), kDynamic, {}, p.deformation());
    const Loaded mean(p, test::make_backend("cpu"), kDynamic, {}, p.deformation());
    const Loaded mixed(p, test::make_backend("mixed"), kDynamic, {}, p.deformation());
    // Of cells of several sizes one may be passed on, as it is, beside the mean of eight.
    const double little = refinement == 0 ? 0.01 : 0.002;
    for (const auto& [off, slope] : {std::pair{0.0, 0.01}, std::pair{0.09, little},
                                     std::pair{0.11, 0.01}, std::pair{0.0, 0.05}}) {
      SCOPED_TRACE(::testing::Message()
                   << off << " and " << slope << " radians, refinement " << refinement);
      const Level& finest = p.hierarchy.levels[0];
      std::vector<double> rotations;
      for (std::int32_t c = 0; c < finest.cells(); ++c) {
        const Vec3i& at = finest.corner[c];
        const double angle = 0.4 + slope * (at[0] / 2 + 2 * (at[1] / 2) + 3 * (at[2] / 2)) +
                             (at[0] % 2 == 0 ? off : -off);
        const double sign = at[1] % 2 == 0 ? 1 : -1;
        for (const double part :
             {std::cos(angle / 2), 0.0, 0.6 * std::sin(angle / 2), 0.8 * std::sin(angle / 2)})
          rotations.push_back(sign * part);
      }
      turn_to(p, *exact.backend, rotations);
      turn_to(p, *mixed.backend, rotations);
      const AsOne ones = test::as_one(p, rotations, 0.1);
      EXPECT_GT(ones.count[0][1], 100);
      EXPECT_NEAR(ones.farthest[0][1], off, 1e-6);
      if (off < 0.1) {
        EXPECT_GT(ones.count[0][2], 20);
        EXPECT_NEAR(ones.farthest[0][2], 3 * slope, 1e-6);
        EXPECT_EQ(ones.count[0][3] > 0, slope < 0.05 && refinement == 0);
      }
      expect_operators_alike(p, *exact.backend, *mean.backend, ones.rotations, *mixed.backend);
      if (off == 0) continue;  // else the two references differ, so that one of them is not met
      test::write(*exact.backend, 1, kKrylovX, p.free_vector(1, 7));
      turn_to(p, *mean.backend, test::as_one(p, rotations).rotations[1]);
      test::write(*mean.backend, 1, kKrylovX, p.free_vector(1, 7));
      exact.backend->apply(1, kKrylovX, kKrylovV);
      mean.backend->apply(1, kKrylovX, kKrylovV);
      EXPECT_GT(relative(p.read(*exact.backend, 1, kKrylovV), p.read(*mean.backend, 1, kKrylovV)),
                20 * kCoded);
    }
  }
}

// Rotations that are far apart stay eight; and a coarse cell of lumped masses never is one element.
TEST(MixedPrecision, CoarseOperatorsAreExactForOneRotationAndForMany) {
  for (const bool lumped : {false, true}) {
    ProblemOptions options;
    options.coarsest_vertices = 60;
    options.lumped_mass = lumped;
    options.materials = 1;
    options.with_oracle = false;
    const Problem p(LinkedOctree(test::box_body({24, 16, 16}), 0), options);
    ASSERT_GE(p.levels(), 3);
    for (const bool many : {false, true}) {
      SCOPED_TRACE(::testing::Message() << (many ? "many" : "one") << (lumped ? ", lumped" : ""));
      const Loaded exact(p, test::make_backend("cpu"), kDynamic, {}, p.deformation());
      const Loaded mixed(p, test::make_backend("mixed"), kDynamic, {}, p.deformation());
      std::vector<double> rotations;
      test::Dice dice(3);
      for (std::int32_t c = 0; c < p.hierarchy.levels[0].cells(); ++c) {
        const double half = many ? dice.between(-1, 1) : 0.4, turn = many ? dice.between(0, 6) : 1;
        const std::array<double, 3> axis{0, std::cos(turn), std::sin(turn)};
        rotations.push_back(std::cos(half));
        for (const double component : axis) rotations.push_back(std::sin(half) * component);
      }
      turn_to(p, *exact.backend, rotations);
      turn_to(p, *mixed.backend, rotations);
      const std::vector<std::vector<double>> same(p.hierarchy.levels.size(), rotations);
      expect_operators_alike(p, *exact.backend, *exact.backend, same, *mixed.backend);
    }
  }
}

TEST(MixedPrecision, ForcesAndRotationsStayDouble) {
  constexpr double kDouble = 1e-12;
  const Problem p = cut_octree();
  const Vector u = p.deformation();
  const Loaded exact(p, test::make_backend("cpu"), kDynamic, {}, u);
  const Loaded mixed(p, test::make_backend("mixed"), kDynamic, {}, u);
  Vector force[2], product[2];
  std::vector<double> rotation[2];

  for (int i = 0; i < 2; ++i) {
    Backend& backend = *(i == 0 ? exact : mixed).backend;
    const int in = exact.extra, out = exact.extra + 1;
    backend.elastic_force(in, out);
    force[i] = p.read(backend, 0, out);
    backend.apply_scaled({-0.3, 170}, in, out);
    product[i] = p.read(backend, 0, out);
    rotation[i].resize(4 * p.hierarchy.values.size());
    backend.read_rotations(rotation[i]);
  }

  EXPECT_LE(relative(force[1], force[0]), kDouble);
  EXPECT_LE(relative(product[1], product[0]), kDouble);
  for (std::size_t k = 0; k < rotation[0].size(); ++k)
    ASSERT_NEAR(rotation[1][k], rotation[0][k], kDouble);
}

// Stored in single precision, but from a product in double: its size is right where the vectors
// nearly cancel.
TEST(MixedPrecision, TrueResidualIsFromAProductInDouble) {
  constexpr double kDouble = 1e-6, kSmall = 1e-7;
  const Problem p = cut_octree();
  const Vector x = p.free_vector(0, 31);
  const Loaded exact(p, test::make_backend("cpu"), kDynamic, {}, p.deformation());
  const Loaded mixed(p, test::make_backend("mixed"), kDynamic, {}, p.deformation());
  const int right = exact.extra, solution = exact.extra + 1;
  test::write(*exact.backend, 0, solution, x);
  exact.backend->apply(0, solution, right);
  const Vector product = p.read(*exact.backend, 0, right);
  const Vector b = product + kSmall * product.norm() * p.free_vector(0, 32).normalized();
  Vector left[2];
  double norm[2];

  for (int i = 0; i < 2; ++i) {
    Backend& backend = *(i == 0 ? exact : mixed).backend;
    test::write(backend, 0, right, b);
    test::write(backend, 0, solution, x);
    const int r = backend.conjugate_vectors().residual;
    norm[i] = backend.true_residual(right, solution, r);
    left[i] = p.read(backend, 0, r);
  }

  EXPECT_NEAR(norm[0], kSmall * product.norm(), 1e-3 * norm[0]);
  EXPECT_NEAR(norm[1], norm[0], kDouble * norm[0]);
  EXPECT_LE(relative(left[1], left[0]), kSingle);
}

/// One solve by conjugate gradients with a K-cycle.
Solved solve(const Problem& p, const std::string& machine, double tolerance) {
  SolverSetup setup;
  setup.cycle = CycleType::k;
  return test::solve(p, *test::make_backend(machine), setup, kDynamic, tolerance);
}

TEST(MixedPrecision, SolvesToATrueResidualThatSinglePrecisionNeverSees) {
  const Problem p = cut_octree();
  constexpr double kFar = 1e-11;

  const Solved exact = solve(p, "cpu", kFar), mixed = solve(p, "mixed", kFar);

  EXPECT_TRUE(mixed.stats.converged);
  EXPECT_LE(mixed.stats.residual, kFar);
  EXPECT_LE(std::abs(mixed.stats.cycles - exact.stats.cycles), 1);
  EXPECT_LE(relative(mixed.x, exact.x), 1e-8);  // the residual times the condition of the body
}

/// A block that sags and is cut on its way, in either mode.
SimulationSetup block(TimeMode mode) {
  SimulationSetup setup;
  setup.body = {test::box_solid({1, 1, 0.5}), 10, 1};
  setup.material = {1e5, 0.4, 1000, 0, 0.01};  // stiff enough to have one equilibrium
  setup.supports = {{{{-9, -9, -9}, {9, 0.001, 9}}, {}, {true, true, true}}};
  setup.loads = {Gravity{{3, -9.81, 0}}};
  setup.time.mode = mode;
  setup.time.duration = 0.2;
  setup.solver.tolerance = 1e-9;
  CutSetup cut;
  cut.start = 0.04;
  if (mode == TimeMode::dynamic) cut.end = 0.15;
  cut.lines = {{{0.53, 1.5, -1}, {0.57, 1.6, 2}}, {{0.48, 0.4, -1}, {0.52, 0.5, 2}}};
  setup.cuts = {cut};
  return setup;
}

std::vector<Vec3d> corners_after(const SimulationSetup& setup, std::unique_ptr<Backend> backend) {
  Simulation simulation(setup, std::move(backend));
  while (!simulation.finished()) EXPECT_TRUE(simulation.step().converged);
  return simulation.deformed_corners();
}

TEST(FastBackend, RunsWithCutsEndWhereTheReferenceEnds) {
  constexpr double kOfTheSolver = 1e-6;  // m of a block of 1 m: the tolerance times the steps
  for (const TimeMode mode : {TimeMode::dynamic, TimeMode::statics}) {
    const SimulationSetup setup = block(mode);
    const auto expected = corners_after(setup, test::make_backend("cpu"));
    for (const char* machine : {"fast", "mixed"}) {
      const auto found = corners_after(setup, test::make_backend(machine, 2));
      ASSERT_EQ(found.size(), expected.size());
      double worst = 0;
      for (std::size_t i = 0; i < found.size(); ++i)
        worst = std::max(worst, norm(found[i] - expected[i]));
      EXPECT_LE(worst, kOfTheSolver)
          << machine << (mode == TimeMode::dynamic ? ", dynamic" : ", static");
    }
  }
}

// Cells deep in a support take no part: neither do the coarse cells above them.
TEST(FastBackend, CoarseMatricesOverThickSupportsAreThoseOfTheReference) {
  constexpr double kDouble = 1e-12;
  ProblemOptions options;
  options.holds = test::Holds::none;
  options.with_oracle = false;
  for (const int refinement : {0, 2}) {
    Hierarchy h =
        Problem(LinkedOctree(test::box_body({30, 12, 11}), refinement), options).hierarchy;
    for (std::size_t v = 0; v < h.levels[0].point.size(); ++v)
      if (h.levels[0].point[v][0] <= 18) h.levels[0].fixed[v] = 7;
    build_coarse_levels(h, {30, 0, true});
    ASSERT_GE(h.levels.size(), 3u);
    const auto exact = test::make_backend("cpu"), fast = test::make_backend("fast");
    for (Backend* backend : {exact.get(), fast.get()}) {
      backend->load(h);
      backend->set_operator({1, 0});
      for (int l = 0; l + 1 < static_cast<int>(h.levels.size()); ++l) backend->coarsen(l);
    }
    for (int l = 1; l < static_cast<int>(h.levels.size()); ++l) {
      std::vector<double> a(300), b(300);
      double worst = 0, largest = 0;
      for (std::int32_t c = 0; c < h.levels[l].cells(); ++c) {
        exact->read_cell_matrix(l, c, a);
        fast->read_cell_matrix(l, c, b);
        for (std::size_t e = 0; e < a.size(); ++e) {
          worst = std::max(worst, std::abs(a[e] - b[e]));
          largest = std::max(largest, std::abs(a[e]));
        }
      }
      EXPECT_LE(worst, kDouble * largest) << "level " << l << ", refinement " << refinement;
    }
  }
}

/// All operations that do not depend on what was done before, of every level, one after another.
std::vector<Vector> results_of(const Problem& p, Backend& backend) {
  std::vector<Vector> out;
  backend.set_operator(kDynamic);
  backend.prepare(0);
  for (int l = 0; l < p.levels(); ++l) {
    if (l > 0) backend.coarsen(l - 1), backend.prepare(l);
    test::write(backend, l, kKrylovX, p.free_vector(l, 7));
    backend.apply(l, kKrylovX, kKrylovV);
    out.push_back(p.read(backend, l, kKrylovV));
    backend.precondition_jacobi(l, kKrylovX, kKrylovV);
    out.push_back(p.read(backend, l, kKrylovV));
  }
  for (int l = 0; l + 1 < p.levels(); ++l) {
    test::write(backend, l, kResidual, p.free_vector(l, 8));
    backend.restrict_residual(l);
    out.push_back(p.read(backend, l + 1, kRight));
    test::write(backend, l + 1, kSolution, p.free_vector(l + 1, 9));
    test::write(backend, l, kSolution, p.free_vector(l, 10));
    backend.prolong_correction(l);
    out.push_back(p.read(backend, l, kSolution));
  }
  return out;
}

/// Whether a cell may be met if its vertices move by what they lose when they are rounded.
bool may_be_met_rounded(const Problem& p, const Vector& u, std::int32_t cell,
                        const BladeReach& reach) {
  constexpr double kRounding = 2e-7;  // half a unit in the last place, and one for the box: 1.8e-7
  const Level& level = p.hierarchy.levels[0];
  Box3 box;
  double farthest = 0;
  for (const std::int32_t v : level.slots[cell]) {
    Vec3d at;
    for (int d = 0; d < 3; ++d) {
      at[d] = p.hierarchy.spacing * level.point[v][d] + u[3 * v + d];
      farthest = std::max(farthest, std::abs(at[d]));
    }
    box.add(at);
  }
  const double by = kRounding * farthest;
  return reach.may_meet({box.lo - Vec3d{by, by, by}, box.hi + Vec3d{by, by, by}}, false);
}

void expect_near(const Problem& p, const Backend& fast, int vector, const TriangleMesh& blade) {
  const Vector at = p.deformation();
  std::vector<std::int32_t> opened = opened_cells(p.body), others;
  std::sort(opened.begin(), opened.end());
  const BladeReach reach(blade, p.body.lattice().origin);
  const NearCells expected = near_cells(p.hierarchy, test::span_of(at), reach, opened),
                  found = fast.find_near(vector, reach, opened);
  EXPECT_TRUE(std::is_sorted(found.cells.begin(), found.cells.end()));
  EXPECT_TRUE(std::includes(found.cells.begin(), found.cells.end(), expected.cells.begin(),
                            expected.cells.end()));
  std::set_difference(found.cells.begin(), found.cells.end(), expected.cells.begin(),
                      expected.cells.end(), std::back_inserter(others));
  for (const std::int32_t c : others)
    EXPECT_TRUE(may_be_met_rounded(p, at, c, reach)) << "cell " << c;
  EXPECT_EQ(found.finite, expected.finite);
  for (int d = 0; d < 3; ++d) {
    EXPECT_EQ(found.bounds.lo[d], expected.bounds.lo[d]);
    EXPECT_EQ(found.bounds.hi[d], expected.bounds.hi[d]);
  }
}

// A cut changes patches in place, or makes them again elsewhere; vectors and rotations move.
TEST(FastBackend, FollowsCutsAsIfLoadedAfterThem) {
  constexpr double kDouble = 1e-12;
  for (const int refinement : {0, 1, 2}) {
    ProblemOptions options;
    options.coarsest_vertices = 1;
    options.max_levels = 3;
    options.with_oracle = false;
    const Voxels voxels = test::box_body({33, 18, 14});
    Problem p(LinkedOctree(voxels, refinement), options);
    const auto fast = test::make_backend("fast", 2), reference = test::make_backend("cpu");
    const int held = fast->add_vector(), work = fast->add_vector();
    reference->add_vector(), reference->add_vector();
    fast->load(p.hierarchy);
    LevelUpdater updater;
    test::Dice dice(refinement + 1);
    test::RandomBlades random(voxels.lattice, dice);
    for (int i = 0; i < 5; ++i) {
      SCOPED_TRACE(::testing::Message() << "refinement " << refinement << ", blade " << i);
      const Vector before = test::random_vector(p.unknowns(0), 3);
      test::write(*fast, 0, held, before);
      test::write(*fast, 0, work, p.deformation());
      fast->rotate_cells(work);
      std::vector<double> rotation(4 * p.hierarchy.values.size());
      fast->read_rotations(rotation);

      const TriangleMesh blade = random.next();
      expect_near(p, *fast, work, blade);
      ASSERT_TRUE(p.update(updater, cut(p.body, {}, blade, i + 1)));
      const LevelChange& change = updater.change().levels[0];
      fast->update(p.hierarchy, updater.change());

      Vector kept = Vector::Zero(static_cast<Eigen::Index>(p.unknowns(0)));
      kept.head(before.size()) = before;
      ASSERT_EQ(p.read(*fast, 0, held), kept);
      for (const std::int32_t origin : change.origin)
        for (std::size_t k = 0; k < 4; ++k)
          rotation.push_back(rotation[4 * static_cast<std::size_t>(origin) + k]);
      std::vector<double> now(rotation.size());
      fast->read_rotations(now);
      ASSERT_EQ(now, rotation);
      reference->load(p.hierarchy);
      reference->write_rotations(rotation);
      const std::vector<Vector> found = results_of(p, *fast), expected = results_of(p, *reference);
      for (std::size_t n = 0; n < found.size(); ++n) {
        ASSERT_LE(relative(found[n], expected[n]), kDouble * (n % 2 == 1 ? 100 : 1)) << n;
      }
    }
  }
}

// Here the errors of 16-bit entries make the coarsest matrix indefinite, though the body is held.
TEST(MixedPrecision, SolvesWhereCodedMatricesWouldBeIndefinite) {
  constexpr double kTolerance = 1e-9;
  const Problem p = test::cut_block({21, 14, 11}, {9.24, 5.88, 5.17}, 8, 200);
  const SolveStats stats = solve(p, "mixed", kTolerance).stats;
  EXPECT_TRUE(stats.converged);
  EXPECT_LE(stats.residual, kTolerance);
  EXPECT_LT(stats.cycles, 40);
}

// A single loose cell gives a large coarse cell entries over many orders of magnitude.
TEST(MixedPrecision, SolvesBodiesWithLooseCellsInDynamics) {
  constexpr double kTolerance = 1e-9;
  constexpr OperatorScale kSlow{1, 3};
  ProblemOptions options;
  options.holds = test::Holds::one_side;
  options.coarsest_vertices = 60;
  options.materials = 1;
  options.with_oracle = false;
  const auto is_inside = [](const Vec3i& c) {
    for (const Vec3i& loose :
         {Vec3i{40, 3, 5}, Vec3i{48, 8, 8}, Vec3i{63, 15, 15}, Vec3i{33, 0, 7}})
      if (c == loose) return 1;
    return c[0] < 30 ? 1 : 0;
  };
  const Problem p(LinkedOctree(test::make_voxels(test::lattice_of({64, 16, 16}), is_inside), 1),
                  options);
  ASSERT_GE(p.hierarchy.levels.size(), 5u);
  const auto cycles = [&](const char* machine) {
    const SolveStats stats =
        test::solve(p, *test::make_backend(machine), {}, kSlow, kTolerance).stats;
    EXPECT_TRUE(stats.converged) << machine;
    EXPECT_LE(stats.residual, kTolerance) << machine;
    return stats.cycles;
  };
  const int exact = cycles("fast");
  EXPECT_LE(cycles("mixed"), exact + 2);
}

// What the vector held before does not matter, and a fixed number of cycles gets as far as in
// double.
TEST(MixedPrecision, EveryMethodSolvesFromAnything) {
  const Problem p = cut_octree();
  for (const char* machine : {"fast", "mixed"})
    for (const SolverMethod method : {SolverMethod::cg, SolverMethod::multigrid,
                                      SolverMethod::cg_jacobi, SolverMethod::cholesky})
      for (const int cycles : {0, 30}) {
        SCOPED_TRACE(::testing::Message() << machine << ' ' << int(method) << ' ' << cycles);
        SolverSetup setup;
        setup.method = method;
        setup.cycles = cycles;
        const auto backend = test::make_backend(machine, 2);
        const Solved solved = test::solve(p, *backend, setup, kDynamic, 1e-11);
        EXPECT_TRUE(solved.stats.converged);
        const int x = backend->add_vector(), b = backend->add_vector();
        test::write(*backend, 0, x, solved.x);
        backend->apply(0, x, b);
        const Vector right = test::right_of_solve(p);
        // 30 cycles alone, or 30 steps with Jacobi, are too few here.
        const bool is_enough =
            cycles == 0 || method == SolverMethod::cg || method == SolverMethod::cholesky;
        if (is_enough) {
          EXPECT_LE(relative(p.read(*backend, 0, b), right), 5e-10);
        }
        if (cycles > 0 && method != SolverMethod::cholesky) {
          EXPECT_EQ(solved.stats.cycles, cycles);
        }
      }
}

// A factor of slightly older rotations serves; one of another structure or operator does not.
TEST(LinearSolver, KeepsTheFactorOfTheCoarsestLevelWhileItServes) {
  constexpr double kTolerance = 1e-9;
  const Problem p = cut_octree();
  for (const char* machine : {"cpu", "fast", "mixed"}) {
    SCOPED_TRACE(machine);
    const auto backend = test::make_backend(machine);
    LinearSolver solver(*backend, {});
    const int b = backend->add_vector(), x = backend->add_vector();
    const auto solves = [&](double turn) {
      test::write(*backend, 0, x, turn * p.deformation());
      backend->rotate_cells(x);
      solver.refresh();
      test::write(*backend, 0, b, p.free_vector(0, 101));
      backend->zero(0, x);
      const SolveStats stats = solver.solve(b, x, kTolerance);
      EXPECT_TRUE(stats.converged);
      EXPECT_LE(stats.residual, kTolerance);
    };
    backend->load(p.hierarchy);
    solver.set_structure(p.hierarchy);
    backend->set_operator({1, 0});
    solves(1);
    EXPECT_EQ(solver.factors(), 1);
    solves(1.001);
    EXPECT_EQ(solver.factors(), 1);
    backend->set_operator(kDynamic);
    solves(1.001);
    EXPECT_EQ(solver.factors(), 2);
    backend->load(p.hierarchy);
    solves(1.001);
    EXPECT_EQ(solver.factors(), 3);
  }
}

}  // namespace
}  // namespace kerf
