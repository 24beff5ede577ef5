// SPDX-License-Identifier: MIT
#include "bench/linear_problem.hpp"

#include <cmath>

#include "bench/noise.hpp"
#include "core/base/error.hpp"
#include "core/base/timer.hpp"
#include "core/body/cut.hpp"
#include "core/fem/loads.hpp"
#include "cpu/cpu_backend.hpp"

namespace kerf::bench {

LinearProblem::LinearProblem(const ProblemSetup& setup) : setup_(setup) {
  const Box3 cube{{0, 0, 0}, {1, 1, 1}};
  const Lattice lattice = make_lattice(cube, setup.cells, setup.refinement);
  LinkedOctree body(voxelise(*make_box(cube), lattice), setup.refinement);
  std::int32_t id = 0;
  for (const TriangleMesh& blade : setup.blades) cut(body, {}, blade, ++id);

  hierarchy_.levels.push_back(finest_level(body));
  hierarchy_.spacing = lattice.spacing;
  hierarchy_.poisson = {setup.poisson};
  hierarchy_.cut = id > 0;
  for (const std::uint8_t log2 : hierarchy_.levels[0].size_log2) {
    const double side = lattice.spacing * (1 << log2);
    hierarchy_.values.push_back({side, side * side * side, 0});
  }
  std::vector<HeldComponent> held;
  apply_supports(lattice, {{{{-1, -1e-9, -1}, {2, 1e-9, 2}}, {}, {true, true, true}}},
                 hierarchy_.levels[0], 0, held);
  build_coarse_levels(hierarchy_, {setup.solver.coarsest_vertices, setup.solver.max_levels,
                                   setup.solver.duplicate_cells});

  backend_ = make_cpu_backend({setup.solver.threads, 0});
  SolverSetup solver =
      setup.solver;  // of the reference solution, also where the cycle stands alone
  solver.method = SolverMethod::cg;
  solver_ = std::make_unique<LinearSolver>(*backend_, solver);
  b_ = backend_->add_vector();
  x_ = backend_->add_vector();
  backend_->load(hierarchy_);
  OperatorScale scale;
  if (setup.courant > 0) {
    const double shear_speed = std::sqrt(1 / (2 * (1 + setup.poisson)));  // E = density = 1
    const double dt = setup.courant / shear_speed;
    scale.mass = 4 / (dt * dt);  // Newmark, beta 1/4
  }
  backend_->set_operator(scale);
  const ExternalForce load(lattice, {Gravity{{0.3, -1, 0.2}}}, hierarchy_.levels[0]);
  backend_->write(0, b_, load.on_all(hierarchy_));
  backend_->mask(0, b_);
  solver_->set_structure(hierarchy_);
  solver_->refresh();
}

double LinearProblem::error(int x) const {
  std::vector<double> now(exact_.size());
  backend_->read(0, x, now);
  double sum = 0;
  for (std::size_t i = 0; i < now.size(); ++i) sum += (now[i] - exact_[i]) * (now[i] - exact_[i]);
  return std::sqrt(sum) / norm_exact_;
}

// Level 0 depends neither on how cells merge above it nor on the cycle, so that the default serves
// those that hardly converge, or whose cycles stand alone.
void LinearProblem::solve_exactly() {
  const SolverSetup& own = setup_.solver;
  if (!own.duplicate_cells || own.method == SolverMethod::multigrid) {
    ProblemSetup like = setup_;
    like.solver = {};
    like.solver.coarsest_vertices = own.coarsest_vertices;
    like.solver.max_cycles = own.max_cycles;
    like.solver.threads = own.threads;
    LinearProblem other(like);
    other.solve_exactly();
    exact_ = std::move(other.exact_);
    norm_exact_ = other.norm_exact_;
    return;
  }
  backend_->zero(0, x_);
  const SolveStats exact = solver_->solve(b_, x_, 1e-13);
  expects(exact.residual < 1e-10, "the reference solution did not converge; raise max_cycles");
  exact_.resize(3 * hierarchy_.levels[0].point.size());
  backend_->read(0, x_, exact_);
  norm_exact_ = std::sqrt(backend_->dot(0, x_, x_));
}

void LinearProblem::count_iterations(Convergence& out) {
  backend_->zero(0, x_);
  solver_->on_progress([&](int iteration, double) {
    if (out.cg_1e10 >= 0) return;
    const double now = error(x_);
    if (out.cg_1e6 < 0 && now <= 1e-6) out.cg_1e6 = iteration;
    if (now <= 1e-10) out.cg_1e10 = iteration;
  });
  solver_->solve(b_, x_, 1e-12);
  solver_->on_progress({});
}

Convergence LinearProblem::measure(bool error_of_cg) {
  Convergence out;
  for (const Level& level : hierarchy_.levels) out.vertices.push_back(level.vertices());

  // The error of A u = 0 is u itself; the largest eigenvector of the cycle remains.
  const int cycles = setup_.cells > 48 ? 24 : 60;
  constexpr int last = 8;
  const bool alone = setup_.solver.method == SolverMethod::multigrid;
  Cycle cycle(*backend_, static_cast<int>(hierarchy_.levels.size()),
              cycle_options(setup_.solver, hierarchy_));
  backend_->zero(0, kRight);
  backend_->write(0, kSolution, noise(3 * hierarchy_.levels[0].point.size()));
  backend_->mask(0, kSolution);
  double before = 0;
  const Timer timer;
  for (int i = 0; i < cycles; ++i) {
    if (i == cycles - last) before = std::sqrt(backend_->dot(0, kSolution, kSolution));
    cycle.run();
  }
  out.seconds_per_cycle = timer.seconds() / cycles;
  const double after = std::sqrt(backend_->dot(0, kSolution, kSolution));
  out.factor = std::pow(after / before, 1.0 / last);
  if (!error_of_cg) return out;

  solve_exactly();
  if (!alone) count_iterations(out);
  backend_->copy(0, b_, kRight);
  backend_->zero(0, kSolution);
  for (int i = 0; i < 3; ++i) cycle.run();
  out.three_cycles = error(kSolution);
  return out;
}

}  // namespace kerf::bench
