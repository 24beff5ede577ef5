// SPDX-License-Identifier: MIT
//
// The linear solver: every method against a direct solution of a matrix that shares no code with
// it, what it reports against the same matrix, and what it does where there is no solution.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/base/error.hpp"
#include "core/solve/linear_solver.hpp"
#include "tests/support/problem.hpp"

namespace kerf {
namespace {

using oracle::Sparse;
using oracle::Vector;
using test::Holds;
using test::Problem;
using test::ProblemOptions;

constexpr double kAccuracy = 1e-9;  // of the solution
constexpr double kTight = 1e-11;    // asked of the solvers, as a residual, where rounding allows
constexpr double kRounding = 1e-12;
constexpr OperatorScale kStatic{1, 0}, kDynamic{0.8, 400};

/// A problem with its right-hand side and direct solution.
struct Case {
  Problem problem;
  OperatorScale scale;
  Sparse A;
  Vector b, x;
  double floor = 0;  ///< rounding of the residual of the solution itself, relative to |b|

  Case(const std::string& name, const OperatorScale& s,
       const ProblemOptions& options = static_options())
      : Case(test::scene(name), s, options) {}
  Case(LinkedOctree body, const OperatorScale& s, const ProblemOptions& options = static_options())
      : problem(std::move(body), options), scale(s) {
    const auto R = oracle::rotations(problem.grids[0], problem.physics, problem.deformation());
    A = oracle::masked(oracle::assemble(problem.grids[0], problem.physics, R, scale),
                       problem.fixed(0), problem.fixed(0));
    b = problem.free_vector(0, 17);
    x = oracle::solve(A, problem.fixed(0), b);
    constexpr double kSums = 8e-16;  // each entry of A x is a sum of sums
    floor = kSums * (A.cwiseAbs() * x.cwiseAbs()).norm() / b.norm();
  }
  static ProblemOptions static_options() {
    ProblemOptions options;
    options.holds = Holds::one_side;
    return options;
  }
};

struct Outcome {
  SolveStats stats;
  Vector x;
};

Outcome solve(const Problem& p, const Vector& deformation, const OperatorScale& scale,
              const SolverSetup& setup, const Vector& b, const Vector& start, double tolerance,
              double reference = 0) {
  const std::unique_ptr<Backend> backend = test::make_backend("cpu");
  LinearSolver solver(*backend, setup);
  const int right = backend->add_vector(), solution = backend->add_vector();
  backend->load(p.hierarchy);
  solver.set_structure(p.hierarchy);
  backend->set_operator(scale);
  test::write(*backend, 0, solution, deformation);
  backend->rotate_cells(solution);
  solver.refresh();
  test::write(*backend, 0, right, b);
  test::write(*backend, 0, solution, start);
  const SolveStats stats = solver.solve(right, solution, tolerance, reference);
  return {stats, p.read(*backend, 0, solution)};
}

/// What may be asked of a solver's residual.
double tight(const Case& c) { return std::max(kTight, 10 * c.floor); }

Outcome solve(const Case& c, const SolverSetup& setup, double tolerance) {
  return solve(c.problem, c.problem.deformation(), c.scale, setup, c.b, Vector::Zero(c.b.size()),
               tolerance);
}

void expect_true_residual(const Case& c, const Outcome& outcome) {
  const double residual = (c.b - c.A * outcome.x).norm() / c.b.norm();
  EXPECT_NEAR(outcome.stats.residual, residual, 3 * c.floor + kRounding * residual);
}

void expect_solution(const Case& c, const SolverSetup& setup) {
  const Outcome outcome = solve(c, setup, tight(c));
  EXPECT_TRUE(outcome.stats.converged);
  EXPECT_LE(outcome.stats.residual, tight(c) * (1 + kRounding));
  EXPECT_GE(outcome.stats.cycles, 1);
  EXPECT_LE((outcome.x - c.x).norm(), kAccuracy * c.x.norm());
  expect_true_residual(c, outcome);
}

SolverSetup setup_of(SolverMethod method, CycleType cycle = CycleType::v,
                     SmootherType smoother = SmootherType::chebyshev) {
  SolverSetup setup;
  setup.method = method;
  setup.cycle = cycle;
  setup.smoother = smoother;
  return setup;
}

class SolverOnScene : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Solver, SolverOnScene,
                         ::testing::Values("uniform", "octree2", "bar", "half_cut", "limbs", "arc"),
                         [](const auto& scene) { return std::string(scene.param); });

TEST_P(SolverOnScene, EveryMethodGivesTheDirectSolution) {
  const Case c(GetParam(), kStatic);
  for (const SmootherType smoother : {SmootherType::chebyshev, SmootherType::gauss_seidel})
    for (const CycleType cycle : {CycleType::v, CycleType::w, CycleType::k}) {
      SCOPED_TRACE(::testing::Message() << "cycle " << static_cast<int>(cycle));
      expect_solution(c, setup_of(SolverMethod::cg, cycle, smoother));
    }
  // Alone, V and W are slow where a piece is thinner than the coarse cells; K is not.
  expect_solution(c, setup_of(SolverMethod::multigrid, CycleType::k));
  expect_solution(c, setup_of(SolverMethod::cg_jacobi));
  expect_solution(c, setup_of(SolverMethod::cholesky));
}

TEST(Solver, MultigridAloneGivesTheDirectSolution) {
  for (const char* name : {"uniform", "octree1"}) {
    const Case c(name, kStatic);
    for (const SmootherType smoother : {SmootherType::chebyshev, SmootherType::gauss_seidel})
      for (const CycleType cycle : {CycleType::v, CycleType::w, CycleType::k})
        expect_solution(c, setup_of(SolverMethod::multigrid, cycle, smoother));
  }
}

TEST(Solver, FloatingPiecesAreSolvedInDynamics) {
  for (const char* name : {"floating", "crossed"}) {
    ProblemOptions options;
    options.holds = Holds::one_side;
    options.lumped_mass = true;
    options.materials = 1;  // multigrid alone is slow where stiff and soft share thin pieces
    const Case c(name, kDynamic, options);
    for (const SolverMethod method : {SolverMethod::cg, SolverMethod::multigrid,
                                      SolverMethod::cg_jacobi, SolverMethod::cholesky})
      expect_solution(c, setup_of(method, CycleType::k));
  }
}

// Fewer free vertices than coarse vertices over them: the coarse matrix is singular, the body held.
TEST(Solver, SupportsMayHoldMostOfACoarseCell) {
  for (const char* name : {"uniform", "octree1", "half_cut"}) {
    ProblemOptions options;
    options.holds = Holds::dense;
    const Case c(name, kStatic, options);
    for (const SolverMethod method :
         {SolverMethod::cg, SolverMethod::cg_jacobi, SolverMethod::cholesky})
      expect_solution(c, setup_of(method));
  }
}

TEST(Solver, MergingByPlaceConvergesToTheSameSolution) {
  for (const char* name : {"half_cut", "limbs", "bar"}) {
    ProblemOptions options = Case::static_options();
    options.duplicate_cells = false;
    expect_solution(Case(name, kStatic, options), setup_of(SolverMethod::cg));
  }
}

TEST(Solver, AutomaticCycleIsKOnCutBodiesOnly) {
  for (const bool cut : {false, true}) {
    Problem p("uniform", Case::static_options());
    p.hierarchy.cut = cut;
    const std::unique_ptr<Backend> backend = test::make_backend("cpu");
    LinearSolver solver(*backend, {});
    backend->load(p.hierarchy);
    solver.set_structure(p.hierarchy);
    EXPECT_EQ(solver.cycle_in_use().type, cut ? CycleType::k : CycleType::v);
    EXPECT_EQ(solver.cycle_in_use().first_twice, 1);
  }
}

TEST(Solver, AutomaticCycleSolvesLevelOneOnceWhereItIsLarge) {
  const Problem few("octree2", Case::static_options()), many("ball", Case::static_options());
  const Problem plate(LinkedOctree(test::box_body({9, 9, 1}), 0), Case::static_options());
  for (const Problem* p : {&few, &many, &plate}) {
    const auto& levels = p->hierarchy.levels;
    EXPECT_EQ(4 * levels[1].cells() > levels[0].cells(), p != &few);
    EXPECT_EQ(cycle_options({}, p->hierarchy).first_twice, p == &many ? 2 : 1);
  }
}

/// A bar that twists from solve to solve, so that corrections by an old factor are too long: cycles
/// alone may grow, and W is no longer positive definite.
class TwistedBar {
 public:
  TwistedBar(const char* machine, const SolverSetup& setup)
      : backend_(test::make_backend(machine)),
        solver_(*backend_, setup),
        b_(backend_->add_vector()),
        x_(backend_->add_vector()) {
    backend_->load(problem().hierarchy);
    solver_.set_structure(problem().hierarchy);
    backend_->set_operator(kStatic);
  }
  void twist(double radians) {
    const Level& level = problem().hierarchy.levels[0];
    std::vector<double> q;
    for (std::int32_t c = 0; c < level.cells(); ++c) {
      const double half = 0.5 * radians * level.corner[c][0] / kLength;
      for (const double x : {std::cos(half), std::sin(half), 0.0, 0.0}) q.push_back(x);
    }
    backend_->write_rotations(q);
    solver_.refresh();
  }
  SolveStats solve(double load = 1) {
    test::write(*backend_, 0, b_, load * problem().free_vector(0, 17));
    return solver_.solve_from_zero(b_, x_, 1e-8);
  }
  int factors() const { return solver_.factors(); }

