// SPDX-License-Identifier: MIT
//
// One candidate at work on one body. Candidates on the same backend share it: they differ in the
// solver alone, and memory for one backend each would not suffice for the larger bodies.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bench/body.hpp"
#include "bench/candidates.hpp"
#include "bench/dense24.hpp"
#include "core/backend.hpp"
#include "core/solve/linear_solver.hpp"
#include "core/structure.hpp"
#include "core/surface/surface.hpp"

namespace kerf::bench {

/// A backend that holds a body in its bent state, its values up to date.
class Machine {
 public:
  Machine(const Body& body, const SolverSetup& setup);

  /// Topology, vectors, rotations, matrices, factor: whatever a phase left behind is gone.
  void load();
  /// Matrices, diagonals and factor, of the rotations that there are, on what was loaded last.
  void find_values(const Hierarchy& hierarchy);

  Backend& backend() { return *backend_; }
  const Backend& backend() const { return *backend_; }
  int levels() const { return static_cast<int>(body_.hierarchy().levels.size()); }

  // Vectors of level 0.
  int load_vector = -1, bent = -1, solution = -1;
  /// Rotations a tenth of the way before the bent state, where a time step would start.
  std::vector<double> rotations_before;

 private:
  const Body& body_;
  std::unique_ptr<Backend> backend_;
};

/// Ends a run that takes longer than its trial allows.
struct GaveUp {};

struct Trial {
  Trial(const Body& of, Machine& on, const Candidate& by, std::vector<double>& solution)
      : body(of), machine(on), candidate(by), exact(solution) {}

  const Body& body;
  Machine& machine;
  const Candidate& candidate;
  std::vector<double>& exact;  ///< solution of the linear problem, found by the first who needs it

  double give_up = 0;  ///< > 0: longest run of a solve, s

  // What phases keep from prepare to run to outcome.
  double number = 0;  ///< a scalar result
  SolveStats stats;
  std::unique_ptr<LinearSolver> solver;
  std::optional<Dense24> dense;
  std::vector<double> dense_in, dense_out;
  std::optional<LinkedOctree> octree;
  std::unique_ptr<Surface> surface;
  std::unique_ptr<Hierarchy> hierarchy, previous;  // built by a phase, loaded into the backend
  std::unique_ptr<Structure> structure, structure_before;  // the same
  CutEvent event;
  bool in_place = false;                  // levels followed the event so
  std::vector<Vec3d> positions, normals;  // of the surface of a frame

  Backend& backend() { return machine.backend(); }
  /// Frees what a phase kept.
  void drop();
  /// The smoother of this candidate from now on.
  void use_smoother(SmootherType type);
  /// Cycle of this candidate, for level 0.
  Cycle cycle();
  /// Values of one level of the backend.
  std::vector<double> read(int level, int x);
  bool is_paper() const { return candidate.solver.method == SolverMethod::multigrid; }
  bool is_jacobi() const { return candidate.solver.degree == 1; }
};

}  // namespace kerf::bench
