// SPDX-License-Identifier: MIT
#include "core/fem/equilibrium.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

namespace kerf {
namespace {

constexpr int kDepth = 6;  // measured in docs/convergence.md; 3 to 10 behave alike

}  // namespace

Equilibrium::Equilibrium(Backend& backend, LinearSolver& solver, const TimeSetup& time,
                         const SolverSetup& setup, StateVectors state)
    : backend_(backend),
      solver_(solver),
      time_(time),
      setup_(setup),
      state_(state),
      right_(backend.add_vector()),
      increment_(backend.add_vector()),
      best_(backend.add_vector()),
      velocity_(backend.add_vector()),
      work_(solver.spare()[0]) {
  for (int i = 0; i < 2 * (kDepth + 1); ++i) free_.push_back(backend_.add_rough_vector());
}

double Equilibrium::residual() {
  if (!keep_rotations_) backend_.rotate_cells(state_.displacement);
  backend_.elastic_force(state_.displacement, right_);
  const double inner = backend_.dot(0, right_, right_);  // with the reactions
  const double outer = backend_.dot(0, state_.external, state_.external);
  backend_.combine(0, 1, state_.external, -1, right_);
  backend_.mask(0, right_);
  const double reference = std::sqrt(std::max(inner, outer));
  if (reference == 0) return 0;
  return std::sqrt(backend_.dot(0, right_, right_)) / reference;
}

// Solves for the increment of the current iterate; the force is in right_ already.
double Equilibrium::update(double mass_factor) {
  // The rotations move as well: more digits cost cycles and save next to no update
  // (docs/decisions/0016-early-updates.md).
  constexpr double kInner = 3e-3;
  backend_.set_operator({1, mass_factor});
  solver_.refresh();
  const SolveStats solve =
      solver_.solve_from_zero(right_, increment_, std::max(setup_.tolerance, kInner));
  stats_.cycles += solve.cycles;
  stats_.linear_residual = std::max(stats_.linear_residual, solve.residual);
  ++stats_.rotation_updates;
  keep_rotations_ = false;
  return solve.residual;
}

/// Factors of the differences in the least-squares fit to the increment.
std::vector<double> Equilibrium::fit() {
  const auto m = static_cast<Eigen::Index>(dd_.size());
  if (m == 0) return {};
  Eigen::MatrixXd gram(m, m);
  Eigen::VectorXd right(m), scale(m);
  for (Eigen::Index i = 0; i < m; ++i) {
    const int row = dd_[static_cast<std::size_t>(i)];
    for (Eigen::Index j = 0; j <= i; ++j)
      gram(i, j) = gram(j, i) = backend_.dot(0, row, dd_[static_cast<std::size_t>(j)]);
    right(i) = backend_.dot(0, row, increment_);
    scale(i) = gram(i, i) > 0 ? 1 / std::sqrt(gram(i, i)) : 0;
  }
  // Scaled to a unit diagonal, so that the rank decision sees directions and not lengths.
  gram = scale.asDiagonal() * gram * scale.asDiagonal();
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> solver;
  solver.setThreshold(1e-12);
  solver.compute(gram);
  const Eigen::VectorXd gamma =
      scale.asDiagonal() * solver.solve(scale.asDiagonal() * right).eval();
  return {gamma.begin(), gamma.end()};
}

// u <- u + d - sum gamma_j (du_j + dd_j), gamma least squares of d - sum gamma_j dd_j. The last
// pair is begun when u moves, with what it moves by and this d, and ends with the next d.
// They may be rounded: dd by 6e-8 of d, which is far below what the rank decision drops unless d
// hardly changes. What u moves by stays in the increment.
void Equilibrium::anderson_step() {
  if (!dd_.empty()) backend_.combine(0, 1, increment_, -1, dd_.back());
  const std::vector<double> gamma = fit();
  begin_difference(dd_);
  for (std::size_t i = 0; i < gamma.size(); ++i) {
    backend_.add(0, -gamma[i], du_[i], increment_);
    backend_.add(0, -gamma[i], dd_[i], increment_);
  }
  begin_difference(du_);
  if (static_cast<int>(du_.size()) > kDepth)
    for (auto* list : {&du_, &dd_}) {  // the oldest pair goes
      free_.push_back(list->front());
      list->erase(list->begin());
    }
  leave_best();
  backend_.add(0, 1, increment_, state_.displacement);
}

/// The increment, as it is, becomes the newest.
void Equilibrium::begin_difference(std::vector<int>& list) {
  list.push_back(free_.back());
  free_.pop_back();
  backend_.copy(0, increment_, list.back());
}

// Implicit steps with a mass, as a body would fall into place, its velocity thrown away whenever
// the forces work against it; returns whether Anderson may go on.
bool Equilibrium::pseudo_time(double natural_time) {
  constexpr int kSteps = 60;
  constexpr double kNear = 0.05;  // of the residual at entry
  constexpr int kGood = 3;        // steps in a row before the step grows
  double dt = 0.25 * natural_time;
  const double entry = stats_.residual;
  int good = 0;
  backend_.zero(0, velocity_);
  for (int i = 0; i < kSteps && stats_.rotation_updates < time_.nonlinear_iterations; ++i) {
    const double power = backend_.dot(0, right_, velocity_);
    if (power < 0) {
      backend_.zero(0, velocity_);
      dt *= 0.5;
      good = 0;
    } else if (++good > kGood) {
      dt *= 2;
      good = 0;
    }
    backend_.apply_scaled({0, 1 / dt}, velocity_, work_);
    backend_.mask(0, work_);
    backend_.add(0, 1, work_, right_);
    update(1 / (dt * dt));
    backend_.add(0, 1, increment_, state_.displacement);
    backend_.combine(0, 1 / dt, increment_, 0, velocity_);
    stats_.residual = residual();
    if (progress_) progress_(stats_.rotation_updates, stats_.residual);
    if (!std::isfinite(stats_.residual)) return false;
    if (finished() || stats_.residual < kNear * entry) return true;
  }
  return true;
}

/// Before the displacement moves by the increment. As long as each iterate is better than the last
/// there is no need for a copy, unless the way back would lose more than a digit.
void Equilibrium::leave_best() {
  constexpr double kFar = 100;  // squared
  if (best_at_ != Best::current) return;
  const double step = backend_.dot(0, increment_, increment_);
  const double size = backend_.dot(0, state_.displacement, state_.displacement);
  best_at_ = Best::one_step_back;
  if (!std::isfinite(step) || (size > 0 && step > kFar * size)) {
    backend_.copy(0, state_.displacement, best_);
    best_at_ = Best::kept;
  }
}

void Equilibrium::keep_best() {
  if (best_at_ == Best::kept) return;
  backend_.copy(0, state_.displacement, best_);
  if (best_at_ == Best::one_step_back) backend_.add(0, -1, increment_, best_);
  best_at_ = Best::kept;
}

void Equilibrium::go_to_best() {
  if (best_at_ == Best::kept) backend_.copy(0, best_, state_.displacement);
  if (best_at_ == Best::one_step_back) backend_.add(0, -1, increment_, state_.displacement);
  best_at_ = Best::current;
  stats_.residual = residual();
}

// One step back may be no place any more: the increment is being found anew.
bool Equilibrium::rewind() {
  if (best_at_ == Best::kept) backend_.copy(0, best_, state_.displacement);
  return keep_rotations_;
}

NonlinearStats Equilibrium::solve(double natural_time, bool keep_rotations) {
  stats_ = {};
  keep_rotations_ = keep_rotations;
  forget();
  best_at_ = Best::current;  // to come back to if the first update is lost
  stats_.residual = residual();
  double best = std::numeric_limits<double>::infinity();
  int since_best = 0;
  while (!(finished() && !keep_rotations_) &&
         stats_.rotation_updates < time_.nonlinear_iterations) {
    const bool kept = keep_rotations_;
    update(0);
    anderson_step();
    if (kept) forget();  // its increment belongs to another map than the next ones
    stats_.residual = residual();
    if (progress_) progress_(stats_.rotation_updates, stats_.residual);
    if (stats_.residual < best) {
      // Only a real gain counts as progress.
      since_best = stats_.residual < 0.9 * best ? 0 : since_best + 1;
      best = stats_.residual;
      best_at_ = Best::current;
    } else {
      ++since_best;
      keep_best();
    }
    // Large loads: the first iterates may be far worse than the start without harm.
    constexpr int kPatience = 15;
    const bool lost = !std::isfinite(stats_.residual) || stats_.residual > 1e3 * best;
    if (!lost && since_best < kPatience) continue;
    go_to_best();
    keep_best();
    if (!pseudo_time(natural_time)) break;
    forget();
    since_best = 0;
    best = stats_.residual;
    best_at_ = Best::current;
  }
  if (!(stats_.residual <= best)) go_to_best();  // never end on a NaN
  stats_.converged = finished();
  return stats_;
}

void Equilibrium::release() {
  forget();
  for (const int x : {right_, increment_, best_, velocity_}) backend_.release(x);
  solver_.release();
}

void Equilibrium::forget() {
  for (auto* list : {&du_, &dd_}) {
    for (const int x : *list) backend_.release(x);
    free_.insert(free_.end(), list->begin(), list->end());
    list->clear();
  }
}

}  // namespace kerf
