// SPDX-License-Identifier: MIT
//
// Planar cuts and planar faces: where the answer is exact.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>

#include "core/body/cut.hpp"
#include "tests/support/blades.hpp"
#include "tests/support/meshes.hpp"
#include "tests/support/surface_cases.hpp"
#include "tests/support/triangle_distance.hpp"

namespace kerf {
namespace {

// Records are floats, and so are their normals: some ten roundings of 6e-8 of a cell.
constexpr double kFloat = 1e-6;

std::unique_ptr<Solid> solid_named(const std::string& name) {
  if (name == "box") return make_box({{0, 0, 0}, {1, 0.8, 0.7}});
  if (name == "ball") return make_ellipsoid({0.5, 0.4, 0.35}, {0.5, 0.5, 0.5});
  return make_mesh_solid(test::torus_mesh({0.5, 0.4, 0.35}, 0.35, 0.16, 64, 32), name);
}

struct Plane {
  Vec3d normal, through;
  double off(const Vec3d& x) const { return dot(normal, x - through) / norm(normal); }
};

/// Oblique, along axes and diagonals; through no place in particular, a grid point, a centre.
std::vector<Plane> planes(const Lattice& lattice) {
  const Vec3d middle{0.5, 0.4, 0.35};
  const Vec3i c{lattice.size[0] / 2, lattice.size[1] / 2, lattice.size[2] / 2};
  std::vector<Plane> out;
  for (const Vec3d& normal : {Vec3d{1, 0.3, 0.2}, Vec3d{-0.4, 1, 0.7}, Vec3d{0.1, -0.2, 1},
                              Vec3d{1, 0, 0}, Vec3d{0, 1, 1}, Vec3d{1, -1, 1}, Vec3d{2, 1, 0}})
    for (const Vec3d& through :
         {middle + Vec3d{0.013, -0.021, 0.017}, lattice.point(c), lattice.center(c)})
      out.push_back({normal, through});
  return out;
}

class PlanarCuts : public ::testing::TestWithParam<const char*> {
 protected:
  /// Cuts the body by each plane and hands over the plane, the body and both surfaces.
  template <class Check>
  void for_each_plane(SurfaceMethod method, const Check& check) const {
    const bool is_torus = GetParam() == std::string("torus");
    const int resolution = is_torus ? 32 : 20;  // its tube is thin
    const LinkedOctree whole =
        test::octree_of(*solid_named(GetParam()), resolution, is_torus ? 1 : 0);
    const SurfaceMesh before = test::surface_of(whole, method);
    for (const Plane& plane : planes(whole.lattice())) {
      SCOPED_TRACE(::testing::Message()
                   << "normal " << plane.normal.x << " " << plane.normal.y << " " << plane.normal.z
                   << " through x = " << plane.through.x);
      LinkedOctree body = whole;
      cut(body, {}, test::plane_blade(plane.through, plane.normal, 4), 1);
      check(plane, body.lattice().spacing, before, test::surface_of(body, method));
    }
  }
};

INSTANTIATE_TEST_SUITE_P(Bodies, PlanarCuts, ::testing::Values("box", "ball", "torus"),
                         [](const auto& name) { return std::string(name.param); });

/// Per point: whether all triangles around it belong to a cut.
std::vector<char> inside_cut(const SurfaceMesh& mesh) {
  std::vector<char> out(mesh.reference.size(), 1);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (const std::int32_t p : mesh.triangles[t])
      if (mesh.cut_id[t] == 0) out[static_cast<std::size_t>(p)] = 0;
  return out;
}

/// Per piece: +1 if it lies on the side that the normal points to, else -1.
std::vector<int> sides_of(const SurfaceMesh& mesh, const Plane& plane) {
  std::vector<double> sum;
  for (std::size_t p = 0; p < mesh.reference.size(); ++p) {
    const auto piece = static_cast<std::size_t>(mesh.piece[p]);
    if (piece >= sum.size()) sum.resize(piece + 1, 0);
    sum[piece] += plane.off(mesh.reference[p]);
  }
  std::vector<int> out;
  for (const double s : sum) out.push_back(s > 0 ? 1 : -1);
  return out;
}

TEST_P(PlanarCuts, PointsOfCutTrianglesLieInThePlaneAlsoAtItsRim) {
  for_each_plane(SurfaceMethod::dual_contouring,
                 [](const Plane& plane, double h, const SurfaceMesh&, const SurfaceMesh& mesh) {
                   std::size_t of_cut = 0, rim = 0;
                   double most = 0;
                   const std::vector<char> inside = inside_cut(mesh);
                   for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
                     if (mesh.cut_id[t] != 1) continue;
                     ++of_cut;
                     for (const std::int32_t p : mesh.triangles[t]) {
                       most = std::max(most, std::abs(plane.off(test::point_of(mesh, p))));
                       rim += inside[static_cast<std::size_t>(p)] == 0 ? 1 : 0;
                     }
                   }
                   EXPECT_LT(most, kFloat * h);
                   EXPECT_GT(of_cut, 100u);
                   EXPECT_GT(rim, 40u);
                 });
}

// Splitting cubes has triangles from a cut's last link to one of the object's own surface, which
// leave the plane; all other points of cuts lie in it.
TEST_P(PlanarCuts, PointsInsideCutsLieInThePlaneUnderSplittingCubes) {
  for_each_plane(SurfaceMethod::splitting_cubes,
                 [](const Plane& plane, double h, const SurfaceMesh&, const SurfaceMesh& mesh) {
                   std::size_t points = 0;
                   const std::vector<char> inside = inside_cut(mesh);
                   for (std::size_t p = 0; p < inside.size(); ++p) {
                     if (inside[p] == 0) continue;
                     ++points;
                     EXPECT_LT(std::abs(plane.off(mesh.reference[p])), kFloat * h);
                   }
                   EXPECT_GT(points, 100u);
                 });
}

/// Points of a cut that lie further than two cells from its rim on either side: there, both sides
/// see the links of the cut alone.
std::vector<std::size_t> deep_in_cut(const SurfaceMesh& mesh, double h) {
  const std::vector<char> inside = inside_cut(mesh);
  std::set<std::int32_t> rim;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (const std::int32_t p : mesh.triangles[t])
      if (mesh.cut_id[t] != 0 && inside[static_cast<std::size_t>(p)] == 0) rim.insert(p);
  std::vector<std::size_t> out;
  for (std::size_t p = 0; p < inside.size(); ++p)
    if (inside[p] != 0 && std::all_of(rim.begin(), rim.end(), [&](std::int32_t r) {
          return norm(mesh.reference[p] - test::point_of(mesh, r)) > 2 * h;
        }))
      out.push_back(p);
  return out;
}

void expect_coinciding_sides(const Plane& plane, double h, const SurfaceMesh& mesh) {
  using Place = std::array<double, 3>;
  const std::vector<int> side = sides_of(mesh, plane);
  const auto is_above = [&](std::size_t p) {
    return side[static_cast<std::size_t>(mesh.piece[p])] > 0 ? 1 : 0;
  };
  const auto place = [&](std::size_t p) {
    const Vec3d& x = mesh.reference[p];
    return Place{x.x, x.y, x.z};
  };
  std::set<Place> all[2], of_cut[2];
  for (std::size_t p = 0; p < mesh.reference.size(); ++p) all[is_above(p)].insert(place(p));
  for (const std::size_t p : deep_in_cut(mesh, h)) of_cut[is_above(p)].insert(place(p));

  for (int above = 0; above < 2; ++above) {
    EXPECT_GT(of_cut[above].size(), 2u);
    for (const Place& x : of_cut[above]) ASSERT_TRUE(all[1 - above].contains(x));
  }
}

TEST_P(PlanarCuts, TwoSidesCoincideToTheBit) {
  for (const SurfaceMethod method : test::kMethods)
    for_each_plane(method,
                   [](const Plane& plane, double h, const SurfaceMesh&, const SurfaceMesh& mesh) {
                     expect_coinciding_sides(plane, h, mesh);
                   });
}

TEST_P(PlanarCuts, SidesFaceApart) {
  for (const SurfaceMethod method : test::kMethods)
    for_each_plane(method, [](const Plane& plane, double h, const SurfaceMesh&,
                              const SurfaceMesh& mesh) {
      const std::vector<char> inside = inside_cut(mesh);
      const std::vector<int> side = sides_of(mesh, plane);
      double area[2] = {0, 0};
      for (const auto& t : mesh.triangles) {
        if (std::any_of(t.begin(), t.end(),
                        [&](std::int32_t p) { return inside[static_cast<std::size_t>(p)] == 0; }))
          continue;
        const int s = side[static_cast<std::size_t>(mesh.piece[static_cast<std::size_t>(t[0])])];
        const double up = dot(test::face_of(mesh, t), plane.normal);
        // The piece above the plane looks down there, up to slivers that have no side.
        ASSERT_LT(s * up, kFloat * h * h);
        area[s > 0 ? 1 : 0] += std::abs(up);
      }
      EXPECT_GT(area[0], 0);
      EXPECT_GT(area[1], 0);
    });
}

// What an acute edge loses has a section of a part of h^2, along rims of up to 3 m.
TEST_P(PlanarCuts, KeepTheEnclosedVolumeToSecondOrder) {
  for (const SurfaceMethod method : test::kMethods) {
    double worst = 0;
    for_each_plane(method,
                   [&](const Plane&, double h, const SurfaceMesh& before, const SurfaceMesh& mesh) {
                     const double change = test::rest_volume(mesh) - test::rest_volume(before);
                     worst = std::max(worst, std::abs(change) / (h * h));
                   });
    std::cout << GetParam() << ", " << test::method_name(method) << ": volume changes by at most "
              << worst << " m h^2\n";
    EXPECT_LT(worst, 1.5);
  }
}

// A crack inside a box, a few cells wide: its tips, and where it is one cell wide its middles.
TEST(PlanarCracks, PointsOfACrackLieInItsPlane) {
  const LinkedOctree whole = test::octree_of(*make_box({{0, 0, 0}, {1, 1, 1}}), 16, 0);
  const double h = whole.lattice().spacing;
  for (const SurfaceMethod method : test::kMethods)
    for (const Plane& plane : planes(whole.lattice()))
      for (const double reach : {0.9 * h, 2.3 * h, 4.2 * h}) {
        SCOPED_TRACE(::testing::Message()
                     << test::method_name(method) << ", normal " << plane.normal.x << " "
                     << plane.normal.y << " " << plane.normal.z << ", reach " << reach / h << " h");
        LinkedOctree body = whole;
        cut(body, {}, test::plane_blade(plane.through, plane.normal, reach), 1);

        const SurfaceMesh mesh = test::surface_of(body, method);

        std::size_t of_cut = 0;
        for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
          if (mesh.cut_id[t] == 0) continue;
          ++of_cut;
          for (const std::int32_t p : mesh.triangles[t])
            EXPECT_LT(std::abs(plane.off(test::point_of(mesh, p))), kFloat * h);
        }
        EXPECT_GE(of_cut, 8u);
      }
}

