// SPDX-License-Identifier: MIT
#include "bench/papers/experiments.hpp"

#include "core/base/error.hpp"

namespace kerf::papers {

const std::vector<Experiment>& experiments() {
  static const std::vector<Experiment> all{
      {"table1", "[DGW11] table 1: cells, and seconds of cutting and of a time step", run_table1},
      {"table2", "[DGW11] table 2: multigrid against CG with Jacobi in the same time", run_table2},
      {"figure10", "[DGW11] figure 10: error over cycles, by cuts and by mass", run_figure10},
      {"figure12", "[DGW11] figure 12: error over time of four solvers", run_figure12},
      {"pictures", "[DGW11] figures 1, 11, 13, 14, 15: cells, seconds; how rods bend",
       run_pictures},
      {"survey", "[WWD15] table 2: a cut into a liver on a uniform grid and on an octree",
       run_survey}};
  return all;
}

void run(Context& context, const Experiment& experiment) {
  experiment.run(context);
  if (context.size == bench::Size::small)
    for (Figure& figure : context.results.figures)
      if (figure.experiment == experiment.name) figure.printed = kNone;
}

SimulationSetup fitted(const Context& context, SimulationSetup setup) {
  constexpr int kSmallCoarsest = 100;  // vertices
  if (context.size == bench::Size::small) setup.solver.coarsest_vertices = kSmallCoarsest;
  return setup;
}

std::optional<SimulationSetup> setup_of(Context& context, const BodyInfo& info, Grid grid) {
  std::string missing;
  std::optional<SimulationSetup> out =
      make_setup(info, grid, context.size, context.folders, missing);
  if (!out)
    context.note(text(info.name, ": left out: ", missing,
                      " is in no folder of meshes (--meshes, KERF_MESHES)"));
  if (out) out = fitted(context, *std::move(out));
  return out;
}

}  // namespace kerf::papers
