// SPDX-License-Identifier: MIT
//
// Figure 10 of [DGW11]: error over cycles, by the direction of cuts, and by mass.
#include <numbers>

#include "bench/papers/experiments.hpp"
#include "core/base/error.hpp"

namespace kerf::papers {
namespace {

constexpr const char* kFigure10 = "figure10";
constexpr int kLongest = 30;
constexpr double kFloor = 1e-9;  // below it, what the solution itself is off may show
constexpr double kTurn = std::numbers::pi / 6;
constexpr int kBlades = 7;  // in each direction: those that give the printed number of cells
constexpr int kRefinement = 4, kSmallRefinement = 1;

struct Case {
  std::string name;
  double printed = kNone;  ///< rate
};

void add_course(Context& context, const char* panel, const std::string& series,
                const Course& course) {
  for (const Sample& s : course.samples)
    context.results.points.push_back(
        {kFigure10, panel, series, static_cast<double>(s.cycle), s.error, false});
}

// Cycles of the paper's solver.
void run_case(Context& context, const Problem& problem, double density, const char* panel,
              const Case& one) {
  context.doing(text(kFigure10, ": ", one.name));
  std::vector<double> solution;
  {
    Machine fast(problem, fast_backend(context.all_threads), density);
    fast.find_solution();
    solution = fast.solution();
    const Course course = fast.run(default_solver(), {kLongest, 0, kFloor});
    context.results.add(
        {kFigure10, one.name, kKerfMethod, "rate", "1", kNone, course.rate(kFloor)});
    add_course(context, panel, one.name + ": Kerf", course);
  }
  Machine plain(problem, reference_backend(context.all_threads), density);
  plain.take_solution(std::move(solution));
  const Course course = plain.run(paper_solver(), {kLongest, 0, kFloor});
  context.results.add(
      {kFigure10, one.name, kPaperMethod, "rate", "1", one.printed, course.rate(kFloor)});
  context.results.add({kFigure10, one.name, kPaperMethod, "error after three cycles", "1", kNone,
                       course.error_after(3)});
  add_course(context, panel, one.name, course);
}

SimulationSetup prepared(Context& context, SimulationSetup setup, bool duplicate) {
  setup.solver.duplicate_cells = duplicate;
  return fitted(context, std::move(setup));
}

void run_cuts(Context& context) {
  constexpr const char* kPanel = "cube";
  const int refinement = context.size == bench::Size::small ? kSmallRefinement : kRefinement;
  run_case(context, Problem(prepared(context, cube(context.size, refinement), true)), 1, kPanel,
           {"uncut", 0.66});
  for (const bool turned : {false, true}) {
    const std::string name = turned ? "rotated cut" : "aligned cut";
    const SimulationSetup setup =
        cube_with_comb(context.size, refinement, kBlades, turned ? kTurn : 0);
    run_case(context, Problem(prepared(context, setup, true)), 1, kPanel, {name, 0.75});
    run_case(context, Problem(prepared(context, setup, false)), 1, kPanel,
             {name + " merged by place", kNone});
  }
}

// At half the resolution of the paper: its solver runs on the readable backend alone.
void run_masses(Context& context) {
  BodyInfo half = body("Armadillo");
  half.resolution /= 2;
  --half.refinement;
  std::optional<SimulationSetup> setup = setup_of(context, half, Grid::adaptive);
  if (!setup) return;
  for (const double density : {100.0, 10.0, 1.0, 0.1, 0.0}) {
    setup->time.mode = density == 0 ? TimeMode::statics : TimeMode::dynamic;
    run_case(context, Problem(*setup), density, "armadillo",
             {text("armadillo at half size: ",
                   density == 0 ? std::string("static") : text("mass x ", density)),
              density == 0 ? 0.85 : kNone});
  }
}

}  // namespace

void run_figure10(Context& context) {
  run_cuts(context);
  run_masses(context);
}

}  // namespace kerf::papers
