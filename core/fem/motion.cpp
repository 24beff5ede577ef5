// SPDX-License-Identifier: MIT
#include "core/fem/motion.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace kerf {
namespace {

constexpr double kBeta = 0.25, kGamma = 0.5;  // Newmark: second order, no numerical damping

/// Of its residual, that an update but the last leaves at most, and of what came back in the step
/// before when the rotations had moved.
constexpr double kEarly = 0.1, kOfReturned = 0.5;

}  // namespace

Motion::Motion(Backend& backend, LinearSolver& solver, const TimeSetup& time,
               const Material& material, const SolverSetup& setup, StateVectors state)
    : backend_(backend),
      solver_(solver),
      time_(time),
      material_(material),
      setup_(setup),
      state_(state),
      acceleration_(time.scheme == TimeScheme::newmark ? state.memory : backend.add_vector()),
      right_(backend.add_vector()),
      increment_(backend.add_vector()),
      work_(solver.spare()[0]),
      scratch_(solver.spare()[1]),
      far_{backend.add_vector(), backend.add_vector()},
      returned_(static_cast<std::size_t>(setup.rotation_updates), 1.0) {}

double Motion::velocity_factor() const {
  return time_.scheme == TimeScheme::newmark ? kGamma / (kBeta * time_.step) : 0.5 / time_.step;
}

double Motion::acceleration_factor() const {
  const double dt2 = time_.step * time_.step;
  return time_.scheme == TimeScheme::newmark ? 1 / (kBeta * dt2) : 1 / dt2;
}

// Solves M a = external - elastic - damping for the start; M is well conditioned.
void Motion::start() {
  backend_.rotate_cells(state_.displacement);
  backend_.zero(0, acceleration_);
  residual(right_);
  backend_.set_operator({0, 1});
  backend_.prepare(0);
  backend_.zero(0, increment_);
  // A few steps of conjugate gradients with block Jacobi reach rounding: the condition is below 30.
  constexpr int kSteps = 60;
  const double goal = 1e-28 * backend_.dot(0, right_, right_);
  double rho = 0;
  for (int i = 0; i < kSteps && backend_.dot(0, right_, right_) > goal; ++i) {
    backend_.precondition_jacobi(0, right_, kSolution);
    const double next = backend_.dot(0, kSolution, right_);
    backend_.combine(0, 1, kSolution, i == 0 ? 0 : next / rho, work_);
    rho = next;
    backend_.apply(0, work_, scratch_);
    const double alpha = rho / backend_.dot(0, work_, scratch_);
    backend_.add(0, alpha, work_, increment_);
    backend_.add(0, -alpha, scratch_, right_);
  }
  for (const int x : {work_, scratch_}) backend_.release(x);
  // Beyond the numbers: the first step finds that too, and is to leave the velocity as it was.
  if (!std::isfinite(backend_.dot(0, increment_, increment_))) backend_.zero(0, increment_);
  if (time_.scheme == TimeScheme::newmark) {
    backend_.copy(0, increment_, acceleration_);
    return;
  }
  // u_{-1} = u_0 - dt v_0 + dt^2 / 2 a_0
  backend_.copy(0, state_.displacement, state_.memory);
  backend_.add(0, -time_.step, state_.velocity, state_.memory);
  backend_.add(0, 0.5 * time_.step * time_.step, increment_, state_.memory);
}

// Velocity and acceleration of the guess u_{n+1} = u_n.
void Motion::begin_step() {
  const double dt = time_.step;
  if (time_.scheme == TimeScheme::newmark) {
    const int before = increment_;  // a_n
    backend_.copy(0, acceleration_, before);
    backend_.combine(0, -1 / (kBeta * dt), state_.velocity, 1 - 0.5 / kBeta, acceleration_);
    backend_.add(0, dt * (1 - kGamma), before, state_.velocity);
    backend_.add(0, dt * kGamma, acceleration_, state_.velocity);
    return;
  }
  // (u - 2 u_n + u_{n-1}) / dt^2 and (u - u_{n-1}) / (2 dt) with u = u_n
  backend_.copy(0, state_.memory, acceleration_);
  backend_.add(0, -1, state_.displacement, acceleration_);
  backend_.combine(0, -0.5 / dt, acceleration_, 0, state_.velocity);
  backend_.combine(0, 1 / (dt * dt), acceleration_, 0, acceleration_);
  backend_.copy(0, state_.displacement, state_.memory);
}

/// Displacement and velocity by so many increments.
void Motion::move(double by) {
  backend_.add(0, by, increment_, state_.displacement);
  backend_.add(0, by * velocity_factor(), increment_, state_.velocity);
}

