// SPDX-License-Identifier: MIT
//
// A surface that a backend moves: exact fields, cuts that stay apart, and normals against sums over
// the triangles of the mesh.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <set>
#include <string>
#include <tuple>

#include "core/body/pieces.hpp"
#include "tests/support/problem.hpp"
#include "tests/support/surface_cases.hpp"

namespace kerf {
namespace {

using test::Problem;
using test::ProblemOptions;

ProblemOptions without_supports() {
  ProblemOptions options;
  options.holds = test::Holds::none;
  options.with_oracle = false;
  return options;
}

/// A body, its surface, and a backend that holds a displacement.
struct Moved {
  Problem problem;
  Surface surface;
  std::unique_ptr<Backend> backend;
  int displacement;
  std::vector<Vec3d> positions, normals;

  Moved(LinkedOctree body, SurfaceMethod method, const std::string& machine, int threads = 1)
      : problem(std::move(body), without_supports()),
        surface(problem.body, method),
        backend(test::make_backend(machine, threads)),
        displacement(backend->add_vector()) {
    surface.bind(problem.body);
    backend->load(problem.hierarchy);
  }

  /// Moves to u, given at the vertices by their number and place at rest.
  template <class Field>
  void move(const Field& field) {
    const Level& level = problem.level(0);
    std::vector<double> u;
    for (std::int32_t v = 0; v < level.vertices(); ++v) {
      const Vec3d value = field(v, problem.body.lattice().point(level.point[v]));
      u.insert(u.end(), {value.x, value.y, value.z});
    }
    backend->write(0, displacement, u);
    const SurfaceView view = surface.view();
    // So that what is not written shows.
    positions.assign(view.points.size(), {9e9, 9e9, 9e9});
    normals.assign(view.normals, {9e9, 9e9, 9e9});
    backend->move_points(view.points, displacement, positions);
    backend->surface_normals(view, positions, normals);
  }

