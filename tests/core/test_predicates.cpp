// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "core/base/error.hpp"
#include "core/geometry/predicates.hpp"

namespace kerf {
namespace {

// Small coordinates in [-2, 2] tie often. Scaled by 2^24, the infinitesimal becomes a shift that
// can be written down: e = 2^-8, and each power outweighs the next because entries of n are <= 32.
constexpr std::int64_t kScale = std::int64_t{1} << 24;
constexpr Int3 kShift{std::int64_t{1} << 16, std::int64_t{1} << 8, 1};

class Random {
 public:
  Int3 small() { return {pick_(engine_), pick_(engine_), pick_(engine_)}; }

 private:
  std::mt19937 engine_{7};
  std::uniform_int_distribution<std::int64_t> pick_{-2, 2};
};

Int3 scaled(const Int3& p) { return {kScale * p[0], kScale * p[1], kScale * p[2]}; }
Int3 moved(const Int3& p) {
  return {kScale * p[0] + kShift[0], kScale * p[1] + kShift[1], kScale * p[2] + kShift[2]};
}
Int3 minus(const Int3& a, const Int3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

// a . (b x c) in 128 bits, written out apart from the library.
int sign_of_det(const Int3& a, const Int3& b, const Int3& c) {
  Int128 det = 0;
  for (unsigned i = 0; i < 3; ++i) {
    const unsigned j = (i + 1) % 3, k = (i + 2) % 3;
    det += a[i] * (static_cast<Int128>(b[j]) * c[k] - static_cast<Int128>(b[k]) * c[j]);
  }
  return det > 0 ? 1 : (det < 0 ? -1 : 0);
}

TEST(Predicates, SideOfPlaneEqualsAnActualTinyShift) {
  Random random;
  int ties = 0;
  for (int n = 0; n < 100000; ++n) {
    const Int3 a = random.small(), b = random.small(), c = random.small(), p = random.small();

    const int side = side_of_plane(a, b, c, p);

    const Int3 A = scaled(a), P = moved(p);
    EXPECT_EQ(side, sign_of_det(minus(P, A), minus(scaled(b), A), minus(scaled(c), A)));
    ties += sign_of_det(minus(p, a), minus(b, a), minus(c, a)) == 0 && side != 0;
  }
  EXPECT_GT(ties, 1000);
}

TEST(Predicates, LineSideEqualsAnActualTinyShift) {
  Random random;
  int ties = 0;
  for (int n = 0; n < 100000; ++n) {
    const Int3 p = random.small(), q = random.small(), u = random.small(), v = random.small();

    const int side = line_side(p, q, u, v);

    const Int3 P = moved(p), Q = moved(q);
    EXPECT_EQ(side, sign_of_det(minus(Q, P), minus(scaled(u), P), minus(scaled(v), P)));
    EXPECT_EQ(side, -line_side(p, q, v, u));
    ties += sign_of_det(minus(q, p), minus(u, p), minus(v, p)) == 0 && side != 0;
  }
  EXPECT_GT(ties, 1000);
}

TEST(Predicates, CrossingEqualsAnActualTinyShift) {
  Random random;
  int crossed = 0;
  for (int n = 0; n < 100000; ++n) {
    const Int3 p = random.small(), q = random.small();
    const Int3 a = random.small(), b = random.small(), c = random.small();

    double t = -1;
    const int crossing = segment_crosses_triangle(p, q, a, b, c, &t);

    double t_moved = -1;
    EXPECT_EQ(crossing, segment_crosses_triangle(moved(p), moved(q), scaled(a), scaled(b),
                                                 scaled(c), &t_moved));
    EXPECT_EQ(crossing, -segment_crosses_triangle(q, p, a, b, c));
    EXPECT_EQ(crossing, -segment_crosses_triangle(p, q, b, a, c));
    if (crossing == 0) continue;
    ++crossed;
    constexpr double kShiftOfT = 0.15;  // e |n| / |n . (q - p)|, at most 32 / 256, and a little
    EXPECT_NEAR(t, t_moved, kShiftOfT);
    EXPECT_TRUE(t >= 0 && t <= 1);
  }
  EXPECT_GT(crossed, 1000);
}

// A closed surface: the octahedron of the 6 unit points, with every face split at its corner sum,
// so that lattice segments pass through its corners, along its edges and within its faces.
std::vector<std::array<Int3, 3>> octahedron(std::int64_t r) {
  std::vector<std::array<Int3, 3>> faces;
  for (std::int64_t sx : {-1, 1})
    for (std::int64_t sy : {-1, 1})
      for (std::int64_t sz : {-1, 1}) {
        Int3 x{sx * r, 0, 0}, y{0, sy * r, 0}, z{0, 0, sz * r};
        const Int3 m{sx * r / 3, sy * r / 3, sz * r / 3};
        if (sx * sy * sz < 0) std::swap(y, z);
        faces.push_back({x, y, m});
        faces.push_back({y, z, m});
        faces.push_back({z, x, m});
      }
  return faces;
}

// |x| + |y| + |z| < r for the point moved by the infinitesimal.
bool inside_octahedron(const Int3& p, std::int64_t r) {
  const std::int64_t sum = std::abs(p[0]) + std::abs(p[1]) + std::abs(p[2]) - r;
  return sum < 0 || (sum == 0 && p[0] < 0);  // x has the largest infinitesimal
}

TEST(Predicates, ClosedSurfaceIsCrossedAsTopologyDemands) {
  constexpr std::int64_t kRadius = 6;
  const auto faces = octahedron(kRadius);
  std::mt19937 engine(3);
  std::uniform_int_distribution<std::int64_t> pick(-7, 7);
  for (int n = 0; n < 20000; ++n) {
    const Int3 p{pick(engine), pick(engine), pick(engine)};
    Int3 q{pick(engine), pick(engine), pick(engine)};
    if (n % 2 == 0) {  // along an axis, where ties are most common
      q = p;
      q[static_cast<unsigned>(n / 2) % 3] = pick(engine);
    }

    int leaving = 0;
    for (const auto& f : faces) leaving += segment_crosses_triangle(p, q, f[0], f[1], f[2]);

    EXPECT_EQ(leaving, inside_octahedron(p, kRadius) - inside_octahedron(q, kRadius));
  }
}

TEST(Predicates, AxisLineAgreesWithTheSegmentAlongIt) {
  Random random;
  int crossed = 0;
  for (int n = 0; n < 100000; ++n) {
    const Int3 a = random.small(), b = random.small(), c = random.small(), p = random.small();
    const int axis = n % 3;
    Int3 lo = p, hi = p;
    lo[static_cast<unsigned>(axis)] = -3;
    hi[static_cast<unsigned>(axis)] = 3;

    const int crossing = axis_line_crosses_triangle(axis, p, a, b, c);

    EXPECT_EQ(crossing, segment_crosses_triangle(lo, hi, a, b, c));
    EXPECT_EQ(axis_line_side(axis, p, a, b), line_side(lo, hi, a, b));
    crossed += crossing != 0;
  }
  EXPECT_GT(crossed, 1000);
}

TEST(Predicates, LargestCoordinatesDoNotOverflow) {
  constexpr std::int64_t M = kMaxCoordinate;
  const Int3 a{-M, -M, -M}, b{M, -M, M}, c{-M, M, M};  // n is along (-1, -1, 1), entries 2^82

  EXPECT_EQ(side_of_plane(a, b, c, {M, M, -M}), -1);
  EXPECT_EQ(side_of_plane(a, b, c, {-M, -M, M}), 1);
  EXPECT_EQ(side_of_plane(a, b, c, {M, M, M}), -1);
  EXPECT_EQ(side_of_plane(a, b, c, {-M, -M, -M + 1}), 1);
  EXPECT_EQ(segment_crosses_triangle({-M, -M, M}, {M, M, -M}, a, b, c), -1);
}

TEST(Predicates, QuantiserKeepsTheBoxAndItsBits) {
  const Box3 box{{-0.3, 1e3, 5}, {0.7, 1e3 + 2, 5.5}};

  const Quantiser quantise(box);

  EXPECT_EQ(quantise.unit(), std::ldexp(1.0, 1 - 40));  // half extent 1 = 0.5 * 2^1
  for (const Vec3d& p : {box.lo, box.hi, Vec3d{0.1, 1000.25, 5.25}}) {
    const Int3 i = quantise(p);
    EXPECT_EQ(i, quantise(Vec3d(p)));
    const Vec3d back = quantise.position(i);
    constexpr double kRounding = 1e-13;  // of coordinates near 1e3, beside half a unit
    for (int d = 0; d < 3; ++d) EXPECT_NEAR(back[d], p[d], 0.5 * quantise.unit() + kRounding);
  }
}

TEST(Predicates, QuantiserRefusesWhatItCannotHold) {
  const Quantiser quantise(Box3{{0, 0, 0}, {1, 1, 1}});

  EXPECT_THROW(quantise({std::nan(""), 0, 0}), Error);
  EXPECT_THROW(quantise({0, 0, std::numeric_limits<double>::infinity()}), Error);
  EXPECT_THROW(quantise({0, 100, 0}), Error);
  EXPECT_THROW(Quantiser{Box3{}}, Error);
  EXPECT_NO_THROW(Quantiser(Box3{{1, 1, 1}, {1, 1, 1}})({1, 1, 1}));
}

}  // namespace
}  // namespace kerf
