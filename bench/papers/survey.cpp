// SPDX-License-Identifier: MIT
//
// Table 2 of [WWD15]: one cut into a liver, on a uniform grid and on an octree. Its third column,
// composite elements, is not there yet.
#include "bench/papers/experiments.hpp"
#include "core/base/error.hpp"
#include "core/base/timer.hpp"

namespace kerf::papers {
namespace {

constexpr const char* kSurvey = "survey";
constexpr int kSweeps = 4, kSurveyCycles = 2;

/// Milliseconds on one core of a Xeon X5560 at 2.8 GHz.
struct Column {
  const char* name;
  Grid grid;
  double cells, unknowns, cells_added, unknowns_added;
  double octree, surface, matrices, levels, solver;
};

// Of the time of a cut: what level 0 and the coarse levels are made from.
struct Values {
  double finest = 0, coarse = 0;  // s
};

Values set_values(Backend& backend, int levels) {
  Values out;
  {
    const AddTime time(out.finest);
    backend.prepare(0);
    backend.wait();
  }
  const AddTime time(out.coarse);
  for (int level = 0; level + 1 < levels; ++level) {
    backend.coarsen(level);
    backend.prepare(level + 1);
  }
  backend.factor_coarsest();
  backend.wait();
  return out;
}

void run_column(Context& context, const BodyInfo& info, const Column& column) {
  const std::optional<SimulationSetup> setup = setup_of(context, info, column.grid);
  if (!setup) return;
  context.doing(text(kSurvey, ": ", column.name));
  std::unique_ptr<Backend> backend = fast_backend(context.threads);
  Backend& of_machine = *backend;
  const Problem problem(*setup, backend.get(), true);
  Machine machine(problem, std::move(backend), 1);
  machine.find_solution();
  const Values values = set_values(of_machine, static_cast<int>(problem.hierarchy().levels.size()));
  SolverSetup solver = method_solver(SolverMethod::multigrid);
  solver.cycle = CycleType::v;
  solver.pre_sweeps = solver.post_sweeps = kSweeps;
  const Course course = machine.run(solver, {kSurveyCycles, 0, 0});
  const double solve =
      course.samples.back().seconds - course.samples.front().seconds - course.values;

  const CutTimes& cut = problem.cut_times();
  const auto add = [&](const char* quantity, const char* unit, double printed, double ours) {
    context.results.add({kSurvey, column.name, kKerfMethod, quantity, unit, printed, ours});
  };
  const auto count = [](std::size_t n) { return static_cast<double>(n); };
  constexpr double kMilli = 1e3;
  const double times[] = {kMilli * cut.octree, kMilli * cut.surface, kMilli * values.finest,
                          kMilli * (cut.levels + cut.backend + values.coarse), kMilli * solve};
  const double printed[] = {column.octree, column.surface, column.matrices, column.levels,
                            column.solver};
  add("cells", "1", column.cells, count(problem.cells_before()));
  add("unknowns", "1", column.unknowns, count(3 * problem.vertices_before()));
  add("cells added by the cut", "1", column.cells_added,
      count(problem.cells() - problem.cells_before()));
  add("unknowns added by the cut", "1", column.unknowns_added,
      count(3 * (problem.vertices() - problem.vertices_before())));
  add("octree subdivision", "ms", printed[0], times[0]);
  add("surface meshing", "ms", printed[1], times[1]);
  add("FE matrices (ours: diagonals)", "ms", printed[2], times[2]);
  add("multigrid hierarchy", "ms", printed[3], times[3]);
  add("solver", "ms", printed[4], times[4]);
  double sum = 0, sum_printed = 0;
  for (int i = 0; i < 5; ++i) {
    sum += times[i];
    sum_printed += printed[i];
  }
  add("all of the cut", "ms", sum_printed, sum);
  add("error after two cycles", "1", kNone, course.error_after(kSurveyCycles));
}

}  // namespace

void run_survey(Context& context) {
  // As long as gives the printed number of cells: 108 instead of 100, since this liver is slimmer.
  const BodyInfo liver{
      "Liver", "[WWD15] table 2", "papers/liver_cut.toml", "liver.obj", 108, 2, 24, 1, false, {}};
  run_column(context, liver,
             {"uniform", Grid::uniform, 173843, 566493, 0, 2037, 0, 1.26, 29.57, 40.34, 2033.09});
  run_column(
      context, liver,
      {"adaptive", Grid::adaptive, 40080, 129162, 1596, 6438, 13.29, 1.26, 7.05, 10.09, 581.66});
}

}  // namespace kerf::papers
