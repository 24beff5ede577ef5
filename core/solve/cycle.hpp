// SPDX-License-Identifier: MIT
//
// The multigrid cycle, written once against a Backend.
//
// Source  [DGW11] section 6.1; K-cycle: Notay, Vassilevski 2008 [NV08].
#pragma once

#include "core/backend.hpp"
#include "core/setup.hpp"

namespace kerf {

struct CycleOptions {
  CycleType type = CycleType::v;
  int pre_sweeps = 1, post_sweeps = 1;
  /// Post-smoothing runs the colours backwards, so that the cycle may precondition CG.
  bool symmetric = true;
  /// W and K: the first level, from 1 on, that is solved twice.
  int first_twice = 1;

  /// Whether a coarse level is solved by one cycle.
  bool is_once(int level) const { return type == CycleType::v || level < first_twice; }

  bool operator==(const CycleOptions&) const = default;
};

/// What a setup asks for on these levels. Measured (docs/convergence.md): on cut bodies the coarse
/// cells are too stiff in bending, and K-cycles repair it; on uncut ones V costs less.
CycleOptions cycle_options(const SolverSetup& setup, const Hierarchy& hierarchy);

/// What a setup asks for of the smoother.
SmootherOptions smoother_options(const SolverSetup& setup);

class Cycle {
 public:
  Cycle(Backend& backend, int levels, CycleOptions options)
      : backend_(backend), coarsest_(levels - 1), options_(options) {}

  /// Improves u of A u = f on level 0.
  void run() {
    if (!backend_.run_cycle(options_)) descend(0);
  }

 private:
  void descend(int level);
  void solve_coarse(int level);
  void k_step(int level);

  Backend& backend_;
  int coarsest_;
  CycleOptions options_;
};

}  // namespace kerf