 private:
  static constexpr int kLength = 24;
  static const Problem& problem() {
    static const Problem bar = [] {
      ProblemOptions options = Case::static_options();
      options.materials = 1;
      options.with_oracle = false;
      options.coarsest_vertices = 300;
      return Problem(LinkedOctree(test::box_body({kLength, 8, 8}), 0), options);
    }();
    return bar;
  }
  std::unique_ptr<Backend> backend_;
  LinearSolver solver_;
  int b_, x_;
};

TEST(Solver, AFactorOfOtherRotationsIsMadeAnewWhereItFails) {
  for (const char* machine : {"cpu", "fast", "mixed"})
    for (const SolverMethod method : {SolverMethod::cg, SolverMethod::multigrid})
      for (const CycleType cycle : {CycleType::v, CycleType::w, CycleType::k}) {
        SCOPED_TRACE(::testing::Message() << machine << ", method " << static_cast<int>(method)
                                          << ", cycle " << static_cast<int>(cycle));
        TwistedBar bar(machine, setup_of(method, cycle));
        int factors = 1;
        for (const double radians : {0.0, 3.0, -3.0}) {
          bar.twist(radians);
          // Cycles alone find out at once; conjugate gradients begin with a new one after a
          // failure.
          const bool is_ready = method == SolverMethod::cg && radians < 0;
          EXPECT_EQ(bar.factors(), is_ready ? ++factors : factors);
          const SolveStats stats = bar.solve();
          EXPECT_TRUE(stats.converged);
          EXPECT_LE(stats.residual, 1e-8);
          if (radians != 0 && !is_ready) ++factors;
          EXPECT_EQ(bar.factors(), factors);
          // 8 to 14 and 8 to 32; with the old factor 23 to 74, or never.
          EXPECT_LE(stats.cycles, radians == 0 ? 15 : 35);
        }
      }
}

// A factor that nothing would use is not made, and an update that none follows is kept.
TEST(Solver, AFixedNumberOfCyclesMakesNoFactorInTheLast) {
  for (const SolverMethod method : {SolverMethod::cg, SolverMethod::multigrid})
    for (const int cycles : {1, 5}) {
      SolverSetup setup = setup_of(method, CycleType::v);
      setup.cycles = cycles;
      TwistedBar bar("fast", setup);
      for (const double radians : {0.0, 3.0}) {
        bar.twist(radians);
        const SolveStats stats = bar.solve();
        EXPECT_EQ(stats.cycles, cycles);
        EXPECT_NE(stats.residual, 1);
        if (cycles == 1 || method == SolverMethod::cg) {
          EXPECT_EQ(bar.factors(), 1);
        }
      }
    }
}

TEST(Solver, AnUpdateThatMadeTheResidualGrowIsTakenBack) {
  for (const char* machine : {"fast", "mixed"}) {
    SolverSetup setup = setup_of(SolverMethod::multigrid, CycleType::w);
    setup.cycles = 1;
    TwistedBar fresh(machine, setup);
    fresh.twist(3);
    const double expected = fresh.solve().residual;
    setup.cycles = 2;
    TwistedBar bar(machine, setup);
    bar.twist(0);
    bar.solve();
    bar.twist(3);
    // The bound of Chebyshev is of the first rotations.
    EXPECT_NEAR(bar.solve().residual, expected, 0.01 * expected);
    EXPECT_EQ(bar.factors(), 2);
  }
}

// A first solve without a cycle does not say how good a new factor is; the second one has an old
// one.
TEST(Solver, AFactorThatHasNotSolvedYetIsWatchedToo) {
  for (const CycleType cycle : {CycleType::v, CycleType::w, CycleType::k}) {
    TwistedBar bar("fast", setup_of(SolverMethod::cg, cycle));
    bar.twist(0);
    EXPECT_EQ(bar.solve(0).cycles, 0);
    bar.twist(3);
    EXPECT_EQ(bar.factors(), 1);
    EXPECT_LE(bar.solve().cycles, 20);
    EXPECT_EQ(bar.factors(), 2);
  }
}

TEST(Solver, FixedNumberOfCyclesIsThatNumber) {
  const Case c("half_cut", kStatic);
  for (const SolverMethod method :
       {SolverMethod::cg, SolverMethod::multigrid, SolverMethod::cg_jacobi}) {
    SolverSetup setup = setup_of(method);
    double before = 1;
    for (const int cycles : {1, 3}) {
      setup.cycles = cycles;
      const Outcome outcome = solve(c, setup, 0.5);  // met long before: must not matter
      EXPECT_EQ(outcome.stats.cycles, cycles);
      EXPECT_TRUE(outcome.stats.converged);
      expect_true_residual(c, outcome);
      if (method != SolverMethod::cg_jacobi) {
        EXPECT_LT(outcome.stats.residual, before);
      }
      before = outcome.stats.residual;
    }
  }
}

TEST(Solver, StopsAtTheToleranceAndSaysWhenItDoesNotReachIt) {
  const Case c("limbs", kStatic);
  SolverSetup setup = setup_of(SolverMethod::cg);
  const Outcome loose = solve(c, setup, 1e-3), tight = solve(c, setup, 1e-8);
  EXPECT_LE(loose.stats.residual, 1e-3);
  EXPECT_LE(tight.stats.residual, 1e-8);
  EXPECT_LT(loose.stats.cycles, tight.stats.cycles);
  setup.max_cycles = 2;
  for (const SolverMethod method : {SolverMethod::cg, SolverMethod::multigrid}) {
    setup.method = method;
    const Outcome stopped = solve(c, setup, 1e-8);
    EXPECT_EQ(stopped.stats.cycles, 2);
    EXPECT_FALSE(stopped.stats.converged);
    expect_true_residual(c, stopped);
  }
}

TEST(Solver, WarmStartAndReference) {
  const Case c("octree2", kStatic);
  const SolverSetup setup = setup_of(SolverMethod::cg);
  const Outcome done = solve(c.problem, c.problem.deformation(), c.scale, setup, c.b, c.x, 1e-9);
  EXPECT_EQ(done.stats.cycles, 0);
  EXPECT_TRUE(done.stats.converged);
  EXPECT_EQ(done.x, c.x);
  const double reference = 1e6 * c.b.norm();
  const Outcome rough = solve(c.problem, c.problem.deformation(), c.scale, setup, c.b,
                              Vector::Zero(c.b.size()), 1e-8, reference);
  EXPECT_TRUE(rough.stats.converged);
  EXPECT_NEAR(rough.stats.residual, (c.b - c.A * rough.x).norm() / reference, kRounding);
  EXPECT_LT(rough.stats.cycles, solve(c, setup, 1e-8).stats.cycles);
}

TEST(Solver, ZeroRightHandSideGivesZero) {
  const Case c("bar", kStatic);
  for (const SolverMethod method :
       {SolverMethod::cg, SolverMethod::multigrid, SolverMethod::cg_jacobi, SolverMethod::cholesky})
    for (const int cycles : {0, 2}) {
      SolverSetup setup = setup_of(method);
      setup.cycles = cycles;
      const Outcome outcome = solve(c.problem, c.problem.deformation(), c.scale, setup,
                                    Vector::Zero(c.b.size()), c.x, 1e-8);
      EXPECT_TRUE(outcome.stats.converged);
      EXPECT_EQ(outcome.stats.residual, 0);
      EXPECT_EQ(outcome.x.norm(), 0);
    }
}

TEST(Solver, HeldCompletelyIsNoProblem) {
  Problem p("uniform", Case::static_options());
  for (Level& level : p.hierarchy.levels)
    std::fill(level.fixed.begin(), level.fixed.end(), std::uint8_t{7});
  const Vector zero = Vector::Zero(static_cast<Eigen::Index>(p.unknowns(0)));
  for (const SolverMethod method : {SolverMethod::cg, SolverMethod::multigrid,
                                    SolverMethod::cg_jacobi, SolverMethod::cholesky}) {
    const Outcome outcome = solve(p, zero, kStatic, setup_of(method), zero, zero, 1e-8);
    EXPECT_TRUE(outcome.stats.converged);
    EXPECT_EQ(outcome.x.norm(), 0);
  }
}

// ---- No solution --------------------------------------------------------------------------------

// With one level: a coarse matrix may be singular for a body that is held, and is not judged.
// At rest: the linearised matrix of a bent body knows no turn that leaves it without force.
void expect_singular(const Problem& p, SolverMethod method) {
  const Vector b = p.free_vector(0, 3), zero = Vector::Zero(b.size());
  try {
    solve(p, zero, kStatic, setup_of(method), b, zero, 1e-6);
    ADD_FAILURE() << "a body that can move freely was solved";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::bad_input);
    EXPECT_NE(std::string(error.what()).find("[[support]]"), std::string::npos) << error.what();
  }
}

