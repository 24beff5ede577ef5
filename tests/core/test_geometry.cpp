// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "core/base/error.hpp"
#include "core/geometry/blade.hpp"
#include "core/geometry/bvh.hpp"
#include "core/geometry/closing.hpp"
#include "core/geometry/triangle_mesh.hpp"
#include "core/geometry/winding.hpp"
#include "tests/support/meshes.hpp"

namespace kerf {
namespace {

using test::append;
using test::box_mesh;
using test::flipped;
using test::sphere_mesh;
using test::torus_mesh;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

TEST(TriangleMesh, ClosedBoxIsReportedAsSuch) {
  const MeshReport report = inspect(box_mesh({{1, 2, 3}, {2, 4, 6}}, 3));

  EXPECT_TRUE(report.closed());
  EXPECT_TRUE(report.oriented());
  EXPECT_EQ(report.unbalanced_edges, 0u);
  EXPECT_EQ(report.degenerate_triangles, 0u);
  EXPECT_NEAR(report.volume, 6.0, 1e-13);  // rounding of a sum of 108 terms
  EXPECT_NEAR(inspect(flipped(box_mesh({{1, 2, 3}, {2, 4, 6}}, 3))).volume, -6.0, 1e-13);
}

TEST(TriangleMesh, DefectsAreCounted) {
  TriangleMesh open = box_mesh({{0, 0, 0}, {1, 1, 1}});
  open.triangles.pop_back();
  TriangleMesh turned = box_mesh({{0, 0, 0}, {1, 1, 1}});
  std::swap(turned.triangles[0][0], turned.triangles[0][1]);
  TriangleMesh touching = box_mesh({{0, 0, 0}, {1, 1, 1}});
  append(touching, box_mesh({{1, 1, 0}, {2, 2, 1}}));
  TriangleMesh thin = box_mesh({{0, 0, 0}, {1, 1, 1}}, 2);
  const auto last = static_cast<std::int32_t>(thin.points.size());
  thin.points.insert(thin.points.end(), {{2, 2, 2}, {3, 3, 3}, {5, 5, 5}});
  thin.triangles.push_back({0, 0, 1});
  thin.triangles.push_back({last, last + 1, last + 2});

  EXPECT_EQ(inspect(open).boundary_edges, 3u);
  EXPECT_EQ(inspect(open).unbalanced_edges, 3u);
  EXPECT_EQ(inspect(turned).misoriented_edges, 3u);
  EXPECT_TRUE(inspect(turned).closed());
  EXPECT_EQ(inspect(weld(touching)).nonmanifold_edges, 1u);
  EXPECT_EQ(inspect(weld(touching)).unbalanced_edges, 0u);
  EXPECT_EQ(inspect(thin).degenerate_triangles, 2u);
}

TEST(TriangleMesh, WeldMergesEqualPointsOnly) {
  const TriangleMesh box = box_mesh({{0, 0, 0}, {1, 1, 1}}, 2);
  TriangleMesh soup;  // every triangle has its own three points
  for (const auto& t : box.triangles)
    for (const std::int32_t i : t) soup.points.push_back(box.points[static_cast<std::size_t>(i)]);
  for (std::int32_t i = 0; i < static_cast<std::int32_t>(soup.points.size()); i += 3)
    soup.triangles.push_back({i, i + 1, i + 2});
  const auto first = static_cast<std::int32_t>(soup.points.size());
  soup.points.insert(soup.points.end(), {{-0.0, 0, 0}, {0, 0, 0}, {1e-300, 0, 0}});
  soup.triangles.push_back({first, first + 1, first + 2});  // repeats a vertex once welded

  const TriangleMesh welded = weld(soup);

  EXPECT_EQ(welded.points.size(), 26u + 1u);
  EXPECT_EQ(welded.triangles.size(), 48u);
  EXPECT_EQ(inspect(welded).boundary_edges, 0u);
  EXPECT_EQ(inspect(soup).boundary_edges, 3u * 48u + 3u);
}

TEST(TriangleMesh, ChecksPointsAndIndices) {
  TriangleMesh bad = box_mesh({{0, 0, 0}, {1, 1, 1}});
  EXPECT_NO_THROW(check_finite(bad, "box"));
  bad.points[2].y = kNan;
  EXPECT_THROW(check_finite(bad, "box"), Error);
  bad.points[2].y = 0;
  bad.triangles[1][1] = 8;
  EXPECT_THROW(check_finite(bad, "box"), Error);
  bad.triangles[1][1] = -1;
  EXPECT_THROW(check_finite(bad, "box"), Error);
}

TEST(Bvh, FindsWhatBruteForceFinds) {
  std::mt19937 engine(5);
  std::uniform_real_distribution<double> pick(0, 1);
  for (const std::size_t count : {std::size_t{0}, std::size_t{1}, std::size_t{4}, std::size_t{5},
                                  std::size_t{16}, std::size_t{17}, std::size_t{777}}) {
    std::vector<Box3> boxes(count);
    Box3 all;
    for (std::size_t i = 0; i < count; ++i) {
      const Vec3d p{static_cast<double>(i) / 777, pick(engine), pick(engine)};
      boxes[i].add(p);
      boxes[i].add(p + Vec3d{0.1 * pick(engine), 0.1, 0.1});
      all.add(boxes[i]);
    }
    const Bvh tree(boxes);
    EXPECT_EQ(tree.size(), count);
    EXPECT_EQ(tree.bounds().empty(), count == 0);
    EXPECT_TRUE(tree.bounds().lo == all.lo && tree.bounds().hi == all.hi);
    for (int n = 0; n < 50; ++n) {
      Box3 query;
      query.add(Vec3d{pick(engine), pick(engine), pick(engine)});
      query.add(Vec3d{pick(engine), pick(engine), pick(engine)});
      std::vector<std::int32_t> expected, found;
      for (std::size_t i = 0; i < count; ++i)
        if (boxes[i].overlaps(query)) expected.push_back(static_cast<std::int32_t>(i));

      tree.query(query, [&](std::int32_t i) { found.push_back(i); });

      EXPECT_EQ(found, expected);  // the same boxes, in ascending order
    }
  }
}

const std::vector<CutLine> kPath{{{0, 0, 0}, {0, 0, 1}, {0, 0, 2}},
                                 {{1, 0, 0}, {1, 0, 1}, {1, 0, 2}},
                                 {{2, 1, 0}, {2, 1, 1}, {2, 1, 2}}};

double area(const TriangleMesh& mesh) {
  double sum = 0;
  for (const auto& t : mesh.triangles) {
    const Vec3d& a = mesh.points[static_cast<std::size_t>(t[0])];
    sum += 0.5 * norm(cross(mesh.points[static_cast<std::size_t>(t[1])] - a,
                            mesh.points[static_cast<std::size_t>(t[2])] - a));
  }
  return sum;
}

TEST(Blade, SweepSharesPointsBetweenStrips) {
  const TriangleMesh front = sweep(kPath);

  EXPECT_EQ(front.points.size(), 9u);
  EXPECT_EQ(front.triangles.size(), 8u);
  EXPECT_NEAR(area(front), 2 + 2 * std::sqrt(2.0), 1e-14);
  const MeshReport report = inspect(front);
  EXPECT_EQ(report.boundary_edges, 8u);  // the outline only: no cracks
  EXPECT_TRUE(report.oriented());
}

TEST(Blade, PartsOfASweepFitTogether) {
  TriangleMesh joined;
  double t = 0;
  for (const double next : {0.2, 0.5, 0.7, 1.0}) {
    append(joined, sweep_between(kPath, t, next));
    t = next;
  }

  EXPECT_NEAR(area(joined), area(sweep(kPath)), 1e-14);
  EXPECT_EQ(inspect(weld(joined)).boundary_edges, 4u + 2u * 4u);  // 4 strips: no cracks between
  EXPECT_EQ(edge_at(kPath, 0), kPath[0]);
  EXPECT_EQ(edge_at(kPath, 0.5), kPath[1]);
  EXPECT_EQ(edge_at(kPath, 1), kPath[2]);
  EXPECT_EQ(edge_at(kPath, 0.75)[1], (Vec3d{1.5, 0.5, 1}));
  EXPECT_EQ(sweep_between(kPath, 0.25, 0.75).points.size(), 9u);  // the line at 0.5 is kept
}

TEST(Blade, BadLinesAreRefused) {
  EXPECT_THROW(sweep({}), Error);
  EXPECT_THROW(sweep({kPath[0]}), Error);
  EXPECT_THROW(sweep({{{0, 0, 0}}, {{1, 0, 0}}}), Error);
  EXPECT_THROW(sweep({kPath[0], {{0, 0, 0}, {1, 1, 1}}}), Error);
  EXPECT_THROW(sweep({kPath[0], {{0, 0, 0}, {1, 1, 1}, {kNan, 0, 0}}}), Error);
  EXPECT_THROW(edge_at(kPath, -0.1), Error);
  EXPECT_THROW(edge_at(kPath, kNan), Error);
  EXPECT_THROW(sweep_between(kPath, 0.5, 0.5), Error);
  EXPECT_THROW(sweep_between(kPath, 0.5, 1.1), Error);
}

TEST(Winding, IsOneInsideAndZeroOutside) {
  const TriangleMesh torus = torus_mesh({0, 0, 0}, 1, 0.3, 40, 20);
  constexpr double kRounding = 1e-12;

  EXPECT_NEAR(winding_number(torus, {1, 0, 0}), 1, kRounding);
  EXPECT_NEAR(winding_number(torus, {0, 0, 0}), 0, kRounding);
  EXPECT_NEAR(winding_number(torus, {5, 0, 1}), 0, kRounding);
  EXPECT_NEAR(winding_number(flipped(torus), {0, 1, 0.1}), -1, kRounding);
}

TEST(Winding, TreeAgreesWithTheSum) {
  TriangleMesh open = sphere_mesh({0, 0, 0}, 1, 40);
  open.triangles.resize(open.triangles.size() * 2 / 3);
  const WindingTree tree(open);
  constexpr double kFarFieldError = 0.02;  // of dipoles beyond three radii
  std::mt19937 engine(11);
  std::uniform_real_distribution<double> pick(-1.5, 1.5);
  for (int n = 0; n < 1000; ++n) {
    const Vec3d p{pick(engine), pick(engine), pick(engine)};
    EXPECT_NEAR(tree(p), winding_number(open, p), kFarFieldError);
  }
  EXPECT_EQ(WindingTree(TriangleMesh{})({0, 0, 0}), 0);
  EXPECT_FALSE(tree.touches({{-0.1, -0.1, -0.1}, {0.1, 0.1, 0.1}}));
  EXPECT_TRUE(tree.touches({{-0.1, -0.1, -1.1}, {0.1, 0.1, -0.9}}));
}

TEST(Closing, CapsBalanceEveryEdge) {
  TriangleMesh defective = torus_mesh({0, 0, 0}, 1, 0.3, 20, 10);
  std::mt19937 engine(2);
  for (int n = 0; n < 40; ++n) {
    const auto at = static_cast<std::ptrdiff_t>(engine() % defective.triangles.size());
    if (n % 2 == 0)
      defective.triangles.erase(defective.triangles.begin() + at);
    else
      std::swap(defective.triangles[static_cast<std::size_t>(at)][0],
                defective.triangles[static_cast<std::size_t>(at)][1]);
  }
  ASSERT_GT(inspect(defective).unbalanced_edges, 20u);
  const TriangleMesh caps = closing_caps(defective);

  TriangleMesh closed = defective;
  append(closed, caps);
  closed = weld(closed);

  EXPECT_EQ(inspect(closed).unbalanced_edges, 0u);
  const double w = winding_number(closed, {1.01, 0.02, 0.03});
  EXPECT_NEAR(w, std::round(w), 1e-12);  // rounding of the sum
  EXPECT_TRUE(closing_caps(torus_mesh({0, 0, 0}, 1, 0.3, 20, 10)).triangles.empty());
}

}  // namespace
}  // namespace kerf
