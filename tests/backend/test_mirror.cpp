// SPDX-License-Identifier: MIT
//
// The backend of a device, on the mirror, against the double reference: operation by operation,
// whole solves, and runs with cuts; what it sends and when; and that no result depends on the order
// in which threads run. That its double twin is right is also for test_operators.cpp.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "core/simulation.hpp"
#include "core/solve/linear_solver.hpp"
#include "tests/support/physics.hpp"
#include "tests/support/solves.hpp"

namespace kerf {
namespace {

using oracle::Vector;
using test::counters_of;
using test::Loaded;
using test::make_mirror_backend;
using test::MirrorOptions;
using test::Problem;
using test::ProblemOptions;
using test::relative;
using test::Solved;
using test::ThreadOrder;

constexpr OperatorScale kDynamic{0.8, 400};
// Some hundred roundings of sums whose terms are as large as the largest entry.
constexpr double kDouble = 1e-12;
// The same of single precision.
constexpr double kSingle = 1e-5;
// Diagonal blocks are inverted; those of lone corners are ill-conditioned by a factor of tens.
constexpr double kSmoothed = 2e-4;

/// A cut octree of three materials, with held components and hanging corners.
Problem cut_octree() { return test::cut_block({15, 10, 9}, {7.3, 5.2, 4.1}, 4, 60); }

// ---- operation by operation --------------------------------------------------------------------

class Parity : public ::testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    const std::string why = test::why_missing(GetParam());
    if (why.empty()) return;
    if (test::is_required(GetParam())) FAIL() << why;
    GTEST_SKIP() << why;
  }
  static bool is_mixed() { return GetParam().find("mixed") != std::string::npos; }
  static double operators() { return is_mixed() ? kSingle : kDouble; }
  static double smoothed() { return is_mixed() ? kSmoothed : 100 * kDouble; }
  static std::unique_ptr<Backend> machine() { return test::make_backend(GetParam()); }
};

INSTANTIATE_TEST_SUITE_P(Device, Parity,
                         ::testing::Values("mirror", "mirror_mixed", "cuda", "cuda_mixed"),
                         [](const auto& parameters) { return parameters.param; });

TEST_P(Parity, OfProductsSmoothingAndTransfer) {
  const Problem p = cut_octree();
  const Vector u = p.deformation();
  ASSERT_GE(p.levels(), 3);
  for (const bool chebyshev : {true, false}) {
    SmootherOptions smoother;
    smoother.chebyshev = chebyshev;
    const Loaded exact(p, test::make_backend("cpu"), kDynamic, smoother, u);
    const Loaded mirror(p, machine(), kDynamic, smoother, u);
    for (int l = 0; l < p.levels(); ++l) {
      SCOPED_TRACE(::testing::Message() << "level " << l << (chebyshev ? "" : ", Gauss-Seidel"));
      const Vector x = p.free_vector(l, 7), f = p.free_vector(l, 8);
      double norm[2] = {};
      for (const Loaded* loaded : {&exact, &mirror}) {
        Backend& backend = *loaded->backend;
        test::write(backend, l, kKrylovX, x);
        backend.apply(l, kKrylovX, kKrylovV);
        test::write(backend, l, kRight, f);
        backend.precondition_jacobi(l, kRight, kScratch);
        if (l + 1 == p.levels()) continue;
        backend.zero(l, kSolution);
        backend.smooth(l, SweepOrder::forward, 1);
        backend.smooth(l, SweepOrder::backward, 1);
        norm[loaded == &mirror] = backend.residual(l);
        backend.restrict_residual(l);
        backend.copy(l + 1, kRight, kSolution);
        backend.prolong_correction(l);
      }
      const auto both = [&](int level, int id, double tolerance) {
        EXPECT_LE(relative(p.read(*mirror.backend, level, id), p.read(*exact.backend, level, id)),
                  tolerance)
            << "vector " << id;
      };
      both(l, kKrylovV, operators());
      both(l, kScratch, smoothed());
      if (l + 1 == p.levels()) continue;
      both(l, kResidual, smoothed());
      both(l, kSolution, smoothed());
      both(l + 1, kRight, smoothed());
      EXPECT_NEAR(norm[1], norm[0], smoothed() * norm[0]);
      EXPECT_NEAR(mirror.backend->spectral_bound(l), exact.backend->spectral_bound(l),
                  1e-4 * exact.backend->spectral_bound(l));
    }
  }
}

