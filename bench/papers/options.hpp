// SPDX-License-Identifier: MIT
//
// The command line of kerf_papers.
#pragma once

#include <string>
#include <vector>

#include "bench/scenes.hpp"

namespace kerf::papers {

struct Options {
  bool list = false, help = false;
  std::vector<std::string> experiments;
  std::string out, render;  ///< folders
  std::string meshes, machine;
  bench::Size size = bench::Size::full;
  int threads = 1;
  int repeat = 3;
  double give_up = 30;  ///< s
};

/// @throws Error (bad_input) that names the option, and for an unknown name the nearest known one.
Options parse_options(int argc, const char* const* argv);
std::string usage();
std::string listing();  ///< what --list prints

}  // namespace kerf::papers
