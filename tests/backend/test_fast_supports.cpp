// SPDX-License-Identifier: MIT
//
// The fast backend in mixed precision where supports hold single components: on coarse levels one
// of a vertex may be that of one fine vertex alone, and its stiffness a millionth of the others'.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/support/solves.hpp"

namespace kerf {
namespace {

using oracle::Vector;
using test::Loaded;
using test::Problem;

constexpr OperatorScale kStatic{1, 0};

Problem sliding_block() {
  test::ProblemOptions options;
  options.holds = test::Holds::slides;
  options.coarsest_vertices = 60;
  options.with_oracle = false;
  return {LinkedOctree(test::box_body({48, 32, 32}), 0), options};
}

TEST(PartialSupports, LeaveEveryComponentOfADiagonalBlock) {
  const Problem p = sliding_block();
  // Unturned, eight cells are one element exactly, and no other difference is left.
  const Vector still = Vector::Zero(3 * static_cast<Eigen::Index>(p.level(0).vertices()));
  const Loaded exact(p, test::make_backend("fast"), kStatic, {}, still);
  const Loaded mixed(p, test::make_backend("mixed"), kStatic, {}, still);
  double least = 1;  // of the components of a vertex, the smallest over the greatest
  for (int l = 0; l + 1 < p.levels(); ++l) {
    SCOPED_TRACE(l);
    const auto vertices = static_cast<Eigen::Index>(p.level(l).vertices());
    Vector inverse[2] = {Vector::Zero(3 * vertices), Vector::Zero(3 * vertices)};
    for (int c = 0; c < 3; ++c) {
      Vector one = Vector::Zero(3 * vertices);
      for (Eigen::Index v = 0; v < vertices; ++v)
        one[3 * v + c] = ((p.level(l).fixed[v] >> c) & 1) != 0 ? 0 : 1;
      for (int i = 0; i < 2; ++i) {
        Backend& backend = *(i == 0 ? exact : mixed).backend;
        test::write(backend, l, kRight, one);
        backend.precondition_jacobi(l, kRight, kScratch);
        const Vector out = p.read(backend, l, kScratch);
        for (Eigen::Index v = 0; v < vertices; ++v) inverse[i][3 * v + c] = out[3 * v + c];
      }
    }
    for (Eigen::Index v = 0; v < vertices; ++v) {
      const auto of = inverse[0].segment<3>(3 * v);
      double trace = 0;  // about that of the block
      for (int c = 0; c < 3; ++c) trace += of[c] == 0 ? 0 : 1 / of[c];
      for (int c = 0; c < 3; ++c) {
        // Held, or so soft that single precision takes it for nothing (inverse_semidefinite).
        if (of[c] == 0 || 1 / of[c] < 32 * 0x1p-23 * trace) continue;
        least = std::min(least, of[c] / of.maxCoeff());
        EXPECT_NEAR(inverse[1][3 * v + c], of[c], 0.05 * of[c]) << "vertex " << v << ", " << c;
      }
    }
  }
  EXPECT_LT(least, 1e-4);
}

TEST(PartialSupports, TakeAsManyCyclesAsInDouble) {
  const Problem p = sliding_block();
  ASSERT_GE(p.hierarchy.levels.size(), 4u);
  const auto cycles = [&](const char* machine) {
    const SolveStats stats = test::solve(p, *test::make_backend(machine), {}, kStatic, 1e-9).stats;
    EXPECT_TRUE(stats.converged) << machine;
    return stats.cycles;
  };
  EXPECT_LE(cycles("mixed"), cycles("fast") + 1);
}

}  // namespace
}  // namespace kerf