TEST_P(Parity, OfMatricesAndTheCoarsestSolution) {
  const Problem p = cut_octree();
  const Vector u = p.deformation();
  const Loaded exact(p, test::make_backend("cpu"), kDynamic, {}, u);
  const Loaded mirror(p, machine(), kDynamic, {}, u);
  for (int l = 0; l < p.levels(); ++l) {
    std::vector<double> a(300), b(300);
    double worst = 0, largest = 0;
    for (std::int32_t c = 0; c < p.level(l).cells(); ++c) {
      exact.backend->read_cell_matrix(l, c, a);
      mirror.backend->read_cell_matrix(l, c, b);
      for (std::size_t e = 0; e < a.size(); ++e) {
        worst = std::max(worst, std::abs(a[e] - b[e]));
        largest = std::max(largest, std::abs(a[e]));
      }
    }
    EXPECT_LE(worst, operators() * largest) << "level " << l;
  }

  const int last = p.levels() - 1;
  const Vector f = p.free_vector(last, 9);
  for (const Loaded* loaded : {&exact, &mirror}) {
    EXPECT_FALSE(loaded->backend->has_factor());
    loaded->backend->factor_coarsest();
    EXPECT_TRUE(loaded->backend->has_factor());
    test::write(*loaded->backend, last, kRight, f);
    loaded->backend->solve_coarsest();
  }
  const Vector found = p.read(*mirror.backend, last, kSolution);
  // The residual, since the matrix may be as good as singular.
  test::write(*exact.backend, last, kKrylovX, found);
  exact.backend->apply(last, kKrylovX, kKrylovV);
  EXPECT_LE(relative(p.read(*exact.backend, last, kKrylovV), f), is_mixed() ? 1e-2 : 1e-9);
}

