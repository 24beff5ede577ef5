// SPDX-License-Identifier: MIT
//
// Solves A x = b on level 0 by the method that the setup names.
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <vector>

#include "core/backend.hpp"
#include "core/setup.hpp"
#include "core/solve/cycle.hpp"
#include "core/solve/small_pieces.hpp"
#include "core/solve/sparse_cholesky.hpp"

namespace kerf {

/// Not converging is a result. `residual` is the true |b - A x| / reference.
struct SolveStats {
  int cycles = 0;
  double residual = 0;
  bool converged = true;
};

/// Seconds of the parts of set-up, summed over calls.
struct SolverTimes {
  double structure = 0;  ///< symbolic work: after a cut
  double values = 0;     ///< coarse matrices, diagonal blocks, factors: every update
  double solve = 0;
};

class LinearSolver {
 public:
  using Progress = std::function<void(int cycles, double residual)>;

  LinearSolver(Backend& backend, const SolverSetup& setup);

  /// After load(): symbolic work, choice of the cycle. `small_pieces`: the cells of those that are
  /// solved for directly, by whatever method the rest is.
  void set_structure(const Hierarchy& hierarchy,
                     const std::vector<std::vector<std::int32_t>>& small_pieces = {});
  /// After set_operator() and rotate_cells(): all values that the method needs. The factor of the
  /// coarsest level is kept from the last time while cycles contract as they did with a new one:
  /// the preconditioner is then of slightly older rotations, the solution is not. A solve that it
  /// fails makes a new one on its way.
  void refresh();
  /// Improves x until |b - A x| <= tolerance * reference, or by a fixed number of cycles.
  /// `reference` 0: |b|. b and x must be vectors of their own, not those of VectorId.
  SolveStats solve(int b, int x, double tolerance, double reference = 0);
  /// The same from x = 0, whatever x holds.
  SolveStats solve_from_zero(int b, int x, double tolerance, double reference = 0);

  /// Vectors of level 0 in double that hold nothing between solves, for others to use.
  std::array<int, 2> spare() const { return spare_; }
  /// Gives the memory of these, and of those of conjugate gradients, back until the next solve.
  void release();

  const CycleOptions& cycle_in_use() const { return cycle_options_; }
  const SolverTimes& times() const { return times_; }
  /// How often the coarsest level was factored.
  int factors() const { return factors_; }
  void on_progress(Progress progress) { progress_ = std::move(progress); }
  std::size_t bytes() const;

 private:
  struct Problem {
    int b, x;
    bool from_zero;                            // x is zero
    double size = 0, reference = 0, goal = 0;  // |b|; what residuals are relative to; to be reached
  };
  SolveStats run(Problem problem, double tolerance, double reference);
  SolveStats conjugate_gradients(const Problem& problem, bool jacobi);
  SolveStats multigrid(const Problem& problem);
  SolveStats direct(const Problem& problem);
  double first_residual(const Problem& problem);
  double true_residual(const Problem& problem);
  void precondition(bool jacobi);

  /// How far a solve has come.
  struct Place {
    double residual;
    int cycles;
  };
  bool renew_factor();
  /// `since`: from where on the solve had the factor that it ends with; renewed: made within it.
  void watch_factor(const SolveStats& stats, const Place& since, bool renewed);
  bool is_slow(const Place& from, const Place& to, double part) const;

  Backend& backend_;
  SolverSetup setup_;
  const Hierarchy* hierarchy_ = nullptr;
  CycleOptions cycle_options_;
  std::unique_ptr<Cycle> cycle_;
  SmallPieces small_;
  std::unique_ptr<AssembledLevel> assembled_;
  std::unique_ptr<SparseCholesky> cholesky_;
  ConjugateVectors vectors_;  // the residual is the true one, or that of the recursion
  std::array<int, 2> spare_;
  bool factor_due_ = true;
  bool factor_is_new_ = false;  // of the values that cycles have
  int factors_ = 0;
  double decades_with_new_ = 0;  // a cycle, of the first solve with a new one; 0: not known
  SolverTimes times_;
  Progress progress_;
};

}  // namespace kerf