TEST(Solver, BodiesThatMoveFreelyAreBadInput) {
  constexpr int kOneLevel = 1 << 20;
  for (const SolverMethod method :
       {SolverMethod::cg, SolverMethod::multigrid, SolverMethod::cholesky}) {
    SCOPED_TRACE(static_cast<int>(method));
    for (const char* name : {"one_cell", "uniform", "octree1", "half_cut"}) {
      SCOPED_TRACE(name);
      ProblemOptions options;
      options.holds = Holds::none;
      options.with_oracle = false;
      options.coarsest_vertices = kOneLevel;
      expect_singular(Problem(name, options), method);  // nothing held
      Problem hinged(name, options);                    // a point held: free to turn
      hinged.hierarchy.levels[0].fixed[0] = 7;
      expect_singular(hinged, method);
    }
    for (const char* name : {"floating", "crossed"}) {  // a piece that nothing holds
      SCOPED_TRACE(name);
      ProblemOptions options = Case::static_options();
      options.with_oracle = false;
      options.coarsest_vertices = kOneLevel;
      expect_singular(Problem(name, options), method);
    }
  }
}

TEST(Solver, SlenderBodiesThatAreHeldAreNotSingular) {
  // A beam of 120 cells, one thick: its softest mode is 1e-9 of the stiffest.
  ProblemOptions options = Case::static_options();
  options.materials = 1;
  const Case c(LinkedOctree(test::box_body({120, 1, 1}), 0), kStatic, options);
  constexpr double kDirect = 1e-9, kSlender = 1e-5;
  for (const SolverMethod method : {SolverMethod::cg, SolverMethod::cholesky}) {
    const Outcome outcome = solve(c, setup_of(method), kDirect);
    EXPECT_TRUE(outcome.stats.converged);
    EXPECT_LE((outcome.x - c.x).norm(), kSlender * c.x.norm());
  }
}

