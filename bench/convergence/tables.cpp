// SPDX-License-Identifier: MIT
#include "bench/convergence/tables.hpp"

#include <numbers>

#include "bench/command_line.hpp"
#include "core/base/error.hpp"
#include "scenes/comb.hpp"

namespace kerf::convergence {
namespace {

constexpr double kPaperOmega = 1.7;  // [DGW11, 6.1]
constexpr double kOmegas[] = {1.0, 1.15, 1.3, 1.5, kPaperOmega};

/// Bodies of a test have levels too, with fewer cells.
class Maker {
 public:
  explicit Maker(Size size) : small_(size == Size::small) {}

  Case cube(int cells) const {
    Case out;
    out.body = "cube";
    out.setup.cells = small_ ? cells / 4 : cells;
    if (small_) out.setup.solver.coarsest_vertices = 150;
    return out;
  }
  Case comb(bool rotated, int cells = 32) const {
    constexpr int kBlades = 4;
    Case out = cube(cells);
    if (small_) out.setup.cells = 10;  // rods of two cells, between blades on planes of the grid
    out.body = rotated ? "comb-rotated" : "comb-aligned";
    out.setup.blades = scenes::comb(1.0, kBlades, 0.5, rotated ? std::numbers::pi / 6 : 0.0);
    out.setup.solver.max_cycles = 1000;
    return out;
  }

