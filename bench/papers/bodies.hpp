// SPDX-License-Identifier: MIT
//
// The bodies of the papers' tables and figures, from scenes/papers/*.toml, and what the papers
// print of them.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "bench/papers/results.hpp"
#include "bench/scenes.hpp"
#include "core/setup.hpp"

namespace kerf::papers {

/// Rows of [DGW11], tables 1 and 2, and captions of its figures: cells, seconds on one core of a
/// Xeon X5560 at 2.8 GHz. No number: not printed.
struct Printed {
  double cells = kNone, uniform_cells = kNone, cut_cells = kNone;
  double cutting = kNone, step = kNone, uniform_step = kNone;  ///< s
  double multigrid = kNone, multigrid_error = kNone;           ///< s; |e_3| / |e_0|
  double cg_error = kNone, cg = kNone;                         ///< CG with Jacobi: the same, s
  double cut_and_step = kNone;                                 ///< s; of captions
};

struct BodyInfo {
  const char* name;
  const char* place;  ///< in the paper; empty: ours
  const char* scene;  ///< file in scenes/
  const char* mesh;   ///< as Debian's libcgal-demo or scenes/ name it; empty: needs none
  int resolution, refinement;
  int small_resolution, small_refinement;
  bool in_tables;  ///< a row of tables 1 and 2
  Printed printed;
};
const std::vector<BodyInfo>& bodies();
/// Needs  a name out of bodies().
const BodyInfo& body(const std::string& name);

enum class Grid { adaptive, uniform };

/// The scene of a body, cuts in the reference state. Empty if its mesh lies in none of `folders`;
/// `missing` then names the file.
std::optional<SimulationSetup> make_setup(const BodyInfo& info, Grid grid, bench::Size size,
                                          const std::vector<std::filesystem::path>& folders,
                                          std::string& missing);

/// The cube of scenes/papers/cube_rods.toml without its blades.
SimulationSetup cube(bench::Size size, int refinement);
/// The same with `count` blades in each direction to half its height, turned by `angle`, rad.
SimulationSetup cube_with_comb(bench::Size size, int refinement, int count, double angle);

}  // namespace kerf::papers
