// SPDX-License-Identifier: MIT
//
// A program outside Kerf: it cuts a box in half, lets it sag for one step, prints its cells.
#include <cstdio>

#include "core/setup.hpp"
#include "core/simulation.hpp"
#include "cpu/cpu_backend.hpp"

int main() {
  kerf::SimulationSetup setup;
  setup.body = {kerf::make_box({{0, 0, 0}, {0.1, 0.1, 0.1}}), 8, 1};
  setup.supports = {{.box = {{-1, -1, -1}, {1, 0.001, 1}}}};
  setup.loads = {kerf::Gravity{{0, -9.81, 0}}};
  setup.cuts = {{.lines = {{{0.05, 0.2, -0.1}, {0.05, 0.2, 0.2}}, {{0.05, 0, -0.1}, {0.05, 0, 0.2}}}}};

  kerf::Simulation simulation(setup, kerf::make_cpu_backend(kerf::CpuOptions{}));
  const kerf::StepReport report = simulation.step();

  std::printf("cells %zu, links cut %zu\n", simulation.cells(), simulation.links_cut());
  return report.converged && simulation.links_cut() > 0 ? 0 : 1;
}
