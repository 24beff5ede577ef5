// SPDX-License-Identifier: MIT
#include "core/solve/linear_solver.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/base/error.hpp"
#include "core/base/timer.hpp"

namespace kerf {
namespace {

/// Whether residuals fell by less than so many decades.
bool is_slow(double before, double after, double decades) {
  return !(after < before) || std::log10(before / after) < decades;
}

}  // namespace

LinearSolver::LinearSolver(Backend& backend, const SolverSetup& setup)
    : backend_(backend),
      setup_(setup),
      vectors_(backend.conjugate_vectors()),
      spare_{vectors_.rounded ? backend.add_vector() : vectors_.direction,
             vectors_.rounded ? backend.add_vector() : vectors_.product} {
  backend_.set_smoother(smoother_options(setup));
}

void LinearSolver::release() {
  for (const int x : {vectors_.residual, vectors_.direction, vectors_.product}) backend_.release(x);
  if (vectors_.rounded)
    for (const int x : spare_) backend_.release(x);
}

void LinearSolver::set_structure(const Hierarchy& hierarchy,
                                 const std::vector<std::vector<std::int32_t>>& small_pieces) {
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
    return;
  }
  small_.set(hierarchy.levels[0], small_pieces);
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
  small_.refresh(backend_);
  backend_.prepare(0);
  if (setup_.method == SolverMethod::cg_jacobi) return;
  const int last = static_cast<int>(hierarchy_->levels.size()) - 1;
  for (int level = 0; level + 1 < last; ++level) {
    backend_.coarsen(level);
    backend_.prepare(level + 1);
  }
  factor_is_new_ = false;
  if ((factor_due_ || !backend_.has_factor()) && renew_factor()) decades_with_new_ = 0;
}

/// The factor of the coarsest level, of the values of now; false if it is. The matrices of that
/// level serve the factor alone.
bool LinearSolver::renew_factor() {
  if (factor_is_new_) return false;
  const int last = static_cast<int>(hierarchy_->levels.size()) - 1;
  if (last > 0) backend_.coarsen(last - 1);
  backend_.factor_coarsest();
  ++factors_;
  factor_is_new_ = true;
  factor_due_ = false;
  return true;
}

// With a factor of older rotations the coarsest correction is off, and cycles contract less. Where
// it has more than twice the length that it should have, they do not contract at all.
void LinearSolver::watch_factor(const SolveStats& stats, const Watch& since) {
  constexpr double kWorthIt = 0.85;  // a factor costs as much as some cycles
  const int cycles = stats.cycles - since.cycles;
  // One that failed was older than the last solve: the next one is likely to fail as well.
  if (since.cycles > 0 || cycles == 0 || !(stats.residual > 0) ||
      !(since.residual > stats.residual)) {
    factor_due_ = factor_due_ || since.cycles > 0 || !stats.converged;
    return;
  }
  const double decades = std::log10(since.residual / stats.residual) / cycles;
  if (decades_with_new_ == 0)
    decades_with_new_ = decades;
  else if (decades < kWorthIt * decades_with_new_ || !stats.converged)
    factor_due_ = true;
}

SolveStats LinearSolver::solve(int b, int x, double tolerance, double reference) {
  return run({b, x, false}, tolerance, reference);
}

SolveStats LinearSolver::solve_from_zero(int b, int x, double tolerance, double reference) {
  backend_.zero(0, x);
  return run({b, x, true}, tolerance, reference);
}

SolveStats LinearSolver::run(Problem problem, double tolerance, double reference) {
  const AddTime time(times_.solve);
  problem.size = std::sqrt(backend_.dot(0, problem.b, problem.b));
  problem.reference = reference > 0 ? reference : problem.size;
  if (problem.reference == 0) {
    backend_.zero(0, problem.x);
    return {};
  }
  problem.goal = tolerance * problem.reference;
  switch (setup_.method) {
    case SolverMethod::cholesky:
      return direct(problem);
    case SolverMethod::multigrid:
      return multigrid(problem);
    case SolverMethod::cg_jacobi:
      return conjugate_gradients(problem, true);
    case SolverMethod::cg:
      break;
  }
  return conjugate_gradients(problem, false);
}

/// Solves for small pieces and leaves b - A x; without a product where x is zero elsewhere.
double LinearSolver::first_residual(const Problem& problem) {
  const int r = vectors_.residual;
  if (!problem.from_zero) {
    if (!small_.empty()) small_.solve(backend_, problem.b, problem.x);
    return true_residual(problem);
  }
  backend_.copy(0, problem.b, r);
  if (small_.empty()) return problem.size;
  small_.solve(backend_, problem.b, problem.x);
  small_.clear(backend_, r);
  return std::sqrt(backend_.dot(0, r, r));
}

double LinearSolver::true_residual(const Problem& problem) {
  return backend_.true_residual(problem.b, problem.x, vectors_.residual);
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
  // Coarse cells that merge pieces would move those that are solved for.
  if (!setup_.duplicate_cells && !small_.empty()) small_.clear(backend_, kSolution);
}