TEST_P(Parity, OfForcesAndRotations) {
  constexpr double kRotation = 1e-12;  // double in both
  const Problem p = cut_octree();
  const Vector u = p.deformation();
  const Loaded exact(p, test::make_backend("cpu"), kDynamic, {}, u);
  const Loaded mirror(p, machine(), kDynamic, {}, u);
  Vector force[2], product[2];
  std::vector<double> rotation[2];

  for (int i = 0; i < 2; ++i) {
    Backend& backend = *(i == 0 ? exact : mirror).backend;
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
    ASSERT_NEAR(rotation[1][k], rotation[0][k], kRotation);
}

TEST_P(Parity, OfVectorsAndParts) {
  const Problem p = cut_octree();
  const Loaded mirror(p, machine(), kDynamic, {}, p.deformation());
  Backend& backend = *mirror.backend;
  const int x = mirror.extra, y = mirror.extra + 1;
  const Vector a = test::random_vector(p.unknowns(0), 1), b = test::random_vector(p.unknowns(0), 2);
  test::write(backend, 0, x, a);
  test::write(backend, 0, y, b);

  EXPECT_NEAR(backend.dot(0, x, y), a.dot(b), kDouble * a.norm() * b.norm());
  backend.combine(0, 2, x, -3, y);
  EXPECT_LE(relative(p.read(backend, 0, y), 2 * a - 3 * b), kDouble);
  backend.copy(0, x, kRight);  // to the precision of the cycle
  EXPECT_LE(relative(p.read(backend, 0, kRight), a), is_mixed() ? 1e-7 : 0);
  backend.mask(0, x);
  EXPECT_EQ(p.read(backend, 0, x), oracle::masked(a, p.fixed(0)));

  const std::vector<std::int32_t> some{5, 2, 400};
  std::vector<double> values(9), back(9);
  for (std::size_t i = 0; i < 9; ++i) values[i] = 0.5 * static_cast<double>(i);
  for (const int id : {y, static_cast<int>(kSolution)}) {
    backend.write_some(0, id, some, values);
    backend.read_some(0, id, some, back);
    EXPECT_EQ(back, values);
    EXPECT_EQ(p.read(backend, 0, id)[3 * 400 + 1], values[7]);
  }
}

// ---- whole solves ------------------------------------------------------------------------------

Solved solve(const Problem& p, std::unique_ptr<Backend> machine, CycleType cycle, double tolerance,
             bool chebyshev = true) {
  SolverSetup setup;
  setup.cycle = cycle;
  setup.smoother = chebyshev ? SmootherType::chebyshev : SmootherType::gauss_seidel;
  return test::solve(p, *machine, setup, kDynamic, tolerance);
}

TEST_P(Parity, OfResidualHistories) {
  const Problem p = cut_octree();
  for (const CycleType cycle : {CycleType::v, CycleType::w})
    for (const bool chebyshev : {true, false}) {
      if (is_mixed() && !chebyshev) continue;
      const Solved exact = solve(p, test::make_backend("cpu"), cycle, 1e-9, chebyshev);
      const Solved found = solve(p, machine(), cycle, 1e-9, chebyshev);
      ASSERT_LE(found.history.size(), exact.history.size() + (is_mixed() ? 1 : 0));
      // The coarsest solution is another sum; what it rounds off the next cycles amplify.
      const double tolerance = is_mixed() ? 0.2 : 1e-4;
      for (std::size_t i = 0; i < std::min(exact.history.size(), found.history.size()); ++i)
        EXPECT_NEAR(found.history[i], exact.history[i], tolerance * exact.history[i]) << i;
      EXPECT_LE(relative(found.x, exact.x), 1e-6);
    }
}

TEST_P(Parity, OfKCyclesInTheNumberOfSteps) {
  const Problem p = cut_octree();
  const Solved exact = solve(p, test::make_backend("cpu"), CycleType::k, 1e-9);
  const Solved found = solve(p, machine(), CycleType::k, 1e-9);

  EXPECT_TRUE(found.stats.converged);
  EXPECT_LE(found.stats.cycles, exact.stats.cycles + 1);
}

// By W-cycles: of K-cycles a device runs both steps where the host may stop after one.
TEST_P(Parity, OfCyclesThatSolveLevelOneOnce) {
  const Problem p = cut_octree();
  ASSERT_GE(p.levels(), 4);
  const auto solution = [&](std::unique_ptr<Backend> backend, int first_twice) {
    const Loaded loaded(p, std::move(backend), kDynamic, {}, p.deformation());
    loaded.backend->factor_coarsest();
    test::write(*loaded.backend, 0, kRight, p.free_vector(0, 55));
    loaded.backend->zero(0, kSolution);
    CycleOptions options{CycleType::w};
    options.first_twice = first_twice;
    Cycle(*loaded.backend, p.levels(), options).run();
    return p.read(*loaded.backend, 0, kSolution);
  };
  const Vector twice = solution(test::make_backend("cpu"), 1);
  const Vector once = solution(test::make_backend("cpu"), 2);
  const Vector found = solution(machine(), 2);
  const double tolerance = is_mixed() ? 1e-4 : 1e-9;
  EXPECT_LE(relative(found, once), tolerance);
  EXPECT_GT(relative(twice, once), 10 * tolerance);
}

TEST_P(Parity, OfATrueResidualThatSinglePrecisionNeverSees) {
  constexpr double kFar = 1e-11;
  const Problem p = cut_octree();
  const Solved exact = solve(p, test::make_backend("cpu"), CycleType::v, kFar);
  const Solved found = solve(p, machine(), CycleType::v, kFar);

  EXPECT_TRUE(found.stats.converged);
  EXPECT_LE(found.stats.residual, kFar);
  EXPECT_LE(found.stats.cycles, exact.stats.cycles + 2);
  EXPECT_LE(relative(found.x, exact.x), 1e-8);  // the residual times the condition of the body
}

TEST_P(Parity, OfGaussSeidelToATrueResidual) {
  const Problem p = cut_octree();
  const Solved exact = solve(p, test::make_backend("cpu"), CycleType::v, 1e-9, false);
  const Solved found = solve(p, machine(), CycleType::v, 1e-9, false);

  EXPECT_TRUE(found.stats.converged);
  EXPECT_LE(found.stats.cycles, exact.stats.cycles + 2);
  EXPECT_LE(relative(found.x, exact.x), 1e-6);
}

// Load and product are nearly the same: what is left of them needs a product in double.
TEST_P(Parity, OfATrueResidualWhereVectorsNearlyCancel) {
  constexpr double kSmall = 1e-7;
  const Problem p = cut_octree();
  const Loaded exact(p, test::make_backend("cpu"), kDynamic, {}, p.deformation());
  const Loaded mirror(p, machine(), kDynamic, {}, p.deformation());
  const int right = exact.extra, solution = exact.extra + 1;
  const Vector x = p.free_vector(0, 31);
  test::write(*exact.backend, 0, solution, x);
  exact.backend->apply(0, solution, right);
  const Vector product = p.read(*exact.backend, 0, right);
  const Vector left = kSmall * product.norm() * p.free_vector(0, 32).normalized();
  Backend& backend = *mirror.backend;
  test::write(backend, 0, right, product + left);
  test::write(backend, 0, solution, x);

  const int r = backend.conjugate_vectors().residual;
  const double norm = backend.true_residual(right, solution, r);

  EXPECT_NEAR(norm, left.norm(), 1e-5 * left.norm());
  EXPECT_LE(relative(p.read(backend, 0, r), left), kSingle);
}

// x follows the direction as it is stored, so that r stays what x leaves.
TEST_P(Parity, OfStepsOfConjugateGradients) {
  const Problem p = cut_octree();
  const Loaded mirror(p, machine(), kDynamic, {}, p.deformation());
  Backend& backend = *mirror.backend;
  const int b = mirror.extra, x = mirror.extra + 1;
  const auto [r, d, q, rounded] = backend.conjugate_vectors();
  EXPECT_EQ(rounded, is_mixed());
  test::write(backend, 0, b, p.free_vector(0, 33));
  test::write(backend, 0, x, p.free_vector(0, 34));
  double greatest = backend.true_residual(b, x, r);
  const auto step = [&](ConjugateState& state) {
    backend.copy(0, r, kRight);
    backend.precondition_jacobi(0, kRight, kSolution);
    return backend.advance_conjugate(kSolution, d, q, x, r, state);
  };

  ConjugateState state;
  for (int i = 0; i < 5; ++i) {
    ASSERT_TRUE(step(state));
    const Vector of_recursion = p.read(backend, 0, r);
    greatest = std::max(greatest, of_recursion.norm());
    EXPECT_NEAR(std::sqrt(state.residual2), of_recursion.norm(), 1e-6 * greatest);
    backend.true_residual(b, x, r);
    EXPECT_LE((p.read(backend, 0, r) - of_recursion).norm(), 0.1 * operators() * greatest);
    test::write(backend, 0, r, of_recursion);
  }

  // Of an operator that is not definite nothing is kept.
  const Vector before_x = p.read(backend, 0, x), before_r = p.read(backend, 0, r);
  backend.set_operator({-kDynamic.stiffness, -kDynamic.mass});
  EXPECT_FALSE(step(state));
  EXPECT_EQ(p.read(backend, 0, x), before_x);
  EXPECT_EQ(p.read(backend, 0, r), before_r);
}

TEST_P(Parity, OfVectorsThatKeepTheirPrecisionThroughLoads) {
  const Problem p = cut_octree();
  std::unique_ptr<Backend> owner = machine();
  Backend& backend = *owner;
  std::vector<int> rough{backend.add_rough_vector()}, exact{backend.add_vector()};
  const Vector value = p.free_vector(0, 35);
  for (int load = 0; load < 2; ++load) {
    backend.load(p.hierarchy);
    exact.push_back(backend.add_vector());
    rough.push_back(backend.add_rough_vector());
    for (const auto* some : {&exact, &rough})
      for (const int id : *some) {
        EXPECT_EQ(p.read(backend, 0, id).norm(), 0);
        test::write(backend, 0, id, value);
      }
    for (const int id : exact) EXPECT_EQ(p.read(backend, 0, id), value);
    for (const int id : rough) {
      const double off = relative(p.read(backend, 0, id), value);
      EXPECT_LE(off, 1e-7);
      EXPECT_EQ(off > 0, is_mixed());
    }
  }
}

// The same bodies in the same order: a GPU rounds as the host does, and again the next time.
TEST_P(Parity, OfBitsWithTheMirror) {
  const Problem p = cut_octree();
  const Solved expected = solve(p, make_mirror_backend(is_mixed()), CycleType::k, 1e-6);
  for (int run = 0; run < 2; ++run) {
    const Solved found = solve(p, machine(), CycleType::k, 1e-6);
    EXPECT_EQ(found.history, expected.history);
    EXPECT_EQ(std::memcmp(found.x.data(), expected.x.data(), sizeof(double) * p.unknowns(0)), 0);
  }
}

TEST(MirrorSolve, GivesTheSameBitsInAnyOrderOfThreads) {
  const Problem p = cut_octree();
  for (const bool single : {false, true})
    for (const bool chebyshev : {true, false}) {
      const Solved expected = solve(p, make_mirror_backend(single), CycleType::k, 1e-6, chebyshev);
      for (const ThreadOrder order : {ThreadOrder::falling, ThreadOrder::strided}) {
        MirrorOptions options;
        options.order = order;
        const Solved found =
            solve(p, make_mirror_backend(single, options), CycleType::k, 1e-6, chebyshev);
        EXPECT_EQ(found.history, expected.history);
        EXPECT_EQ(std::memcmp(found.x.data(), expected.x.data(), sizeof(double) * p.unknowns(0)),
                  0);
      }
    }
}

TEST(MirrorSolve, TheHostHearsOfEachCycleOnce) {
  const Problem p = cut_octree();
  std::unique_ptr<Backend> machine = make_mirror_backend(true);
  Backend& backend = *machine;
  SolverSetup setup;
  setup.cycle = CycleType::k;
  LinearSolver solver(backend, setup);
  const int b = backend.add_vector(), x = backend.add_vector();
  backend.load(p.hierarchy);
  solver.set_structure(p.hierarchy);
  backend.set_operator(kDynamic);
  solver.refresh();
  test::write(backend, 0, b, p.free_vector(0, 101));

  const std::size_t recorded_before = counters_of(backend).recordings;
  solver.solve(b, x, 1e-8);  // records the cycle
  EXPECT_EQ(counters_of(backend).recordings, recorded_before + 1);
  backend.combine(0, 0.5, b, 0, x);  // far from the solution again
  const gpu::DeviceCounters before = counters_of(backend);
  const SolveStats stats = solver.solve(b, x, 1e-8);
  const gpu::DeviceCounters after = counters_of(backend);

  ASSERT_GT(stats.cycles, 2);
  // |b|, the true residual before and after, and where it takes the place of that of the recursion:
  // each five digits, and each time that the recursion ended too early.
  const std::size_t downloads = after.downloads - before.downloads;
  const auto cycles = static_cast<std::size_t>(stats.cycles);
  EXPECT_GE(downloads, cycles + 3);
  EXPECT_LE(downloads, cycles + 3 + 3);
  EXPECT_LE(after.bytes_down - before.bytes_down, 64 * downloads);
  EXPECT_EQ(after.bytes_up, before.bytes_up);
  EXPECT_EQ(after.recordings, before.recordings);
  EXPECT_EQ(after.replays - before.replays, cycles);
  EXPECT_EQ(after.bytes_held, before.bytes_held);
}

TEST(MirrorSolve, CycleIsRecordedOnceForAllValuesOfOneStructure) {
  const Problem p = cut_octree();
  std::unique_ptr<Backend> machine = make_mirror_backend(false);
  Backend& backend = *machine;
  LinearSolver solver(backend, {});
  const int b = backend.add_vector(), x = backend.add_vector();
  backend.load(p.hierarchy);
  solver.set_structure(p.hierarchy);
  for (const double mass : {400.0, 900.0, 3e4}) {
    backend.set_operator({1, mass});
    test::write(backend, 0, x, mass / 400 * p.deformation());
    backend.rotate_cells(x);
    solver.refresh();
    test::write(backend, 0, b, p.free_vector(0, 101));
    backend.zero(0, x);
    EXPECT_TRUE(solver.solve(b, x, 1e-9).converged);
  }
  EXPECT_EQ(counters_of(backend).recordings, 1u);
}

// So that a factor that is due in the middle of a solve does not end a run for want of memory.
TEST(MirrorSolve, ASecondFactorAsksForNoMemory) {
  const Problem p = cut_octree();
  for (const bool single : {false, true}) {
    const Loaded mirror(p, make_mirror_backend(single), kDynamic, {}, p.deformation());
    mirror.backend->factor_coarsest();
    const std::size_t before = counters_of(*mirror.backend).allocations;
    mirror.backend->factor_coarsest();
    EXPECT_EQ(counters_of(*mirror.backend).allocations, before);
  }
}

TEST(MirrorSolve, LooseBodyIsAnErrorThatNamesTheRemedy) {
  for (const bool single : {false, true}) {
    ProblemOptions options;
    options.holds = test::Holds::none;
    options.with_oracle = false;
    options.coarsest_vertices = 1000;  // one level
    const Problem p("uniform", options);
    const Loaded mirror(p, make_mirror_backend(single), {1, 0}, {}, p.deformation());
    try {
      mirror.backend->factor_coarsest();
      FAIL() << "a body that floats was factored";
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find("[[support]]"), std::string::npos);
    }
    EXPECT_FALSE(mirror.backend->has_factor());
  }
}

}  // namespace
}  // namespace kerf
