// SPDX-License-Identifier: MIT
#include "bench/scenes.hpp"

#include <cstdlib>
#include <numbers>
#include <sstream>

#include "app/scene.hpp"
#include "bench/command_line.hpp"
#include "core/base/error.hpp"
#include "scenes/comb.hpp"

namespace kerf::bench {
namespace {

namespace fs = std::filesystem;

constexpr int kSmallCoarsest = 100;  // vertices, so that small bodies have levels too

// E = density = 1: what is timed does not depend on them.
SimulationSetup cube(int cells) {
  SimulationSetup out;
  out.body = {make_box({{0, 0, 0}, {1, 1, 1}}), cells, 0};
  out.material.young = out.material.density = 1;
  out.material.poisson = 0.3;
  out.supports = {{{{-1, -1e-9, -1}, {2, 1e-9, 2}}, {}, {true, true, true}}};
  out.loads = {Gravity{{0.3, -1, 0.2}}};
  return out;
}

SimulationSetup comb(int cells, double angle) {
  constexpr int kBlades = 4;
  SimulationSetup out = cube(cells);
  for (TriangleMesh& blade : scenes::comb(1.0, kBlades, 0.5, angle)) {
    CutSetup cut;
    cut.mesh = std::move(blade);
    out.cuts.push_back(std::move(cut));
  }
  return out;
}

// A body on a real mesh is that of its scene file, at the resolution and refinement given here.
struct MeshScene {
  const char* file;
  const char* mesh;
  int resolution, small_resolution;
};

std::optional<SimulationSetup> real_body(const MeshScene& scene, Size size, bool octree,
                                         bool is_cut, const std::vector<fs::path>& folders,
                                         std::string& missing) {
  for (const fs::path& folder : folders) {
    if (!fs::exists(folder / scene.mesh)) continue;
    const int resolution = size == Size::small ? scene.small_resolution : scene.resolution;
    SimulationSetup out =
        read_scene(fs::path(KERF_SOURCE_DIR) / "scenes" / scene.file,
                   {"body.mesh=" + (folder / scene.mesh).string(),
                    text("body.resolution=", resolution), text("body.refinement=", octree ? 2 : 0)})
            .setup;
    if (!is_cut) out.cuts.clear();
    return out;
  }
  missing = scene.mesh;
  return std::nullopt;
}

struct Sizes {
  int full, small;
  int of(Size size) const { return size == Size::small ? small : full; }
};

}  // namespace

Size size_named(const std::string& name) {
  const Names chosen = choose("--size", "size", name, {"full", "small"});
  expects(chosen.size() == 1, "--size must be full or small");
  return chosen[0] == "small" ? Size::small : Size::full;
}

const std::vector<SceneInfo>& scenes() {
  static const std::vector<SceneInfo> all{
      {"box46", "uncut cube, 46^3 cells: a hundred thousand"},
      {"box64", "uncut cube, 64^3 cells, nu 0.3"},
      {"box100", "uncut cube, 100^3 cells: a million cells"},
      {"box128", "uncut cube, 128^3 cells, nu 0.3"},
      {"box192", "uncut cube, 192^3 cells, nu 0.3"},
      {"bunny", "Stanford bunny, 96 uniform cells long"},
      {"bunny-octree", "the same with an interior of larger cells"},
      {"bunny-cut", "the same, with the curved cut of scenes/bunny.toml"},
      {"armadillo", "Stanford armadillo, 128 uniform cells high"},
      {"armadillo-octree", "the same with an interior of larger cells"},
      {"armadillo-cut", "the same, with the cut of scenes/armadillo.toml"},
      {"comb-aligned", "cube of 48^3 cells, eight blades along the grid in its upper half"},
      {"comb-rotated", "the same, blades turned by 30 degrees"},
      {"box1m-unknowns", "uncut cube, 69^3 cells: a million unknowns"},
      {"bunny1m-unknowns", "Stanford bunny, 117 uniform cells long: a million unknowns"},
      {"bunny192", "Stanford bunny, 192 uniform cells long: 1.4 million cells"},
      {"armadillo3m7", "Stanford armadillo, 378 uniform cells high: 3.7 million cells"},
      {"box200", "uncut cube, 200^3 cells: eight million, enough to fill a GPU"},
      {"box7m", "uncut cube, 192^3 cells: seven million cells, the long solve alone", true},
      {"box585", "uncut cube, 585^3 cells: two hundred million, the long solve alone", true}};
  return all;
}

std::optional<SimulationSetup> make_scene(const std::string& name, Size size,
                                          const std::vector<fs::path>& folders,
                                          std::string& missing) {
  const MeshScene bunny{"bunny.toml", "bunny00.off", 96, 28};
  const MeshScene large_bunny{"bunny.toml", "bunny00.off", 117, 30};
  const MeshScene frame_bunny{"bunny.toml", "bunny00.off", 192, 32};
  const MeshScene large_armadillo{"armadillo.toml", "armadillo.obj", 378, 42};
  const MeshScene armadillo{"armadillo.toml", "armadillo.obj", 128, 40};
  std::optional<SimulationSetup> out;
  if (name == "box46") out = cube(Sizes{46, 5}.of(size));
  if (name == "box64") out = cube(Sizes{64, 6}.of(size));
  if (name == "box100") out = cube(Sizes{100, 7}.of(size));
  if (name == "box128") out = cube(Sizes{128, 8}.of(size));
  if (name == "box192" || name == "box7m") out = cube(Sizes{192, 12}.of(size));
  if (name == "box200") out = cube(Sizes{200, 11}.of(size));
  if (name == "box585") out = cube(Sizes{585, 13}.of(size));
  if (name == "box1m-unknowns") out = cube(Sizes{69, 9}.of(size));
  if (name == "comb-aligned") out = comb(Sizes{48, 10}.of(size), 0);
  if (name == "comb-rotated") out = comb(Sizes{48, 10}.of(size), std::numbers::pi / 6);
  if (name == "bunny") out = real_body(bunny, size, false, false, folders, missing);
  if (name == "bunny1m-unknowns")
    out = real_body(large_bunny, size, false, false, folders, missing);
  if (name == "bunny192") out = real_body(frame_bunny, size, false, false, folders, missing);
  if (name == "armadillo3m7")
    out = real_body(large_armadillo, size, false, false, folders, missing);
  if (name == "bunny-octree") out = real_body(bunny, size, true, false, folders, missing);
  if (name == "bunny-cut") out = real_body(bunny, size, true, true, folders, missing);
  if (name == "armadillo") out = real_body(armadillo, size, false, false, folders, missing);
  if (name == "armadillo-octree") out = real_body(armadillo, size, true, false, folders, missing);
  if (name == "armadillo-cut") out = real_body(armadillo, size, true, true, folders, missing);
  ensures(out.has_value() || !missing.empty(), "every scene of the bench has a set-up");
  if (out && size == Size::small) out->solver.coarsest_vertices = kSmallCoarsest;
  return out;
}

std::vector<fs::path> mesh_folders(const std::string& given) {
  std::vector<fs::path> out;
  std::istringstream list(given);
  for (std::string folder; std::getline(list, folder, ':');)
    if (!folder.empty()) out.emplace_back(folder);
  if (!out.empty()) return out;
  if (const char* folder = std::getenv("KERF_MESHES"); folder != nullptr) out.emplace_back(folder);
  out.push_back(fs::path(KERF_SOURCE_DIR) / ".." / "shared" / "meshes");
  return out;
}

}  // namespace kerf::bench
