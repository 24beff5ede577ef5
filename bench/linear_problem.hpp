// SPDX-License-Identifier: MIT
//
// One linear problem on a cube, ready for any solver: the bench's and the convergence test's body.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/body/linked_octree.hpp"
#include "core/solve/linear_solver.hpp"

namespace kerf::bench {

struct ProblemSetup {
  int cells = 32;  ///< along an edge of the unit cube
  int refinement = 0;
  double poisson = 0.3;
  std::vector<TriangleMesh> blades;  ///< applied in the reference state
  double courant = 0;                ///< > 0: time step in crossings of the cube by a shear wave
  SolverSetup solver;  ///< method `multigrid`: the cycle stands alone, as that method runs it
};

/// What one cycle and CG with it do to the error.
struct Convergence {
  double factor = 0;  ///< asymptotic factor of one cycle alone, in the 2-norm of the error
  /// Iterations until the error is below; -1: not within the limit, or a cycle that stands alone.
  int cg_1e6 = -1, cg_1e10 = -1;
  double three_cycles = 0;  ///< error left after three cycles from zero
  double seconds_per_cycle = 0;
  std::vector<std::int32_t> vertices;  ///< of each level
};

/// The unit cube, E = 1, bottom face held, a body force with three components, R = I.
class LinearProblem {
 public:
  explicit LinearProblem(const ProblemSetup& setup);
  /// `error_of_cg`: also solve to rounding, to count iterations by the error.
  Convergence measure(bool error_of_cg = true);
  const Hierarchy& hierarchy() const { return hierarchy_; }
  const CycleOptions& cycle_in_use() const { return solver_->cycle_in_use(); }

 private:
  double error(int x) const;  // relative to exact_
  void solve_exactly();
  void count_iterations(Convergence& out);

  ProblemSetup setup_;
  Hierarchy hierarchy_;
  std::unique_ptr<Backend> backend_;
  std::unique_ptr<LinearSolver> solver_;
  int b_ = -1, x_ = -1;
  std::vector<double> exact_;
  double norm_exact_ = 0;
};

}  // namespace kerf::bench
