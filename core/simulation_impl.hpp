// SPDX-License-Identifier: MIT
//
// What a simulation holds, and how a step goes: cuts, structure, backend, solution, surface.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/base/error.hpp"
#include "core/cut_schedule.hpp"
#include "core/fem/equilibrium.hpp"
#include "core/fem/motion.hpp"
#include "core/simulation.hpp"
#include "core/solve/linear_solver.hpp"
#include "core/structure.hpp"
#include "core/surface/surface.hpp"

namespace kerf {

/// Seconds of the phases that are not the linear solver's.
struct PhaseClock {
  double voxelise = 0, cut = 0, structure = 0, load = 0, step = 0;
  double surface = 0, surface_bind = 0, surface_positions = 0, surface_normals = 0;
};

/// What a backend that cannot update forgets.
struct KeptState {
  std::vector<std::vector<double>> vectors;  ///< of the state
  std::vector<double> rotations;
};

struct Simulation::Impl {
  Impl(SimulationSetup given, std::unique_ptr<Backend> machine);

  void start();
  void make_solvers();
  void build_structure();
  void warn_of_idle_supports();
  void load_structure();
  void follow_structure(bool in_place, KeptState kept);
  void update_backend(bool& is_told);
  KeptState read_state(std::int32_t vertices, std::int32_t cells) const;
  void follow_cut(KeptState& kept) const;
  void write_state(const KeptState& kept);
  KeptState rescue(const OutOfMemory& error, std::int32_t vertices, std::int32_t cells) const;
  void change_backend(const OutOfMemory& error, const KeptState& kept);
  void take_fallback(const OutOfMemory& error, const KeptState& kept);
  void change_surface(const CutEvent& event);
  void bind_surface();
  void move_surface();
  void place_surface();
  void check_memory() const;
  CutEvent make_cut(const DueCut& due);
  DeformedLeaves find_leaves(const TriangleMesh& blade);
  void apply_cut(const DueCut& due, StepReport& report);
  std::array<std::pair<int, bool>, 3> state_vectors() const;
  double natural_time() const;
  void step_back();
  void warn_of_pieces();
  std::vector<double> read_vector(int x) const;
  NonlinearStats solve_step();
  NonlinearStats solve_once();
  StepReport step();

  SimulationSetup setup;
  mutable PhaseClock clock;
  std::unique_ptr<Backend> backend;
  Voxels voxels;
  LinkedOctree body;
  CutSchedule schedule;
  std::unique_ptr<LinearSolver> solver;
  std::unique_ptr<Structure> structure;
  StateVectors state;
  std::unique_ptr<Motion> motion;
  std::unique_ptr<Equilibrium> equilibrium;
  std::unique_ptr<Surface> surface;       // null: none asked for
  std::vector<Vec3d> positions, normals;  // of its slots, after the last step
  std::size_t cells_before = 0, links_cut = 0;
  int steps = 0;
  bool stopped = false;
  bool broken = false;
  double time = 0;
  bool prescribed = false;  // some held displacement is not zero, and has not spread yet
  std::vector<std::string> warnings;
  Progress progress;
  Fallback fallback;            // null: none, or taken
  bool has_incidences = false;  // of all levels, for backends that read them
  SolverTimes earlier;          // of the solver of a backend before this one

  const Hierarchy& hierarchy() const { return structure->hierarchy(); }
  const Level& finest() const { return structure->finest(); }
};

}  // namespace kerf
