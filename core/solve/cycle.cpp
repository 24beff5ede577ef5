// SPDX-License-Identifier: MIT
#include "core/solve/cycle.hpp"

#include <algorithm>
#include <cmath>

namespace kerf {

namespace {

/// Of an octree level 1 has a third of the cells: a second visit costs more than it gains. On a
/// plate or a rod of one cell size it may have as many, but there coarse cells soon are too stiff.
bool level_one_is_dear(const Hierarchy& hierarchy) {
  constexpr int kFew = 4;
  if (hierarchy.levels.size() < 2) return false;
  const Level& finest = hierarchy.levels[0];
  const auto& sizes = finest.size_log2;
  const bool is_octree =
      std::any_of(sizes.begin(), sizes.end(), [&](auto size) { return size != sizes.front(); });
  return is_octree && kFew * hierarchy.levels[1].cells() > finest.cells();
}

}  // namespace

CycleOptions cycle_options(const SolverSetup& setup, const Hierarchy& hierarchy) {
  CycleOptions options{setup.cycle, setup.pre_sweeps, setup.post_sweeps};
  if (setup.cycle == CycleType::automatic) {
    options.type = hierarchy.cut ? CycleType::k : CycleType::v;
    options.first_twice = level_one_is_dear(hierarchy) ? 2 : 1;
  }
  // As a solver of its own, Gauss-Seidel in one order contracts faster than forward then backward.
  options.symmetric = setup.method == SolverMethod::cg;
  return options;
}

SmootherOptions smoother_options(const SolverSetup& setup) {
  SmootherOptions options;
  options.chebyshev = setup.smoother == SmootherType::chebyshev;
  options.omega = setup.omega;
  options.degree = setup.degree;
  return options;
}

void Cycle::descend(int level) {
  if (level == coarsest_) {
    backend_.solve_coarsest();
    return;
  }
  backend_.smooth(level, SweepOrder::forward, options_.pre_sweeps);
  backend_.restrict_from_solution(level);
  solve_coarse(level + 1);
  backend_.prolong_correction(level);
  backend_.smooth(level, options_.symmetric ? SweepOrder::backward : SweepOrder::forward,
                  options_.post_sweeps);
}

void Cycle::solve_coarse(int level) {
  if (level == coarsest_ || options_.is_once(level)) {
    descend(level);
  } else if (options_.type == CycleType::w) {
    descend(level);
    descend(level);
  } else {
    k_step(level);
  }
}

// Two steps of flexible conjugate gradients on A u = f of this level, with the cycle below as
// preconditioner; one step where that already leaves little. Uses the notation of [NV08].
void Cycle::k_step(int level) {
  constexpr double kEnough = 0.25;  // their threshold
  const double norm_before = backend_.dot(level, kRight, kRight);
  if (norm_before == 0) return;  // u is zero already

  descend(level);
  backend_.copy(level, kSolution, kKrylovX);
  backend_.apply(level, kKrylovX, kKrylovV);
  const double rho = backend_.dot(level, kKrylovX, kKrylovV);
  const double alpha = backend_.dot(level, kKrylovX, kRight);
  if (!(rho > 0)) return;
  const double step = alpha / rho;
  backend_.add(level, -step, kKrylovV, kRight);
  if (backend_.dot(level, kRight, kRight) <= kEnough * kEnough * norm_before) {
    backend_.combine(level, step, kKrylovX, 0, kSolution);
    return;
  }

  backend_.zero(level, kSolution);
  descend(level);
  backend_.apply(level, kSolution, kScratch);
  const double gamma = backend_.dot(level, kSolution, kKrylovV);
  const double beta = backend_.dot(level, kSolution, kScratch);
  const double alpha2 = backend_.dot(level, kSolution, kRight);
  const double rho2 = beta - gamma * gamma / rho;
  if (!(rho2 > 0)) {
    backend_.combine(level, step, kKrylovX, 0, kSolution);
    return;
  }
  backend_.combine(level, step - gamma * alpha2 / (rho * rho2), kKrylovX, alpha2 / rho2, kSolution);
}

}  // namespace kerf
