// SPDX-License-Identifier: MIT
//
// Tables 1 and 2 of [DGW11].
#include <algorithm>
#include <cmath>

#include "bench/papers/experiments.hpp"
#include "core/base/error.hpp"

namespace kerf::papers {
namespace {

// Adds figures of one body, each beside what is printed.
class Row {
 public:
  Row(Context& context, const char* experiment, const BodyInfo& info)
      : context_(context), experiment_(experiment), body_(info.name) {}

  void add(const std::string& quantity, const char* unit, double printed, double ours,
           const std::string& method = "") {
    context_.results.add({experiment_, body_, method, quantity, unit, printed, ours});
  }

 private:
  Context& context_;
  std::string experiment_, body_;
};

// The paper's solver on the backend that has it, and Kerf's defaults.
void time_steps(Context& context, const Problem& problem, Row& row, const std::string& quantity,
                double printed) {
  std::vector<double> solution;
  {
    Machine fast(problem, fast_backend(context.threads), 1);
    fast.find_solution(Machine::kRough);
    row.add(quantity, "s", kNone, fast.step_seconds(default_solver(), context.repeat), kKerfMethod);
    solution = fast.solution();
  }
  Machine plain(problem, reference_backend(context.threads), 1);
  plain.take_solution(std::move(solution));
  row.add(quantity, "s", printed, plain.step_seconds(paper_solver(), context.repeat), kPaperMethod);
}

void table1_row(Context& context, const BodyInfo& info) {
  const Printed& printed = info.printed;
  Row row(context, "table1", info);
  context.doing(text("table1: ", info.name, ", octree"));
  std::optional<SimulationSetup> setup = setup_of(context, info, Grid::adaptive);
  if (!setup) return;
  {
    const std::unique_ptr<Backend> follower = fast_backend(context.threads);
    const Problem cut_body(*setup, follower.get());
    row.add("cells", "1", printed.cells, static_cast<double>(cut_body.cells_before()));
    row.add("cells after the cut", "1", printed.cut_cells, static_cast<double>(cut_body.cells()));
    row.add("cutting", "s", printed.cutting, cut_body.cut_times().sum());
  }
  time_steps(context, Problem(*setup), row, "step", printed.step);

  context.doing(text("table1: ", info.name, ", uniform grid"));
  setup = setup_of(context, info, Grid::uniform);
  const Problem uniform(*setup);
  row.add("cells of the uniform grid", "1", printed.uniform_cells,
          static_cast<double>(uniform.cells()));
  time_steps(context, uniform, row, "step on the uniform grid", printed.uniform_step);
}

// What CG reaches in the time that a few cycles of multigrid take.
struct Duel {
  double multigrid = kNone, multigrid_error = kNone, cg_error = kNone, cg = kNone;
  double longest = kNone;  // after so many seconds CG is given up
};

Duel duel(Machine& machine, const SolverSetup& multigrid, double give_up) {
  constexpr int kCycles = 3;
  const Course a = machine.run(multigrid, {kCycles, 0, 0});
  Duel out;
  // Without what topology asks for, as the table says.
  out.multigrid = a.samples.back().seconds - a.structure;
  out.multigrid_error = a.error_after(kCycles);
  out.longest = std::max(give_up, 2 * out.multigrid);
  const Course b =
      machine.run(method_solver(SolverMethod::cg_jacobi), {0, out.longest, out.multigrid_error});
  out.cg = b.seconds_to(out.multigrid_error);
  out.cg_error = out.cg <= out.multigrid ? out.multigrid_error : b.error_at(out.multigrid);
  return out;
}

void add(Row& row, const Duel& found, const Printed& printed, const char* method) {
  row.add("multigrid", "s", printed.multigrid, found.multigrid, method);
  row.add("error after three cycles", "1", printed.multigrid_error, found.multigrid_error, method);
  row.add("error of CG in that time", "1", printed.cg_error, found.cg_error, method);
  row.add("CG to the same error", "s", printed.cg, found.cg, method);
  if (std::isnan(found.cg)) row.add("CG given up after", "s", kNone, found.longest, method);
}

void note_given_up(Context& context, const BodyInfo& info, const char* method, const Duel& found) {
  if (std::isnan(found.cg))
    context.note(text("table2: ", info.name, ", ", method, ": CG with Jacobi was given up after ",
                      found.longest, " s (--give-up)"));
}

void table2_row(Context& context, const BodyInfo& info) {
  const std::optional<SimulationSetup> setup = setup_of(context, info, Grid::adaptive);
  if (!setup) return;
  Row row(context, "table2", info);
  const Problem problem(*setup);
  std::vector<double> solution;
  {
    context.doing(text("table2: ", info.name, ", Kerf"));
    Machine fast(problem, fast_backend(context.threads), 1);
    fast.find_solution();
    const Duel found = duel(fast, default_solver(), context.give_up);
    add(row, found, {}, kKerfMethod);
    note_given_up(context, info, kKerfMethod, found);
    solution = fast.solution();
  }
  context.doing(text("table2: ", info.name, ", as in the paper"));
  Machine plain(problem, reference_backend(context.threads), 1);
  plain.take_solution(std::move(solution));
  const Duel found = duel(plain, paper_solver(), context.give_up);
  add(row, found, info.printed, kPaperMethod);
  note_given_up(context, info, kPaperMethod, found);
}

}  // namespace

void run_table1(Context& context) {
  for (const BodyInfo& info : bodies())
    if (info.in_tables) table1_row(context, info);
}

void run_table2(Context& context) {
  for (const BodyInfo& info : bodies())
    if (info.in_tables) table2_row(context, info);
}

}  // namespace kerf::papers