  SurfaceMesh mesh() const {
    return surface.mesh(positions, normals, label_pieces(problem.body, nullptr));
  }
  double size() const {
    const Vec3i& n = problem.body.lattice().size;
    return problem.physics.spacing * std::max({n[0], n[1], n[2]});
  }
};

using Parameters = std::tuple<std::string, SurfaceMethod, std::string>;

class BackendSurface : public ::testing::TestWithParam<Parameters> {
 protected:
  void SetUp() override {
    const std::string why = test::why_missing(machine());
    if (why.empty()) return;
    if (test::is_required(machine())) FAIL() << why;
    GTEST_SKIP() << why;
  }
  std::string machine() const { return std::get<0>(GetParam()); }
  SurfaceMethod method() const { return std::get<1>(GetParam()); }
  Moved moved() const { return {test::scene(std::get<2>(GetParam())), method(), machine()}; }
};

std::string name_of(const ::testing::TestParamInfo<Parameters>& p) {
  return std::get<0>(p.param) + "_" + test::method_name(std::get<1>(p.param)) + "_" +
         std::get<2>(p.param);
}

INSTANTIATE_TEST_SUITE_P(Backends, BackendSurface,
                         ::testing::Combine(::testing::Values("cpu"),
                                            ::testing::ValuesIn(test::kMethods),
                                            ::testing::Values("one_cell", "floating", "bar",
                                                              "octree2", "half_cut", "crossed",
                                                              "limbs")),
                         name_of);

INSTANTIATE_TEST_SUITE_P(Device, BackendSurface,
                         ::testing::Combine(::testing::Values("mirror", "cuda"),
                                            ::testing::Values(test::kMethods[0]),
                                            ::testing::Values("one_cell", "bar", "half_cut")),
                         name_of);

TEST_P(BackendSurface, WithoutDisplacementNothingMoves) {
  Moved m = moved();

  m.move([](std::int32_t, const Vec3d&) { return Vec3d{}; });

  const SurfaceView view = m.surface.view();
  ASSERT_FALSE(view.points.empty());
  for (std::size_t v = 0; v < view.points.size(); ++v)
    EXPECT_EQ(std::memcmp(&m.positions[v], &view.points[v].reference, sizeof(Vec3d)), 0);
}

TEST_P(BackendSurface, AffineFieldsMoveEveryPointToItsImage) {
  constexpr double kRelative = 1e-12;  // some hundred roundings, of the size of the body
  Moved m = moved();
  const auto field = [](const Vec3d& x) {
    return Vec3d{0.3 - 0.4 * x.x + 0.2 * x.y + 0.5 * x.z, -0.1 + 0.7 * x.x + 0.1 * x.y - 0.3 * x.z,
                 0.2 + 0.1 * x.x - 0.6 * x.y + 0.4 * x.z};
  };

  m.move([&](std::int32_t, const Vec3d& x) { return field(x); });

  const SurfaceMesh mesh = m.mesh();
  for (std::size_t p = 0; p < mesh.reference.size(); ++p)
    ASSERT_LT(norm(mesh.displacement[p] - field(mesh.reference[p])), kRelative * m.size());
}

// Pieces that are torn apart: each point moves exactly as its own piece does.
TEST_P(BackendSurface, PointsMoveWithTheirOwnPiece) {
  constexpr double kRelative = 1e-12;
  Moved m = moved();
  const std::vector<std::int32_t> piece = label_pieces(m.problem.body, nullptr);
  const auto shift = [](std::int32_t p) { return Vec3d{1.0 * p, 0.5 - 2.0 * p, 1.0 * p * p}; };
  const Level& level = m.problem.level(0);
  const auto piece_of = [&](std::int32_t vertex) {
    return piece[static_cast<std::size_t>(level.incidence[level.incidence_begin[vertex]] / 8)];
  };

  m.move([&](std::int32_t v, const Vec3d&) { return shift(piece_of(v)); });

  const SurfaceMesh mesh = m.mesh();
  for (std::size_t p = 0; p < mesh.reference.size(); ++p) {
    const Vec3d expected = shift(mesh.piece[p]);
    ASSERT_LT(norm(mesh.displacement[p] - expected), kRelative * (m.size() + norm(expected)));
  }
}

/// A normal as the triangles that use it tell: its point and cut id, and the sum of its faces.
struct NormalUse {
  std::set<std::array<std::int32_t, 2>> owners;  // point and cut id
  Vec3d sum{};
};

std::map<std::int32_t, NormalUse> uses_of_normals(const TriangleStore& store,
                                                  const std::vector<Vec3d>& positions) {
  std::map<std::int32_t, NormalUse> uses;
  for (std::size_t t = 0; t < store.triangle_slots(); ++t) {
    const auto& [a, b, c] = store.triangles[t];
    if (a == b) continue;
    const auto at = [&](std::int32_t v) { return positions[static_cast<std::size_t>(v)]; };
    const Vec3d face = cross(at(b) - at(a), at(c) - at(a));
    for (std::size_t k = 0; k < 3; ++k) {
      NormalUse& use = uses[store.normal_of[3 * t + k]];
      use.owners.insert({store.triangles[t][k], store.group[t]});
      use.sum += face;
    }
  }
  return uses;
}

TEST_P(BackendSurface, NormalsAreSumsOfFacesByAreaOfOneCutId) {
  // Sums that nearly cancel point anywhere; elsewhere some hundred roundings.
  constexpr double kCancelled = 1e-6, kRounding = 1e-8;
  Moved m = moved();
  const oracle::Vector u = m.problem.deformation();

  m.move([&](std::int32_t v, const Vec3d&) { return Vec3d{u[3 * v], u[3 * v + 1], u[3 * v + 2]}; });

  const auto uses = uses_of_normals(m.surface.store(), m.positions);
  const double h = m.problem.physics.spacing;
  std::size_t compared = 0;
  for (const auto& [n, use] : uses) {
    const Vec3d& found = m.normals[static_cast<std::size_t>(n)];
    EXPECT_EQ(use.owners.size(), 1u);
    ASSERT_NEAR(norm(found), 1, kRounding);
    if (norm(use.sum) < kCancelled * h * h) continue;
    ++compared;
    ASSERT_LT(norm(found - (1 / norm(use.sum)) * use.sum), kRounding);
  }
  EXPECT_GT(compared, uses.size() / 2);
}

TEST_P(BackendSurface, FacesOfOneCutAreSmoothUnlessTheirSurfaceBends) {
  constexpr float kCrease = 0.64F;
  const Moved m = moved();
  const TriangleStore& store = m.surface.store();
  // Two corners of one group at one point share a normal if their surfaces face the same way; if
  // they do not share one, some two of the group face apart.
  std::map<std::array<std::int32_t, 2>, std::vector<std::size_t>> groups;
  for (std::size_t t = 0; t < store.triangle_slots(); ++t)
    if (store.triangles[t][0] != store.triangles[t][1])
      for (std::size_t k = 0; k < 3; ++k)
        groups[{store.triangles[t][k], store.group[t]}].push_back(3 * t + k);
  for (const auto& [key, corners] : groups) {
    std::set<std::int32_t> normals;
    float least = 1;
    for (const std::size_t a : corners) {
      normals.insert(store.normal_of[a]);
      for (const std::size_t b : corners) {
        const float cosine = dot(store.true_normal[a / 3], store.true_normal[b / 3]);
        least = std::min(least, cosine);
        if (store.true_normal[a / 3] == store.true_normal[b / 3]) {
          EXPECT_EQ(store.normal_of[a], store.normal_of[b]);
        }
      }
    }
    EXPECT_EQ(normals.size() > 1, least <= kCrease);
  }
}

/// How many corners of cut triangles have the normal `normal`, and how many its opposite; none may
/// have another. Where a cut ends at a single link, triangles without area have no normal at rest.
std::array<std::size_t, 2> along_and_against(const SurfaceMesh& mesh, double h,
                                             const Vec3d& normal) {
  const double collapsed = 1e-6 * h * h;
  constexpr double kFloat = 1e-5;  // records are floats, over faces of a hundredth of a cell's
  std::array<std::size_t, 2> count{0, 0};
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (mesh.cut_id[t] != 1 || norm(test::face_of(mesh, mesh.triangles[t])) < collapsed) continue;
    for (const std::int32_t n : mesh.normal_of[t]) {
      const Vec3d& found = mesh.normals[static_cast<std::size_t>(n)];
      const double sign = dot(found, normal) > 0 ? 1 : -1;
      EXPECT_LT(norm(found - sign * normal), kFloat) << "triangle " << t;
      ++count[sign > 0 ? 0 : 1];
    }
  }
  return count;
}

// Whatever the own surface does beside it.
TEST(SurfaceNormals, OfAPlanarCutAreThoseOfThePlaneAlsoAtItsRim) {
  const Vec3d normal = (1 / norm(Vec3d{1, 0.4, -0.3})) * Vec3d{1, 0.4, -0.3};
  LinkedOctree body(test::box_body({11, 10, 9}), 1);
  test::cut_plane(body, {5.3, 4.8, 4.6}, normal, 30);
  Moved m(std::move(body), SurfaceMethod::dual_contouring, "cpu");

  m.move([](std::int32_t, const Vec3d&) { return Vec3d{}; });

  const auto [up, down] = along_and_against(m.mesh(), m.problem.physics.spacing, normal);
  EXPECT_GT(up, 300u);
  EXPECT_GT(down, 300u);
}

// At the tip both sides share points, but not their normals.
TEST(SurfaceNormals, OfAPlanarCrackAreThoseOfThePlaneAlsoAtItsTip) {
  const Vec3d normal = (1 / norm(Vec3d{0.2, 0.3, 1})) * Vec3d{0.2, 0.3, 1};
  for (const SurfaceMethod method : test::kMethods) {
    LinkedOctree body(test::box_body({14, 14, 14}), 1);
    test::cut_plane(body, {7.2, 6.9, 7.1}, normal, 4.3);
    Moved m(std::move(body), method, "cpu");

    m.move([](std::int32_t, const Vec3d&) { return Vec3d{}; });

    const auto [up, down] = along_and_against(m.mesh(), m.problem.physics.spacing, normal);
    EXPECT_GT(up, 300u);
    EXPECT_EQ(up, down);
  }
}

TEST(SurfaceNormals, OfCollapsedTrianglesAreUnitToo) {
  for (const SurfaceMethod method : test::kMethods) {
    Moved m(test::scene("half_cut"), method, "cpu");

    // All of the body in one point, then on a line.
    m.move([](std::int32_t, const Vec3d& x) { return -1.0 * x; });
    for (const Vec3d& n : m.normals) ASSERT_NEAR(norm(n), 1, 1e-12);
    m.move([](std::int32_t, const Vec3d& x) { return Vec3d{0, -x.y, -x.z}; });
    for (const Vec3d& n : m.normals) ASSERT_NEAR(norm(n), 1, 1e-12);
  }
}

TEST(SurfaceNormals, DoNotDependOnTheUnitOfLength) {
  constexpr double kRounding = 1e-9;            // products of scaled numbers round elsewhere
  for (const double scale : {1e-120, 1e120}) {  // squares of areas under- and overflow
    Moved m(test::scene("octree2"), SurfaceMethod::dual_contouring, "cpu");
    m.move([](std::int32_t, const Vec3d&) { return Vec3d{}; });
    const std::vector<Vec3d> expected = m.normals;
    for (Vec3d& x : m.positions) x *= scale;

    m.backend->surface_normals(m.surface.view(), m.positions, m.normals);

    for (std::size_t n = 0; n < expected.size(); ++n)
      ASSERT_LT(norm(m.normals[n] - expected[n]), kRounding);
  }
}

TEST(SurfaceThreads, GiveTheSameBits) {
  constexpr std::size_t kWorth = 4096;  // points and triangles from which loops are shared
  for (const SurfaceMethod method : test::kMethods) {
    LinkedOctree body(test::ball_body(44), 2);
    test::cut_plane(body, {21.3, 22.4, 21.8}, {1, 0.3, 0.2}, 60);
    std::vector<Vec3d> positions, normals;
    for (const int threads : {1, 2, 4}) {
      Moved m(body, method, "cpu", threads);

      m.move([&](std::int32_t v, const Vec3d& x) {
        return Vec3d{std::sin(3 * x.y), std::cos(2 * x.x * x.z), 1e-3 * (v % 17)};
      });

      ASSERT_GT(m.positions.size(), kWorth);
      if (threads == 1) {
        positions = m.positions;
        normals = m.normals;
      }
      EXPECT_EQ(m.positions, positions) << threads;
      EXPECT_EQ(m.normals, normals) << threads;
    }
  }
}

// After cuts, slots lie elsewhere than in a surface built anew; sums must not.
TEST(SurfaceNormals, DoNotDependOnThePastOfTheSurface) {
  for (const SurfaceMethod method : test::kMethods) {
    LinkedOctree body = test::scene("octree2");
    Surface surface(body, method);
    test::Dice dice(3);
    test::RandomBlades blades(body.lattice(), dice);
    for (int i = 0; i < 20; ++i) surface.update(body, cut(body, {}, blades.next(), i + 1));
    surface.bind(body);
    const auto wave = [](std::int32_t, const Vec3d& x) {
      return Vec3d{0.1 * std::sin(9 * x.y), 0.1 * std::cos(7 * x.z), 0.1 * std::sin(5 * x.x)};
    };
    Moved anew(body, method, "cpu");
    anew.move(wave);
    Moved updated(body, method, "cpu");
    updated.surface = std::move(surface);

    updated.move(wave);

    const SurfaceMesh a = anew.mesh(), b = updated.mesh();
    EXPECT_EQ(a.displacement, b.displacement);
    EXPECT_EQ(a.normals, b.normals);
    EXPECT_EQ(a.normal_of, b.normal_of);
  }
}

}  // namespace
}  // namespace kerf
