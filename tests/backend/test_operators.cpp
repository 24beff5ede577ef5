// SPDX-License-Identifier: MIT
//
// Every operator of a backend against global matrices that share no code with it, on bodies with
// cuts, duplicates, hanging corners, supports and several materials, turned and bent.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <tuple>

#include "core/levels/colours.hpp"
#include "core/solve/cycle.hpp"
#include "core/solve/linear_solver.hpp"
#include "tests/support/problem.hpp"

namespace kerf {
namespace {

using oracle::Sparse;
using oracle::Vector;
using test::Holds;
using test::Loaded;
using test::Problem;
using test::ProblemOptions;

// Some hundred roundings of sums whose terms are as large as the largest entry.
constexpr double kRelative = 1e-12;
// Inertia beside stiffness, so that a piece that floats is held by its mass.
constexpr OperatorScale kDynamic{0.8, 400};

void expect_close(const Vector& found, const Vector& expected, const char* what,
                  double tolerance = kRelative) {
  ASSERT_EQ(found.size(), expected.size()) << what;
  const double scale = expected.lpNorm<Eigen::Infinity>();
  ASSERT_GT(scale, 0) << what << ": the case proves nothing";
  EXPECT_LE((found - expected).lpNorm<Eigen::Infinity>(), tolerance * scale) << what;
}

void expect_close(const Sparse& found, const Sparse& expected, const char* what) {
  const Sparse difference = found - expected;
  const auto largest = [](const Sparse& A) {
    double m = 0;
    for (int k = 0; k < A.outerSize(); ++k)
      for (Sparse::InnerIterator it(A, k); it; ++it) m = std::max(m, std::abs(it.value()));
    return m;
  };
  ASSERT_GT(largest(expected), 0) << what << ": the case proves nothing";
  EXPECT_LE(largest(difference), kRelative * largest(expected)) << what;
}

/// The tiles that a backend is tested with.
std::vector<int> tiles_of(const std::string& backend) {
  return backend == "cpu" ? std::vector<int>{0, 4, 5} : std::vector<int>{5};
}

using Parameters = std::tuple<std::string, std::string>;  // backend, scene

class Operators : public ::testing::TestWithParam<Parameters> {
 protected:
  void SetUp() override {
    const std::string why = test::why_missing(machine());
    if (why.empty()) return;
    if (test::is_required(machine())) FAIL() << why;
    GTEST_SKIP() << why;
  }
  std::string machine() const { return std::get<0>(GetParam()); }
  std::string scene() const { return std::get<1>(GetParam()); }

