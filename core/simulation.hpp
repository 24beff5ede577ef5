// SPDX-License-Identifier: MIT
//
// The public face: build a body, cut it, step it, read it.
//
//   kerf::SimulationSetup setup;
//   setup.body = {kerf::make_box({{0, 0, 0}, {0.1, 0.1, 0.1}}), 32, 1};
//   ...
//   kerf::Simulation simulation(setup, kerf::make_fast_backend());
//   while (!simulation.finished()) simulation.step();
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/backend.hpp"
#include "core/base/error.hpp"
#include "core/body/cut.hpp"
#include "core/body/linked_octree.hpp"
#include "core/levels/hierarchy.hpp"
#include "core/setup.hpp"
#include "core/surface/surface_mesh.hpp"

namespace kerf {

/// One finished step (dynamic) or equilibrium (static).
struct StepReport {
  int step = 0;
  double time = 0;  ///< s, at the end of the step
  int rotation_updates = 0;
  int cycles = 0;              ///< multigrid cycles or CG iterations, all linear solves together
  double linear_residual = 0;  ///< true relative residual of its last linear solve; in static mode
                               ///< the largest of them
  double residual = 0;         ///< relative residual of the nonlinear equation at the end; the
                               ///< largest double if the motion blew up, which ends the run
  bool converged = true;       ///< linear solves and, in static mode, equilibrium
  double seconds = 0;
  std::vector<CutEvent> cuts;
  std::size_t cells = 0, vertices = 0, pieces = 0;
  std::size_t pieces_before = 0;  ///< pieces > pieces_before: something came off in this step
};

/// Seconds by phase, in the order in which a step meets them.
using PhaseTimes = std::vector<std::pair<std::string, double>>;

/// The state in one flat picture for files: points are vertices first, then hanging corners.
struct Snapshot {
  std::vector<Vec3d> points;                                  ///< reference positions, m
  std::vector<Vec3d> displacement, velocity, external_force;  ///< m, m/s, N; force 0 at hanging
  std::vector<std::uint8_t> fixed;                            ///< bit per held component
  std::vector<std::array<std::int32_t, 4>>
      masters;  ///< of a hanging corner; else all -1; a
                ///< corner in mid-edge has two masters and twice -1
  std::vector<std::array<std::int32_t, 8>> cells;  ///< points, corner x + 2y + 4z
  std::vector<std::uint8_t> size_log2;             ///< 0: a finest cell
  std::vector<std::int32_t> piece;
  std::vector<double> young, poisson, density;
  std::vector<Mat3d> rotation;
  /// Boundary faces of cells: cell, face (2 axis + side) and the cut id (0: object surface).
  struct Face {
    std::int32_t cell;
    std::int32_t face;
    std::int32_t cut_id;
  };
  std::vector<Face> boundary;
};

class Simulation {
 public:
  /// Called after each cycle of a time step ("solve") and each update of an equilibrium
  /// ("equilibrium"): phase name, cycles or updates so far, residual. Nothing of the simulation may
  /// be read then, nor step() called.
  using Progress = std::function<void(const char* phase, int cycles, double residual)>;
  using Fallback = std::function<std::unique_ptr<Backend>()>;

  /// @throws Error (bad_input) for a setup that makes no sense; Error (unavailable) when memory
  /// would not suffice, before it is allocated.
  Simulation(SimulationSetup setup, std::unique_ptr<Backend> backend);
  ~Simulation();
  Simulation(Simulation&&) noexcept;  ///< what was moved from may only be assigned or destroyed
  Simulation& operator=(Simulation&&) noexcept;

  /// Whether the duration is over (dynamic), or all cuts are made and solved (static).
  bool finished() const;
  int steps_planned() const;
  /// Makes the cuts that are due, then one time step or one equilibrium.
  /// @throws Error (bad_input) in static mode if a piece is held by nothing; names the piece. After
  /// a throw the object may only be destroyed.
  StepReport step();
  void on_progress(Progress progress);
  /// What to go on with where a cut, or the first solve after one, asks the backend for memory that
  /// it does not have (OutOfMemory): the state moves over, a warning says so, and the step
  /// goes on. Taken once. Without a fallback the step throws.
  void set_fallback(Fallback make);

  double time() const;
  const SimulationSetup& setup() const;
  const LinkedOctree& body() const;
  const Hierarchy& hierarchy() const;
  const Backend& backend() const;
  std::size_t cells() const;
  std::size_t cells_before_cuts() const;
  std::size_t vertices() const;
  std::size_t unknowns() const;  ///< free components
  std::size_t hanging() const;   ///< hanging corners, each place once
  std::size_t pieces() const;
  std::size_t links_cut() const;  ///< by blades, so far
  std::size_t bytes() const;      ///< held by body, hierarchy, backend and surface
  PhaseTimes seconds() const;
  const std::vector<std::string>& warnings() const;

  Snapshot snapshot() const;
  /// The surface as it lies now; empty if the setup asks for none.
  SurfaceMesh surface_mesh() const;
  /// Hash of displacement and velocity as double bits, in vertex order.
  std::uint64_t state_hash() const;
  /// Volume of the cells, m^3; cuts do not change it.
  double volume() const;
  /// Of all vertices where they are now, m.
  Box3 deformed_box() const;
  /// Positions of the corners of all leaves, eight per leaf in the order of body().leaves().
  std::vector<Vec3d> deformed_corners() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace kerf
