// SPDX-License-Identifier: MIT
#include "core/simulation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <numeric>
#include <utility>

#include "core/base/error.hpp"
#include "core/base/hash.hpp"
#include "core/base/memory.hpp"
#include "core/base/timer.hpp"
#include "core/cut_schedule.hpp"
#include "core/fem/equilibrium.hpp"
#include "core/fem/motion.hpp"
#include "core/levels/corners.hpp"
#include "core/near_leaves.hpp"
#include "core/snapshot.hpp"
#include "core/structure.hpp"
#include "core/surface/surface.hpp"
#include "kernels/mat3.hpp"

namespace kerf {
namespace {

// Seconds of the phases that are not the linear solver's.
struct Clock {
  double voxelise = 0, cut = 0, structure = 0, load = 0, step = 0;
  double surface = 0, surface_bind = 0, surface_positions = 0, surface_normals = 0;
};

// What a backend that cannot update forgets.
struct Kept {
  std::vector<std::vector<double>> vectors;  // of the state
  std::vector<double> rotations;
};

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

}  // namespace

struct Simulation::Impl {
  Impl(SimulationSetup given, std::unique_ptr<Backend> machine)
      : setup(std::move(given)),
        backend(std::move(machine)),
        voxels(voxelise_setup(setup, clock.voxelise)),
        body(voxels, setup.body.refinement),
        schedule(setup.cuts, setup.time),
        solver(*backend, setup.solver) {}

  void start();
  void build_structure();
  void warn_of_idle_supports();
  void load_structure();
  void follow_structure(bool in_place, Kept kept);
  void update_backend();
  Kept read_state(std::int32_t vertices, std::int32_t cells) const;
  void write_state(Kept kept);
  void change_surface(const CutEvent& event);
  void bind_surface();
  void move_surface();
  void check_memory() const;
  CutEvent make_cut(const DueCut& due);
  void apply_cut(const DueCut& due, StepReport& report);
  std::array<std::pair<int, bool>, 3> state_vectors() const;
  double natural_time() const;
  void step_back();
  void warn_of_pieces();
  std::vector<double> read_vector(int x) const;
  NonlinearStats solve_step();
  StepReport step();

  SimulationSetup setup;
  mutable Clock clock;
  std::unique_ptr<Backend> backend;
  Voxels voxels;
  LinkedOctree body;
  CutSchedule schedule;
  LinearSolver solver;
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