/// Before the increment is added. There is no need for a copy, unless the way back would lose more
/// than a digit.
void Motion::keep_way_back() {
  constexpr double kFar = 100;  // squared
  const double step = backend_.dot(0, increment_, increment_);
  const double size = backend_.dot(0, state_.displacement, state_.displacement);
  const bool was_far = std::exchange(is_far_, !std::isfinite(step) || step > kFar * size);
  if (!is_far_) {
    if (was_far)
      for (const int x : {far_.displacement, far_.velocity}) backend_.release(x);
    return;
  }
  backend_.copy(0, state_.displacement, far_.displacement);
  backend_.copy(0, state_.velocity, far_.velocity);
}

void Motion::go_back() {
  if (!is_far_) return move(-1);
  backend_.copy(0, far_.displacement, state_.displacement);
  backend_.copy(0, far_.velocity, state_.velocity);
}

// Overflow: nothing further would be a number. `updates`: that were added; the state before the
// first one is the guess. Of Newmark its velocity is (1 - gamma / beta) v_n + dt (1 - gamma / (2
// beta)) a_n, of the central scheme half of the mean over the step before.
NonlinearStats Motion::lost(NonlinearStats stats, int updates, bool last_is_lost) {
  static_assert(kGamma == 2 * kBeta);
  if (last_is_lost && updates > 0) {
    go_back();
    --updates;
  }
  const double factor = time_.scheme == TimeScheme::newmark ? -1 : 2;
  if (updates == 0) backend_.combine(0, factor, state_.velocity, 0, state_.velocity);
  stats.residual = std::numeric_limits<double>::infinity();
  return stats;
}

// begin_step backwards; it asks for memory before it changes what the state is made of. Newmark: v'
// = -v and a' = -a - v / (beta dt), as lost() says; the velocity of the central scheme is found
// anew.
bool Motion::rewind() {
  static_assert(kGamma == 2 * kBeta && kBeta == 0.25);
  const At at = std::exchange(at_, At::updated);
  if (at != At::begun) return at == At::before;
  const double dt = time_.step;
  if (time_.scheme == TimeScheme::newmark) {
    backend_.combine(0, -1, state_.velocity, 0, state_.velocity);
    backend_.combine(0, -1 / (kBeta * dt), state_.velocity, -1, acceleration_);
    return true;
  }
  // u_{n-1} = u_n + dt^2 (u_{n-1} - u_n) / dt^2
  backend_.copy(0, state_.displacement, state_.memory);
  backend_.add(0, dt * dt, acceleration_, state_.memory);
  return true;
}

double Motion::residual(int out) {
  const OperatorScale damping{material_.stiffness_damping, material_.mass_damping};
  const double external = backend_.dot(0, state_.external, state_.external);
  backend_.copy(0, state_.external, out);
  const double elastic = backend_.subtract_elastic_force(state_.displacement, out, work_);
  const double inertia = backend_.subtract_scaled({0, 1}, acceleration_, out, work_);
  const double damped = damping.stiffness > 0 || damping.mass > 0
                            ? backend_.subtract_scaled(damping, state_.velocity, out, work_)
                            : 0;
  backend_.mask(0, out);
  largest_force_ = std::sqrt(std::max({external, elastic, inertia, damped}));
  return std::sqrt(backend_.dot(0, out, out));
}

NonlinearStats Motion::step() {
  NonlinearStats stats;
  at_ = At::before;
  begin_step();
  at_ = At::begun;
  backend_.set_operator({1 + material_.stiffness_damping * velocity_factor(),
                         acceleration_factor() + material_.mass_damping * velocity_factor()});
  double reference = 0, previous = 0;  // residual before the first update, and the one just made
  for (int update = 0; update < setup_.rotation_updates; ++update) {
    backend_.rotate_cells(state_.displacement);
    const double before = residual(right_);
    if (!std::isfinite(before)) return lost(stats, update, true);
    if (update == 0) reference = before;  // later ones correct a remainder
    if (previous > 0) returned_[update - 1] = before / previous;
    previous = before;
    double tolerance = setup_.tolerance;
    if (update + 1 < setup_.rotation_updates && reference > 0) {
      const double leave = std::min(kEarly, kOfReturned * returned_[update]);
      tolerance = std::max(tolerance, leave * before / reference);
    }
    solver_.refresh();
    const SolveStats solve = solver_.solve_from_zero(right_, increment_, tolerance, reference);
    stats.cycles += solve.cycles;
    stats.linear_residual = solve.residual;
    stats.converged = stats.converged && solve.converged;
    ++stats.rotation_updates;
    if (!std::isfinite(solve.residual)) return lost(stats, update, false);
    keep_way_back();
    at_ = At::updated;
    move(1);
    backend_.add(0, acceleration_factor(), increment_, acceleration_);
  }
  backend_.rotate_cells(state_.displacement);
  const double left = residual(right_);
  if (!std::isfinite(left) || !std::isfinite(largest_force_))
    return lost(stats, setup_.rotation_updates, true);
  stats.residual = largest_force_ > 0 ? left / largest_force_ : 0;
  return stats;
}

}  // namespace kerf
