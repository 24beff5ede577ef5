// SPDX-License-Identifier: MIT
//
// Dynamics: one implicit time step, with rotation updates inside it.
//
// Newmark (beta 1/4, gamma 1/2), and the survey's scheme with a second difference of u and a
// central difference for damping, stiffness at the new time. Both start from u_n, displacement and
// rotations: predicted ones let stiff modes ring (docs/decisions/0016-early-updates.md).
// Source  [DGW11] section 5; [WWD15] appendix A.4, equations 46 to 48.
#pragma once

#include <utility>
#include <vector>

#include "core/solve/linear_solver.hpp"

namespace kerf {

/// Vectors of the state, on level 0 of the backend.
struct StateVectors {
  int displacement = -1;  ///< m
  int velocity = -1;      ///< m/s
  int memory = -1;    ///< Newmark: acceleration, m/s^2; central: displacement one step before, m
  int external = -1;  ///< N
};

struct NonlinearStats {
  int rotation_updates = 0;
  int cycles = 0;
  double linear_residual = 0;  ///< dynamics: of the last linear solve; statics: the largest
  double residual = 0;         ///< of the equation of motion, relative to its largest term
  bool converged = true;
};

class Motion {
 public:
  Motion(Backend& backend, LinearSolver& solver, const TimeSetup& time, const Material& material,
         const SolverSetup& setup, StateVectors state);

  /// Acceleration (or the displacement before) that fits displacement and velocity at the start.
  void start();
  /// Where forces or solutions stop being numbers, stats.residual is not finite, and displacement
  /// and velocity are those of the last update that was finite; before the first one u_n, and v_n
  /// (central: (u_n - u_{n-1}) / dt). The acceleration is then of no use.
  NonlinearStats step();
  /// After a step that threw: the state of before it, but for rounding. Returns false, and changes
  /// nothing, where an update had been added already.
  bool rewind();
  /// What the last step has taught this one; for a motion that goes on with another backend.
  const std::vector<double>& returned() const { return returned_; }
  void learn(std::vector<double> returned) { returned_ = std::move(returned); }

 private:
  // Coefficients of u_{n+1} in velocity and acceleration.
  double velocity_factor() const;
  double acceleration_factor() const;
  void begin_step();
  void move(double by);
  void keep_way_back();
  void go_back();
  NonlinearStats lost(NonlinearStats stats, int updates, bool last_is_lost);
  /// external - elastic - damping - inertia, of the current iterate; returns its norm.
  double residual(int out);

  Backend& backend_;
  LinearSolver& solver_;
  TimeSetup time_;
  Material material_;
  SolverSetup setup_;
  StateVectors state_;
  int acceleration_, right_, increment_, work_, scratch_;
  StateVectors far_;  // displacement and velocity before the last update, if it went far
  bool is_far_ = false;
  enum class At { before, begun, updated } at_ = At::updated;  // in a step
  std::vector<double> returned_;  // per update: the residual after it over that before it, when the
                                  // rotations had moved, in the last step
  double largest_force_ = 0;      // of the terms of the last residual
};

}  // namespace kerf
