// SPDX-License-Identifier: MIT
//
// Curved cuts and curved bodies: the surface converges to the true one, in both directions, with
// second order in the side of a cell.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iomanip>
#include <iostream>
#include <numbers>
#include <set>

#include "core/body/cut.hpp"
#include "tests/support/blades.hpp"
#include "tests/support/meshes.hpp"
#include "tests/support/surface_cases.hpp"
#include "tests/support/triangle_distance.hpp"

namespace kerf {
namespace {

constexpr double kLeastOrder = 1.8;  // 2, less what the place of the lattice adds to a maximum

/// A true surface: its distance from a point, and points all over it.
struct Truth {
  std::function<double(const Vec3d&)> distance;
  std::vector<Vec3d> points;
};

struct Errors {
  double there = 0, back = 0;  // from the mesh to the truth, and from the truth to the mesh
};

Errors hausdorff(const TriangleMesh& mesh, const Truth& truth, double h) {
  Errors out;
  for (const auto& [a, b, c] : mesh.triangles)
    test::sample_triangle(
        {mesh.points[static_cast<std::size_t>(a)], mesh.points[static_cast<std::size_t>(b)],
         mesh.points[static_cast<std::size_t>(c)]},
        3, [&](const Vec3d& x) { out.there = std::max(out.there, truth.distance(x)); });
  const test::TriangleFinder finder(mesh, h);
  for (const Vec3d& x : truth.points) out.back = std::max(out.back, finder.distance(x));
  return out;
}

/// Measures at `cells`, twice and four times as many along 1 m, prints the table and expects second
/// order over both halvings.
void expect_second_order(const char* name, const Truth& truth, int cells,
                         const std::function<TriangleMesh(int)>& mesh_at) {
  Errors error[3];
  for (int i = 0; i < 3; ++i) error[i] = hausdorff(mesh_at(cells << i), truth, 1.0 / (cells << i));
  std::cout << std::left << std::setw(34) << name << std::setprecision(3);
  for (const Errors& e : error) std::cout << "  " << std::setw(9) << std::max(e.there, e.back);
  const auto order = [&](double Errors::*e) {
    return 0.5 * std::log2(error[0].*e / (error[2].*e));
  };
  std::cout << "  order " << order(&Errors::there) << " to, " << order(&Errors::back)
            << " from the true surface\n";
  EXPECT_GT(order(&Errors::there), kLeastOrder);
  EXPECT_GT(order(&Errors::back), kLeastOrder);
  EXPECT_GT(error[0].there, error[1].there);
  EXPECT_GT(error[1].there, error[2].there);
}

/// The triangles of cuts, or all others.
TriangleMesh cut_faces(const SurfaceMesh& mesh, bool of_cut) {
  TriangleMesh out{mesh.reference, {}};
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    if ((mesh.cut_id[t] != 0) == of_cut) out.triangles.push_back(mesh.triangles[t]);
  return out;
}

LinkedOctree unit_box(int cells) {
  return test::octree_of(*make_box({{0, 0, 0}, {1, 1, 1}}), cells, 0);
}

TEST(SurfaceOrder, StampThroughABox) {
  // 720 sides: they leave the circle by 3e-6, far below the error of the finest lattice.
  const double x = 0.513, y = 0.487, radius = 0.29;
  Truth truth{[=](const Vec3d& p) { return std::abs(std::hypot(p.x - x, p.y - y) - radius); }, {}};
  for (int i = 0; i < 300; ++i)
    for (int j = 0; j <= 100; ++j) {
      const double angle = 2 * std::numbers::pi * i / 300;
      truth.points.push_back(
          {x + radius * std::cos(angle), y + radius * std::sin(angle), 0.01 * j});
    }

  expect_second_order("stamp, dual contouring", truth, 12, [=](int cells) {
    LinkedOctree body = unit_box(cells);
    cut(body, {}, test::stamp_blade(x, y, radius, -0.5, 1.5, 720), 1);
    return cut_faces(test::surface_of(body, SurfaceMethod::dual_contouring), true);
  });
}

Truth sphere(const Vec3d& center, double radius) {
  Truth out{[=](const Vec3d& p) { return std::abs(norm(p - center) - radius); }, {}};
  for (int i = 0; i < 200; ++i)
    for (int j = 0; j <= 100; ++j) {
      const double a = 2 * std::numbers::pi * i / 200, b = std::numbers::pi * j / 100;
      out.points.push_back(center + radius * Vec3d{std::cos(a) * std::sin(b),
                                                   std::sin(a) * std::sin(b), std::cos(b)});
    }
  return out;
}

class Methods : public ::testing::TestWithParam<SurfaceMethod> {
 protected:
  std::string named(const std::string& what) const {
    return what + ", " +
           (GetParam() == SurfaceMethod::dual_contouring ? "dual contouring" : "splitting cubes");
  }
};
INSTANTIATE_TEST_SUITE_P(SurfaceOrder, Methods, ::testing::ValuesIn(test::kMethods),
                         [](const auto& method) { return test::method_name(method.param); });

TEST_P(Methods, BallCutOutOfABox) {
  const Vec3d center{0.507, 0.492, 0.511};
  const TriangleMesh blade = test::sphere_mesh(center, 0.34, 240);

  expect_second_order(named("ball blade").c_str(), sphere(center, 0.34), 12, [&](int cells) {
    LinkedOctree body = unit_box(cells);
    cut(body, {}, blade, 1);
    return cut_faces(test::surface_of(body, GetParam()), true);
  });
}

TEST_P(Methods, EllipsoidWithoutAMesh) {
  const Vec3d center{0.5, 0.4, 0.3}, radii{0.5, 0.38, 0.29};
  Truth truth = sphere({0, 0, 0}, 1);
  // To first order, which suffices this near: the level set over its slope.
  truth.distance = [=](const Vec3d& p) {
    Vec3d q = p - center, slope;
    for (int d = 0; d < 3; ++d) {
      q[d] /= radii[d];
      slope[d] = q[d] / radii[d];
    }
    return std::abs(norm(q) - 1) * norm(q) / norm(slope);
  };
  for (Vec3d& p : truth.points) p = center + Vec3d{radii.x * p.x, radii.y * p.y, radii.z * p.z};

  expect_second_order(named("ellipsoid").c_str(), truth, 12, [&](int cells) {
    return cut_faces(
        test::surface_of(test::octree_of(*make_ellipsoid(center, radii), cells, 0), GetParam()),
        false);
  });
}

TEST_P(Methods, TorusOfTriangles) {
  const double ring = 0.34, tube = 0.16;
  Truth truth{
      [=](const Vec3d& p) { return std::abs(std::hypot(std::hypot(p.x, p.y) - ring, p.z) - tube); },
      {}};
  for (int i = 0; i < 300; ++i)
    for (int j = 0; j < 100; ++j) {
      const double a = 2 * std::numbers::pi * i / 300, b = 2 * std::numbers::pi * j / 100;
      const double r = ring + tube * std::cos(b);
      truth.points.push_back({r * std::cos(a), r * std::sin(a), tube * std::sin(b)});
    }
  const auto solid = make_mesh_solid(test::torus_mesh({0, 0, 0}, ring, tube, 480, 240), "torus");

  expect_second_order(named("torus").c_str(), truth, 20, [&](int cells) {
    return cut_faces(test::surface_of(test::octree_of(*solid, cells, 0), GetParam()), false);
  });
}

TEST(TriangleDistance, IsThatOfTheNearestSample) {
  const std::array<Vec3d, 3> x{Vec3d{0, 0, 0}, Vec3d{1, 0.2, 0}, Vec3d{0.3, 0.9, 0.4}};
  constexpr int kRows = 200;
  for (const Vec3d& p : {Vec3d{0.4, 0.3, 0.5}, Vec3d{-1, -0.5, 0.2}, Vec3d{2, 0.1, -1},
                         Vec3d{0.2, 1.5, 0.3}, Vec3d{0.5, -0.4, 0.1}}) {
    double least = 1e9;
    test::sample_triangle(x, kRows, [&](const Vec3d& y) { least = std::min(least, norm(p - y)); });

    const double found = test::triangle_distance(p, x);

    EXPECT_LE(found, least + 1e-15);  // rounding
    EXPECT_GT(found, least - 1.0 / kRows);
    const test::TriangleFinder finder({{x.begin(), x.end()}, {{0, 1, 2}}}, 0.13);
    EXPECT_EQ(finder.distance(p), found);
  }
}

}  // namespace
}  // namespace kerf
