// SPDX-License-Identifier: MIT
//
// Statics: the displacement at which elastic forces balance the loads.
//
// Each update takes the rotations of the last iterate and solves the linear problem; that map
// diverges under large loads, so it is accelerated by Anderson's method, and where that stalls, a
// mass term (pseudo time) leads closer first. Line searches stall: docs/convergence.md.
// An equilibrium that is found need not be the stable one: a column may stand beyond its buckling.
// Source  Walker, Ni 2011 [WN11]; [DGW11] section 5; Bitzek et al. 2006 [BKGMG06] for the velocity.
#pragma once

#include <functional>
#include <vector>

#include "core/fem/motion.hpp"

namespace kerf {

class Equilibrium {
 public:
  /// Called after each update.
  using Progress = std::function<void(int update, double residual)>;

  Equilibrium(Backend& backend, LinearSolver& solver, const TimeSetup& time,
              const SolverSetup& setup, StateVectors state);

  /// Improves the displacement until the residual is below the tolerance.
  /// `natural_time`: a time in which waves cross the body, s, for the pseudo time step.
  /// `keep_rotations`: the first update takes the rotations as they are, so that prescribed
  /// displacements spread over the body before any rotation is extracted.
  NonlinearStats solve(double natural_time, bool keep_rotations);
  /// After a solve that threw: the best iterate that was kept, else that of the moment. Returns
  /// whether the next solve is still to keep the rotations.
  bool rewind();
  /// Gives the memory of vectors that hold nothing between solves back until the next one.
  void release();
  void on_progress(Progress progress) { progress_ = std::move(progress); }

 private:
  /// Where the best iterate is: the displacement; the displacement less the increment; best_.
  enum class Best { current, one_step_back, kept };

  double residual();  // relative; leaves the force in right_
  double update(double mass_factor);
  std::vector<double> fit();
  void anderson_step();
  void begin_difference(std::vector<int>& list);
  bool pseudo_time(double natural_time);
  void leave_best();
  void keep_best();
  void go_to_best();
  void forget();  // the history
  bool finished() const { return stats_.residual <= time_.nonlinear_tolerance; }

  Backend& backend_;
  LinearSolver& solver_;
  TimeSetup time_;
  SolverSetup setup_;
  StateVectors state_;
  int right_, increment_, best_, velocity_, work_;
  Best best_at_ = Best::current;
  std::vector<int> du_, dd_;  // differences of iterates and of increments, newest last
  std::vector<int> free_;     // vectors to store them in
  bool keep_rotations_ = false;
  NonlinearStats stats_;
  Progress progress_;
};

}  // namespace kerf