  Loaded load(const Problem& p, int tile_log2 = 0, const OperatorScale& scale = kDynamic,
              const SmootherOptions& smoother = {}) const {
    return {p, test::make_backend(machine(), 1, tile_log2), scale, smoother, p.deformation()};
  }
};

std::string name_of(const ::testing::TestParamInfo<Parameters>& parameters) {
  return std::get<0>(parameters.param) + "_" + std::get<1>(parameters.param);
}

INSTANTIATE_TEST_SUITE_P(Backends, Operators,
                         ::testing::Combine(::testing::Values("cpu", "fast"),
                                            ::testing::Values("one_cell", "uniform", "floating",
                                                              "bar", "octree1", "octree2",
                                                              "half_cut", "crossed", "limbs")),
                         name_of);

INSTANTIATE_TEST_SUITE_P(Device, Operators,
                         ::testing::Combine(::testing::Values("mirror", "cuda"),
                                            ::testing::Values("one_cell", "floating", "bar",
                                                              "half_cut", "crossed")),
                         name_of);

TEST_P(Operators, RotationsAreThoseOfTheSingularValues) {
  const Problem p(scene());
  const Loaded loaded = load(p);
  std::vector<double> q(4 * p.grids[0].cells.size());
  loaded.backend->read_rotations(q);
  const auto R = oracle::rotations(p.grids[0], p.physics, p.deformation());
  for (std::size_t c = 0; c < R.size(); ++c) {
    const Eigen::Quaterniond found(q[4 * c], q[4 * c + 1], q[4 * c + 2], q[4 * c + 3]);
    ASSERT_LE((found.toRotationMatrix() - R[c]).norm(), kRelative) << "cell " << c;
  }
}

TEST_P(Operators, FinestLevelIsTheAssembledMatrix) {
  for (const bool lumped : {false, true}) {
    ProblemOptions options;
    options.lumped_mass = lumped;
    const Problem p(scene(), options);
    const Vector u = p.deformation();
    const auto R = oracle::rotations(p.grids[0], p.physics, u);
    const Sparse whole = oracle::assemble(p.grids[0], p.physics, R, kDynamic);
    const Sparse A = oracle::masked(whole, p.fixed(0), p.fixed(0));
    const OperatorScale other{-0.3, 170};
    const Sparse B = oracle::assemble(p.grids[0], p.physics, R, other);
    const Vector x = p.free_vector(0, 21), any = test::random_vector(p.unknowns(0), 22);
    for (const int tile : tiles_of(machine())) {
      const Loaded loaded = load(p, tile);
      Backend& backend = *loaded.backend;
      expect_close(oracle::assemble_stored(backend, 0, p.level(0)), A, "cell matrices");
      test::write(backend, 0, kKrylovX, x);
      backend.apply(0, kKrylovX, kKrylovV);
      if (x.norm() > 0) expect_close(p.read(backend, 0, kKrylovV), A * x, "apply");
      test::write(backend, 0, kKrylovX, any);
      backend.apply_scaled(other, kKrylovX, kKrylovV);
      expect_close(p.read(backend, 0, kKrylovV), B * any, "apply_scaled");
      backend.elastic_force(loaded.extra, kKrylovV);
      expect_close(p.read(backend, 0, kKrylovV), oracle::elastic_force(p.grids[0], p.physics, R, u),
                   "elastic_force");
    }
  }
}

TEST_P(Operators, ForcesAreTakenOffInFreeComponents) {
  const Problem p(scene());
  const Vector u = p.deformation();
  const auto R = oracle::rotations(p.grids[0], p.physics, u);
  const OperatorScale other{-0.3, 170};
  const Vector elastic =
      oracle::masked(oracle::elastic_force(p.grids[0], p.physics, R, u), p.fixed(0));
  const Vector scaled =
      oracle::masked(oracle::assemble(p.grids[0], p.physics, R, other) * u, p.fixed(0));
  const Vector any = test::random_vector(p.unknowns(0), 23);
  const Loaded loaded = load(p);
  Backend& backend = *loaded.backend;
  const int out = loaded.extra + 1, work = backend.add_vector();
  const auto expect_off = [&](const Vector& force, double squares, const char* what) {
    expect_close(p.read(backend, 0, out), any - force, what);
    EXPECT_NEAR(squares, force.squaredNorm(), kRelative * force.squaredNorm()) << what;
  };
  test::write(backend, 0, out, any);
  expect_off(elastic, backend.subtract_elastic_force(loaded.extra, out, work), "elastic");
  test::write(backend, 0, out, any);
  expect_off(scaled, backend.subtract_scaled(other, loaded.extra, out, work), "scaled");
}

TEST_P(Operators, TrueResidualIsWhatTheSystemLeaves) {
  const Problem p(scene());
  const auto R = oracle::rotations(p.grids[0], p.physics, p.deformation());
  const Sparse A =
      oracle::masked(oracle::assemble(p.grids[0], p.physics, R, kDynamic), p.fixed(0), p.fixed(0));
  const Vector x = p.free_vector(0, 24), b = p.free_vector(0, 25), left = b - A * x;
  const Loaded loaded = load(p);
  Backend& backend = *loaded.backend;
  const int right = loaded.extra, solution = loaded.extra + 1;
  const int r = backend.conjugate_vectors().residual;
  test::write(backend, 0, right, b);
  test::write(backend, 0, solution, x);
  const double norm = backend.true_residual(right, solution, r);
  if (left.norm() > 0) expect_close(p.read(backend, 0, r), left, "true residual");
  EXPECT_NEAR(norm, left.norm(), kRelative * left.norm());
}

TEST_P(Operators, CoarseLevelsAreTripleProducts) {
  for (const bool duplicate : {true, false})
    for (const bool lumped : {false, true})
      for (const Holds holds : {Holds::none, Holds::mixed}) {
        ProblemOptions options;
        options.duplicate_cells = duplicate;
        options.lumped_mass = lumped;
        options.holds = holds;
        const Problem p(scene(), options);
        const auto A = test::matrices_of(p, kDynamic, p.deformation());
        for (const int tile : tiles_of(machine())) {
          const Loaded loaded = load(p, tile);
          for (int l = 1; l < p.levels(); ++l) {
            SCOPED_TRACE(::testing::Message() << "level " << l << ", tile " << tile);
            Backend& backend = *loaded.backend;
            expect_close(oracle::assemble_stored(backend, l, p.level(l)), A[l], "cell matrices");
            const Vector x = p.free_vector(l, 31);
            test::write(backend, l, kKrylovX, x);
            backend.apply(l, kKrylovX, kKrylovV);
            expect_close(p.read(backend, l, kKrylovV), A[l] * x, "apply");
          }
        }
      }
}

TEST_P(Operators, TransferIsTheProlongationAndItsTranspose) {
  const Problem p(scene());
  const Loaded loaded = load(p);
  Backend& backend = *loaded.backend;
  for (int l = 0; l + 1 < p.levels(); ++l) {
    SCOPED_TRACE(l);
    const Sparse P = oracle::masked(oracle::prolongation_matrix(p.grids[l], p.grids[l + 1]),
                                    p.fixed(l), p.fixed(l + 1));
    const Vector r = p.free_vector(l, 41), u = p.free_vector(l, 42), e = p.free_vector(l + 1, 43);
    test::write(backend, l, kResidual, r);
    test::write(backend, l + 1, kSolution, e);
    backend.restrict_residual(l);
    expect_close(p.read(backend, l + 1, kRight), P.transpose() * r, "restrict_residual");
    EXPECT_EQ(p.read(backend, l + 1, kSolution).norm(), 0);
    test::write(backend, l, kSolution, u);
    test::write(backend, l + 1, kSolution, e);
    backend.prolong_correction(l);
    expect_close(p.read(backend, l, kSolution), u + P * e, "prolong_correction");
  }
}

TEST_P(Operators, ResidualAndDiagonalBlocks) {
  const Problem p(scene());
  const auto A = test::matrices_of(p, kDynamic, p.deformation());
  const Loaded loaded = load(p);
  Backend& backend = *loaded.backend;
  for (int l = 0; l < p.levels(); ++l) {
    SCOPED_TRACE(l);
    const Vector f = p.free_vector(l, 51), u = 1e-3 * p.free_vector(l, 52);
    if (f.norm() == 0) continue;  // all of it is held
    test::write(backend, l, kRight, f);
    test::write(backend, l, kSolution, u);
    const double norm = backend.residual(l);
    const Vector r = f - A[l] * u;
    expect_close(p.read(backend, l, kResidual), r, "residual");
    EXPECT_NEAR(norm, r.norm(), kRelative * r.norm());
    backend.precondition_jacobi(l, kRight, kScratch);
    // A block's condition times the rounding of its sums.
    expect_close(p.read(backend, l, kScratch), oracle::inverse_diagonal(A[l], p.fixed(l)) * f,
                 "precondition_jacobi", 10 * kRelative);
  }
}

TEST_P(Operators, GaussSeidelIsASequentialSweepInTheOrderOfColours) {
  if (machine() == "fast") GTEST_SKIP() << "the fast backend smooths by Chebyshev only";
  const Problem p(scene());
  const auto A = test::matrices_of(p, kDynamic, p.deformation());
  SmootherOptions smoother;
  smoother.chebyshev = false;
  smoother.omega = 1.3;
  for (const int tile : tiles_of(machine())) {
    const Loaded loaded = load(p, tile, kDynamic, smoother);
    Backend& backend = *loaded.backend;
    for (int l = 0; l + 1 < p.levels(); ++l) {
      const Sparse D = oracle::inverse_diagonal(A[l], p.fixed(l));
      const Vector f = p.free_vector(l, 61), start = 1e-3 * p.free_vector(l, 62);
      if (f.norm() == 0) continue;
      for (const SweepOrder order : {SweepOrder::forward, SweepOrder::backward}) {
        const Level& level = p.level(l);
        std::vector<std::int32_t> vertices = colour_vertices(level).order;
        if (order == SweepOrder::backward) std::reverse(vertices.begin(), vertices.end());
        Vector u = start;
        for (int k = 0; k < 2; ++k) oracle::gauss_seidel(A[l], D, vertices, smoother.omega, f, u);
        test::write(backend, l, kRight, f);
        test::write(backend, l, kSolution, start);
        backend.smooth(l, order, 2);
        expect_close(p.read(backend, l, kSolution), u, "smooth", 10 * kRelative);
      }
    }
  }
}

// From zero, from a solution, and with a correction that a backend may still owe to it.
TEST_P(Operators, RestrictionFromTheSolutionIsThatOfItsResidual) {
  const Problem p(scene());
  const auto A = test::matrices_of(p, kDynamic, p.deformation());
  const Loaded loaded = load(p, tiles_of(machine()).back(), kDynamic);
  Backend& backend = *loaded.backend;
  for (int l = 0; l + 1 < p.levels(); ++l) {
    const Sparse P = oracle::masked(oracle::prolongation_matrix(p.grids[l], p.grids[l + 1]),
                                    p.fixed(l), p.fixed(l + 1));
    const Vector f = p.free_vector(l, 61), u = 1e-3 * p.free_vector(l, 62),
                 e = 1e-3 * p.free_vector(l + 1, 63);
    test::write(backend, l, kRight, f);
    for (const int start : {0, 1, 2}) {
      SCOPED_TRACE(::testing::Message() << "level " << l << ", start " << start);
      Vector r = f;
      backend.zero(l, kSolution);
      if (start > 0) test::write(backend, l, kSolution, u), r -= A[l] * u;
      if (start > 1) {
        test::write(backend, l + 1, kSolution, e);
        backend.prolong_correction(l);
        r -= A[l] * (P * e);
      }
      backend.restrict_from_solution(l);
      const Vector once = p.read(backend, l + 1, kRight);
      expect_close(once, P.transpose() * r, "restrict_from_solution", 10 * kRelative);
      EXPECT_EQ(p.read(backend, l + 1, kSolution).norm(), 0);
      backend.residual(l);
      backend.restrict_residual(l);
      EXPECT_EQ(p.read(backend, l + 1, kRight), once);
    }
  }
}

TEST_P(Operators, ChebyshevIsTheLeastPolynomial) {
  const Problem p(scene());
  const auto A = test::matrices_of(p, kDynamic, p.deformation());
  for (const int degree : {1, 2, 4}) {
    SmootherOptions smoother;
    smoother.degree = degree;
    smoother.smallest = 0.2;
    const Loaded loaded = load(p, tiles_of(machine()).back(), kDynamic, smoother);
    Backend& backend = *loaded.backend;
    for (int l = 0; l + 1 < p.levels(); ++l) {
      const Sparse D = oracle::inverse_diagonal(A[l], p.fixed(l));
      const Vector f = p.free_vector(l, 71), start = 1e-3 * p.free_vector(l, 72);
      if (f.norm() == 0) continue;
      const double upper = backend.spectral_bound(l);
      test::write(backend, l, kRight, f);
      for (const bool from_zero : {false, true}) {
        Vector u = start;
        test::write(backend, l, kSolution, start);
        if (from_zero) u.setZero(), backend.zero(l, kSolution);
        for (const int sweeps : {1, 2}) {
          for (int k = 0; k < sweeps; ++k)
            oracle::chebyshev(A[l], D, smoother.smallest * upper, upper, degree, f, u);
          backend.smooth(l, SweepOrder::forward, sweeps);
          // Richardson's steps amplify some modes before they damp them.
          expect_close(p.read(backend, l, kSolution), u, "smooth", 100 * kRelative);
        }
      }
    }
  }
}

TEST_P(Operators, CyclePreconditionerIsSymmetricAndPositive) {
  const Problem p(scene());
  for (const bool chebyshev : {true, false})
    for (const CycleType type : {CycleType::v, CycleType::w}) {
      if (!chebyshev && machine() == "fast") continue;  // smooths by Chebyshev only
      SmootherOptions smoother;
      smoother.chebyshev = chebyshev;
      const Loaded loaded = load(p, 0, kDynamic, smoother);
      Backend& backend = *loaded.backend;
      backend.factor_coarsest();
      Cycle cycle(backend, p.levels(), {type, 2, 2, true});
      const auto apply = [&](const Vector& r) {
        test::write(backend, 0, kRight, r);
        backend.zero(0, kSolution);
        cycle.run();
        return p.read(backend, 0, kSolution);
      };
      const Vector x = p.free_vector(0, 81), y = p.free_vector(0, 82);
      if (x.norm() == 0) continue;
      const Vector Bx = apply(x), By = apply(y);
      ASSERT_GT(x.dot(Bx), 0);
      ASSERT_GT(y.dot(By), 0);
      EXPECT_LE(std::abs(x.dot(By) - y.dot(Bx)), kRelative * std::sqrt(x.dot(Bx) * y.dot(By)));
      EXPECT_EQ(Bx, oracle::masked(Bx, p.fixed(0)));
    }
}

TEST_P(Operators, CoarsestIsSolvedExactly) {
  const Problem p(scene());
  const auto A = test::matrices_of(p, kDynamic, p.deformation());
  const Loaded loaded = load(p);
  Backend& backend = *loaded.backend;
  const int last = p.levels() - 1;
  // In the range of A: supports may leave a coarse matrix that is singular.
  const Vector f = A[last] * p.free_vector(last, 91);
  backend.factor_coarsest();
  test::write(backend, last, kRight, f);
  backend.solve_coarsest();
  if (f.norm() == 0) return;
  // The backend may raise the diagonal by 1e-12 of itself.
  constexpr double kCoarsest = 1e-10;
  expect_close(A[last] * p.read(backend, last, kSolution), f, "solve_coarsest", kCoarsest);
}

TEST_P(Operators, RigidMotionGivesNoForce) {
  ProblemOptions options;
  options.holds = Holds::none;
  const Problem p(scene(), options);
  const Level& finest = p.level(0);
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(2.6, Eigen::Vector3d(-1, 0.4, 2).normalized()).toRotationMatrix();
  Vector u(static_cast<Eigen::Index>(p.unknowns(0)));
  for (std::int32_t v = 0; v < finest.vertices(); ++v) {
    const Eigen::Vector3d x(finest.point[v][0], finest.point[v][1], finest.point[v][2]);
    u.segment<3>(3 * v) = p.physics.spacing * (turn * x - x) + Eigen::Vector3d(0.3, -4, 1);
  }
  const Loaded loaded(p, test::make_backend(machine()), kDynamic, {}, u);
  Backend& backend = *loaded.backend;
  backend.elastic_force(loaded.extra, kKrylovV);
  // Against the force of a stretch by one cell: E h^2.
  const double force = 7e5 * p.physics.spacing * p.physics.spacing;
  EXPECT_LE(p.read(backend, 0, kKrylovV).lpNorm<Eigen::Infinity>(),
            kRelative * force * u.lpNorm<Eigen::Infinity>() / p.physics.spacing);
}

// ---- The range of the Chebyshev smoother --------------------------------------------------------

class Spectrum : public ::testing::TestWithParam<Parameters> {};

INSTANTIATE_TEST_SUITE_P(Backends, Spectrum,
                         ::testing::Combine(::testing::Values("cpu", "fast"),
                                            ::testing::Values("one_cell", "uniform", "floating",
                                                              "small_octree", "small_cut")),
                         name_of);

LinkedOctree small_scene(const std::string& name) {
  if (name == "small_octree") return LinkedOctree(test::box_body({6, 6, 6}), 1);
  if (name == "small_cut") {
    LinkedOctree body(test::box_body({7, 5, 4}), 1);
    test::cut_plane(body, {3.3, 1, 2}, {1, 0.3, 0.2}, 2.5);
    return body;
  }
  return test::scene(name);
}

TEST_P(Spectrum, BoundHoldsAndIsNotMuchTooLarge) {
  constexpr double kLoose = 1.35;
  for (const Holds holds : {Holds::one_side, Holds::none})
    for (const OperatorScale& scale : {kDynamic, OperatorScale{1, 1}, OperatorScale{1e-6, 1e4}})
      for (const int materials : {1, 3}) {
        ProblemOptions options;
        options.holds = holds;
        options.materials = materials;
        options.coarsest_vertices = 8;
        const Problem p(small_scene(std::get<1>(GetParam())), options);
        const Vector u = p.deformation();
        const auto A = test::matrices_of(p, scale, u);
        const Loaded loaded(p, test::make_backend(std::get<0>(GetParam())), scale, {}, u);
        for (int l = 0; l + 1 < p.levels(); ++l) {
          const double largest = oracle::largest_eigenvalue(A[l], p.fixed(l));
          const double bound = loaded.backend->spectral_bound(l);
          EXPECT_GE(bound, largest) << "level " << l;
          EXPECT_LE(bound, kLoose * largest) << "level " << l;
        }
      }
}

// The bound is kept while the operator's factors are. Chebyshev on [l / 8, l] damps, and the cycle
// is positive, up to 9/8 l.
TEST_P(Spectrum, BoundIsGoodEnoughWhenTheBodyDeformsLater) {
  const double damped_to = 1 + SmootherOptions{}.smallest;
  ProblemOptions options;
  options.coarsest_vertices = 8;
  const Problem p(small_scene(std::get<1>(GetParam())), options);
  const Vector u = p.deformation();
  const auto A = test::matrices_of(p, kDynamic, u);
  const Loaded loaded(p, test::make_backend(std::get<0>(GetParam())), kDynamic, {},
                      Vector::Zero(u.size()));
  Backend& backend = *loaded.backend;
  test::write(backend, 0, loaded.extra, u);
  backend.rotate_cells(loaded.extra);
  backend.prepare(0);
  for (int l = 0; l + 1 < p.levels(); ++l) {
    backend.coarsen(l);
    backend.prepare(l + 1);
    EXPECT_GT(damped_to * backend.spectral_bound(l), oracle::largest_eigenvalue(A[l], p.fixed(l)))
        << "level " << l;
  }
}

// ---- The same bits ------------------------------------------------------------------------------

/// All that a solve leaves behind, as bits.
std::vector<std::uint64_t> bits_of_a_solve(const Problem& p, const std::string& machine,
                                           int threads, int tile, bool chebyshev) {
  SolverSetup setup;
  setup.cycle = CycleType::k;
  setup.smoother = chebyshev ? SmootherType::chebyshev : SmootherType::gauss_seidel;
  setup.cycles = 2;
  const std::unique_ptr<Backend> backend = test::make_backend(machine, threads, tile);
  LinearSolver solver(*backend, setup);
  const int b = backend->add_vector(), x = backend->add_vector();
  backend->load(p.hierarchy);
  solver.set_structure(p.hierarchy);
  backend->set_operator(kDynamic);
  test::write(*backend, 0, x, p.deformation());
  backend->rotate_cells(x);
  solver.refresh();
  test::write(*backend, 0, b, p.free_vector(0, 101));
  backend->mask(0, x);
  const SolveStats stats = solver.solve(b, x, 0);
  backend->elastic_force(x, b);
  backend->apply(0, x, kKrylovV);

  std::vector<std::uint64_t> bits(1);
  std::memcpy(bits.data(), &stats.residual, sizeof stats.residual);
  for (const int id : {x, b, static_cast<int>(kKrylovV), static_cast<int>(kSolution)}) {
    const Vector values = p.read(*backend, 0, id);
    const std::size_t at = bits.size();
    bits.resize(at + static_cast<std::size_t>(values.size()));
    std::memcpy(&bits[at], values.data(), sizeof(double) * p.unknowns(0));
  }
  return bits;
}

/// Large enough that every kind of loop is worth threads, with a cut and larger leaves.
Problem large_problem() { return test::cut_block({41, 26, 19}, {17.3, 9.2, 8.1}, 9, 300); }

TEST(SameBits, ForAnyNumberOfThreadsAndAnyTile) {
  const Problem p = large_problem();
  for (const bool chebyshev : {true, false}) {
    const auto expected = bits_of_a_solve(p, "cpu", 1, 0, chebyshev);
    for (const auto& [threads, tile] : {std::pair(2, 0), std::pair(4, 5), std::pair(1, 4)})
      EXPECT_EQ(bits_of_a_solve(p, "cpu", threads, tile, chebyshev), expected)
          << threads << " threads, tile " << tile;
  }
}

}  // namespace
}  // namespace kerf
