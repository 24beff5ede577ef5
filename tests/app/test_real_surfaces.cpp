// SPDX-License-Identifier: MIT
//
// Surfaces of real meshes, where the folder with them is at hand: against the mesh, and under many
// random blades, at rest and deformed. KERF_FUZZ sets how many blades a mesh and method meet.
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <optional>

#include "app/mesh_io.hpp"
#include "core/body/cut.hpp"
#include "core/body/voxelise.hpp"
#include "tests/support/cut_oracle.hpp"
#include "tests/support/random_blades.hpp"
#include "tests/support/real_mesh.hpp"
#include "tests/support/surface_cases.hpp"
#include "tests/support/triangle_distance.hpp"

namespace kerf {
namespace {

struct RealSurface {
  const char* file;
  int resolution;                     // of the bodies that are cut
  std::optional<std::int64_t> euler;  // at 96 cells, where these resolve the mesh
  std::uint64_t seed;
};

std::ostream& operator<<(std::ostream& out, const RealSurface& mesh) { return out << mesh.file; }

class RealSurfaces : public ::testing::TestWithParam<RealSurface> {
 protected:
  void SetUp() override {
    const std::filesystem::path path = test::real_mesh(GetParam().file);
    if (!std::filesystem::exists(path))
      GTEST_SKIP() << "no " << GetParam().file << "; set KERF_MESHES to the folder of meshes";
    mesh_ = read_mesh(path);
    solid_ = make_mesh_solid(mesh_, GetParam().file);
  }
  TriangleMesh mesh_;
  std::unique_ptr<Solid> solid_;
};

TEST_P(RealSurfaces, UncutSurfaceIsThatOfTheMesh) {
  constexpr double kVolume = 0.005;  // of the mesh's; second order in the cell
  // In cells. Where a limb is thinner than a cell, the planes on its sides may meet beyond its end:
  // the armadillo has seven such points, the cheese three.
  constexpr double kDistance = 0.5, kAnyDistance = 1, kMean = 0.05, kShareBeyond = 5e-4;
  const LinkedOctree body = test::octree_of(*solid_, 96, 2);
  const double h = body.lattice().spacing;
  const test::TriangleFinder finder(mesh_, h);
  const double volume = inspect(mesh_).volume;
  std::size_t pieces = 0;
  label_pieces(body, &pieces);
  for (const SurfaceMethod method : test::kMethods) {
    const SurfaceMesh surface = test::surface_of(body, method);

    EXPECT_TRUE(test::is_manifold(surface));
    EXPECT_TRUE(test::pieces_are_apart(surface, pieces));
    double most = 0, sum = 0, beyond = 0;
    for (const Vec3d& x : surface.reference) {
      const double distance = finder.distance(x) / h;
      most = std::max(most, distance);
      sum += distance;
      beyond += distance > kDistance ? 1 : 0;
    }
    const double mean = sum / static_cast<double>(surface.reference.size());
    const double error = test::rest_volume(surface) / volume - 1;
    std::cout << GetParam().file << ", " << test::method_name(method) << ": "
              << surface.triangles.size() << " triangles, " << pieces
              << " pieces, V - E + F = " << test::euler_number(surface) << ", volume off by "
              << 100 * error << " %, distance to the mesh " << most << " of a cell at most, "
              << mean << " in the mean\n";
    EXPECT_LT(std::abs(error), kVolume);
    EXPECT_LT(most, kAnyDistance);
    EXPECT_LT(mean, kMean);
    EXPECT_LE(beyond, kShareBeyond * static_cast<double>(surface.reference.size()));
    if (GetParam().euler) {  // of one part; crumbs beside it are spheres
      EXPECT_EQ(test::euler_number(surface) - 2 * (static_cast<std::int64_t>(pieces) - 1),
                *GetParam().euler);
    }
  }
}

/// A bend about the y axis and a twist along it, of the size of the lattice.
std::vector<Vec3d> bent(const LinkedOctree& body, double angle) {
  const Lattice lattice = body.lattice();
  const Vec3d middle =
      lattice.point({lattice.size[0] / 2, lattice.size[1] / 2, lattice.size[2] / 2});
  const double size =
      lattice.spacing * std::max({lattice.size[0], lattice.size[1], lattice.size[2]});
  return test::corners_of(body, [=](const Vec3d& x) {
    const Vec3d r = x - middle;
    const double twist = angle * r.y / size, bend = 0.3 * angle * r.x * r.x / size;
    return middle + Vec3d{std::cos(twist) * r.x - std::sin(twist) * r.z, 1.1 * r.y + bend,
                          std::sin(twist) * r.x + std::cos(twist) * r.z};
  });
}

void check(const LinkedOctree& body, Surface& surface) {
  surface.bind(body);
  const SurfaceMesh mesh = test::mesh_at_rest(surface, body);
  std::size_t pieces = 0;
  label_pieces(body, &pieces);
  EXPECT_TRUE(test::is_manifold(mesh));
  EXPECT_TRUE(test::pieces_are_apart(mesh, pieces));
}

TEST_P(RealSurfaces, RandomBladesLeaveAManifoldWithItsPiecesApart) {
  constexpr int kBladesPerBody = 100, kCheckEvery = 10;
  const int count = test::blade_count(2000);
  ASSERT_GT(count, 0) << "KERF_FUZZ must be the number of blades";
  std::size_t most_triangles = 0;
  for (int done = 0, number = 0; done < count && !HasFailure(); done += kBladesPerBody, ++number) {
    const std::uint64_t seed = GetParam().seed + static_cast<std::uint64_t>(number);
    const SurfaceMethod method = test::kMethods[number % 2];
    test::Dice dice(seed);
    LinkedOctree body = test::octree_of(*solid_, GetParam().resolution, number / 2 % 3);
    const bool deformed = number % 4 >= 2;
    test::RandomBlades blades(body.lattice(), dice);
    Surface surface(body, method);
    check(body, surface);
    for (int i = 0; i < std::min(kBladesPerBody, count - done) && !HasFailure(); ++i) {
      SCOPED_TRACE(::testing::Message()
                   << "seed " << seed << ", blade " << i << ", " << test::method_name(method));
      const std::vector<Vec3d> corners =
          deformed ? bent(body, dice.between(-1.5, 1.5)) : std::vector<Vec3d>{};

      surface.update(body, cut(body, corners, blades.next(), i + 1));

      if (i % kCheckEvery == kCheckEvery - 1) check(body, surface);
    }
    SCOPED_TRACE(::testing::Message() << "seed " << seed << ", at the end");
    check(body, surface);
    most_triangles = std::max(most_triangles, surface.store().triangles_used());
  }
  std::cout << GetParam().file << ": " << count << " blades, up to " << most_triangles
            << " triangles\n";
}

INSTANTIATE_TEST_SUITE_P(Meshes, RealSurfaces,
                         ::testing::Values(RealSurface{"bunny00.off", 24, 2, 1000},
                                           RealSurface{"armadillo.obj", 30, 2, 2000},
                                           RealSurface{"liver.obj", 26, 2, 3000},
                                           RealSurface{"cheese.off", 20, {}, 4000},
                                           RealSurface{"fixed_top.ply", 40, -12, 5000}),
                         [](const auto& mesh) {
                           return std::filesystem::path(mesh.param.file).stem().string();
                         });

}  // namespace
}  // namespace kerf
