// SPDX-License-Identifier: MIT
//
// What is compared: the backends with their defaults, and the baselines that they have to beat.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "core/setup.hpp"

namespace kerf::bench {

/// One value of --backend.
struct Candidate {
  std::string name;
  std::string what;
  std::string backend;             ///< that does the work: "cpu", "cuda", ...
  SolverSetup solver;              ///< of its cycle, step and solve
  std::set<std::string> phases;    ///< in which it differs from its backend; empty: all
  std::int32_t most_vertices = 0;  ///< above, it is skipped; 0: no limit
};
const std::vector<Candidate>& candidates();

}  // namespace kerf::bench
