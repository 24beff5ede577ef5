// SPDX-License-Identifier: MIT
//
// The fast backend on several threads, and of a body that no blade will meet: the same bits.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "core/base/error.hpp"
#include "core/body/cut.hpp"
#include "core/levels/update.hpp"
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

#if defined(__SSE2__)
// On any thread, in loops that are worth several threads and in those that are not.
TEST(FastBackend, TakesSubnormalNumbersForZero) {
  constexpr double kSubnormal = 1e-39;  // in single precision
  const Problem large = test::large_cut_block();
  const Problem small = test::cut_block({6, 5, 4}, {3.3, 2.2, 2.1}, 5, 60);
  ASSERT_GE(large.hierarchy.levels[0].cells(), 2048) << "one thread does all";
  for (const Problem* p : {&large, &small})
    for (const int threads : {1, 2, 3}) {
      const Loaded loaded(*p, test::make_backend("mixed", threads), kDynamic, {}, p->deformation());
      Backend& backend = *loaded.backend;
      for (int l = 0; l + 1 < p->levels(); ++l) {
        SCOPED_TRACE(::testing::Message() << threads << " threads, level " << l);
        const Vector tiny = Vector::Constant(p->unknowns(l), kSubnormal);
        backend.zero(l, kRight);
        test::write(backend, l, kSolution, tiny);
        ASSERT_GT(p->read(backend, l, kSolution).norm(), 0) << "they can be stored";
        backend.residual(l);
        EXPECT_EQ(p->read(backend, l, kResidual).norm(), 0);
        backend.apply(l, kSolution, kResidual);
        EXPECT_EQ(p->read(backend, l, kResidual).norm(), 0);
        test::write(backend, l, kResidual, tiny);
        EXPECT_EQ(backend.dot(l, kResidual, kSolution), 0);
        backend.restrict_residual(l);
        EXPECT_EQ(p->read(backend, l + 1, kRight).norm(), 0);
      }
    }
}
#endif

// Of a body that bends in a plane rounding leaves rotations whose squares are subnormal.
TEST(FastBackend, GivesTheSameBitsWhereRotationsAreNearlyInAPlane) {
  const Problem p = test::large_cut_block();
  std::vector<Vector> found;
  for (const int threads : {1, 2, 3}) {
    const Loaded loaded(p, test::make_backend("mixed", threads), kDynamic, {}, p.deformation());
    Backend& backend = *loaded.backend;
    std::vector<double> q;
    for (std::int32_t c = 0; c < p.hierarchy.levels[0].cells(); ++c) {
      const double angle = 0.001 * c;
      q.insert(q.end(), {std::cos(angle), 3e-20 * c, -1e-21 * c, std::sin(angle)});
    }
    backend.write_rotations(q);
    std::vector<Vector> of;
    for (int l = 0; l + 1 < p.levels(); ++l) backend.coarsen(l);
    for (int l = 0; l + 1 < p.levels(); ++l) {
      backend.prepare(l);
      test::write(backend, l, kRight, p.free_vector(l, 8));
      backend.zero(l, kSolution);
      backend.smooth(l, SweepOrder::forward, 2);
      of.push_back(p.read(backend, l, kSolution));
    }
    if (found.empty()) found = of;
    for (std::size_t l = 0; l < of.size(); ++l) EXPECT_EQ(of[l], found[l]) << threads << ", " << l;
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

// A hierarchy that no blade will meet has no neighbours, and the backend keeps less of it.
TEST(FastBackend, ComputesTheSameWithoutNeighboursInLessMemory) {
  const Problem whole = test::cut_block({21, 14, 11}, {9.3, 5.2, 4.1}, 5, 60);
  Problem bare = test::cut_block({21, 14, 11}, {9.3, 5.2, 4.1}, 5, 60);
  bare.hierarchy.forget_neighbours();
  ASSERT_TRUE(whole.hierarchy.has_neighbours());
  ASSERT_FALSE(bare.hierarchy.has_neighbours());
  for (const char* machine : {"fast", "mixed"}) {
    SCOPED_TRACE(machine);
    const Loaded a(whole, test::make_backend(machine), kDynamic, {}, whole.deformation());
    const Loaded b(bare, test::make_backend(machine), kDynamic, {}, whole.deformation());
    EXPECT_LT(b.backend->bytes(), a.backend->bytes());
    for (int l = 0; l < whole.levels(); ++l) {
      Vector product[2], smoothed[2];
      for (int i = 0; i < 2; ++i) {
        Backend& backend = *(i == 0 ? a : b).backend;
        test::write(backend, l, kKrylovX, whole.free_vector(l, 7));
        backend.apply(l, kKrylovX, kKrylovV);
        product[i] = whole.read(backend, l, kKrylovV);
        if (l + 1 == whole.levels()) continue;
        test::write(backend, l, kRight, whole.free_vector(l, 8));
        backend.zero(l, kSolution);
        backend.smooth(l, SweepOrder::forward, 2);
        smoothed[i] = whole.read(backend, l, kSolution);
      }
      EXPECT_EQ(product[0], product[1]);
      EXPECT_EQ(smoothed[0], smoothed[1]);
    }
    HierarchyChange none;
    none.levels.resize(bare.hierarchy.levels.size());
    EXPECT_THROW(b.backend->update(bare.hierarchy, none), Error);
    const BladeReach reach(TriangleMesh{{{1, 0, 0}, {1, 9, 0}, {1, 0, 9}}, {{0, 1, 2}}});
    EXPECT_THROW(b.backend->find_near(b.extra, reach, {}), Error);
  }
}

}  // namespace
}  // namespace kerf
