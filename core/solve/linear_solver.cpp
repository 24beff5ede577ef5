// SPDX-License-Identifier: MIT
#include "core/solve/linear_solver.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/base/error.hpp"
#include "core/base/timer.hpp"

namespace kerf {

LinearSolver::LinearSolver(Backend& backend, const SolverSetup& setup)
    : backend_(backend),
      setup_(setup),
      vectors_(backend.conjugate_vectors()),
      spare_{vectors_.exact ? vectors_.direction : backend.add_vector(),
             vectors_.exact ? vectors_.product : backend.add_vector()},
      correction_(vectors_.exact ? vectors_.residual : backend.add_vector()) {
  SmootherOptions smoother;
  smoother.chebyshev = setup.smoother == SmootherType::chebyshev;
  smoother.omega = setup.omega;
  backend_.set_smoother(smoother);
}

void LinearSolver::release() {
  for (const int x : {vectors_.residual, vectors_.direction, vectors_.product}) backend_.release(x);
  for (const int x : {spare_[0], spare_[1], correction_}) backend_.release(x);
}

void LinearSolver::set_structure(const Hierarchy& hierarchy) {
  const AddTime time(times_.structure);
  hierarchy_ = &hierarchy;
  factor_due_ = true;
  cycle_options_ = cycle_options(setup_, hierarchy);
  cycle_ =
      std::make_unique<Cycle>(backend_, static_cast<int>(hierarchy.levels.size()), cycle_options_);
  if (setup_.method == SolverMethod::cholesky) {
    assembled_ = std::make_unique<AssembledLevel>(hierarchy.levels[0]);
    cholesky_ = std::make_unique<SparseCholesky>(CholeskyEngine::supernodal);
    cholesky_->analyse(*assembled_);
  }
}

void LinearSolver::refresh() {
  const AddTime time(times_.values);
  if (setup_.method == SolverMethod::cholesky) {
    assembled_->assemble(hierarchy_->levels[0], [&](std::int32_t cell, std::span<double> out) {
      backend_.read_cell_matrix(0, cell, out);
    });
    expects(
        cholesky_->factor(*assembled_),
        "the system matrix is not positive definite: in static mode some part of the body can move "
        "freely and needs a [[support]]; otherwise sizes, moduli or the time step are out of "
        "range");
    return;
  }
  backend_.prepare(0);
  if (setup_.method == SolverMethod::cg_jacobi) return;
  const int last = static_cast<int>(hierarchy_->levels.size()) - 1;
  const bool factors = factor_due_ || !backend_.has_factor();
  for (int level = 0; level < last; ++level) {
    if (level + 1 == last && !factors) break;  // its matrices serve the factor alone
    backend_.coarsen(level);
    if (level + 1 < last) backend_.prepare(level + 1);
  }
  if (!factors) return;
  backend_.factor_coarsest();
  ++factors_;
  factor_due_ = false;
  decades_with_new_ = 0;
}

// With a factor of older rotations the coarsest correction is off, and cycles contract less.
void LinearSolver::watch_factor(const SolveStats& stats, double before) {
  constexpr double kWorthIt = 0.85;  // a factor costs as much as some cycles
  if (stats.cycles == 0 || !(stats.residual > 0) || !(before > stats.residual)) {
    factor_due_ = factor_due_ || !stats.converged;
    return;
  }
  const double decades = std::log10(before / stats.residual) / stats.cycles;
  if (decades_with_new_ == 0)
    decades_with_new_ = decades;
  else if (decades < kWorthIt * decades_with_new_ || !stats.converged)
    factor_due_ = true;
}

SolveStats LinearSolver::solve(int b, int x, double tolerance, double reference) {
  from_zero_ = false;
  return run(b, x, tolerance, reference);
}

SolveStats LinearSolver::solve_from_zero(int b, int x, double tolerance, double reference) {
  backend_.zero(0, x);
  from_zero_ = true;
  return run(b, x, tolerance, reference);
}

/// Leaves b - A x, without a product where x is known to be zero.
double LinearSolver::first_residual(int b, int x) {
  if (!from_zero_) return backend_.true_residual(b, x, vectors_.residual);
  backend_.copy(0, b, vectors_.residual);
  return norm_of_right_;
}

SolveStats LinearSolver::run(int b, int x, double tolerance, double reference) {
  const AddTime time(times_.solve);
  norm_of_right_ = std::sqrt(backend_.dot(0, b, b));
  if (reference <= 0) reference = norm_of_right_;
  if (reference == 0) {
    backend_.zero(0, x);
    return {};
  }
  const double goal = tolerance * reference;
  switch (setup_.method) {
    case SolverMethod::cholesky:
      return direct(b, x, goal, reference);
    case SolverMethod::multigrid:
      return multigrid(b, x, goal, reference);
    case SolverMethod::cg_jacobi:
      return conjugate_gradients(b, x, goal, reference, true);
    case SolverMethod::cg:
      break;
  }
  return conjugate_gradients(b, x, goal, reference, false);
}

// z = B r: r is the residual, z becomes kSolution. The cycle may be of another precision.
void LinearSolver::precondition(bool jacobi) {
  if (vectors_.residual != kRight) backend_.copy(0, vectors_.residual, kRight);
  if (jacobi) {
    backend_.precondition_jacobi(0, kRight, kSolution);
    return;
  }
  backend_.zero(0, kSolution);
  cycle_->run();
}

// The recursion parts from the true residual with rounding, and is then put right; its direction
// goes on (van der Vorst, Ye 2000 [VY00]).
// Flexible conjugate gradients: beta from the change of the residual (Polak, Ribiere), because the
// K-cycle is not quite linear.
SolveStats LinearSolver::conjugate_gradients(int b, int x, double goal, double reference,
                                             bool jacobi) {
  const bool fixed = setup_.cycles > 0;
  const std::int64_t limit =
      fixed ? setup_.cycles : (jacobi ? std::int64_t{50} : std::int64_t{1}) * setup_.max_cycles;
  constexpr int kRestarts = 3;  // when the recursion and the true residual part; more that gain
  constexpr double kGain = 0.1;
  constexpr double kDigits = 1e-5;  // that a recursion in single precision is trusted with
  SolveStats stats;
  double norm = first_residual(b, x);
  const double before = norm / reference;
  double at_start = 0;
  ConjugateState state;
  for (int start = 0; stats.cycles < limit; ++start) {
    if (!fixed && norm <= goal) break;
    if (start >= kRestarts && !(norm < kGain * at_start)) break;
    at_start = norm;
    const double down_to = vectors_.exact ? goal : std::max(goal, kDigits * norm);
    while (stats.cycles < limit && (fixed || norm > down_to)) {
      precondition(jacobi);
      if (!backend_.advance_conjugate(kSolution, vectors_.direction, vectors_.product, x,
                                      vectors_.residual, state)) {
        state = {};  // the next start has no direction
        break;
      }
      norm = std::sqrt(state.residual2);
      ++stats.cycles;
      if (progress_) progress_(stats.cycles, norm / reference);
    }
    norm = backend_.true_residual(b, x, vectors_.residual);
    if (fixed) break;
  }
  stats.residual = norm / reference;
  stats.converged = fixed || norm <= goal * (1 + 1e-12);
  if (!jacobi) watch_factor(stats, before);
  return stats;
}

SolveStats LinearSolver::multigrid(int b, int x, double goal, double reference) {
  const bool fixed = setup_.cycles > 0;
  const int limit = fixed ? setup_.cycles : setup_.max_cycles;
  SolveStats stats;
  double norm = first_residual(b, x);
  const double before = norm / reference;
  while (stats.cycles < limit && (fixed || norm > goal)) {
    precondition(false);
    backend_.add(0, 1, kSolution, x);
    norm = backend_.true_residual(b, x, vectors_.residual);
    ++stats.cycles;
    if (progress_) progress_(stats.cycles, norm / reference);
  }
  stats.residual = norm / reference;
  stats.converged = fixed || norm <= goal;
  watch_factor(stats, before);
  return stats;
}

SolveStats LinearSolver::direct(int b, int x, double goal, double reference) {
  constexpr int kRefinements = 3;  // of the solution with the same factor; one is usually enough
  std::vector<double> right(3 * hierarchy_->levels[0].point.size()), solution(right.size());
  backend_.zero(0, x);
  SolveStats stats;
  backend_.copy(0, b, vectors_.residual);
  double norm = norm_of_right_;
  do {
    backend_.read(0, vectors_.residual, right);
    cholesky_->solve(right, solution);
    backend_.write(0, correction_, solution);
    backend_.mask(0, correction_);
    backend_.add(0, 1, correction_, x);
    norm = backend_.true_residual(b, x, vectors_.residual);
    ++stats.cycles;
  } while (norm > goal && stats.cycles <= kRefinements);
  stats.residual = norm / reference;
  stats.converged = norm <= goal;
  return stats;
}

std::size_t LinearSolver::bytes() const {
  if (!assembled_) return 0;
  return assembled_->value.capacity() * 12 + cholesky_->factor_entries() * 12;
}

}  // namespace kerf
