// SPDX-License-Identifier: MIT
//
// The fast backend on several threads: the same bits.
#include <gtest/gtest.h>

#include <cstring>
#include <string>

#include "core/solve/linear_solver.hpp"
#include "tests/support/solves.hpp"

namespace kerf {
namespace {

using oracle::Vector;
using test::Loaded;
using test::Problem;
using test::Solved;

constexpr OperatorScale kDynamic{0.8, 400};

TEST(FastBackend, GivesTheSameBitsForAnyNumberOfThreads) {
  const Problem p = test::large_cut_block();
  const auto solve = [&](const std::string& machine, int threads) {
    SolverSetup setup;
    setup.cycle = CycleType::k;
    return test::solve(p, *test::make_backend(machine, threads), setup, kDynamic, 1e-6);
  };
  for (const char* machine : {"fast", "mixed"}) {
    const Solved one = solve(machine, 1);
    for (const int threads : {2, 3, 4}) {
      const Solved more = solve(machine, threads);
      EXPECT_EQ(more.stats.residual, one.stats.residual) << machine;
      EXPECT_EQ(std::memcmp(more.x.data(), one.x.data(), sizeof(double) * p.unknowns(0)), 0)
          << machine << ", " << threads << " threads";
    }
  }
}

// Sums of shared vertices are there only when all patches are done, on whatever thread.
TEST(FastBackend, RestrictsWhatResidualsLeaveToTheSameBits) {
  const Problem p = test::large_cut_block();
  ASSERT_GE(p.hierarchy.levels[0].cells(), 2048) << "one thread does all";
  for (const char* machine : {"fast", "mixed"})
    for (const int threads : {1, 2, 3, 4}) {
      const Loaded loaded(p, test::make_backend(machine, threads), kDynamic, {}, p.deformation());
      Backend& backend = *loaded.backend;
      for (int l = 0; l + 1 < p.levels(); ++l) {
        SCOPED_TRACE(::testing::Message() << machine << ", " << threads << ", level " << l);
        test::write(backend, l, kRight, p.free_vector(l, 8));
        test::write(backend, l, kSolution, p.free_vector(l, 9));
        backend.restrict_from_solution(l);  // first, while no vector has the residual
        const Vector found = p.read(backend, l + 1, kRight);
        backend.residual(l);
        backend.restrict_residual(l);
        EXPECT_EQ(p.read(backend, l + 1, kRight), found);
        EXPECT_GT(found.norm(), 0);
      }
    }
}

}  // namespace
}  // namespace kerf
