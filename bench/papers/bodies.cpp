// SPDX-License-Identifier: MIT
#include "bench/papers/bodies.hpp"

#include "app/scene.hpp"
#include "core/base/error.hpp"
#include "scenes/comb.hpp"

namespace kerf::papers {
namespace {

namespace fs = std::filesystem;

constexpr int kCubeCells = 80, kSmallCubeCells = 16;
constexpr const char* kBunny = "bunny00.off";
constexpr const char* kArmadillo = "armadillo.obj";

// Of one file, under the names that it has at different places.
std::vector<std::string> names_of_mesh(const std::string& mesh) {
  if (mesh == kArmadillo) return {mesh, "armadillo.off"};
  return {mesh};
}

std::optional<fs::path> find_mesh(const std::string& mesh, const std::vector<fs::path>& folders) {
  for (const fs::path& folder : folders)
    for (const std::string& name : names_of_mesh(mesh))
      if (fs::exists(folder / name)) return folder / name;
  return std::nullopt;
}

SimulationSetup read(const std::string& scene, const std::vector<std::string>& overrides) {
  SimulationSetup out = read_scene(fs::path(KERF_SOURCE_DIR) / "scenes" / scene, overrides).setup;
  out.surface = SurfaceMethod::none;
  return out;
}

}  // namespace

const std::vector<BodyInfo>& bodies() {
  // "Bunny 2" and "Bunny 3" have one and two octree levels fewer. Resolutions and levels are those
  // that give the printed numbers of cells; the paper does not say them.
  static const std::vector<BodyInfo> all{
      {"Bunny",
       "Figure 15 (left); tables 1 and 2",
       "papers/bunny_mixed_cuts.toml",
       kBunny,
       156,
       4,
       26,
       1,
       true,
       {118e3, 755e3, 197e3, 0.693, 2.42, 9.31, 1.30, 0.100, 0.935, 9.76, 3.1}},
      {"Cube",
       "Figure 11 (right); tables 1 and 2",
       "papers/cube_rods.toml",
       "",
       kCubeCells,
       4,
       kSmallCubeCells,
       1,
       true,
       {83.3e3, 512e3, 230e3, 0.781, 3.13, 7.05, 1.94, 0.0145, 0.870, 31.9, 3.9}},
      {"Armadillo",
       "Figure 1 (middle); tables 1 and 2",
       "papers/armadillo_crossed.toml",
       kArmadillo,
       378,
       4,
       48,
       2,
       true,
       {493e3, 3717e3, 643e3, 2.24, 8.24, 47.2, 4.35, 0.0190, 0.973, 101, kNone}},
      {"Bunny 2",
       "tables 1 and 2",
       "papers/bunny_mixed_cuts.toml",
       kBunny,
       78,
       3,
       22,
       1,
       true,
       {26.1e3, 94.3e3, 42.4e3, 0.143, 0.498, 1.12, 0.270, 0.107, 0.864, 1.22, kNone}},
      {"Bunny 3",
       "tables 1 and 2",
       "papers/bunny_mixed_cuts.toml",
       kBunny,
       39,
       2,
       18,
       1,
       true,
       {5.48e3, 11.9e3, 8.27e3, 0.0286, 0.0928, 0.130, 0.0532, 0.0734, 0.655, 0.172, kNone}},
      {"Cheese", "", "cheese.toml", "cheese.off", 80, 3, 24, 1, true, {}},
      {"Cube with thick rods",
       "Figure 11 (left)",
       "papers/cube_thick_rods.toml",
       "",
       kCubeCells,
       4,
       kSmallCubeCells,
       1,
       false,
       {83e3, kNone, 204e3, kNone, kNone, kNone, kNone, kNone, kNone, kNone, 3.5}},
      {"Thin slices",
       "Figure 13",
       "papers/bunny_thin_slices.toml",
       kBunny,
       261,
       4,
       28,
       1,
       false,
       {345e3, kNone, 429e3, kNone, kNone, kNone, kNone, kNone, kNone, kNone, 7.3}},
      {"Cube with a soft layer",
       "Figure 14",
       "papers/cube_buckling.toml",
       "",
       kCubeCells,
       4,
       kSmallCubeCells,
       1,
       false,
       {83e3, kNone, 321e3, kNone, kNone, kNone, kNone, kNone, kNone, kNone, 5.5}},
      {"Bunny with overlapping cuts",
       "Figure 15 (middle)",
       "papers/bunny_overlapping_cuts.toml",
       kBunny,
       156,
       4,
       26,
       1,
       false,
       {118e3, kNone, 166e3, kNone, kNone, kNone, kNone, kNone, kNone, kNone, 2.6}},
      {"Bunny with parallel cuts",
       "Figure 15 (right)",
       "papers/bunny_parallel_cuts.toml",
       kBunny,
       156,
       4,
       26,
       1,
       false,
       {118e3, kNone, 177e3, kNone, kNone, kNone, kNone, kNone, kNone, kNone, 2.8}},
      {"Armadillo with a split head",
       "Figure 1 (left)",
       "papers/armadillo_head.toml",
       kArmadillo,
       378,
       4,
       32,
       1,
       false,
       {493e3, kNone, 569e3, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone}},
      {"Armadillo with parallel cuts",
       "Figure 1 (right)",
       "papers/armadillo_slices.toml",
       kArmadillo,
       378,
       4,
       32,
       1,
       false,
       {493e3, kNone, 646e3, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone}}};
  return all;
}

const BodyInfo& body(const std::string& name) {
  for (const BodyInfo& info : bodies())
    if (name == info.name) return info;
  throw Error(ErrorKind::internal, text("no body '", name, "'"));
}

std::optional<SimulationSetup> make_setup(const BodyInfo& info, Grid grid, bench::Size size,
                                          const std::vector<fs::path>& folders,
                                          std::string& missing) {
  const bool is_small = size == bench::Size::small;
  const int refinement = is_small ? info.small_refinement : info.refinement;
  std::vector<std::string> overrides{
      text("body.resolution=", is_small ? info.small_resolution : info.resolution),
      text("body.refinement=", grid == Grid::uniform ? 0 : refinement)};
  if (const std::string mesh = info.mesh; !mesh.empty()) {
    const std::optional<fs::path> file = find_mesh(mesh, folders);
    if (!file) {
      missing = mesh;
      return std::nullopt;
    }
    overrides.push_back("body.mesh=" + file->string());
  }
  return read(info.scene, overrides);
}

SimulationSetup cube(bench::Size size, int refinement) {
  SimulationSetup out =
      read("papers/cube_rods.toml",
           {text("body.resolution=", size == bench::Size::small ? kSmallCubeCells : kCubeCells),
            text("body.refinement=", refinement)});
  out.cuts.clear();
  return out;
}

SimulationSetup cube_with_comb(bench::Size size, int refinement, int count, double angle) {
  constexpr double kDepth = 0.5;
  SimulationSetup out = cube(size, refinement);
  for (TriangleMesh& blade :
       scenes::comb(out.body.solid->bounds().extent().x, count, kDepth, angle)) {
    CutSetup cut;
    cut.mesh = std::move(blade);
    out.cuts.push_back(std::move(cut));
  }
  return out;
}

}  // namespace kerf::papers
