// SPDX-License-Identifier: MIT
#include "core/solve/linear_solver.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/base/error.hpp"
#include "core/base/timer.hpp"

namespace kerf {
namespace {

/// Steps of conjugate gradients that are judged together: single ones may lower the error alone.
constexpr int kPatience = 5;

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
  if (!factor_due_ && backend_.has_factor()) return;
  renew_factor();
  decades_with_new_ = 0;
}

/// The factor of the coarsest level, of the values of now; false if it is that already. The
/// matrices of that level serve the factor alone.
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
void LinearSolver::watch_factor(const SolveStats& stats, const Place& since, bool renewed) {
  constexpr double kWorthIt = 0.85;  // a factor costs as much as some cycles
  const int cycles = stats.cycles - since.cycles;
  const bool falls = cycles > 0 && stats.residual > 0 && since.residual > stats.residual;
  const double decades = falls ? std::log10(since.residual / stats.residual) / cycles : 0;
  if (decades_with_new_ == 0 && factor_is_new_) decades_with_new_ = decades;
  // The next update may turn as far as this one did. Cycles alone find that out at once, conjugate
  // gradients not before kPatience steps.
  const bool was_late = renewed && setup_.method == SolverMethod::cg;
  const bool is_slower = !renewed && falls && decades < kWorthIt * decades_with_new_;
  factor_due_ = factor_due_ || was_late || is_slower || !stats.converged;
}

/// Whether the residual falls by less than `part` of what it does with a new factor on the mean;
/// where that is not known, whether there were many cycles.
bool LinearSolver::is_slow(const Place& from, const Place& to, double part) const {
  if (!(to.residual < from.residual)) return true;
  if (decades_with_new_ == 0) return to.cycles >= kPatience;
  const double decades = std::log10(from.residual / to.residual);
  return decades < part * (to.cycles - from.cycles) * decades_with_new_;
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
  constexpr double kPart = 0.4;     // half or more is usual, whatever the factor is
  const bool fixed = setup_.cycles > 0;
  const std::int64_t limit =
      fixed ? setup_.cycles : (jacobi ? std::int64_t{50} : std::int64_t{1}) * setup_.max_cycles;
  const double goal = fixed ? 0 : problem.goal;
  SolveStats stats;
  double norm = first_residual(problem);
  Place watched{norm / problem.reference, 0}, window = watched;
  const int factors_before = factors_;
  ConjugateState state;
  const auto has_more = [&] { return stats.cycles < limit; };
  for (int retries = 0; norm > goal && has_more() && retries <= kRetries;) {
    const double at_start = norm;
    double greatest = norm;
    const auto enough = [&] {
      return norm <= goal || (vectors_.rounded && norm <= kDigits * greatest);
    };
    bool lost = false;
    while (!enough() && has_more()) {
      precondition(jacobi);
      lost = !backend_.advance_conjugate(kSolution, vectors_.direction, vectors_.product, problem.x,
                                         vectors_.residual, state);
      if (lost) break;
      norm = std::sqrt(state.residual2);
      greatest = std::max(greatest, norm);
      ++stats.cycles;
      if (progress_) progress_(stats.cycles, norm / problem.reference);
      if (jacobi || stats.cycles - window.cycles < kPatience) continue;
      const Place now{norm / problem.reference, stats.cycles};
      if (is_slow(window, now, kPart) && !enough() && has_more() && renew_factor()) watched = now;
      window = now;
    }
    const bool was_at_goal = norm <= goal;
    norm = true_residual(problem);
    if (lost) state = {};  // the next start has no direction
    if (lost && !jacobi && has_more() && renew_factor())
      watched = window = {norm / problem.reference, stats.cycles};
    else if (lost || (!fixed && (was_at_goal || !(norm < at_start))))
      ++retries;
  }
  stats.residual = norm / problem.reference;
  stats.converged = fixed || norm <= goal * (1 + 1e-12);
  if (!jacobi) watch_factor(stats, watched, factors_ > factors_before);
  return stats;
}

SolveStats LinearSolver::multigrid(const Problem& problem) {
  constexpr double kPart = 0.5;  // the first cycles of a solve lower the residual most
  const bool fixed = setup_.cycles > 0;
  const int limit = fixed ? setup_.cycles : setup_.max_cycles;
  SolveStats stats;
  double norm = first_residual(problem);
  Place watched{norm / problem.reference, 0};
  const int factors_before = factors_;
  const auto has_more = [&] { return stats.cycles < limit && (fixed || norm > problem.goal); };
  while (has_more()) {
    const Place before{norm / problem.reference, stats.cycles};
    precondition(false);
    backend_.add(0, 1, kSolution, problem.x);
    norm = true_residual(problem);
    ++stats.cycles;
    const Place now{norm / problem.reference, stats.cycles};
    if (is_slow(before, now, kPart) && has_more() && renew_factor()) {
      if (!(now.residual < before.residual)) {  // x is not far: what rounding leaves is solved for
        backend_.add(0, -1, kSolution, problem.x);
        norm = true_residual(problem);
      }
      watched = {norm / problem.reference, stats.cycles};
    }
    if (progress_) progress_(stats.cycles, norm / problem.reference);
  }
  stats.residual = norm / problem.reference;
  stats.converged = fixed || norm <= problem.goal;
  watch_factor(stats, watched, factors_ > factors_before);
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
