// SPDX-License-Identifier: MIT
//
// Real meshes, cut and simulated in both modes, where the folder with them is at hand.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "app/mesh_io.hpp"
#include "app/scene.hpp"
#include "app/session.hpp"
#include "core/simulation.hpp"
#include "cpu/cpu_backend.hpp"
#include "cpu/fast_backend.hpp"
#include "tests/support/real_mesh.hpp"

namespace kerf {
namespace {

struct RealRun {
  const char* file;
  int resolution;  // enough that the cut leaves no large loose piece, and some corners hang
  double at;       // where the blade enters, of the width
  double depth;    // how deep it goes, of the height
};

std::ostream& operator<<(std::ostream& out, const RealRun& run) { return out << run.file; }

class RealRuns : public ::testing::TestWithParam<RealRun> {
 protected:
  void SetUp() override {
    path_ = test::real_mesh(GetParam().file);
    if (!std::filesystem::exists(path_))
      GTEST_SKIP() << "no " << GetParam().file << "; set KERF_MESHES to the folder of meshes";
  }

  // The body scaled to 0.15 m, its lower third held, a slanted blade from above.
  SimulationSetup setup(TimeMode mode) const {
    TriangleMesh mesh = read_mesh(path_);
    const Box3 box = mesh.bounds();
    const Vec3d extent = box.extent();
    const double scale = 0.15 / std::max({extent.x, extent.y, extent.z});
    for (Vec3d& p : mesh.points) p = scale * (p - box.lo);
    const Vec3d size = scale * extent;

    SimulationSetup out;
    out.body = {make_mesh_solid(std::move(mesh), GetParam().file), GetParam().resolution, 2};
    out.material.young = 1e5;
    out.material.stiffness_damping = 0.02;
    out.supports = {{{{-1, -1, -1}, {1, size.y / 3, 1}}, {}, {true, true, true}}};
    out.loads = {Gravity{{1, -9.81, 0.5}}};
    CutSetup cut;
    cut.start = 0.02;
    const double x = GetParam().at * size.x, y = (1 - GetParam().depth) * size.y;
    cut.lines = {{{x, 1, -1}, {x, 1, 1}}, {{x + 0.1 * y, y, -1}, {x + 0.1 * y, y, 1}}};
    out.cuts = {cut};
    out.time.mode = mode;
    out.time.duration = 0.08;
    return out;
  }

  std::filesystem::path path_;
};

// By the backend that users get; motion by the reference.
TEST_P(RealRuns, EquilibriumOfACutBody) {
  Simulation simulation(setup(TimeMode::statics), make_fast_backend());
  StepReport last;
  while (!simulation.finished()) {
    last = simulation.step();

    EXPECT_TRUE(last.converged);
    EXPECT_LE(last.residual, 1e-8);
  }

  EXPECT_GT(simulation.links_cut(), 0u);
  EXPECT_GT(simulation.hanging(), 0u);
}

TEST_P(RealRuns, MotionOfACutBody) {
  Simulation simulation(setup(TimeMode::dynamic), make_cpu_backend({}));
  const double volume = simulation.volume();
  while (!simulation.finished()) {
    const StepReport step = simulation.step();

    EXPECT_TRUE(step.converged);
    EXPECT_TRUE(std::isfinite(step.residual));
  }

  EXPECT_GT(simulation.links_cut(), 0u);
  constexpr double kRounding = 1e-12;
  EXPECT_NEAR(simulation.volume() / volume, 1, kRounding);
}

INSTANTIATE_TEST_SUITE_P(
    Meshes, RealRuns,
    testing::Values(RealRun{"bunny00.off", 40, 0.5, 0.5}, RealRun{"armadillo.obj", 80, 0.49, 0.35},
                    RealRun{"liver.obj", 40, 0.5, 0.5}, RealRun{"cheese.off", 32, 0.52, 0.2},
                    RealRun{"fixed_top.ply", 96, 0.5, 0.5}),
    [](const auto& mesh) { return std::filesystem::path(mesh.param.file).stem().string(); });

struct SceneRun {
  const char *scene, *mesh;
};

std::ostream& operator<<(std::ostream& out, const SceneRun& run) { return out << run.scene; }

class SceneRuns : public ::testing::TestWithParam<SceneRun> {};

// Cells that fall off and lie in the corner of a large coarse cell are where single precision has
// failed before: it took 1506 cycles for `armadillo`, where double took 581.
TEST_P(SceneRuns, TakeAsManyCyclesInMixedPrecisionAsInDouble) {
  const std::filesystem::path mesh = test::real_mesh(GetParam().mesh);
  if (!std::filesystem::exists(mesh))
    GTEST_SKIP() << "no " << GetParam().mesh << "; set KERF_MESHES to the folder of meshes";
  int cycles[2] = {};
  double worst[2] = {};  // nonlinear residual
  for (const int mixed : {0, 1}) {
    Scene scene =
        read_scene(std::filesystem::path(KERF_SOURCE_DIR) / "scenes" /
                       (std::string(GetParam().scene) + ".toml"),
                   {"body.mesh=\"" + mesh.string() + "\"", "solver.backend=cpu",
                    std::string("solver.precision=") + (mixed != 0 ? "mixed" : "double")});
    scene.setup.surface = SurfaceMethod::none;
    Simulation simulation = open_simulation(scene, open_backend(scene));
    while (!simulation.finished()) {
      const StepReport step = simulation.step();
      EXPECT_TRUE(step.converged);
      cycles[mixed] += step.cycles;
      worst[mixed] = std::max(worst[mixed], step.residual);
    }
  }
  RecordProperty("cycles_double", cycles[0]);
  RecordProperty("cycles_mixed", cycles[1]);
  constexpr double kMore = 1.15;
  EXPECT_LE(cycles[1], kMore * cycles[0]);
  EXPECT_LE(worst[1], kMore * worst[0]);
}

INSTANTIATE_TEST_SUITE_P(Scenes, SceneRuns,
                         testing::Values(SceneRun{"armadillo", "armadillo.obj"},
                                         SceneRun{"bunny", "bunny00.off"},
                                         SceneRun{"cheese", "cheese.off"},
                                         SceneRun{"fixed_top", "fixed_top.ply"},
                                         SceneRun{"liver_incision", "liver.obj"}),
                         [](const auto& run) { return std::string(run.param.scene); });

}  // namespace
}  // namespace kerf