// Flexible conjugate gradients: beta from the change of the residual (Polak, Ribiere), because the
// K-cycle is not quite linear. Rounding parts the residual of the recursion from the true one, by
// an error that follows its greatest size so far: in single precision the true one takes its place
// every few digits, and the direction goes on (van der Vorst, Ye 2000 [VY00]).
SolveStats LinearSolver::conjugate_gradients(const Problem& problem, bool jacobi) {
  constexpr double kDigits = 1e-5;  // that single precision is trusted with
  constexpr int kRetries = 2;       // where the recursion was at the goal, and the residual is not
  constexpr int kPatience = 5;      // first steps may lower the error alone
  constexpr double kPart = 0.4;     // of what cycles with a new factor did: a newer one pays
  const bool fixed = setup_.cycles > 0;
  const std::int64_t limit =
      fixed ? setup_.cycles : (jacobi ? std::int64_t{50} : std::int64_t{1}) * setup_.max_cycles;
  const double goal = fixed ? 0 : problem.goal;
  SolveStats stats;
  double norm = first_residual(problem);
  Watch watch{norm / problem.reference, 0};
  ConjugateState state;
  for (int retries = 0; norm > goal && stats.cycles < limit && retries <= kRetries;) {
    const double at_start = norm;
    double greatest = norm;
    const auto enough = [&] {
      return norm <= goal || (vectors_.rounded && norm <= kDigits * greatest);
    };
    bool lost = false;
    while (!enough() && stats.cycles < limit) {
      precondition(jacobi);
      lost = !backend_.advance_conjugate(kSolution, vectors_.direction, vectors_.product, problem.x,
                                         vectors_.residual, state);
      if (lost) break;
      norm = std::sqrt(state.residual2);
      greatest = std::max(greatest, norm);
      ++stats.cycles;
      if (progress_) progress_(stats.cycles, norm / problem.reference);
      const int since = stats.cycles - watch.cycles;
      if (!jacobi && since >= kPatience && !enough() &&
          is_slow(watch.residual * problem.reference, norm, kPart * since * decades_with_new_) &&
          renew_factor())
        watch = {norm / problem.reference, stats.cycles};
    }
    const bool was_at_goal = norm <= goal;
    norm = true_residual(problem);
    if (lost) state = {};  // the next start has no direction
    if (lost && !jacobi && renew_factor())
      watch = {norm / problem.reference, stats.cycles};
    else if (lost || (!fixed && (was_at_goal || !(norm < at_start))))
      ++retries;
  }
  stats.residual = norm / problem.reference;
  stats.converged = fixed || norm <= goal * (1 + 1e-12);
  if (!jacobi) watch_factor(stats, watch);
  return stats;
}

SolveStats LinearSolver::multigrid(const Problem& problem) {
  constexpr double kPart = 0.5;  // of what cycles with a new factor did, the first ones most
  const bool fixed = setup_.cycles > 0;
  const int limit = fixed ? setup_.cycles : setup_.max_cycles;
  SolveStats stats;
  double norm = first_residual(problem);
  Watch watch{norm / problem.reference, 0};
  while (stats.cycles < limit && (fixed || norm > problem.goal)) {
    precondition(false);
    backend_.add(0, 1, kSolution, problem.x);
    double left = true_residual(problem);
    ++stats.cycles;
    if (is_slow(norm, left, kPart * decades_with_new_) && renew_factor()) {
      if (!(left < norm)) {
        backend_.add(0, -1, kSolution, problem.x);
        left = true_residual(problem);
      }
      watch = {left / problem.reference, stats.cycles};
    }
    norm = left;
    if (progress_) progress_(stats.cycles, norm / problem.reference);
  }
  stats.residual = norm / problem.reference;
  stats.converged = fixed || norm <= problem.goal;
  watch_factor(stats, watch);
  return stats;
}

SolveStats LinearSolver::direct(const Problem& problem) {
  constexpr int kRefinements = 3;  // of the solution with the same factor; one is usually enough
  std::vector<double> right(3 * hierarchy_->levels[0].point.size()), solution(right.size());
  const int correction = spare_[0];
  backend_.zero(0, problem.x);
  SolveStats stats;
  double norm = problem.size;
  do {
    backend_.read(0, stats.cycles == 0 ? problem.b : vectors_.residual, right);
    cholesky_->solve(right, solution);
    backend_.write(0, correction, solution);
    backend_.mask(0, correction);
    backend_.add(0, 1, correction, problem.x);
    norm = true_residual(problem);
    ++stats.cycles;
  } while (norm > problem.goal && stats.cycles <= kRefinements);
  stats.residual = norm / problem.reference;
  stats.converged = norm <= problem.goal;
  return stats;
}

std::size_t LinearSolver::bytes() const {
  if (!assembled_) return small_.bytes();
  return assembled_->value.capacity() * 12 + cholesky_->factor_entries() * 12;
}

}  // namespace kerf