 private:
  bool small_;
};

Case with(Case out, CycleType cycle, SmootherType smoother, double omega = 1.0) {
  out.setup.solver.cycle = cycle;
  out.setup.solver.smoother = smoother;
  out.setup.solver.omega = omega;
  return out;
}

/// As the paper runs it: V(1,1), forward before and after the coarse levels, not in CG.
Case alone(Case out, double omega) {
  out = with(out, CycleType::v, SmootherType::gauss_seidel, omega);
  out.setup.solver.method = SolverMethod::multigrid;
  return out;
}

Case named(Case out, const std::string& label) {
  out.label = label;
  return out;
}

const char* name_of(CycleType type) {
  return type == CycleType::v   ? "V"
         : type == CycleType::w ? "W"
         : type == CycleType::k ? "K"
                                : "default";
}

std::string size_of(const Case& one) { return text(one.setup.cells, "^3"); }

std::string two_digits(double value) { return bench::formatted("%.2f", value); }

std::vector<Case> cube(Size size) {
  std::vector<Case> out;
  for (const int cells : {32, 64, 96}) {
    if (size == Size::small && cells > 64) continue;
    const Case body = Maker(size).cube(cells);
    out.push_back(named(with(body, CycleType::v, SmootherType::gauss_seidel),
                        size_of(body) + ", V(1,1) Gauss-Seidel"));
    for (const int degree : {2, 1}) {
      out.push_back(named(with(body, CycleType::v, SmootherType::chebyshev),
                          text(size_of(body), ", V(1,1) Chebyshev ", degree)));
      out.back().setup.solver.degree = degree;
    }
  }
  return out;
}

std::vector<Case> depth(Size size) {
  std::vector<Case> out;
  for (const int levels : {2, 3, 4, 5})
    for (const CycleType cycle : {CycleType::v, CycleType::k}) {
      if (size == Size::small && levels > 4) continue;  // the cube has no more
      Case one = with(Maker(size).cube(32), cycle, SmootherType::chebyshev);
      one.setup.solver.max_levels = levels;
      one.setup.solver.coarsest_vertices = 10;
      out.push_back(named(std::move(one), text(levels, ", ", name_of(cycle))));
    }
  return out;
}

std::vector<Case> poisson(Size size) {
  const Case cube = Maker(size).cube(32), comb = Maker(size).comb(true);
  std::vector<Case> out;
  const auto add = [&](const char* body, const Case& like) {
    for (const double nu : {0.2, 0.3, 0.4, 0.45, 0.49}) {
      out.push_back(named(like, text(body, ", ", two_digits(nu))));
      out.back().setup.poisson = nu;
    }
  };
  add("cube, default", cube);
  add("cube, V(1,1) Gauss-Seidel", with(cube, CycleType::v, SmootherType::gauss_seidel));
  add("rotated comb, default", comb);
  return out;
}

std::vector<Case> mass(Size size) {
  const Case comb = Maker(size).comb(true);
  std::vector<Case> out;
  const auto add = [&](const std::string& solver, const Case& like) {
    for (const double courant : {0.1, 0.3, 1.0, 3.0, 10.0, 0.0}) {
      out.push_back(named(like, solver + ", " + (courant > 0 ? text(courant) : "static")));
      out.back().setup.courant = courant;
    }
  };
  add("default", comb);
  add("V", with(comb, CycleType::v, SmootherType::chebyshev));
  for (const double omega : {1.0, kPaperOmega})
    add(text("V(1,1) Gauss-Seidel ", two_digits(omega), " alone"), alone(comb, omega));
  return out;
}

std::vector<Case> omega(Size size) {
  const Case cube = Maker(size).cube(32);
  Case comb = Maker(size).comb(false);
  comb.setup.courant = 1;
  std::vector<Case> out;
  for (const double w : kOmegas)
    out.push_back(named(with(cube, CycleType::v, SmootherType::gauss_seidel, w),
                        text("cube, symmetric, ", two_digits(w))));
  for (const double w : kOmegas)
    out.push_back(named(with(comb, CycleType::v, SmootherType::gauss_seidel, w),
                        text("comb, symmetric, ", two_digits(w))));
  for (const double w : kOmegas)
    out.push_back(named(alone(comb, w), text("comb, forward, ", two_digits(w))));
  return out;
}

std::vector<Case> combs(Size size) {
  std::vector<Case> out;
  for (const bool rotated : {false, true})
    for (const double courant : {0.0, 1.0})
      for (const bool duplicate : {true, false})
        for (const CycleType cycle : {CycleType::v, CycleType::k}) {
          Case one = with(Maker(size).comb(rotated), cycle, SmootherType::chebyshev);
          one.setup.courant = courant;
          one.setup.solver.duplicate_cells = duplicate;
          out.push_back(
              named(std::move(one),
                    text(rotated ? "rotated" : "aligned", ", ", courant > 0 ? "dynamic" : "static",
                         ", ", duplicate ? "duplicated" : "by place", ", ", name_of(cycle))));
        }
  return out;
}

std::vector<Case> by_levels(Size size) {
  std::vector<Case> out;
  for (const int levels : {2, 3, 4, 5})
    for (const CycleType cycle : {CycleType::v, CycleType::w, CycleType::k}) {
      Case one = with(Maker(size).comb(true), cycle, SmootherType::chebyshev);
      one.setup.poisson = 0.4;
      one.setup.solver.max_levels = levels;
      one.setup.solver.coarsest_vertices = 20;
      out.push_back(named(std::move(one), text(levels, ", ", name_of(cycle))));
    }
  return out;
}

std::vector<Case> rotated(Size size) {
  std::vector<Case> out;
  for (const int cells : {32, 48}) {
    if (size == Size::small && cells > 32) continue;
    Case body = Maker(size).comb(true, cells);
    body.setup.poisson = 0.4;
    out.push_back(named(body, size_of(body) + ", default"));
    out.push_back(named(with(body, CycleType::automatic, SmootherType::gauss_seidel),
                        size_of(body) + ", default with Gauss-Seidel"));
    out.push_back(named(with(body, CycleType::v, SmootherType::chebyshev), size_of(body) + ", V"));
  }
  return out;
}

}  // namespace

const std::vector<Table>& tables() {
  static const std::vector<Table> all{
      {"cube", "Clamped cube, nu 0.3, static", "cells, cycle", "cells", cube},
      {"depth", "Cycle types by number of levels: clamped cube, nu 0.3, static, Chebyshev 2",
       "levels, cycle", "levels", depth},
      {"poisson", "Poisson's ratio, static", "body, cycle, nu", "poisson", poisson},
      {"mass", "From heavy to static: rotated comb, nu 0.3", "cycle, time step", "courant", mass},
      {"omega",
       "Over-relaxation: clamped cube, static, and aligned comb, dynamic; nu 0.3, V(1,1) "
       "Gauss-Seidel",
       "body, sweeps, omega", "omega", omega},
      {"comb", "Duplicated cells against merging by place: comb cut, nu 0.3",
       "comb, mass, hierarchy, cycle", "", combs},
      {"levels", "Cycle types by number of levels: rotated comb, nu 0.4, static, Chebyshev 2",
       "levels, cycle", "levels", by_levels},
      {"rotated", "The default on the rotated comb, nu 0.4, static", "cells, cycle", "", rotated}};
  return all;
}

const Table& find_table(const std::string& name) {
  for (const Table& table : tables())
    if (name == table.name) return table;
  throw Error(ErrorKind::bad_input, bench::unknown("table", name, bench::names_of(tables())));
}

Record run_case(const Table& table, const Case& one, int threads) {
  bench::ProblemSetup setup = one.setup;
  setup.solver.threads = threads;
  bench::LinearProblem problem(setup);
  const bench::Convergence c = problem.measure();
  const bool relaxes = setup.solver.smoother == SmootherType::gauss_seidel;
  const bool is_alone = setup.solver.method == SolverMethod::multigrid;
  const auto count = [](int iterations) { return iterations < 0 ? kNone : iterations; };
  Record out;
  out.table = table.name;
  out.label = one.label;
  out.body = one.body;
  out.cells = setup.cells;
  out.vertices = c.vertices;
  out.hierarchy = setup.solver.duplicate_cells ? "duplicated" : "by place";
  const CycleOptions& cycle = problem.cycle_in_use();
  out.cycle = name_of(cycle.type);
  if (cycle.type == CycleType::k && cycle.first_twice > 1)
    out.cycle = text(out.cycle, " from level ", cycle.first_twice);
  constexpr int kUnsaid = 2;  // the degree of rows that say "Chebyshev"
  out.smoother = relaxes ? "Gauss-Seidel" : "Chebyshev";
  if (!relaxes && setup.solver.degree != kUnsaid)
    out.smoother = text(out.smoother, " ", setup.solver.degree);
  out.sweeps = is_alone ? "forward" : "symmetric";
  out.omega = relaxes ? setup.solver.omega : kNone;
  out.poisson = setup.poisson;
  out.courant = setup.courant > 0 ? setup.courant : kNone;
  out.factor = c.factor;
  out.cg_1e6 = count(c.cg_1e6);
  out.cg_1e10 = count(c.cg_1e10);
  out.three_cycles = c.three_cycles;
  out.seconds_per_cycle = c.seconds_per_cycle;
  return out;
}

}  // namespace kerf::convergence
