// SPDX-License-Identifier: MIT
#include "bench/papers/problem.hpp"

#include <cmath>
#include <utility>

#include "app/backends.hpp"
#include "bench/body.hpp"
#include "bench/candidates.hpp"
#include "bench/papers/results.hpp"
#include "core/base/error.hpp"
#include "core/base/timer.hpp"
#include "core/body/cut.hpp"
#include "core/surface/surface.hpp"

namespace kerf::papers {
namespace {

/// Ends a run at its limit.
struct Enough {};

constexpr double kDirectGoal = 1e-8;  // true relative residual; else it would refine in vain

}  // namespace

Problem::Problem(SimulationSetup setup, Backend* follower, bool with_surface)
    : setup_(std::move(setup)), octree_(bench::uncut_octree(setup_)), structure_(setup_, octree_) {
  cells_before_ = cells();
  vertices_before_ = vertices();
  std::optional<Surface> surface;
  if (with_surface) {
    surface.emplace(octree_, SurfaceMethod::dual_contouring);
    surface->bind(octree_);
  }
  if (follower != nullptr) follower->load(hierarchy());
  std::int32_t id = 0;
  for (const CutSetup& blade : setup_.cuts)
    cut(blade, ++id, follower, surface ? &*surface : nullptr);
  structure_.pack();
}

void Problem::cut(const CutSetup& blade, std::int32_t id, Backend* follower, Surface* surface) {
  CutEvent event;
  {
    const AddTime time(cut_times_.octree);
    event = kerf::cut(octree_, {}, blade.lines.empty() ? blade.mesh : sweep(blade.lines), id);
  }
  if (surface != nullptr) {
    const AddTime time(cut_times_.surface);
    surface->update(octree_, event);
    surface->bind(octree_);
  }
  if (!event.changed()) return;
  bool in_place = false;
  {
    const AddTime time(cut_times_.levels);
    in_place = structure_.update(octree_, event);
  }
  if (follower == nullptr) return;
  const AddTime time(cut_times_.backend);
  bench::follow(*follower, structure_, in_place);
}

std::vector<double> Problem::load() const { return structure_.external().on_all(hierarchy()); }

OperatorScale Problem::scale(double density) const {
  if (density == 0) return {};
  const double dt = setup_.time.step;
  const Material& material = setup_.material;
  return {1 + 2 / dt * material.stiffness_damping,
          density * (4 / (dt * dt) + 2 / dt * material.mass_damping)};
}

double Problem::coarse_seconds() const {
  Hierarchy fresh = hierarchy();
  fresh.levels.resize(1);
  const Timer timer;
  build_coarse_levels(fresh, {setup_.solver.coarsest_vertices, setup_.solver.max_levels,
                              setup_.solver.duplicate_cells});
  return timer.seconds();
}

double Course::error_at(double seconds) const {
  if (samples.empty() || samples.back().seconds < seconds) return kNone;
  double out = 1;
  for (const Sample& s : samples)
    if (s.seconds <= seconds) out = s.error;
  return out;
}

double Course::seconds_to(double error) const {
  for (const Sample& s : samples)
    if (s.error <= error) return s.seconds;
  return kNone;
}

double Course::error_after(int cycle) const {
  for (const Sample& s : samples)
    if (s.cycle == cycle) return s.error;
  return kNone;
}

double Course::rate(double floor) const {
  const Sample* last = nullptr;
  for (const Sample& s : samples)
    if (s.error > floor) last = &s;
  if (last == nullptr || last->cycle < 2) return kNone;
  const int first = last->cycle / 2;
  return std::pow(last->error / error_after(first), 1.0 / (last->cycle - first));
}

Machine::Machine(const Problem& problem, std::unique_ptr<Backend> backend, double density)
    : problem_(problem),
      backend_(std::move(backend)),
      right_(backend_->add_vector()),
      solution_(backend_->add_vector()) {
  const Timer timer;
  backend_->load(problem.hierarchy());
  backend_->wait();
  coarse_seconds_ = timer.seconds() + problem.coarse_seconds();
  backend_->set_operator(problem.scale(density));
  backend_->write(0, right_, problem.load());
  backend_->mask(0, right_);
}

double Machine::error_of(int x) {
  now_.resize(exact_.size());
  backend_->read(0, x, now_);
  double sum = 0;
  for (std::size_t i = 0; i < now_.size(); ++i)
    sum += (now_[i] - exact_[i]) * (now_[i] - exact_[i]);
  return std::sqrt(sum) / norm_;
}

LinearSolver& Machine::solver_of(const SolverSetup& setup) {
  for (const std::unique_ptr<LinearSolver>& solver : solvers_) solver->release();
  solvers_.push_back(std::make_unique<LinearSolver>(*backend_, setup));
  LinearSolver& out = *solvers_.back();
  if (setup.method != SolverMethod::cholesky) {
    // The bound of the smoother is estimated once after a cut, not in every step: in no time here.
    out.set_structure(problem_.hierarchy());
    out.refresh();
  }
  out.set_structure(problem_.hierarchy());  // so that it factors again
  return out;
}

void Machine::find_solution(double goal) {
  constexpr double kEnough = 100;  // times the goal: some slender bodies do not get nearer
  SolverSetup setup = default_solver();
  setup.max_cycles = 1000;
  LinearSolver& solver = solver_of(setup);
  solver.refresh();
  backend_->zero(0, solution_);
  const SolveStats stats = solver.solve(right_, solution_, goal);
  expects(stats.residual <= kEnough * goal,
          text("the solution that errors are measured by stops at a residual of ", stats.residual));
  std::vector<double> found(3 * problem_.vertices());
  backend_->read(0, solution_, found);
  take_solution(std::move(found));
}

void Machine::take_solution(std::vector<double> solution) {
  exact_ = std::move(solution);
  norm_ = 0;
  for (const double x : exact_) norm_ += x * x;
  norm_ = std::sqrt(norm_);
}

Course Machine::run(const SolverSetup& setup, const Limits& limits) {
  constexpr double kNever = 1e-14;  // the limits end it
  const bool is_direct = setup.method == SolverMethod::cholesky;
  const bool is_multigrid =
      setup.method == SolverMethod::multigrid || setup.method == SolverMethod::cg;
  SolverSetup endless = setup;
  endless.max_cycles = 100000;
  LinearSolver& solver = solver_of(endless);
  Course out;
  out.structure = solver.times().structure + (is_multigrid ? coarse_seconds_ : 0.0);
  const Timer values;
  solver.refresh();
  backend_->wait();
  out.values = values.seconds();
  const double start = out.structure + out.values;
  out.samples = {{out.structure, 1, 0}, {start, 1, 0}};

  backend_->zero(0, solution_);
  double excluded = 0;  // s, spent on errors
  const Timer timer;
  const auto sample = [&](int cycle) {
    backend_->wait();
    const double now = timer.seconds();
    out.samples.push_back({start + now - excluded, error_of(solution_), cycle});
    const Sample& last = out.samples.back();
    if ((limits.cycles > 0 && cycle >= limits.cycles) || last.error <= limits.error ||
        (limits.seconds > 0 && last.seconds >= limits.seconds))
      throw Enough{};
    excluded += timer.seconds() - now;
  };
  solver.on_progress([&](int cycle, double) { sample(cycle); });
  try {
    solver.solve(right_, solution_, is_direct ? kDirectGoal : kNever);
    if (is_direct) sample(1);
  } catch (const Enough&) {  // as was asked for
  }
  solver.on_progress({});
  return out;
}

void Machine::reset() {
  std::vector<double> identity(4 * problem_.cells(), 0.0);
  for (std::size_t i = 0; i < identity.size(); i += 4) identity[i] = 1;
  backend_->write_rotations(identity);
}

double Machine::step_seconds(const SolverSetup& setup, int repeat) {
  constexpr double kLong = 8;  // s: then the run that warms up says enough
  constexpr int kCycles = 3;
  SolverSetup three = setup;
  three.cycles = kCycles;
  LinearSolver& solver = solver_of(three);
  double best = kNone;
  for (int run = 0; run <= repeat; ++run) {
    reset();
    backend_->write(0, solution_, exact_);
    solver.set_structure(problem_.hierarchy());  // so that it factors again
    backend_->wait();
    const Timer timer;
    backend_->rotate_cells(solution_);
    solver.refresh();
    backend_->zero(0, solution_);
    solver.solve(right_, solution_, 0);
    backend_->wait();
    const double seconds = timer.seconds();
    if (run == 0 && seconds <= kLong) continue;
    best = std::isnan(best) ? seconds : std::min(best, seconds);
    if (seconds > kLong) break;
  }
  reset();
  return best;
}

SolverSetup paper_solver() {
  for (const bench::Candidate& candidate : bench::candidates())
    if (candidate.name == "paper") return candidate.solver;
  throw Error(ErrorKind::internal, "the bench has the solver of the paper");
}

SolverSetup default_solver() { return {}; }

SolverSetup method_solver(SolverMethod method) {
  SolverSetup out;
  out.method = method;
  return out;
}

std::unique_ptr<Backend> reference_backend(int threads) {
  SolverSetup setup;
  setup.backend = "reference";
  setup.threads = threads;
  return make_backend(setup);
}

std::unique_ptr<Backend> fast_backend(int threads) {
  SolverSetup setup;
  setup.precision = Precision::mixed;
  setup.threads = threads;
  return make_backend(setup);
}

}  // namespace kerf::papers