  const Hierarchy& hierarchy() const { return structure->hierarchy(); }
  const Level& finest() const { return structure->finest(); }
};

void Simulation::Impl::start() {
  warnings = voxels.warnings;
  voxels = Voxels{};  // the octree has taken over
  state.displacement = backend->add_vector();
  state.velocity = backend->add_vector();
  state.memory = backend->add_vector();
  state.external = backend->add_vector();
  if (setup.time.mode == TimeMode::dynamic) {
    motion =
        std::make_unique<Motion>(*backend, solver, setup.time, setup.material, setup.solver, state);
  } else {
    equilibrium = std::make_unique<Equilibrium>(*backend, solver, setup.time, setup.solver, state);
  }
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
  if (equilibrium)
    equilibrium->on_progress([this](int update, double residual) {
      if (progress) progress("equilibrium", update, residual);
    });
  if (motion)
    solver.on_progress([this](int cycles, double residual) {
      if (progress) progress("solve", cycles, residual);
    });
}

void Simulation::Impl::build_structure() {
  check_memory();
  const AddTime timer(clock.structure);
  const bool assembles = setup.solver.method == SolverMethod::cholesky;
  structure = std::make_unique<Structure>(setup, body, assembles || backend->reads_incidences());
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
  solver.set_structure(hierarchy(), structure->small_pieces());
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
  const DeformedLeaves leaves =
      leaves_near(*backend, *structure, body.lattice(), state.displacement, due.blade);
  return cut_near(body, leaves, due.blade, due.cut_id, backend->workers());
}

void Simulation::Impl::apply_cut(const DueCut& due, StepReport& report) {
  const CutEvent event = make_cut(due);
  report.cuts.push_back(event);
  links_cut += event.disconnected.size();
  if (!event.changed()) return change_surface(event);
  check_memory();
  if (equilibrium) equilibrium->release();  // there is room for new patches then
  Kept kept;
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
void Simulation::Impl::follow_structure(bool in_place, Kept kept) {
  if (backend->can_update() && in_place) return update_backend();
  const LevelChange& change = structure->finest_change();
  if (backend->can_update()) kept = read_state(change.vertices_before, change.cells_before);
  load_structure();
  write_state(std::move(kept));
}

// All that a load forgets.
Kept Simulation::Impl::read_state(std::int32_t vertices, std::int32_t cells) const {
  const AddTime timer(clock.structure);
  Kept kept;
  for (const auto& [vector, is_displacement] : state_vectors()) {
    kept.vectors.emplace_back(3 * static_cast<std::size_t>(vertices));
    backend->read(0, vector, kept.vectors.back());
  }
  kept.rotations.resize(4 * static_cast<std::size_t>(cells));
  backend->read_rotations(kept.rotations);
  return kept;
}

// The same again, and what is new beside it.
void Simulation::Impl::write_state(Kept kept) {
  const AddTime timer(clock.structure);
  const LevelChange& change = structure->finest_change();
  const NewVertices fresh = new_vertices(finest(), change);
  for (std::size_t i = 0; i < kept.vectors.size(); ++i) {
    std::vector<double>& values = kept.vectors[i];
    const std::vector<double> more = fresh.combine(values_at(values, fresh.source));
    values.insert(values.end(), more.begin(), more.end());
    if (i == 0) structure->hold_crumbs_at(values);
    const auto [vector, is_displacement] = state_vectors()[i];
    backend->write(0, vector, structure->hold(std::move(values), 0, is_displacement));
  }
  for (const std::int32_t origin : change.origin)
    for (std::size_t k = 0; k < 4; ++k)
      kept.rotations.push_back(kept.rotations[4 * static_cast<std::size_t>(origin) + k]);
  backend->write_rotations(kept.rotations);
}

// The backend keeps what it has, and is told what is new.
void Simulation::Impl::update_backend() {
  const LevelChange& change = structure->finest_change();
  {
    const AddTime timer(clock.load);
    backend->update(hierarchy(), structure->change());
    const std::vector<std::int32_t> loaded = structure->reloaded();
    std::vector<double> force = structure->external().on(hierarchy(), loaded);
    for (std::size_t k = 0; k < force.size(); ++k)
      if ((finest().fixed[loaded[k / 3]] >> (k % 3)) & 1) force[k] = 0;
    backend->write_some(0, state.external, loaded, force);
  }
  solver.set_structure(hierarchy(), structure->small_pieces());
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

NonlinearStats Simulation::Impl::solve_step() {
  const AddTime timer(clock.step);
  return motion ? motion->step() : equilibrium->solve(natural_time(), prescribed);
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

Simulation::Simulation(SimulationSetup setup, std::unique_ptr<Backend> backend) {
  expects(backend != nullptr, "Simulation needs a backend; see make_fast_backend");
  validate(setup);
  impl_ = std::make_unique<Impl>(std::move(setup), std::move(backend));
  impl_->start();
}
Simulation::~Simulation() = default;
Simulation::Simulation(Simulation&&) noexcept = default;
Simulation& Simulation::operator=(Simulation&&) noexcept = default;

bool Simulation::finished() const {
  return impl_->stopped || impl_->steps >= impl_->schedule.steps();
}
int Simulation::steps_planned() const { return impl_->schedule.steps(); }
StepReport Simulation::step() {
  expects(!impl_->broken, "this simulation threw during a step; make a new one");
  impl_->broken = true;  // until the step comes back
  StepReport report = impl_->step();
  impl_->broken = false;
  return report;
}
void Simulation::on_progress(Progress progress) { impl_->progress = std::move(progress); }
double Simulation::time() const { return impl_->time; }
const SimulationSetup& Simulation::setup() const { return impl_->setup; }
const LinkedOctree& Simulation::body() const { return impl_->body; }
const Hierarchy& Simulation::hierarchy() const { return impl_->hierarchy(); }
const Backend& Simulation::backend() const { return *impl_->backend; }
std::size_t Simulation::cells() const { return impl_->hierarchy().values.size(); }
std::size_t Simulation::cells_before_cuts() const { return impl_->cells_before; }
std::size_t Simulation::vertices() const { return impl_->finest().point.size(); }
std::size_t Simulation::hanging() const { return count_hanging(impl_->finest()); }
std::size_t Simulation::pieces() const { return impl_->structure->pieces(); }
std::size_t Simulation::links_cut() const { return impl_->links_cut; }
const std::vector<std::string>& Simulation::warnings() const { return impl_->warnings; }

std::size_t Simulation::unknowns() const {
  std::size_t count = 0;
  for (const std::uint8_t fixed : impl_->finest().fixed)
    for (int c = 0; c < 3; ++c) count += ((fixed >> c) & 1) == 0;
  return count;
}

std::size_t Simulation::bytes() const {
  return impl_->body.bytes() + impl_->structure->bytes() + impl_->backend->bytes() +
         impl_->solver.bytes() + (impl_->surface ? impl_->surface->bytes() : 0) +
         (impl_->positions.capacity() + impl_->normals.capacity()) * sizeof(Vec3d);
}

PhaseTimes Simulation::seconds() const {
  const Clock& clock = impl_->clock;
  const SolverTimes& solver = impl_->solver.times();
  return {{"voxelise", clock.voxelise},
          {"cut", clock.cut},
          {"structure", clock.structure + solver.structure},
          {"load", clock.load},
          {"values", solver.values},
          {"solve", solver.solve},
          {"forces", clock.step - solver.values - solver.solve},
          {"surface", clock.surface},
          {"surface_bind", clock.surface_bind},
          {"surface_positions", clock.surface_positions},
          {"surface_normals", clock.surface_normals}};
}

Snapshot Simulation::snapshot() const {
  Snapshot out =
      make_snapshot(impl_->body, impl_->hierarchy(), impl_->read_vector(impl_->state.displacement),
                    impl_->read_vector(impl_->state.velocity),
                    impl_->structure->external().on_all(impl_->hierarchy()));
  out.piece = impl_->structure->piece_of_cells();
  const Level& level = impl_->finest();
  std::vector<double> rotations(4 * impl_->hierarchy().values.size());
  impl_->backend->read_rotations(rotations);
  for (std::int32_t c = 0; c < level.cells(); ++c) {
    const std::uint8_t index = impl_->hierarchy().values[c].material;
    const Material& material =
        index == 0 ? impl_->setup.material : impl_->setup.regions[index - std::size_t{1}].material;
    out.young.push_back(material.young);
    out.poisson.push_back(material.poisson);
    out.density.push_back(material.density);
    const double* q = rotations.data() + 4 * static_cast<std::size_t>(c);
    out.rotation.push_back(kernels::to_matrix(kernels::Quat<double>{q[0], q[1], q[2], q[3]}));
  }
  return out;
}

SurfaceMesh Simulation::surface_mesh() const {
  expects(!impl_->broken, "surface_mesh: not during a step, nor after one that threw");
  if (!impl_->surface) return {};
  return impl_->surface->mesh(impl_->positions, impl_->normals, impl_->structure->piece_of_cells());
}

std::uint64_t Simulation::state_hash() const {
  Hash hash;  // in vertex order
  for (const int x : {impl_->state.displacement, impl_->state.velocity})
    hash.add(impl_->read_vector(x));
  return hash.value();
}

Box3 Simulation::deformed_box() const {
  const std::vector<double> u = impl_->read_vector(impl_->state.displacement);
  Box3 box;
  for (std::size_t v = 0; v < impl_->finest().point.size(); ++v)
    box.add(impl_->body.lattice().point(impl_->finest().point[v]) +
            Vec3d{u[3 * v], u[3 * v + 1], u[3 * v + 2]});
  return box;
}

double Simulation::volume() const {
  const Level& level = impl_->finest();
  double finest = 0;
  for (const std::uint8_t log2 : level.size_log2) finest += static_cast<double>(1 << (3 * log2));
  const double h = impl_->hierarchy().spacing;
  return finest * h * h * h;
}

std::vector<Vec3d> Simulation::deformed_corners() const {
  return cell_corners(impl_->body.lattice(), impl_->finest(),
                      impl_->read_vector(impl_->state.displacement));
}

}  // namespace kerf