// ---- Boxes whose faces lie anywhere in a cell.

const Box3 kBox{{0.013, -0.027, 0.008}, {0.913, 0.591, 0.436}};

/// The lattice of 1/14 m around kBox, so that no face lies on it.
LinkedOctree box_off_the_lattice(int refinement) {
  Lattice lattice{{-0.03, -0.05, -0.04}, 1.0 / 14, {16, 12, 8}};
  return {voxelise(*make_box(kBox), lattice), refinement};
}

Vec3d corner_of(const Box3& box, int i) {
  return {(i & 1) == 0 ? box.lo.x : box.hi.x, (i >> 1 & 1) == 0 ? box.lo.y : box.hi.y,
          (i >> 2) == 0 ? box.lo.z : box.hi.z};
}

/// The largest distance from points on the twelve edges, corners among them, to the surface.
double distance_of_edges(const SurfaceMesh& mesh, double h) {
  const test::TriangleFinder finder({mesh.reference, mesh.triangles}, h);
  double most = 0;
  for (int i = 0; i < 8; ++i)
    for (int axis = 0; axis < 3; ++axis) {
      if ((i >> axis & 1) != 0) continue;
      const Vec3d a = corner_of(kBox, i), b = corner_of(kBox, i | 1 << axis);
      for (int n = 0; n <= 100; ++n) most = std::max(most, finder.distance(a + 0.01 * n * (b - a)));
    }
  return most;
}

