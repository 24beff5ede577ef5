// SPDX-License-Identifier: MIT
//
// Runs the phases of a scene and times them: all variants of a phase (candidate, threads,
// precision) in turn, round by round, so that what else happens on the machine meets all alike.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "bench/ceilings.hpp"
#include "bench/csv.hpp"
#include "bench/options.hpp"

namespace kerf::bench {

/// Where a run tells what it does.
struct Listener {
  std::function<void(const Row&)> row;               ///< a finished row
  std::function<void(const std::string&)> note;      ///< something was skipped, or looks wrong
  std::function<void(const std::string&)> progress;  ///< what runs now
};

/// All rows of a scene; none, with a note, if its mesh or the memory for it is missing.
/// @throws Error (unavailable) for a backend or precision that was asked for by name and is not
/// there.
std::vector<Row> measure_scene(const std::string& scene, const Options& options,
                               const Ceilings& ceilings, const Listener& listener);

/// The rows of scene `machine`.
std::vector<Row> ceiling_rows(const Ceilings& ceilings);

}  // namespace kerf::bench
