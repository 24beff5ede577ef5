// SPDX-License-Identifier: MIT
#include "core/simulation_impl.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numeric>

#include "core/base/memory.hpp"
#include "core/base/timer.hpp"
#include "core/near_leaves.hpp"

namespace kerf {
namespace {

std::vector<std::shared_ptr<const Solid>> solids_of(const std::vector<Region>& regions) {
  std::vector<std::shared_ptr<const Solid>> out;
  for (const Region& region : regions) out.push_back(region.solid);
  return out;
}

Voxels voxelise_setup(const SimulationSetup& setup, double& seconds) {
  const AddTime time(seconds);
  const Lattice lattice =
      make_lattice(setup.body.solid->bounds(), setup.body.resolution, setup.body.refinement);
  // Beyond, products of lengths and moduli leave the range of double precision.
  expects(lattice.spacing > 1e-9 && lattice.spacing < 1e9,
          text("a finest cell would be ", lattice.spacing,
               " m wide; check the unit of body.length, body.size or the mesh"));
  return voxelise(*setup.body.solid, lattice, solids_of(setup.regions));
}

std::size_t at(std::int32_t i) { return static_cast<std::size_t>(i); }

}  // namespace

Simulation::Impl::Impl(SimulationSetup given, std::unique_ptr<Backend> machine)
    : setup(std::move(given)),
      backend(std::move(machine)),
      voxels(voxelise_setup(setup, clock.voxelise)),
      body(voxels, setup.body.refinement),
      schedule(setup.cuts, setup.time) {}

void Simulation::Impl::start() {
  warnings = voxels.warnings;
  voxels = Voxels{};  // the octree has taken over
  make_solvers();
  build_structure();
  if (setup.surface != SurfaceMethod::none) {
    const AddTime timer(clock.surface);
    surface = std::make_unique<Surface>(body, setup.surface);
  }
  bind_surface();
  cells_before = hierarchy().values.size();
  warn_of_idle_supports();
  warn_of_pieces();
  load_structure();
  prescribed = structure->is_prescribed();
  if (prescribed) {
    std::vector<double> zero(3 * finest().point.size(), 0.0);
    backend->write(0, state.displacement, structure->hold(std::move(zero), 0, true));
  }
  if (motion) {
    const AddTime timer(clock.step);
    motion->start();
  }
  if (surface && setup.cuts.empty()) surface->forget_changes();
  move_surface();
}

// All that holds on to the backend, and their vectors.
void Simulation::Impl::make_solvers() {
  solver = std::make_unique<LinearSolver>(*backend, setup.solver);
  state.displacement = backend->add_vector();
  state.velocity = backend->add_vector();
  state.memory = backend->add_vector();
  state.external = backend->add_vector();
  if (setup.time.mode == TimeMode::dynamic) {
    motion = std::make_unique<Motion>(*backend, *solver, setup.time, setup.material, setup.solver,
                                      state);
    solver->on_progress([this](int cycles, double residual) {
      if (progress) progress("solve", cycles, residual);
    });
    return;
  }
  equilibrium = std::make_unique<Equilibrium>(*backend, *solver, setup.time, setup.solver, state);
  equilibrium->on_progress([this](int update, double residual) {
    if (progress) progress("equilibrium", update, residual);
  });
}

void Simulation::Impl::build_structure() {
  check_memory();
  const AddTime timer(clock.structure);
  const bool assembles = setup.solver.method == SolverMethod::cholesky;
  has_incidences = assembles || backend->reads_incidences();
  structure = std::make_unique<Structure>(setup, body, has_incidences);
  for (std::string& warning : structure->take_warnings()) warnings.push_back(std::move(warning));
}

void Simulation::Impl::warn_of_idle_supports() {
  const Level& level = finest();
  for (std::size_t i = 0; i < setup.supports.size(); ++i) {
    const auto holds = [&](const Vec3i& p) {
      return setup.supports[i].box.contains(body.lattice().point(p));
    };
    if (std::none_of(level.point.begin(), level.point.end(), holds))
      warnings.push_back(
          text("support ", i, " holds nothing: no vertex of the body lies in its box"));
  }
}

void Simulation::Impl::load_structure() {
  {
    const AddTime timer(clock.load);
    structure->pack();
    backend->load(hierarchy());
    backend->write(0, state.external, structure->external().on_all(hierarchy()));
    backend->mask(0, state.external);
  }
  solver->set_structure(hierarchy(), structure->small_pieces());
  structure->forget_transfers();
  return_freed_memory();
}

void Simulation::Impl::change_surface(const CutEvent& event) {
  if (!surface) return;
  {
    const AddTime timer(clock.surface);
    surface->update(body, event);
  }
  if (event.changed() || !event.moved.empty()) bind_surface();
}

void Simulation::Impl::bind_surface() {
  if (!surface) return;
  const AddTime timer(clock.surface_bind);
  surface->bind(body);
}

// The surface follows the body: every step, since its user may draw every step.
void Simulation::Impl::move_surface() {
  if (!surface) return;
  try {
    place_surface();
  } catch (const OutOfMemory& error) {
    if (fallback == nullptr) throw;
    change_backend(error, rescue(error, finest().vertices(), finest().cells()));
    place_surface();
  }
}

void Simulation::Impl::place_surface() {
  const SurfaceView view = surface->view();
  {
    const AddTime timer(clock.surface_positions);
    positions.resize(view.points.size());
    backend->move_points(view.points, state.displacement, positions);
  }
  const AddTime timer(clock.surface_normals);
  normals.resize(view.normals);
  backend->surface_normals(view, positions, normals);
}

// Before levels, matrices and vectors are allocated: all that exists are the leaves. Uniform bodies
// have no hanging corners and one vertex a cell, which saves more in double than in mixed.
void Simulation::Impl::check_memory() const {
  constexpr double kUniform = 0.6, kUniformWithBlades = 0.75;
  double bytes = backend->bytes_per_cell() * static_cast<double>(body.leaf_count());
  if (setup.body.refinement == 0) bytes *= setup.cuts.empty() ? kUniform : kUniformWithBlades;
  const double available = physical_memory();
  if (bytes < 0.9 * available) return;
  throw Error(
      ErrorKind::unavailable,
      text("this body of ", body.leaf_count(), " cells needs about ", std::ceil(bytes / 1e8) / 10,
           " GB for its matrices and vectors; this machine has ", std::floor(available / 1e8) / 10,
           " GB; lower body.resolution or raise body.refinement"));
}

std::vector<double> Simulation::Impl::read_vector(int x) const {
  std::vector<double> out(3 * finest().point.size());
  backend->read(0, x, out);
  return out;
}

// A shear wave crosses the body in this time.
double Simulation::Impl::natural_time() const {
  const Vec3d extent = setup.body.solid->bounds().extent();
  const double length = std::max({extent.x, extent.y, extent.z});
  const double shear = setup.material.young / (2 * (1 + setup.material.poisson));
  return length / std::sqrt(shear / setup.material.density);
}

CutEvent Simulation::Impl::make_cut(const DueCut& due) {
  const AddTime timer(clock.cut);
  if (!due.deformed || due.blade.triangles.empty()) return cut(body, {}, due.blade, due.cut_id);
  check_finite(due.blade, "the blade");
  const DeformedLeaves leaves = find_leaves(due.blade);
  return cut_near(body, leaves, due.blade, due.cut_id, backend->workers());
}

// All that a cut asks the backend before it changes the body.
DeformedLeaves Simulation::Impl::find_leaves(const TriangleMesh& blade) {
  const auto find = [&] {
    return leaves_near(*backend, *structure, body.lattice(), state.displacement, blade);
  };
  try {
    return find();
  } catch (const OutOfMemory& error) {
    if (fallback == nullptr) throw;
    change_backend(error, rescue(error, finest().vertices(), finest().cells()));
    return find();
  }
}

void Simulation::Impl::apply_cut(const DueCut& due, StepReport& report) {
  const CutEvent event = make_cut(due);
  report.cuts.push_back(event);
  links_cut += event.disconnected.size();
  if (!event.changed()) return change_surface(event);
  check_memory();
  if (equilibrium) equilibrium->release();  // there is room for new patches then
  KeptState kept;
  if (!backend->can_update()) kept = read_state(finest().vertices(), finest().cells());
  // Both need the octree alone, and are serial; the backend does nothing until both have ended.
  bool in_place = false;
  backend->workers().both([&] { change_surface(event); },
                          [&] {
                            const AddTime timer(clock.structure);
                            in_place = structure->update(body, event);
                          });
  for (std::string& warning : structure->take_warnings()) warnings.push_back(std::move(warning));
  follow_structure(in_place, std::move(kept));
}

// Vectors of the state, and whether they hold a displacement.
std::array<std::pair<int, bool>, 3> Simulation::Impl::state_vectors() const {
  const bool memory_is_displacement = setup.time.scheme == TimeScheme::central;
  return {{{state.displacement, true},
           {state.velocity, false},
           {state.memory, memory_is_displacement}}};
}

/// `kept`: what a backend that cannot follow held before.
void Simulation::Impl::follow_structure(bool in_place, KeptState kept) {
  const LevelChange& change = structure->finest_change();
  if (backend->can_update() && in_place) {
    bool is_told = false;
    try {
      return update_backend(is_told);
    } catch (const OutOfMemory& error) {
      if (fallback == nullptr) throw;
      kept = is_told ? rescue(error, finest().vertices(), finest().cells())
                     : rescue(error, change.vertices_before, change.cells_before);
      for (auto& values : kept.vectors) values.resize(3 * at(change.vertices_before));
      kept.rotations.resize(4 * at(change.cells_before));
      follow_cut(kept);
      return change_backend(error, kept);
    }
  }
  if (backend->can_update()) kept = read_state(change.vertices_before, change.cells_before);
  follow_cut(kept);
  try {
    load_structure();
    write_state(kept);
  } catch (const OutOfMemory& error) {
    if (fallback == nullptr) throw;
    change_backend(error, kept);
  }
}

// All that a load forgets.
KeptState Simulation::Impl::read_state(std::int32_t vertices, std::int32_t cells) const {
  const AddTime timer(clock.structure);
  KeptState kept;
  for (const auto& [vector, is_displacement] : state_vectors()) {
    kept.vectors.emplace_back(3 * static_cast<std::size_t>(vertices));
    backend->read(0, vector, kept.vectors.back());
  }
  kept.rotations.resize(4 * static_cast<std::size_t>(cells));
  backend->read_rotations(kept.rotations);
  return kept;
}

// What was read before a cut, of what there is after it.
void Simulation::Impl::follow_cut(KeptState& kept) const {
  const AddTime timer(clock.structure);
  const LevelChange& change = structure->finest_change();
  const NewVertices fresh = new_vertices(finest(), change);
  for (std::size_t i = 0; i < kept.vectors.size(); ++i) {
    std::vector<double>& values = kept.vectors[i];
    const std::vector<double> more = fresh.combine(values_at(values, fresh.source));
    values.insert(values.end(), more.begin(), more.end());
    if (i == 0) structure->hold_crumbs_at(values);
    const bool is_displacement = state_vectors()[i].second;
    values = structure->hold(std::move(values), 0, is_displacement);
  }
  for (const std::int32_t origin : change.origin)
    for (std::size_t k = 0; k < 4; ++k)
      kept.rotations.push_back(kept.rotations[4 * static_cast<std::size_t>(origin) + k]);
}

void Simulation::Impl::write_state(const KeptState& kept) {
  const AddTime timer(clock.structure);
  for (std::size_t i = 0; i < kept.vectors.size(); ++i)
    backend->write(0, state_vectors()[i].first, kept.vectors[i]);
  backend->write_rotations(kept.rotations);
}

// What a backend without memory still holds. Where it does not, the first error is the one to tell.
KeptState Simulation::Impl::rescue(const OutOfMemory& error, std::int32_t vertices,
                                   std::int32_t cells) const {
  try {
    return read_state(vertices, cells);
  } catch (const Error& second) {
    throw Error(second.kind(), text(error.what(), "; and then: ", second.what()));
  }
}

// Goes on with the fallback, from a state of the structure as it is now.
void Simulation::Impl::change_backend(const OutOfMemory& error, const KeptState& kept) {
  try {
    take_fallback(error, kept);
  } catch (const Error& second) {
    throw Error(second.kind(), text(error.what(), "; and then: ", second.what()));
  }
}

void Simulation::Impl::take_fallback(const OutOfMemory& error, const KeptState& kept) {
  std::unique_ptr<Backend> next = std::exchange(fallback, nullptr)();
  expects(next != nullptr, "the fallback of a simulation made no backend");
  expects(hierarchy().has_transfers() && (has_incidences || !next->reads_incidences()),
          text("backend ", next->name(), " reads what was not kept for backend ", backend->name()));
  warnings.push_back(text(error.what(), "; goes on with backend ", next->name()));
  const SolverTimes& times = solver->times();
  earlier = {earlier.structure + times.structure, earlier.values + times.values,
             earlier.solve + times.solve};
  const std::vector<double> returned = motion ? motion->returned() : std::vector<double>();
  motion.reset();
  equilibrium.reset();
  solver.reset();
  backend = std::move(next);
  make_solvers();
  if (motion) motion->learn(returned);
  load_structure();
  write_state(kept);
}

// The backend keeps what it has, and is told what is new. `is_told`: the sizes are the new ones.
void Simulation::Impl::update_backend(bool& is_told) {
  const LevelChange& change = structure->finest_change();
  {
    const AddTime timer(clock.load);
    backend->update(hierarchy(), structure->change());
    is_told = true;
    const std::vector<std::int32_t> loaded = structure->reloaded();
    std::vector<double> force = structure->external().on(hierarchy(), loaded);
    for (std::size_t k = 0; k < force.size(); ++k)
      if ((finest().fixed[loaded[k / 3]] >> (k % 3)) & 1) force[k] = 0;
    backend->write_some(0, state.external, loaded, force);
  }
  solver->set_structure(hierarchy(), structure->small_pieces());
  const AddTime timer(clock.structure);
  const NewVertices fresh = new_vertices(finest(), change);
  std::vector<std::int32_t> numbers(finest().point.size() - change.vertices_before);
  std::iota(numbers.begin(), numbers.end(), change.vertices_before);
  std::vector<double> sources(3 * fresh.source.size());
  for (const auto& [vector, is_displacement] : state_vectors()) {
    backend->read_some(0, vector, fresh.source, sources);
    std::vector<double> values = fresh.combine(sources);
    if (is_displacement && structure->has_crumbs()) {
      std::vector<double> all = read_vector(vector);
      std::copy(values.begin(), values.end(), all.end() - std::ssize(values));
      structure->hold_crumbs_at(all);
    }
    values = structure->hold(std::move(values), change.vertices_before, is_displacement);
    backend->write_some(0, vector, numbers, values);
  }
}

// The last finite state, perhaps of an update that others were to follow, is worth more than one
// that is no number; the run ends with it, so that the acceleration is not asked for again.
void Simulation::Impl::step_back() {
  backend->zero(0, state.memory);
  backend->rotate_cells(state.displacement);
  stopped = true;
  warnings.push_back(
      text("the motion blew up in step ", steps,
           "; the run ends with the last state that was finite. Shorten time.step, tighten "
           "solver.tolerance, or check that sizes, moduli and loads are in SI units"));
}

// A body in crumbs is a surprise, and in dynamics they fall.
void Simulation::Impl::warn_of_pieces() {
  const std::size_t pieces = structure->pieces();
  if (pieces < 2 || setup.time.mode == TimeMode::statics) return;
  const Level& level = finest();
  const std::vector<std::int32_t> piece = structure->piece_of_cells();
  std::vector<char> is_held(pieces, 0);
  for (std::int32_t c = 0; c < level.cells(); ++c)
    for (const std::int32_t v : level.slots[c])
      if (level.fixed[v] != 0) is_held[piece[c]] = 1;
  const auto loose = std::count(is_held.begin(), is_held.end(), 0);
  if (loose == 0) return;
  warnings.push_back(text("the body starts as ", pieces, " pieces, ", loose,
                          " of them held by no support; a finer body.resolution joins thin parts"));
}

NonlinearStats Simulation::Impl::solve_once() {
  const AddTime timer(clock.step);
  return motion ? motion->step() : equilibrium->solve(natural_time(), prescribed);
}

// Memory is asked for by the first solve of a structure, before its first update is added. In
// statics any iterate may be gone on from.
NonlinearStats Simulation::Impl::solve_step() {
  try {
    return solve_once();
  } catch (const OutOfMemory& error) {
    if (fallback == nullptr || (motion && !motion->rewind())) throw;
    if (equilibrium) prescribed = equilibrium->rewind();
    change_backend(error, rescue(error, finest().vertices(), finest().cells()));
    return solve_once();
  }
}

StepReport Simulation::Impl::step() {
  const Timer timer;
  StepReport report;
  report.pieces_before = structure->pieces();
  for (const DueCut& due : schedule.due(steps)) apply_cut(due, report);
  report.pieces = structure->pieces();

  const NonlinearStats stats = solve_step();
  prescribed = false;
  ++steps;
  time = motion ? steps * setup.time.step : steps;
  report.step = steps;
  report.time = time;
  report.rotation_updates = stats.rotation_updates;
  report.cycles = stats.cycles;
  report.linear_residual = stats.linear_residual;
  report.residual = stats.residual;
  report.converged = stats.converged;
  report.cells = hierarchy().values.size();
  report.vertices = finest().point.size();
  if (motion && !std::isfinite(stats.residual)) {
    step_back();
    report.residual = std::numeric_limits<double>::max();
    report.converged = false;
  }
  move_surface();
  report.seconds = timer.seconds();
  return report;
}

}  // namespace kerf
