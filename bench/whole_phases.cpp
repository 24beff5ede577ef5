// SPDX-License-Identifier: MIT
#include <cmath>

#include "bench/phases.hpp"
#include "core/base/error.hpp"
#include "core/base/timer.hpp"
#include "core/body/cut.hpp"
#include "core/near_leaves.hpp"
#include "core/snapshot.hpp"

namespace kerf::bench {
namespace {

constexpr double kTolerance = 1e-8;        // of `solve`: true relative residual
constexpr double kExactTolerance = 1e-10;  // of the solution that errors are measured by

// topology and cut: the backend keeps a pointer to what it loaded, so the last hierarchy may go
// only when the next one is in place.

void load_built(Trial& t, Hierarchy built) {
  t.hierarchy = std::make_unique<Hierarchy>(std::move(built));
  t.backend().load(*t.hierarchy);
}

void prepare_topology(Trial& t) {
  t.previous = std::move(t.hierarchy);
  t.structure_before = std::move(t.structure);
}

void run_topology(Trial& t) { load_built(t, t.body.build_levels(t.body.octree())); }

Outcome outcome_topology(Trial& t) {
  Outcome out;
  out.hash = hash_of(*t.hierarchy);
  return out;
}

// cut: everything is there as a simulation has it, and one blade has passed far away, so that what
// only the first blade needs is not counted.
void prepare_cut(Trial& t) {
  prepare_topology(t);
  t.octree = t.body.octree();
  t.surface = std::make_unique<Surface>(*t.octree, SurfaceMethod::dual_contouring);
  t.surface->bind(*t.octree);
  t.structure = std::make_unique<Structure>(t.body.setup(), *t.octree);
  t.backend().load(t.structure->hierarchy());
  t.structure_before.reset();
  CutEvent nothing;
  nothing.cells_before = nothing.cells_after = t.octree->leaf_count();
  t.structure->update(*t.octree, nothing);
  t.backend().write(0, t.machine.bent, t.body.bent(1));
}

void cut_octree(Trial& t) {
  const Backend& backend = t.backend();
  const DeformedLeaves leaves =
      leaves_near(backend, *t.structure, t.octree->lattice(), t.machine.bent, t.body.blade());
  const auto id = static_cast<std::int32_t>(t.body.setup().cuts.size()) + 1;
  t.event = cut_near(*t.octree, leaves, t.body.blade(), id, backend.workers());
  ensures(t.event.changed(), "the blade of the bench meets its body");
}

void run_cut_topology(Trial& t) {
  cut_octree(t);
  t.structure->update(*t.octree, t.event);
}

/// The part of the host.
void follow_blade(Trial& t) {
  cut_octree(t);
  t.backend().workers().both(
      [&] {
        t.surface->update(*t.octree, t.event);
        t.surface->bind(*t.octree);
      },
      [&] { t.in_place = t.structure->update(*t.octree, t.event); });
}

void run_cut(Trial& t) {
  follow_blade(t);
  follow(t.backend(), *t.structure, t.in_place);
}

Outcome outcome_cut(Trial& t) {
  Outcome out;
  out.hash = hash_of(t.structure->hierarchy());
  return out;
}

// frame: what a program that shows a body does for a picture while a blade passes, with the linear
// part of a time step. Of it the host has the first part to itself.

void prepare_frame(Trial& t) {
  prepare_cut(t);
  t.use_smoother(t.candidate.solver.smoother);
}

void run_frame(Trial& t) {
  follow_blade(t);
  Backend& b = t.backend();
  follow(b, *t.structure, t.in_place);
  const Hierarchy& hierarchy = t.structure->hierarchy();
  const int levels = static_cast<int>(hierarchy.levels.size());
  b.rotate_cells(t.machine.bent);
  t.machine.find_values(hierarchy);
  b.copy(0, t.machine.load_vector, kRight);
  b.zero(0, kSolution);
  Cycle cycle(b, levels, cycle_options(t.candidate.solver, hierarchy));
  for (int i = 0; i < 3; ++i) cycle.run();
  const SurfaceView view = t.surface->view();
  t.positions.resize(view.points.size());
  t.normals.resize(view.normals);
  b.move_points(view.points, t.machine.bent, t.positions);
  b.surface_normals(view, t.positions, t.normals);
}

Outcome outcome_frame(Trial& t) {
  Outcome out{std::vector<double>(3 * t.structure->finest().point.size())};
  t.backend().read(0, kSolution, out.values);
  return out;
}

// solve: values and solution; symbolic work belongs to the topology

void prepare_solve(Trial& t) {
  if (!t.solver) {
    t.solver = std::make_unique<LinearSolver>(t.backend(), t.candidate.solver);
    t.solver->set_structure(t.body.hierarchy());
  }
  t.use_smoother(t.candidate.solver.smoother);
  t.backend().zero(0, t.machine.solution);
}

void run_solve(Trial& t) {
  const Timer timer;
  t.solver->on_progress([&](int, double) {
    if (t.give_up > 0 && timer.seconds() > t.give_up) throw GaveUp{};
  });
  t.solver->refresh();
  t.stats = t.solver->solve(t.machine.load_vector, t.machine.solution, kTolerance);
  t.solver->on_progress({});
}

Outcome outcome_solve(Trial& t) {
  Outcome out{t.read(0, t.machine.solution)};
  out.residual = t.stats.residual;
  return out;
}

Work work_solve(const Trial& t) {
  using namespace counts;
  const auto cycles = static_cast<double>(t.stats.cycles);
  switch (t.candidate.solver.method) {
    case SolverMethod::cg:
      return kCoarsen + kPrepare + cycles * (work_cycle(t) + kOperator + kIteration);
    case SolverMethod::multigrid:
      return kCoarsenPaper + kPrepare + cycles * (work_cycle(t) + kResidual);
    case SolverMethod::cg_jacobi:
      return kPrepare + cycles * (kJacobi + kOperator + kIteration);
    case SolverMethod::cholesky:
      break;
  }
  return {};
}

// step: the linear part of a time step as [DGW11], table 1, times it; from zero, so that the
// error falls from 1. As in a simulation the bound for Chebyshev stays, and the factor of the
// coarsest level, until cycles contract less (core/solve/linear_solver.cpp)

void find_exact(Trial& t) {
  SolverSetup setup;
  setup.max_cycles = 200;
  LinearSolver solver(t.backend(), setup);
  solver.set_structure(t.body.hierarchy());
  t.backend().zero(0, t.machine.solution);
  solver.solve(t.machine.load_vector, t.machine.solution, kExactTolerance);
  t.exact = t.read(0, t.machine.solution);
}

void prepare_step(Trial& t) {
  if (!t.backend().has_factor()) t.backend().factor_coarsest();  // `bound` forgets it
  if (t.exact.empty()) find_exact(t);
  t.use_smoother(t.candidate.solver.smoother);
  t.backend().write_rotations(t.machine.rotations_before);
  t.backend().copy(0, t.machine.load_vector, kRight);
  t.backend().zero(0, kSolution);
}

void run_step(Trial& t) {
  Backend& b = t.backend();
  b.rotate_cells(t.machine.bent);
  b.prepare(0);
  for (int level = 0; level + 2 < t.machine.levels(); ++level) {
    b.coarsen(level);
    b.prepare(level + 1);
  }
  Cycle cycle = t.cycle();
  for (int i = 0; i < 3; ++i) cycle.run();
}

Outcome outcome_step(Trial& t) {
  Outcome out{t.read(0, kSolution)};
  double error = 0, size = 0;
  for (std::size_t i = 0; i < t.exact.size(); ++i) {
    error += (out.values[i] - t.exact[i]) * (out.values[i] - t.exact[i]);
    size += t.exact[i] * t.exact[i];
  }
  out.residual = std::sqrt(error / size);
  return out;
}

Work work_step(const Trial& t) {
  using namespace counts;
  return kRotate + (t.is_paper() ? kCoarsenPaper : kCoarsen) + kPrepare + 3 * work_cycle(t);
}

}  // namespace

std::vector<Phase> whole_phases() {
  return {
      {"topology", "all levels from the octree, and load", prepare_topology, run_topology,
       outcome_topology, always({}), 1, true},
      {"cut", "a blade through 1 % of the cells: octree, surface, levels, backend", prepare_cut,
       run_cut, outcome_cut, always({}), 1, true},
      {"cut-topology", "`cut` without surface and what the backend makes of it", prepare_cut,
       run_cut_topology, outcome_cut, always({}), 1, true},
      {"frame", "`cut`, then `step`, and where the surface is: a picture while a blade passes",
       prepare_frame, run_frame, outcome_frame, always({}), 2, true},
      {"frame-host", "of that what is the host's alone: octree, surface, levels", prepare_cut,
       follow_blade, outcome_cut, always({}), 2, true},
      {"solve", "values and linear solution to a true relative residual of 1e-8", prepare_solve,
       run_solve, outcome_solve, work_solve},
      {"step", "rotations, matrices and diagonals, three cycles", prepare_step, run_step,
       outcome_step, work_step, 2},
  };
}

const std::vector<Phase>& phases() {
  static const std::vector<Phase> all = [] {
    std::vector<Phase> out = product_phases();
    for (const Phase& phase : value_phases()) out.push_back(phase);
    for (const Phase& phase : whole_phases()) out.push_back(phase);
    return out;
  }();
  return all;
}

}  // namespace kerf::bench
