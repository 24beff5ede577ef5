// SPDX-License-Identifier: MIT
//
// Sizes between those of tests/bench/test_convergence.cpp and of docs/convergence.md, as limits.
#include <gtest/gtest.h>

#include <numbers>

#include "bench/linear_problem.hpp"
#include "scenes/comb.hpp"

namespace kerf {
namespace {

using bench::Convergence;
using bench::LinearProblem;
using bench::ProblemSetup;

ProblemSetup cube(int cells, SmootherType smoother) {
  ProblemSetup out;
  out.cells = cells;
  out.solver.smoother = smoother;
  out.solver.cycle = CycleType::v;
  out.solver.coarsest_vertices = 500;  // small cubes shall have levels too
  return out;
}

ProblemSetup comb(int cells, double angle, CycleType cycle, bool duplicate) {
  ProblemSetup out;
  out.cells = cells;
  out.poisson = 0.4;
  out.blades = scenes::comb(1.0, 4, 0.5, angle);
  out.solver.cycle = cycle;
  out.solver.duplicate_cells = duplicate;
  out.solver.coarsest_vertices = 500;
  out.solver.max_cycles = 1000;
  return out;
}

// Limits: the project's own for 64^3; the factor hardly depends on the size.
TEST(Convergence, GaussSeidelOnAClampedCube) {
  const Convergence c = LinearProblem(cube(24, SmootherType::gauss_seidel)).measure();

  EXPECT_GE(c.vertices.size(), 2u);
  EXPECT_LE(c.factor, 0.50);
  ASSERT_GE(c.cg_1e10, 0);
  EXPECT_LE(c.cg_1e10, 12);
}

TEST(Convergence, TheFactorDoesNotGrowWithTheGrid) {
  const double coarse = LinearProblem(cube(12, SmootherType::chebyshev)).measure(false).factor;
  const double fine = LinearProblem(cube(24, SmootherType::chebyshev)).measure(false).factor;

  EXPECT_LE(fine, coarse + 0.08);  // two levels against three
  EXPECT_LE(fine, 0.40);
}

TEST(Convergence, DefaultCycleOnTheRotatedComb) {
  const Convergence c =
      LinearProblem(comb(24, std::numbers::pi / 6, CycleType::automatic, true)).measure();

  ASSERT_GE(c.cg_1e6, 0);
  EXPECT_LE(c.cg_1e6, 15);
}

// Merging cells that a cut parts is what the duplicated hierarchy is there to avoid.
TEST(Convergence, DuplicatedCellsBeatMergingByPlace) {
  const Convergence duplicated = LinearProblem(comb(24, 0, CycleType::k, true)).measure();
  const Convergence merged = LinearProblem(comb(24, 0, CycleType::k, false)).measure();

  ASSERT_GE(duplicated.cg_1e6, 0);
  ASSERT_GE(merged.cg_1e6, 0);
  EXPECT_GE(merged.cg_1e6, 2 * duplicated.cg_1e6);
  EXPECT_GT(merged.factor, duplicated.factor + 0.02);
}

}  // namespace
}  // namespace kerf
