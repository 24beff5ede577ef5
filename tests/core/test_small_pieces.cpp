// SPDX-License-Identifier: MIT
//
// Pieces of a few cells are solved for directly: to rounding, whatever the tolerance, and no other
// vertex takes notice.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>
#include <vector>

#include "core/levels/piece_labels.hpp"
#include "core/solve/small_pieces.hpp"
#include "tests/support/solves.hpp"

namespace kerf {
namespace {

using oracle::Vector;
using test::Problem;

constexpr OperatorScale kDynamic{0.8, 400}, kStatic{1, 0};

/// A block from which a cell and a row of three have come off, and a block of 27, which is not
/// small.
Problem crumbling(int refinement, test::Holds holds, bool duplicate_cells = true) {
  LinkedOctree body(test::box_body({12, 9, 8}), refinement);
  const auto cut_out = [&](const Vec3i& first, const Vec3i& size) {
    for (int axis = 0; axis < 3; ++axis) {
      const int u = (axis + 1) % 3, v = (axis + 2) % 3;
      for (int i = 0; i < size[u]; ++i)
        for (int j = 0; j < size[v]; ++j) {
          Vec3i at = first;
          at[u] += i, at[v] += j;
          --at[axis];
          test::disconnect(body, at, axis);
          at[axis] += size[axis];
          test::disconnect(body, at, axis);
        }
    }
  };
  cut_out({3, 4, 3}, {1, 1, 1});
  cut_out({5, 2, 5}, {3, 1, 1});
  cut_out({7, 5, 1}, {3, 3, 3});
  test::ProblemOptions options;
  options.holds = holds;
  options.duplicate_cells = duplicate_cells;
  return {std::move(body), options};
}

std::vector<std::vector<std::int32_t>> small_of(const Problem& p) {
  PieceLabels labels;
  labels.build(p.level(0));
  return labels.small();
}

/// Whether a vertex is of one of some cells, by component.
std::vector<bool> components_of(const Problem& p,
                                const std::vector<std::vector<std::int32_t>>& pieces) {
  std::vector<bool> out(p.unknowns(0), false);
  for (const auto& cells : pieces)
    for (const std::int32_t c : cells)
      for (const std::int32_t v : p.level(0).slots[c])
        for (int k = 0; k < 3; ++k) out[static_cast<std::size_t>(3 * v + k)] = true;
  return out;
}

double greatest_there(const Vector& x, const std::vector<bool>& there, bool is) {
  double out = 0;
  for (std::size_t k = 0; k < there.size(); ++k)
    if (there[k] == is) out = std::max(out, std::abs(x[static_cast<Eigen::Index>(k)]));
  return out;
}

Vector exact_solution(const Problem& p, const OperatorScale& scale, const Vector& b) {
  const auto R = oracle::rotations(p.grids[0], p.physics, p.deformation());
  return oracle::solve(
      oracle::masked(oracle::assemble(p.grids[0], p.physics, R, scale), p.fixed(0), p.fixed(0)),
      p.fixed(0), b);
}

class SmallPiecesOf : public ::testing::TestWithParam<std::string> {
 protected:
  std::unique_ptr<Backend> loaded(const Problem& p, const OperatorScale& scale) {
    auto backend = test::make_backend(GetParam());
    b_ = backend->add_vector(), x_ = backend->add_vector(), r_ = backend->add_vector();
    backend->load(p.hierarchy);
    backend->set_operator(scale);
    test::write(*backend, 0, x_, p.deformation());
    backend->rotate_cells(x_);
    return backend;
  }
  int b_ = -1, x_ = -1, r_ = -1;
};

TEST_P(SmallPiecesOf, AreSolvedForAndNothingElseChanges) {
  constexpr double kRounding = 1e-11;
  for (const int refinement : {0, 1})
    for (const test::Holds holds : {test::Holds::one_side, test::Holds::mixed}) {
      const Problem p = crumbling(refinement, holds);
      const auto small = small_of(p);
      ASSERT_EQ(small.size(), 2u);
      const std::vector<bool> there = components_of(p, small);
      const auto backend = loaded(p, kDynamic);
      const Vector b = p.free_vector(0, 5), x = p.free_vector(0, 6), r = p.free_vector(0, 7);
      test::write(*backend, 0, b_, b);
      test::write(*backend, 0, x_, x);
      test::write(*backend, 0, r_, r);
      SmallPieces pieces;
      pieces.set(p.level(0), small);
      pieces.refresh(*backend);
      ASSERT_FALSE(pieces.empty());

      pieces.solve(*backend, b_, x_);
      pieces.clear(*backend, r_);

      const Vector found = p.read(*backend, 0, x_), left = p.read(*backend, 0, r_);
      const Vector exact = exact_solution(p, kDynamic, b);
      EXPECT_LE(greatest_there(found - exact, there, true),
                kRounding * greatest_there(exact, there, true));
      EXPECT_EQ(greatest_there(left, there, true), 0);
      EXPECT_EQ(greatest_there(found - x, there, false), 0);
      EXPECT_EQ(greatest_there(left - r, there, false), 0);
    }
}

// Coarse cells that merge pieces by place have nothing to say here either.
TEST_P(SmallPiecesOf, AreExactWhateverTheTolerance) {
  for (const bool duplicate_cells : {true, false}) {
    const Problem p = crumbling(1, test::Holds::one_side, duplicate_cells);
    const auto small = small_of(p);
    const std::vector<bool> there = components_of(p, small);
    const Vector b = p.free_vector(0, 5), exact = exact_solution(p, kDynamic, b);
    const auto error_of = [&](const std::vector<std::vector<std::int32_t>>& pieces, bool of_them,
                              double tolerance) {
      const auto backend = loaded(p, kDynamic);
      SolverSetup setup;
      setup.smoother = SmootherType::chebyshev;
      setup.duplicate_cells = duplicate_cells;
      LinearSolver solver(*backend, setup);
      solver.set_structure(p.hierarchy, pieces);
      solver.refresh();
      test::write(*backend, 0, b_, b);
      const SolveStats stats = solver.solve_from_zero(b_, x_, tolerance);
      EXPECT_TRUE(stats.converged);
      EXPECT_GE(stats.cycles, 1);
      const Vector x = p.read(*backend, 0, x_);
      return greatest_there(x - exact, there, of_them) / greatest_there(exact, there, of_them);
    };

    EXPECT_LE(error_of(small, true, 1e-2), 1e-10);
    EXPECT_LE(error_of(small, true, 1e-8), 1e-9);
    EXPECT_GT(error_of({}, true, 1e-2), 1e-6);  // else the tolerance shows nothing
    EXPECT_GT(error_of(small, false, 1e-2), 1e-6);
  }
}

// Without a mass a free piece has no solution. It is not taken for one that has, however its cells
// have turned and whatever rounding leaves.
TEST(SmallPieces, ThatAreSingularAreLeftAlone) {
  for (const Vec3i& size :
       {Vec3i{1, 1, 1}, {3, 1, 1}, {2, 2, 1}, {8, 1, 1}, {4, 2, 1}, {2, 2, 2}}) {
    test::ProblemOptions options;
    options.holds = test::Holds::none;
    options.materials = 2;  // 0.3 and 0.45
    options.with_oracle = false;
    const Problem p(LinkedOctree(test::box_body(size), 0), options);
    std::vector<std::int32_t> all(static_cast<std::size_t>(p.level(0).cells()));
    std::iota(all.begin(), all.end(), 0);
    const auto backend = test::make_backend("cpu");
    const int b = backend->add_vector(), x = backend->add_vector();
    backend->load(p.hierarchy);
    backend->set_operator(kStatic);
    SmallPieces pieces;
    pieces.set(p.level(0), {all});
    for (std::uint64_t seed = 1; seed <= 100; ++seed) {
      test::Dice dice(seed);
      const double half = dice.between(-1.5, 1.5);
      std::vector<double> rotations;
      for (std::size_t c = 0; c < all.size(); ++c) {
        const Vec3d axis = dice.direction();
        const Vec3d by = (std::sin(half) / norm(axis)) * axis;
        for (const double part : {std::cos(half), by.x, by.y, by.z}) rotations.push_back(part);
      }
      backend->write_rotations(rotations);
      const Vector before = p.free_vector(0, seed);
      test::write(*backend, 0, b, before);
      test::write(*backend, 0, x, before);
      pieces.refresh(*backend);

      pieces.solve(*backend, b, x);

      ASSERT_EQ(p.read(*backend, 0, x), before) << "seed " << seed << ", cells " << all.size();
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Backends, SmallPiecesOf,
                         ::testing::Values("cpu", "fast", "mixed", "mirror", "mirror_mixed"),
                         [](const auto& backend) { return backend.param; });

TEST(SmallPieces, ThatAreHeldAltogetherAreNone) {
  Problem p = crumbling(0, test::Holds::one_side);
  const auto small = small_of(p);
  for (const auto& cells : small)
    for (const std::int32_t c : cells)
      for (const std::int32_t v : p.level(0).slots[c]) p.hierarchy.levels[0].fixed[v] = 7;
  SmallPieces pieces;

  pieces.set(p.level(0), small);

  EXPECT_TRUE(pieces.empty());
}

}  // namespace
}  // namespace kerf
