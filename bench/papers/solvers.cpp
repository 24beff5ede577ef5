// SPDX-License-Identifier: MIT
//
// Figure 12 of [DGW11]: error over time of four solvers, their own set-up included.
#include "bench/papers/experiments.hpp"
#include "core/base/error.hpp"

namespace kerf::papers {
namespace {

constexpr const char* kFigure12 = "figure12";
constexpr double kGoal = 1e-8;  // of the error
// Its factor takes some 2 GB and half a minute there, and both grow faster than the body.
constexpr std::size_t kMostForCholesky = 80000;

struct Contestant {
  const char* name;
  SolverSetup solver;
};

std::vector<Contestant> contestants(const Problem& problem) {
  std::vector<Contestant> out{{"CG-Jacobi", method_solver(SolverMethod::cg_jacobi)},
                              {"multigrid", method_solver(SolverMethod::multigrid)},
                              {"CG-multigrid", default_solver()}};
  if (problem.vertices() <= kMostForCholesky)
    out.push_back({"Cholesky", method_solver(SolverMethod::cholesky)});
  return out;
}

// Of thousands of cycles, those that a plot can tell apart.
void add_points(Context& context, const std::string& panel, const char* solver,
                const Course& course) {
  constexpr double kApart = 1.01;
  double last = 0;  // s
  for (const Sample& s : course.samples) {
    const bool is_end = &s == &course.samples.back();
    if (s.cycle > 2 && !is_end && s.seconds < kApart * last) continue;
    last = s.seconds;
    context.results.points.push_back(
        {kFigure12, panel, solver, s.seconds, s.error, &s == &course.samples.front()});
  }
}

void run_panel(Context& context, const SimulationSetup& setup, const std::string& panel,
               double density) {
  context.doing(text(kFigure12, ": ", panel));
  const Problem problem(setup);
  Machine machine(problem, fast_backend(context.threads), density);
  machine.find_solution();
  context.results.add(
      {kFigure12, panel, "", "cells", "1", kNone, static_cast<double>(problem.cells())});
  for (const Contestant& one : contestants(problem)) {
    context.doing(text(kFigure12, ": ", panel, ", ", one.name));
    const Course course = machine.run(one.solver, {0, context.give_up, kGoal});
    const auto add = [&](const char* quantity, const char* unit, double value) {
      context.results.add({kFigure12, panel, one.name, quantity, unit, kNone, value});
    };
    add("structural set-up", "s", course.structure);
    add("other set-up", "s", course.values);
    add("to an error of 0.1", "s", course.seconds_to(0.1));
    add("to an error of 0.01", "s", course.seconds_to(0.01));
    add("to an error of 1e-6", "s", course.seconds_to(1e-6));
    add_points(context, panel, one.name, course);
  }
}

}  // namespace

// The cube of the paper, and at half its size, at which Cholesky fits; the armadillo at a half and
// a quarter.
void run_figure12(Context& context) {
  const struct {
    const char *name, *size;
    int halvings;
  } runs[] = {{"Cube", "", 0},
              {"Cube", " at half size", 1},
              {"Armadillo", " at half size", 1},
              {"Armadillo", " at a quarter size", 2}};
  for (const auto& run : runs)
    for (const double density : {1.0, 0.0}) {
      if (context.size == bench::Size::small && run.halvings == 2) continue;  // small anyway
      BodyInfo info = body(run.name);
      info.resolution >>= run.halvings;
      info.refinement -= run.halvings;
      std::optional<SimulationSetup> setup = setup_of(context, info, Grid::adaptive);
      if (!setup) continue;
      setup->time.mode = density == 0 ? TimeMode::statics : TimeMode::dynamic;
      run_panel(context, *setup,
                text(run.name, run.size, density == 0 ? " without mass" : " of medium mass"),
                density);
    }
}

}  // namespace kerf::papers
