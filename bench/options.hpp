// SPDX-License-Identifier: MIT
//
// The command line of kerf_bench.
#pragma once

#include <string>
#include <vector>

#include "bench/scenes.hpp"

namespace kerf::bench {

struct Options {
  bool list = false, help = false;
  std::vector<std::string> scenes, backends{"cpu"}, precisions{"double"}, phases;
  std::vector<int> threads;
  int repeat = 5;
  double seconds = 0;                ///< > 0: no further run of a variant that has taken so long
  double give_up = 0;                ///< > 0: longest run of a solve, s
  std::vector<std::string> compare;  ///< two backends, or none
  std::string csv, meshes, machine, plot, svg;
  Size size = Size::full;
  /// Whether a list was `all`: what cannot be had is then left out in silence.
  bool all_backends = false, all_precisions = false;
};

/// @throws Error (bad_input) that names the option, and for an unknown name the nearest known one.
Options parse_options(int argc, const char* const* argv);

std::string usage();
/// What --list prints: scenes, backends and phases.
std::string listing();

}  // namespace kerf::bench
