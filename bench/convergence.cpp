// SPDX-License-Identifier: MIT
//
// Prints the tables of docs/convergence.md as Markdown:
//   kerf_convergence            everything (minutes)
//   kerf_convergence cube comb  some of: cube omega comb levels rotated
#include <cstdio>
#include <cstring>
#include <numbers>
#include <string>
#include <vector>

#include "bench/linear_problem.hpp"
#include "scenes/comb.hpp"

namespace {

using namespace kerf;
using bench::Convergence;
using bench::LinearProblem;
using bench::ProblemSetup;

constexpr double kTilt = std::numbers::pi / 6;
constexpr int kBlades = 4;

std::vector<TriangleMesh> comb(bool rotated) {
  return scenes::comb(1.0, kBlades, 0.5, rotated ? kTilt : 0.0);
}

SolverSetup solver(CycleType cycle, SmootherType smoother, double omega = 1.0) {
  SolverSetup out;
  out.cycle = cycle;
  out.smoother = smoother;
  out.omega = omega;
  return out;
}

const char* name(CycleType type) {
  return type == CycleType::v   ? "V"
         : type == CycleType::w ? "W"
         : type == CycleType::k ? "K"
                                : "auto";
}

std::string count(int iterations) { return iterations < 0 ? "-" : std::to_string(iterations); }

std::string levels_of(const Convergence& c) {
  std::string out;
  for (const auto v : c.vertices) out += (out.empty() ? "" : " / ") + std::to_string(v);
  return out;
}

void head(const char* title, const char* first) {
  std::printf(
      "\n### %s\n\n| %s | factor | CG 1e-6 | CG 1e-10 | three cycles | ms a cycle | vertices by "
      "level |\n"
      "|---|---|---|---|---|---|---|\n",
      title, first);
}

void row(const std::string& first, const ProblemSetup& setup) {
  LinearProblem problem(setup);
  const Convergence c = problem.measure();
  std::printf("| %s | %.3f | %s | %s | %.2g | %.0f | %s |\n", first.c_str(), c.factor,
              count(c.cg_1e6).c_str(), count(c.cg_1e10).c_str(), c.three_cycles,
              1e3 * c.seconds_per_cycle, levels_of(c).c_str());
  std::fflush(stdout);
}

void cube() {
  head("Clamped cube, nu 0.3, static", "cells, cycle");
  for (const int n : {32, 64, 96}) {
    ProblemSetup setup;
    setup.cells = n;
    setup.solver = solver(CycleType::v, SmootherType::gauss_seidel);
    row(std::to_string(n) + "^3, V(1,1) Gauss-Seidel", setup);
    setup.solver = solver(CycleType::v, SmootherType::chebyshev);
    row(std::to_string(n) + "^3, V(1,1) Chebyshev 2", setup);
  }
}

void omega() {
  head("Over-relaxation: clamped cube 32^3, nu 0.3, V(1,1) Gauss-Seidel", "omega");
  for (const double w : {1.0, 1.15, 1.3, 1.5, 1.7}) {
    ProblemSetup setup;
    setup.solver = solver(CycleType::v, SmootherType::gauss_seidel, w);
    char text[16];
    std::snprintf(text, sizeof text, "%.2f", w);
    row(text, setup);
  }
}

void combs() {
  head("Duplicated cells against merging by place: comb cut, 32^3, nu 0.3",
       "comb, mass, hierarchy, cycle");
  for (const bool rotated : {false, true})
    for (const double courant : {0.0, 1.0})
      for (const bool duplicate : {true, false})
        for (const CycleType cycle : {CycleType::v, CycleType::k}) {
          ProblemSetup setup;
          setup.blades = comb(rotated);
          setup.courant = courant;
          setup.solver = solver(cycle, SmootherType::chebyshev);
          setup.solver.duplicate_cells = duplicate;
          setup.solver.max_cycles = 1000;
          row(std::string(rotated ? "rotated" : "aligned") + ", " +
                  (courant > 0 ? "dynamic" : "static") + ", " +
                  (duplicate ? "duplicated" : "by place") + ", " + name(cycle),
              setup);
        }
}

void by_levels() {
  head("Cycle types by number of levels: rotated comb, 32^3, nu 0.4, static, Chebyshev 2",
       "levels, cycle");
  for (const int levels : {2, 3, 4, 5})
    for (const CycleType cycle : {CycleType::v, CycleType::w, CycleType::k}) {
      ProblemSetup setup;
      setup.blades = comb(true);
      setup.poisson = 0.4;
      setup.solver = solver(cycle, SmootherType::chebyshev);
      setup.solver.max_levels = levels;
      setup.solver.coarsest_vertices = 20;
      row(std::to_string(levels) + ", " + name(cycle), setup);
    }
}

void rotated() {
  head("The default on the rotated comb, nu 0.4, static", "cells, cycle");
  for (const int n : {32, 48}) {
    ProblemSetup setup;
    setup.cells = n;
    setup.blades = comb(true);
    setup.poisson = 0.4;
    row(std::to_string(n) + "^3, default", setup);
    setup.solver = solver(CycleType::automatic, SmootherType::gauss_seidel);
    row(std::to_string(n) + "^3, default with Gauss-Seidel", setup);
    setup.solver = solver(CycleType::v, SmootherType::chebyshev);
    row(std::to_string(n) + "^3, V", setup);
  }
}

}  // namespace

int main(int argc, char** argv) {
  const struct {
    const char* name;
    void (*run)();
  } sections[] = {{"cube", cube},
                  {"omega", omega},
                  {"comb", combs},
                  {"levels", by_levels},
                  {"rotated", rotated}};
  for (int i = 1; i < argc; ++i) {
    bool known = false;
    for (const auto& section : sections) known = known || std::strcmp(argv[i], section.name) == 0;
    if (known) continue;
    std::fprintf(stderr,
                 "kerf_convergence: no table '%s'; there are: cube omega comb levels rotated\n",
                 argv[i]);
    return 2;
  }
  for (const auto& section : sections) {
    bool wanted = argc == 1;
    for (int i = 1; i < argc; ++i) wanted = wanted || std::strcmp(argv[i], section.name) == 0;
    if (wanted) section.run();
  }
}
