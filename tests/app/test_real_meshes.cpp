// SPDX-License-Identifier: MIT
//
// The solids of real meshes, where the folder with them is at hand.
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <random>

#include "app/mesh_io.hpp"
#include "core/body/voxelise.hpp"
#include "core/geometry/winding.hpp"
#include "tests/support/real_mesh.hpp"

namespace kerf {
namespace {

struct RealMesh {
  const char* file;
  double volume_tolerance;  // of the cells against the mesh at 96 cells
};

std::ostream& operator<<(std::ostream& out, const RealMesh& mesh) { return out << mesh.file; }

class RealMeshes : public ::testing::TestWithParam<RealMesh> {
 protected:
  void SetUp() override {
    path_ = test::real_mesh(GetParam().file);
    if (!std::filesystem::exists(path_))
      GTEST_SKIP() << "no " << GetParam().file << "; set KERF_MESHES to the folder of meshes";
  }
  std::filesystem::path path_;
};

TEST_P(RealMeshes, CellsFillTheMesh) {
  const TriangleMesh mesh = read_mesh(path_);
  const MeshReport report = inspect(mesh);
  const auto solid = make_mesh_solid(mesh, GetParam().file);
  const Lattice lattice = make_lattice(solid->bounds(), 96, 2);

  const SolidSamples s = solid->sample(lattice);

  EXPECT_TRUE(report.closed() && report.oriented());
  EXPECT_TRUE(s.warnings.empty());
  std::size_t cells = 0;
  for (const std::uint8_t inside : s.inside) cells += inside;
  const double cell = lattice.spacing * lattice.spacing * lattice.spacing;
  EXPECT_NEAR(static_cast<double>(cells) * cell / report.volume, 1, GetParam().volume_tolerance);
  std::mt19937 engine(17);
  constexpr double kNearSurface = 1e-6;  // from an integer: rounding, and 2^-24 of a cell
  for (int n = 0; n < 2000; ++n) {
    const std::size_t i = engine() % lattice.cells();
    const double w = winding_number(mesh, lattice.center(lattice.cell(i)));
    if (std::abs(w - std::round(w)) > kNearSurface) continue;
    ASSERT_EQ(s.inside[i] != 0, w > 0.5) << "cell " << i;
  }
}

TEST_P(RealMeshes, FineLatticeTakesSeconds) {
  const auto solid = make_mesh_solid(read_mesh(path_), GetParam().file);
  const Lattice lattice = make_lattice(solid->bounds(), 192, 2);
  const auto start = std::chrono::steady_clock::now();

  const Voxels voxels = voxelise(*solid, lattice);

  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  std::cout << GetParam().file << ": " << lattice.cells() << " lattice cells, "
            << voxels.crossings.size() << " crossings in " << seconds << " s\n";
  constexpr double kMinutesNotSeconds = 30;  // measured: below 0.2 s
  EXPECT_LT(seconds, kMinutesNotSeconds);
}

// The ring is 8 cells thick, and its lower face starts a cell: its upper face is anywhere in one,
// so up to 1/16 of the cells could be missing.
INSTANTIATE_TEST_SUITE_P(Meshes, RealMeshes,
                         ::testing::Values(RealMesh{"armadillo.obj", 0.02},
                                           RealMesh{"bunny00.off", 0.02},
                                           RealMesh{"cheese.off", 0.02},
                                           RealMesh{"liver.obj", 0.02},
                                           RealMesh{"fixed_top.ply", 1.0 / 16}),
                         [](const auto& mesh) {
                           const std::string file = mesh.param.file;
                           return file.substr(0, file.find('.'));
                         });

}  // namespace
}  // namespace kerf