double distance_to_faces(const Vec3d& x) {
  double least = 1e9;
  for (int d = 0; d < 3; ++d)
    least = std::min({least, std::abs(x[d] - kBox.lo[d]), std::abs(x[d] - kBox.hi[d])});
  return least;
}

TEST(PlanarFaces, DualContouringKeepsTheEdgesAndCornersOfABox) {
  for (const int refinement : {0, 2}) {
    const LinkedOctree body = box_off_the_lattice(refinement);

    const SurfaceMesh mesh = test::surface_of(body, SurfaceMethod::dual_contouring);

    const double h = body.lattice().spacing;
    EXPECT_LT(distance_of_edges(mesh, h), kFloat * h);
    for (const Vec3d& x : mesh.reference) EXPECT_LT(distance_to_faces(x), kFloat * h);
    const Vec3d size = kBox.extent();
    EXPECT_NEAR(test::rest_volume(mesh) / (size.x * size.y * size.z), 1, kFloat);
  }
}

// Each triangle of a fan joins two links, and where these meet different faces it cuts the edge
// between them off.
TEST(PlanarFaces, SplittingCubesKeepsFacesButBevelsEdges) {
  for (const int refinement : {0, 2}) {
    const LinkedOctree body = box_off_the_lattice(refinement);

    const SurfaceMesh mesh = test::surface_of(body, SurfaceMethod::splitting_cubes);

    const double h = body.lattice().spacing;
    EXPECT_GT(distance_of_edges(mesh, h), 0.05 * h);
    for (const Vec3d& x : mesh.reference) EXPECT_LT(distance_to_faces(x), kFloat * h);
    // A triangle more than a cell from the edges lies in a face.
    std::size_t in_faces = 0;
    for (const auto& t : mesh.triangles) {
      const Vec3d x = (1.0 / 3) * (test::point_of(mesh, t[0]) + test::point_of(mesh, t[1]) +
                                   test::point_of(mesh, t[2]));
      int near = 0;
      for (int d = 0; d < 3; ++d)
        near += std::min(std::abs(x[d] - kBox.lo[d]), std::abs(x[d] - kBox.hi[d])) < h ? 1 : 0;
      if (near != 1) continue;
      ++in_faces;
      EXPECT_LT(distance_to_faces(x), kFloat * h);
    }
    EXPECT_GT(in_faces, 500u);
  }
}

}  // namespace
}  // namespace kerf
