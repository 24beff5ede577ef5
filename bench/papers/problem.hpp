// SPDX-License-Identifier: MIT
//
// The linear system of the first time step after a body was cut at rest: what both tables and all
// curves of [DGW11] section 8 are about.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/backend.hpp"
#include "core/setup.hpp"
#include "core/solve/linear_solver.hpp"
#include "core/structure.hpp"
#include "core/surface/surface.hpp"

namespace kerf::papers {

/// Seconds that all blades of a body take together.
struct CutTimes {
  double octree = 0;   ///< links and new cells
  double surface = 0;  ///< only if asked for
  double levels = 0;   ///< vertices and multigrid levels
  double backend = 0;  ///< what it makes of them; only if there is one

  double sum() const { return octree + surface + levels + backend; }
};

/// A cut body with its levels.
class Problem {
 public:
  /// Cuts the body, blade by blade, as a simulation would. `follower`: a backend that is loaded
  /// before and follows every blade.
  explicit Problem(SimulationSetup setup, Backend* follower = nullptr, bool with_surface = false);

  const SimulationSetup& setup() const { return setup_; }
  const Hierarchy& hierarchy() const { return structure_.hierarchy(); }
  const Lattice& lattice() const { return octree_.lattice(); }
  std::size_t cells_before() const { return cells_before_; }
  std::size_t vertices_before() const { return vertices_before_; }
  std::size_t cells() const { return octree_.leaf_count(); }
  std::size_t vertices() const { return structure_.finest().point.size(); }
  const CutTimes& cut_times() const { return cut_times_; }
  /// Of the scene, on the vertices, N.
  std::vector<double> load() const;
  /// Newmark (beta 1/4, gamma 1/2) with the scene's time step and damping, its density times
  /// `density`; 0: the static problem without damping.
  OperatorScale scale(double density) const;
  /// Seconds to build all coarse levels from level 0.
  double coarse_seconds() const;

 private:
  void cut(const CutSetup& blade, std::int32_t id, Backend* follower, Surface* surface);

  SimulationSetup setup_;
  LinkedOctree octree_;
  Structure structure_;
  std::size_t cells_before_ = 0, vertices_before_ = 0;
  CutTimes cut_times_;
};

/// How far a solver is at some time, its own set-up included. The error falls at the end of a
/// cycle.
struct Sample {
  double seconds = 0;
  double error = 1;  ///< 2-norm, relative to that of the solution
  int cycle = 0;
};

struct Limits {
  int cycles = 0;      ///< > 0: no more than these
  double seconds = 0;  ///< > 0: none after so many
  double error = 0;    ///< none below
};

struct Course {
  double structure = 0;  ///< s, of the set-up that topology alone asks for
  double values = 0;     ///< s, of the rest of the set-up
  /// The first two are the ends of the set-up of structure and of all set-up; then one a cycle.
  std::vector<Sample> samples;

  /// After the last cycle that has ended by then; no number where none of that time was run.
  double error_at(double seconds) const;
  /// The end of the cycle after which it is no more; no number: never.
  double seconds_to(double error) const;
  /// After so many cycles; no number if there were fewer.
  double error_after(int cycle) const;
  /// Average factor of a cycle over the last half of those whose error is above `floor`.
  double rate(double floor) const;
};

/// A backend that holds the system of a problem.
class Machine {
 public:
  /// `density`: as in Problem::scale.
  Machine(const Problem& problem, std::unique_ptr<Backend> backend, double density);

  /// Solves to a true relative residual of `goal`, or as far as rounding allows. Errors are
  /// measured against this.
  void find_solution(double goal = kExact);
  static constexpr double kExact = 1e-11;
  static constexpr double kRough = 1e-3;  ///< enough for a state whose rotations are no identity
  /// One that another backend found.
  void take_solution(std::vector<double> solution);
  const std::vector<double>& solution() const { return exact_; }

  /// From zero. Needs  find_solution().
  Course run(const SolverSetup& solver, const Limits& limits);
  /// Rotations, all matrices with their factor, three cycles (of conjugate gradients where the
  /// method is that), s; of the fastest of `repeat` runs after one that warms up. Of those of many
  /// seconds there is no second. Needs  find_solution().
  double step_seconds(const SolverSetup& solver, int repeat);

 private:
  double error_of(int x);
  void reset();
  LinearSolver& solver_of(const SolverSetup& setup);

  const Problem& problem_;
  std::unique_ptr<Backend> backend_;
  int right_ = -1, solution_ = -1;
  std::vector<double> exact_, now_;
  double norm_ = 0;
  double coarse_seconds_ = 0;  // to build all coarse levels, and load all levels
  std::vector<std::unique_ptr<LinearSolver>> solvers_;  // they keep vectors of the backend
};

/// V(1,1) alone, forward Gauss-Seidel with omega 1.7. Source  [DGW11] section 6.1.
SolverSetup paper_solver();
SolverSetup default_solver();
SolverSetup method_solver(SolverMethod method);

/// The readable backend that has Gauss-Seidel, in double precision.
std::unique_ptr<Backend> reference_backend(int threads);
/// The default one, in mixed precision.
std::unique_ptr<Backend> fast_backend(int threads);

}  // namespace kerf::papers
