// SPDX-License-Identifier: MIT
//
// Cuts that several workers search for.
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "core/body/cut.hpp"
#include "tests/support/blades.hpp"
#include "tests/support/bodies.hpp"
#include "tests/support/cut_oracle.hpp"
#include "tests/support/threads.hpp"

namespace kerf {
namespace {

class CutByWorkers : public testing::TestWithParam<int> {};

// A blade of few triangles, one of many, and again one of few beside where the first one was.
TEST_P(CutByWorkers, IsTheSameForAnyNumber) {
  const Voxels voxels = test::box_body({22, 20, 21});
  const auto bend = [](const Vec3d& p) {
    return p + Vec3d{0.05 * std::sin(p.y), 0.04 * p.z * p.x, 0.03 * std::cos(3 * p.x)};
  };
  const Lattice& l = voxels.lattice;
  const double reach = 40 * l.spacing;
  const auto at = [&](double x) { return l.origin + l.spacing * Vec3d{x, 10, 10}; };
  const auto bent = [&](TriangleMesh mesh) {
    for (Vec3d& p : mesh.points) p = bend(p);
    return mesh;
  };
  const TriangleMesh few = test::joined(test::plane_blade(at(11.2), {1, 0.2, 0.3}, reach),
                                        test::plane_blade(at(11.4), {0.2, 1, -0.7}, reach)),
                     many = bent(test::stamp_blade(
                         l.origin.x + 10 * l.spacing, l.origin.y + 9 * l.spacing, 6 * l.spacing,
                         l.origin.z - l.spacing, l.origin.z + 30 * l.spacing));
  const auto cut_by = [&](const Workers& workers, CutEvent(&events)[3]) {
    LinkedOctree body(voxels, GetParam());
    for (int n = 0; n < 3; ++n) {
      DeformedLeaves leaves;
      leaves.corners = test::corners_of(body, bend);
      for (const Vec3d& p : leaves.corners) leaves.bounds.add(p);
      leaves.numbers.resize(body.leaf_count());
      std::iota(leaves.numbers.begin(), leaves.numbers.end(), 0);
      TriangleMesh blade = n == 1 ? many : bent(few);
      if (n == 2)
        for (Vec3d& p : blade.points) p.x -= 0.1 * l.spacing;
      events[n] = cut_near(body, leaves, blade, n + 1, workers);
    }
    return body;
  };
  CutEvent expected[3];
  const LinkedOctree one = cut_by({}, expected);
  EXPECT_GT(expected[0].disconnected.size(), 500u);
  EXPECT_GT(expected[1].disconnected.size(), 300u);
  EXPECT_GT(expected[2].moved.size(), 100u);
  for (const int threads : {2, 3, 8}) {
    SCOPED_TRACE(threads);
    CutEvent events[3];
    const LinkedOctree body = cut_by(test::thread_workers(threads), events);
    for (int n = 0; n < 3; ++n) {
      EXPECT_EQ(events[n].disconnected, expected[n].disconnected);
      EXPECT_EQ(events[n].moved, expected[n].moved);
      EXPECT_EQ(events[n].split, expected[n].split);
      EXPECT_EQ(events[n].links_hit, expected[n].links_hit);
    }
    ASSERT_EQ(body.records().size(), one.records().size());
    for (const auto& [key, record] : one.records())
      for (int end = 0; end < 2; ++end) {
        const LinkEnd &a = record.end[end], &b = body.records().at(key).end[end];
        EXPECT_EQ(a.distance, b.distance);
        EXPECT_EQ(a.normal, b.normal);
        EXPECT_EQ(a.cut_id, b.cut_id);
      }
  }
}

INSTANTIATE_TEST_SUITE_P(Refinements, CutByWorkers, testing::Values(0, 1),
                         testing::PrintToStringParamName());

}  // namespace
}  // namespace kerf
