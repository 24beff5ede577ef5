// SPDX-License-Identifier: MIT
//
// The command line of kerf_convergence.
#pragma once

#include <string>
#include <vector>

#include "bench/scenes.hpp"

namespace kerf::convergence {

struct Options {
  bool list = false, help = false;
  std::vector<std::string> tables;
  bench::Size size = bench::Size::full;
  int threads = 1;
  std::string csv, machine, markdown, plot, svg;
};

/// @throws Error (bad_input) that names the option, and for an unknown name the nearest known one.
Options parse_options(int argc, const char* const* argv);

std::string usage();
/// What --list prints: the tables.
std::string listing();

}  // namespace kerf::convergence
