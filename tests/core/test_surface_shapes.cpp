// SPDX-License-Identifier: MIT
//
// What surfaces are as shapes: their parts, their handles, and the smallest cuts by hand.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <memory>
#include <set>

#include "core/body/cut.hpp"
#include "core/geometry/blade.hpp"
#include "tests/support/blades.hpp"
#include "tests/support/bodies.hpp"
#include "tests/support/meshes.hpp"
#include "tests/support/surface_cases.hpp"

namespace kerf {
namespace {

using Euler = std::vector<std::int64_t>;

struct Way {
  SurfaceMethod method;
  int refinement;
};

class SurfaceShapes : public ::testing::TestWithParam<Way> {
 protected:
  LinkedOctree body_of(const Solid& solid, int resolution) const {
    return test::octree_of(solid, resolution, GetParam().refinement);
  }
  /// A cube of 1 m, 16 cells wide.
  LinkedOctree cube() const { return body_of(*test_cube(), 16); }
  static std::unique_ptr<Solid> test_cube() { return make_box({{0, 0, 0}, {1, 1, 1}}); }

  /// The Euler numbers of the parts, ascending, of a surface that must be a manifold.
  Euler shape(const LinkedOctree& body) const {
    const SurfaceMesh mesh = test::surface_of(body, GetParam().method);
    EXPECT_TRUE(test::is_manifold(mesh));
    std::size_t pieces = 0;
    label_pieces(body, &pieces);
    EXPECT_TRUE(test::pieces_are_apart(mesh, pieces));
    Euler numbers = test::euler_numbers(mesh);
    std::sort(numbers.begin(), numbers.end());
    return numbers;
  }
};

INSTANTIATE_TEST_SUITE_P(Ways, SurfaceShapes,
                         ::testing::Values(Way{SurfaceMethod::dual_contouring, 0},
                                           Way{SurfaceMethod::dual_contouring, 2},
                                           Way{SurfaceMethod::splitting_cubes, 0},
                                           Way{SurfaceMethod::splitting_cubes, 2}),
                         [](const auto& way) {
                           return test::method_name(way.param.method) +
                                  std::to_string(way.param.refinement);
                         });

TEST_P(SurfaceShapes, EllipsoidIsASphere) {
  EXPECT_EQ(shape(body_of(*make_ellipsoid({0.1, 0.2, 0.3}, {0.5, 0.3, 0.4}), 20)), Euler{2});
}

TEST_P(SurfaceShapes, BoxIsASphere) { EXPECT_EQ(shape(cube()), Euler{2}); }

TEST_P(SurfaceShapes, TorusHasAHandle) {
  const auto solid = make_mesh_solid(test::torus_mesh({0, 0, 0}, 0.4, 0.17, 48, 24), "torus");

  EXPECT_EQ(shape(body_of(*solid, 24)), Euler{0});
}

TEST_P(SurfaceShapes, TubeHasAHandle) {
  EXPECT_EQ(shape(body_of(*make_cylinder_shell({{0, 0, 0}, {1, 0.8, 0.9}}, 0.2), 20)), Euler{0});
}

/// A box of 16 x 12 x 12 cells without a slot 3 cells wide along y, from z = 4 to `top`.
Voxels slotted(int top) {
  return test::make_voxels(test::lattice_of({16, 12, 12}), [top](const Vec3i& c) {
    return c[0] >= 6 && c[0] < 9 && c[2] >= 4 && c[2] < top ? 0 : 1;
  });
}

TEST_P(SurfaceShapes, SlotThroughABoxMakesAHandleAndABlindOneNone) {
  EXPECT_EQ(shape({slotted(8), GetParam().refinement}), Euler{0});   // closed above: a tunnel
  EXPECT_EQ(shape({slotted(12), GetParam().refinement}), Euler{2});  // open above
}

TEST_P(SurfaceShapes, GapThinnerThanACellIsASurfaceToo) {
  EXPECT_EQ(shape({test::two_limb_body({12, 6, 14}), GetParam().refinement}), Euler{2});
}

TEST_P(SurfaceShapes, VoidInsideABoxHasASurfaceOfItsOwn) {
  const Voxels voxels = test::make_voxels(test::lattice_of({12, 12, 12}), [](const Vec3i& c) {
    return c[0] >= 5 && c[0] < 8 && c[1] >= 5 && c[1] < 7 && c[2] == 6 ? 0 : 1;
  });

  EXPECT_EQ(shape({voxels, GetParam().refinement}), (Euler{2, 2}));
}

TEST_P(SurfaceShapes, CellsThatTouchAtAnEdgeOrACornerStayApart) {
  // Two cubes that share only an edge, and two that share only a corner.
  for (const int shift : {0, 4}) {
    const Voxels voxels = test::make_voxels(test::lattice_of({8, 8, 8}), [shift](const Vec3i& c) {
      const bool low = c[0] < 4 && c[1] < 4 && c[2] < 4;
      const bool high = c[0] >= 4 && c[1] >= 4 && c[2] >= shift && c[2] < shift + 4;
      return low || high ? 1 : 0;
    });

    EXPECT_EQ(shape({voxels, GetParam().refinement}), (Euler{2, 2}));
  }
}

TEST_P(SurfaceShapes, StampPunchesACylinderOutOfABoxAndLeavesAHole) {
  LinkedOctree body = cube();

  cut(body, {}, test::stamp_blade(0.51, 0.49, 0.27, -0.5, 1.5), 1);

  EXPECT_EQ(shape(body), (Euler{0, 2}));
}

TEST_P(SurfaceShapes, BladeInsideABoxLeavesAClosedCrack) {
  LinkedOctree body = cube();

  cut(body, {}, test::plane_blade({0.51, 0.47, 0.52}, {0.3, 1, 0.2}, 0.25), 1);

  EXPECT_EQ(shape(body), (Euler{2, 2}));
}

TEST_P(SurfaceShapes, CrackFromAnEdgeIsPartOfTheOuterSurface) {
  LinkedOctree body = cube();

  cut(body, {}, test::plane_blade({0.1, 0.47, 0.1}, {0.1, 1, 0.2}, 0.45), 1);

  EXPECT_EQ(shape(body), Euler{2});
}

TEST_P(SurfaceShapes, CrackThroughAWallMakesAHandle) {
  LinkedOctree body = cube();

  // Through z = 0 and z = 1, but short of all other sides.
  cut(body, {}, sweep({{{0.25, 0.47, -1}, {0.25, 0.47, 2}}, {{0.75, 0.55, -1}, {0.75, 0.55, 2}}}),
      1);

  EXPECT_EQ(shape(body), Euler{0});
}

TEST_P(SurfaceShapes, ClosedBladeInsideABoxFreesABallInAVoid) {
  LinkedOctree body = cube();

  cut(body, {}, test::sphere_mesh({0.51, 0.49, 0.5}, 0.3, 24), 1);

  EXPECT_EQ(shape(body), (Euler{2, 2, 2}));
}

TEST_P(SurfaceShapes, CrossedFullCutsLeaveFourSpheres) {
  LinkedOctree body = cube();

  cut(body, {}, test::plane_blade({0.51, 0.47, 0.52}, {0.3, 1, 0.2}, 3), 1);
  cut(body, {}, test::plane_blade({0.45, 0.47, 0.52}, {1, -0.1, 0.2}, 3), 2);

  EXPECT_EQ(shape(body), (Euler{2, 2, 2, 2}));
}

/// The parts of a surface with triangles of a cut, as meshes of their own.
SurfaceMesh crack_of(const SurfaceMesh& mesh) {
  const std::vector<std::int32_t> part = test::mesh_parts(mesh, nullptr);
  std::set<std::int32_t> cracks;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    if (mesh.cut_id[t] != 0) cracks.insert(part[static_cast<std::size_t>(mesh.triangles[t][0])]);
  SurfaceMesh out;
  std::vector<std::int32_t> number(mesh.reference.size(), -1);
  for (std::size_t p = 0; p < number.size(); ++p)
    if (cracks.contains(part[p])) {
      number[p] = static_cast<std::int32_t>(out.reference.size());
      out.reference.push_back(mesh.reference[p]);
    }
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    if (number[static_cast<std::size_t>(a)] < 0) continue;
    out.triangles.push_back({number[static_cast<std::size_t>(a)],
                             number[static_cast<std::size_t>(b)],
                             number[static_cast<std::size_t>(c)]});
    out.cut_id.push_back(mesh.cut_id[t]);
  }
  return out;
}

// One link cut in the middle: its four dual cells have one sheet each, which the two sides share.
// Two squares over the same four corners cannot be a manifold, so each is a fan.
TEST(SmallCut, OneLinkUnderDualContouringIsTwoFansOverFourSharedCorners) {
  LinkedOctree body(test::box_body({6, 6, 6}), 0);
  body.disconnect({2, 2, 2}, 1, test::halfway(body.lattice(), 1, 1));

  const SurfaceMesh mesh = test::surface_of(body, SurfaceMethod::dual_contouring);
  const SurfaceMesh crack = crack_of(mesh);

  EXPECT_TRUE(test::is_manifold(mesh));
  EXPECT_EQ(test::euler_numbers(mesh), (Euler{2, 2}));
  ASSERT_EQ(crack.reference.size(), 6u);
  ASSERT_EQ(crack.triangles.size(), 8u);
  EXPECT_EQ(crack.cut_id, std::vector<std::int32_t>(8, 1));
  // The middles lie on the link at one place; each has a fan of its own, facing its own way.
  std::map<std::int32_t, int> uses;
  for (const auto& t : crack.triangles)
    for (const std::int32_t p : t) ++uses[p];
  for (const auto& [p, count] : uses) EXPECT_EQ(count, 4);  // corners and middles alike
  constexpr double kRounding = 1e-6;                        // of a cell: records are floats
  const Lattice& lattice = body.lattice();
  const Vec3d middle = lattice.center({2, 2, 2}) + Vec3d{0, 0.5 * lattice.spacing, 0};
  EXPECT_EQ(
      std::count_if(crack.reference.begin(), crack.reference.end(),
                    [&](const Vec3d& x) { return norm(x - middle) < kRounding * lattice.spacing; }),
      6);  // four dual cells see one link, and put their vertices on its only surface point
}

TEST(SmallCut, OneLinkUnderSplittingCubesIsADiscOnEachSide) {
  LinkedOctree body(test::box_body({6, 6, 6}), 0);
  body.disconnect({2, 2, 2}, 1, test::halfway(body.lattice(), 1, 1));

  const SurfaceMesh mesh = test::surface_of(body, SurfaceMethod::splitting_cubes);
  const SurfaceMesh crack = crack_of(mesh);

  EXPECT_TRUE(test::is_manifold(mesh));
  EXPECT_EQ(test::euler_numbers(mesh), (Euler{2, 2}));
  // Two ends of the link, four tips, and in each of four dual cells a fan of four triangles.
  EXPECT_EQ(crack.reference.size(), 10u);
  EXPECT_EQ(crack.triangles.size(), 16u);
  EXPECT_EQ(crack.cut_id, std::vector<std::int32_t>(16, 1));
}

TEST(SmallCut, RowOfLinksIsAClosedCrackOfOneStrip) {
  for (const SurfaceMethod method : test::kMethods)
    for (int n = 1; n <= 4; ++n)
      for (int axis = 0; axis < 3; ++axis)
        for (int along = 0; along < 3; ++along) {
          if (along == axis) continue;
          SCOPED_TRACE(::testing::Message()
                       << test::method_name(method) << ", " << n << " links along axis " << axis);
          LinkedOctree body(test::box_body({8, 8, 8}), 0);
          for (int i = 0; i < n; ++i)
            body.disconnect(test::plus({2, 2, 2}, along, i), axis,
                            test::halfway(body.lattice(), axis, 1));

          const SurfaceMesh mesh = test::surface_of(body, method);
          const SurfaceMesh crack = crack_of(mesh);

          EXPECT_TRUE(test::is_manifold(mesh));
          EXPECT_EQ(test::euler_numbers(mesh), (Euler{2, 2}));
          for (const std::int32_t id : crack.cut_id) EXPECT_EQ(id, 1);
        }
}

TEST(SmallCut, CellCutOffOnAllSidesIsAPieceInAVoid) {
  for (const SurfaceMethod method : test::kMethods) {
    LinkedOctree body(test::box_body({5, 5, 5}), 0);
    for (int axis = 0; axis < 3; ++axis)
      for (int side = -1; side <= 0; ++side)
        body.disconnect(test::plus({2, 2, 2}, axis, side), axis,
                        test::halfway(body.lattice(), axis, 1));

    const SurfaceMesh mesh = test::surface_of(body, method);

    EXPECT_TRUE(test::is_manifold(mesh));
    EXPECT_EQ(test::euler_numbers(mesh), (Euler{2, 2, 2}));
    EXPECT_TRUE(test::pieces_are_apart(mesh, 2));
  }
}

TEST(SmallCut, SurfaceOfOneCellIsASphereOfItsSize) {
  for (const SurfaceMethod method : test::kMethods) {
    const LinkedOctree body(test::box_body({1, 1, 1}), 0);

    const SurfaceMesh mesh = test::surface_of(body, method);

    EXPECT_TRUE(test::is_manifold(mesh));
    EXPECT_EQ(test::euler_number(mesh), 2);
    // A cube; or an octahedron over the middles of its faces, 1/6 of it, and over each of its eight
    // faces a tetrahedron to the corner of the cube, where the three planes meet, 1/24.
    constexpr double kRounding = 1e-6;  // records are floats
    const double h = body.lattice().spacing;
    EXPECT_NEAR(test::rest_volume(mesh) / (h * h * h),
                method == SurfaceMethod::dual_contouring ? 1 : 1.0 / 2, kRounding);
  }
}

}  // namespace
}  // namespace kerf
