// SPDX-License-Identifier: MIT
//
// The point that fits hits best, against answers that fit here and a search of the whole cube.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/surface/quadric.hpp"
#include "tests/support/random_blades.hpp"

namespace kerf {
namespace {

using test::Dice;
using Hits = std::vector<SurfaceHit>;

// Some ten roundings of numbers below 1, in units of the cube's side.
constexpr double kRounding = 1e-14;
// The same through an eigenvalue decomposition whose small eigenvalues are a hundredth.
constexpr double kSolved = 1e-11;

Vec3d unit(const Vec3d& v) { return (1 / norm(v)) * v; }

double plane_distance(const SurfaceHit& plane, const Vec3d& x) {
  return std::abs(dot(plane.normal, x - plane.point));
}

bool in_cube(const Vec3d& x) {
  return std::abs(x.x) <= 0.5 && std::abs(x.y) <= 0.5 && std::abs(x.z) <= 0.5;
}

double energy(const Hits& hits, const Vec3d& x) {
  double sum = 0;
  for (const SurfaceHit& hit : hits) {
    const double miss = dot(hit.normal, x - hit.point);
    sum += miss * miss;
  }
  return sum;
}

Vec3d random_point(Dice& dice) {
  const double x = dice.between(-0.5, 0.5), y = dice.between(-0.5, 0.5);
  return {x, y, dice.between(-0.5, 0.5)};
}

/// `count` points of a plane in the cube.
Hits points_of_plane(Dice& dice, const Vec3d& normal, const Vec3d& through, int count, bool firm) {
  Hits hits;
  while (static_cast<int>(hits.size()) < count) {
    Vec3d p = random_point(dice);
    p = p - dot(normal, p - through) * normal;
    if (in_cube(p)) hits.push_back({p, normal, firm});
  }
  return hits;
}

Hits joined(Hits a, const Hits& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

TEST(FitVertex, PointsOfOnePlaneGiveTheirMeanInThePlane) {
  Dice dice(1);
  for (int n = 0; n < 200; ++n) {
    const Vec3d through = 0.5 * random_point(dice), normal = dice.direction();
    const Hits hits = points_of_plane(dice, normal, through, 1 + n % 12, n % 2 == 0);

    const Vec3d x = fit_vertex(hits);

    Vec3d mean;
    for (const SurfaceHit& hit : hits) mean += (1.0 / static_cast<double>(hits.size())) * hit.point;
    EXPECT_LT(norm(x - mean), kRounding);
    EXPECT_LT(plane_distance(hits[0], x), kRounding);
  }
}

TEST(FitVertex, PointsOfAnEdgeGiveAPointOfTheEdgeNearTheirMean) {
  Dice dice(2);
  for (int n = 0; n < 100; ++n) {
    const Vec3d through = 0.2 * random_point(dice), a = dice.direction();
    Vec3d b = dice.direction();
    while (std::abs(dot(a, b)) > 0.8) b = dice.direction();
    const Hits hits = joined(points_of_plane(dice, a, through, 3, false),
                             points_of_plane(dice, b, through, 2, false));
    Vec3d mean;
    for (const SurfaceHit& hit : hits) mean += 0.2 * hit.point;
    const Vec3d along = unit(cross(a, b));
    const Vec3d expected = through + dot(along, mean - through) * along;
    if (!in_cube(expected)) continue;

    const Vec3d x = fit_vertex(hits);

    EXPECT_LT(norm(x - expected), kSolved);
  }
}

TEST(FitVertex, CornerInsideTheCubeIsMet) {
  Dice dice(3);
  for (int n = 0; n < 100; ++n) {
    const Vec3d corner = random_point(dice);
    const Hits hits{{corner + Vec3d{0, 0.3, 0.1}, {1, 0, 0}, false},
                    {corner + Vec3d{0.2, 0, 0.1}, {0, -1, 0}, false},
                    {corner + Vec3d{-0.1, 0.1, 0}, {0, 0, 1}, false}};

    EXPECT_LT(norm(fit_vertex(hits) - corner), kSolved);
  }
}

// Three slanted planes that meet beside the cube: no point of a fine lattice over the cube fits
// better, and none far from the answer fits as well.
TEST(FitVertex, CornerOutsideTheCubeGivesTheBestPointOfItsBoundary) {
  constexpr int kSteps = 40;
  Dice dice(4);
  int outside = 0;
  for (int n = 0; n < 60; ++n) {
    Hits hits;
    for (int i = 0; i < 3; ++i) {
      const Vec3d p = random_point(dice);
      hits.push_back({p, dice.direction(), false});
    }
    const double volume = dot(hits[0].normal, cross(hits[1].normal, hits[2].normal));
    if (std::abs(volume) < 0.4) continue;  // nearly parallel directions are left out, by design

    const Vec3d x = fit_vertex(hits);

    const double found = energy(hits, x);
    outside += found > 1e-6 ? 1 : 0;
    double least = found;
    for (int k = 0; k < (kSteps + 1) * (kSteps + 1) * (kSteps + 1); ++k) {
      const Vec3d y =
          (1.0 / kSteps) * Vec3d{1.0 * (k % (kSteps + 1)), 1.0 * (k / (kSteps + 1) % (kSteps + 1)),
                                 1.0 * (k / (kSteps + 1) / (kSteps + 1))} -
          Vec3d{0.5, 0.5, 0.5};
      least = std::min(least, energy(hits, y));
    }
    EXPECT_GE(least, found - kRounding) << "case " << n;
    EXPECT_TRUE(in_cube(x));
  }
  EXPECT_GT(outside, 10);
}

TEST(FitVertex, NearlyFlatHitsStayNearTheirMean) {
  // Normals 0.02 apart would put the edge where two nearly parallel planes meet, far away.
  const Hits hits{{{-0.4, 0, 0.0}, unit({0.01, 0, 1}), false},
                  {{0.4, 0, 0.01}, unit({-0.01, 0, 1}), false}};

  const Vec3d x = fit_vertex(hits);

  EXPECT_LT(std::abs(x.x), 0.01);
  EXPECT_NEAR(x.z, 0.005, 0.005);
}

TEST(FitVertex, FirmPointsKeepTheirPlaneWhateverTheOthersSay) {
  Dice dice(5);
  for (int n = 0; n < 500; ++n) {
    const Vec3d through = 0.6 * random_point(dice), normal = dice.direction();
    Hits hits = points_of_plane(dice, normal, through, 1 + n % 4, true);
    for (int i = 0; i < 1 + n % 7; ++i) {
      const Vec3d p = random_point(dice);
      hits.insert(hits.begin() + dice.roll(static_cast<int>(hits.size()) + 1),
                  {p, dice.direction(), false});
    }

    const Vec3d x = fit_vertex(hits);

    const auto firm = std::find_if(hits.begin(), hits.end(), [](const auto& h) { return h.firm; });
    EXPECT_LT(plane_distance(*firm, x), kRounding);
    EXPECT_TRUE(in_cube(x));
  }
}

TEST(FitVertex, RimOfACutLiesOnTheSurfaceThatItMeets) {
  const Hits hits{{{0.1, 0, -0.3}, {1, 0, 0}, true},
                  {{0.1, 0.2, -0.2}, {1, 0, 0}, true},
                  {{-0.5, 0, 0.15}, {0, 0, 1}, false},
                  {{0.5, 0.1, 0.15}, {0, 0, 1}, false}};

  const Vec3d x = fit_vertex(hits);

  EXPECT_NEAR(x.x, 0.1, kRounding);
  EXPECT_NEAR(x.z, 0.15, kSolved);
  EXPECT_NEAR(x.y, 0.075, kSolved);  // the mean of all
}

TEST(FitVertex, FirmEdgeIsKeptAndEndsAtTheOthers) {
  const Hits edge{{{0.1, 0.3, 0}, {1, 0, 0}, true}, {{-0.2, 0.2, 0}, {0, 1, 0}, true}};
  const Hits other{{{0, 0, 0.25}, unit({0.5, 0.5, 1}), false}};

  const Vec3d x = fit_vertex(joined(edge, other));

  EXPECT_NEAR(x.x, 0.1, kSolved);
  EXPECT_NEAR(x.y, 0.2, kSolved);
  EXPECT_LT(plane_distance(other[0], x), kSolved);
}

TEST(FitVertex, FirmCornerLeavesNothingToTheOthers) {
  const Hits corner{{{0.1, 0, 0}, {1, 0, 0}, true},
                    {{0, 0.2, 0}, {0, 1, 0}, true},
                    {{0, 0, -0.3}, {0, 0, 1}, true}};
  const Hits other{{{0.4, 0.4, 0.4}, unit({1, 1, 1}), false}};

  EXPECT_LT(norm(fit_vertex(joined(corner, other)) - Vec3d{0.1, 0.2, -0.3}), kSolved);
}

Hits random_hits(Dice& dice, int count) {
  Hits hits;
  for (int i = 0; i < count; ++i) {
    Vec3d p = random_point(dice), n = dice.direction();
    switch (dice.roll(8)) {
      case 0:
        n = {};  // a blade triangle that the pull-back has flattened
        break;
      case 1:
        n = {dice.roll(3) - 1.0, dice.roll(3) - 1.0, dice.roll(3) - 1.0};
        break;
      case 2:
        p = {0.5 * (dice.roll(3) - 1), 0.5 * (dice.roll(3) - 1), 0.5 * (dice.roll(3) - 1)};
        break;
      case 3:
        if (!hits.empty()) p = hits.back().point;
        break;
      case 4:
        if (!hits.empty()) n = hits.back().normal;
        break;
      case 5:
        if (!hits.empty()) n = (1.0 + 1e-7 * dice.roll(3)) * hits.back().normal;
        break;
      default:
        break;
    }
    hits.push_back({p, n, dice.roll(3) == 0});
  }
  return hits;
}

TEST(FitVertex, NeverLeavesTheCubeNorGivesANan) {
  Dice dice(6);
  for (int n = 0; n < 100000; ++n) {
    const Hits hits = random_hits(dice, 1 + dice.roll(24));

    const Vec3d x = fit_vertex(hits);

    ASSERT_TRUE(in_cube(x)) << "case " << n;  // false for a NaN
  }
}

TEST(FitVertex, OrderOfTheHitsDoesNotMatter) {
  constexpr double kOrder = 1e-9;  // roundings over the least eigenvalues that count, 1/100
  Dice dice(7);
  for (int n = 0; n < 20000; ++n) {
    Hits hits;
    for (int i = 1 + dice.roll(12); i > 0; --i) {
      const Vec3d p = random_point(dice);
      const Vec3d normal = dice.direction();
      hits.push_back({p, normal, dice.roll(3) == 0});
    }
    Hits turned(hits.rbegin(), hits.rend());

    const Vec3d x = fit_vertex(hits), y = fit_vertex(turned);

    ASSERT_LT(norm(x - y), kOrder) << "case " << n << " of " << hits.size() << " hits";
  }
}

// A line through the cube whose point nearest to the mean lies outside: of the two places where it
// leaves the cube, which fit alike, the one nearer to the mean.
TEST(FitVertex, EdgeThatLeavesTheCubeEndsWhereItIsNearestToTheMean) {
  Dice dice(8);
  int cases = 0;
  for (int n = 0; n < 20000; ++n) {
    const Vec3d p = random_point(dice), q = random_point(dice);
    const Hits hits{{p, dice.direction(), false}, {q, dice.direction(), false}};
    const Vec3d line = cross(hits[0].normal, hits[1].normal);
    const Vec3d along = unit(line), mean = 0.5 * (p + q);
    // Lines that run along a face of the cube meet it nowhere in particular.
    const double slant = std::min({std::abs(along.x), std::abs(along.y), std::abs(along.z)});
    if (norm(line) < 0.6 || slant < 0.3) continue;
    const Vec3d x = fit_vertex(hits);
    if (energy(hits, x) > kRounding * kRounding) continue;  // the line misses the cube
    // Both ends of the line in the cube, from x.
    double low = -2, high = 2;
    for (int d = 0; d < 3; ++d) {
      const double a = (-0.5 - x[d]) / along[d], b = (0.5 - x[d]) / along[d];
      low = std::max(low, std::min(a, b));
      high = std::min(high, std::max(a, b));
    }
    const double best = std::clamp(dot(along, mean - x), low, high);

    ASSERT_LT(std::abs(best), kSolved) << "case " << n;

    cases += dot(along, mean - x) != best ? 1 : 0;
  }
  EXPECT_GT(cases, 50);
}

}  // namespace
}  // namespace kerf
