// SPDX-License-Identifier: MIT
//
// What is timed: every operation of the interface, and the parts of a run that are made of them.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "bench/counts.hpp"
#include "bench/trial.hpp"

namespace kerf::bench {

/// What a run left behind.
struct Outcome {
  std::vector<double> values;  ///< the result; hashed, and compared with the reference
  std::uint64_t hash = 0;      ///< of a result that is no vector, when `values` is empty
  /// Of phases that solve; the others are compared with the CPU backend in double instead.
  double residual = std::numeric_limits<double>::quiet_NaN();
};

struct Phase {
  const char* name;
  const char* what;
  void (*prepare)(Trial&);     ///< not timed: the state that the run starts from
  void (*run)(Trial&);         ///< timed
  Outcome (*outcome)(Trial&);  ///< not timed
  /// Counted for this candidate, after a run; all zero: nothing was counted.
  std::function<Work(const Trial&)> work;
  int levels = 1;        ///< that it needs
  bool reloads = false;  ///< leaves another hierarchy in the backend
};

/// In the order in which they run.
const std::vector<Phase>& phases();

// The parts of phases().
std::vector<Phase> product_phases();  ///< products with A, and transfer between levels
std::vector<Phase> value_phases();    ///< what follows the rotations, and single vectors
std::vector<Phase> whole_phases();    ///< larger parts of a run

/// Of one cycle of the candidate.
Work work_cycle(const Trial& t);

inline std::function<Work(const Trial&)> always(const Work& work) {
  return [work](const Trial&) { return work; };
}

}  // namespace kerf::bench
