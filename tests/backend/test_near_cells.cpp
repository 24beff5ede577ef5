// SPDX-License-Identifier: MIT
//
// The search for what a blade may meet where places are no ordinary numbers; and the threads that
// a backend lends.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/levels/corners.hpp"
#include "tests/support/blades.hpp"
#include "tests/support/bodies.hpp"
#include "tests/support/problem.hpp"

namespace kerf {
namespace {

using oracle::Vector;
using test::Problem;

/// A cut body with several patches, on the fast backend.
class NearCellsOf {
 public:
  NearCellsOf() : p_(make()), fast_(test::make_backend("fast", 2)) {
    vector_ = fast_->add_vector();
    fast_->load(p_.hierarchy);
  }
  const Hierarchy& hierarchy() const { return p_.hierarchy; }
  NearCells expected(const Vector& u) const {
    return near_cells(p_.hierarchy, test::span_of(u), reach(), {});
  }
  NearCells found(const Vector& u) {
    test::write(*fast_, 0, vector_, u);
    return fast_->find_near(vector_, reach(), {});
  }
  Vector rest() const { return Vector::Zero(static_cast<Eigen::Index>(p_.unknowns(0))); }

 private:
  static Problem make() {
    test::ProblemOptions options;
    options.max_levels = 2;
    options.with_oracle = false;
    LinkedOctree body(test::box_body({19, 17, 15}), 0);
    for (int z = 0; z < 9; ++z)
      for (int y = 0; y < 17; ++y) test::disconnect(body, {8, y, z}, 0);
    return Problem(std::move(body), options);
  }
  BladeReach reach() const {
    const Lattice& l = p_.body.lattice();
    return BladeReach(
        test::plane_blade(l.origin + l.spacing * Vec3d{9, 8, 7}, {1, 0.4, 0.2}, 30 * l.spacing),
        l.origin);
  }

  Problem p_;
  std::unique_ptr<Backend> fast_;
  int vector_ = -1;
};

TEST(FindNear, TellsOfEachPlaceThatIsNoNumber) {
  NearCellsOf body;
  EXPECT_TRUE(body.found(body.rest()).finite);
  const std::int32_t vertices = body.hierarchy().levels[0].vertices();
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
        -std::numeric_limits<double>::infinity()})
    for (std::int32_t v = 0; v < vertices; v += 7) {  // own ones, and those of several patches
      Vector u = body.rest();
      u[3 * v + v % 3] = bad;
      ASSERT_FALSE(body.found(u).finite) << "vertex " << v;
    }
}

TEST(FindNear, FindsCellsThatReachBeyondSinglePrecision) {
  NearCellsOf body;
  for (const double far : {1e30, 1e39, 1e100}) {
    Vector u = body.rest();
    for (std::int32_t v = 0; v < body.hierarchy().levels[0].vertices(); v += 11)
      u[3 * v + v % 3] = v % 2 == 0 ? far : -far;
    const NearCells expected = body.expected(u), found = body.found(u);
    EXPECT_GT(expected.cells.size(), 100u);
    EXPECT_TRUE(found.finite);
    EXPECT_TRUE(std::includes(found.cells.begin(), found.cells.end(), expected.cells.begin(),
                              expected.cells.end()))
        << far;
  }
}

class LentThreads : public testing::TestWithParam<const char*> {};

TEST_P(LentThreads, DoEachPieceOnceAndPassOnErrors) {
  const auto backend = test::make_backend(GetParam(), 3);
  const Workers workers = backend->workers();
  EXPECT_EQ(workers.parts_of(5000), 3u);
  std::vector<std::atomic<int>> times(5000);
  workers.share(times.size(), [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) ++times[i];
  });
  for (const auto& count : times) EXPECT_EQ(count, 1);
  EXPECT_THROW(workers.share(5000,
                             [](std::size_t part, std::size_t, std::size_t) {
                               if (part == 1) throw std::runtime_error("part");
                             }),
               std::runtime_error);
  bool here = false;
  EXPECT_THROW(workers.both([] { throw std::runtime_error("aside"); }, [&] { here = true; }),
               std::runtime_error);
  EXPECT_TRUE(here);
}

INSTANTIATE_TEST_SUITE_P(Backends, LentThreads, testing::Values("fast", "cpu"),
                         [](const auto& backend) { return std::string(backend.param); });

}  // namespace
}  // namespace kerf
