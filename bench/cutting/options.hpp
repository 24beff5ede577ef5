// SPDX-License-Identifier: MIT
//
// The command line of kerf_cutting.
#pragma once

#include <string>
#include <vector>

#include "bench/cutting/body.hpp"

namespace kerf::cutting {

struct Options {
  bool list = false, help = false;
  std::vector<std::string> scenes;
  std::vector<Method> methods;
  std::vector<int> sizes;  ///< ascending; empty: those of each scene
  bool smallest = false;   ///< the smallest size of each scene
  int threads = 1;
  std::string json, machine, plot, svg, table;
};

/// @throws Error (bad_input) that names the option, and for an unknown name the nearest known one.
Options parse_options(int argc, const char* const* argv);

std::string usage();
/// What --list prints: scenes and methods.
std::string listing();

}  // namespace kerf::cutting