// ---- Factorisation ------------------------------------------------------------------------------

TEST(SparseCholesky, BothEnginesSolveTheAssembledMatrix) {
  for (const char* name : {"octree1", "half_cut"}) {
    const Case c(name, kStatic);
    const Problem& p = c.problem;
    const test::Loaded loaded(p, test::make_backend("cpu"), kStatic, {}, p.deformation());
    for (int l = 0; l < p.levels(); ++l) {
      AssembledLevel matrix(p.level(l));
      matrix.assemble(p.level(l), [&](std::int32_t cell, std::span<double> out) {
        loaded.backend->read_cell_matrix(l, cell, out);
      });
      const auto n = static_cast<Eigen::Index>(p.unknowns(l));
      ASSERT_EQ(matrix.unknowns(), n);
      const Sparse lower = Eigen::Map<const Sparse>(
          n, n, static_cast<Eigen::Index>(matrix.row.size()), matrix.column_begin.data(),
          matrix.row.data(), matrix.value.data());
      const Sparse stored = oracle::assemble_stored(*loaded.backend, l, p.level(l));
      Sparse units(n, n);
      for (int i = 0; i < n; ++i)
        if ((p.fixed(l)[static_cast<std::size_t>(i / 3)] >> (i % 3)) & 1) units.insert(i, i) = 1;
      const Sparse expected = Sparse(stored + units).triangularView<Eigen::Lower>();
      EXPECT_LE(Sparse(lower - expected).norm(), kRounding * expected.norm());

      const Vector b = p.free_vector(l, 7);
      const Vector x = oracle::solve(stored, p.fixed(l), b);
      for (const CholeskyEngine engine : {CholeskyEngine::simplicial, CholeskyEngine::supernodal}) {
        SparseCholesky cholesky(engine);
        cholesky.analyse(matrix);
        ASSERT_TRUE(cholesky.factor(matrix));
        ASSERT_TRUE(cholesky.factor(matrix));  // values again, same pattern
        EXPECT_GE(cholesky.factor_entries(), p.unknowns(l));
        Vector found(n);
        cholesky.solve(test::span_of(b), {found.data(), p.unknowns(l)});
        EXPECT_LE((found - x).norm(), kAccuracy * x.norm()) << name << ", level " << l;
      }
    }
  }
}

TEST(SparseCholesky, SeesAMatrixThatIsNotPositive) {
  const Problem p("uniform", Case::static_options());
  const test::Loaded loaded(p, test::make_backend("cpu"), {-1, 0}, {}, p.deformation());
  AssembledLevel matrix(p.level(0));
  matrix.assemble(p.level(0), [&](std::int32_t cell, std::span<double> out) {
    loaded.backend->read_cell_matrix(0, cell, out);
  });
  for (const CholeskyEngine engine : {CholeskyEngine::simplicial, CholeskyEngine::supernodal}) {
    SparseCholesky cholesky(engine);
    cholesky.analyse(matrix);
    EXPECT_FALSE(cholesky.factor(matrix));
  }
}

}  // namespace
}  // namespace kerf
