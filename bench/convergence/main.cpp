// SPDX-License-Identifier: MIT
#include <cstdio>

#include "app/commands.hpp"
#include "bench/chart.hpp"
#include "bench/command_line.hpp"
#include "bench/convergence/figures.hpp"
#include "bench/convergence/options.hpp"
#include "bench/convergence/tables.hpp"
#include "bench/progress_line.hpp"
#include "core/base/error.hpp"

namespace {

using namespace kerf;
using namespace kerf::convergence;
using bench::formatted;

void print_head() {
  std::printf("%-8s %-38s %7s %7s %8s %12s %11s\n", "table", "case", "factor", "CG 1e-6",
              "CG 1e-10", "three cycles", "ms a cycle");
}

void print_row(const Record& r) {
  std::printf("%-8s %-38s %7.3f %7s %8s %12.2g %11.1f\n", r.table.c_str(), r.label.c_str(),
              r.factor, formatted("%.0f", r.cg_1e6).c_str(), formatted("%.0f", r.cg_1e10).c_str(),
              r.three_cycles, 1e3 * r.seconds_per_cycle);
  std::fflush(stdout);
}

int measure(const Options& options) {
  const bench::Origin origin = bench::origin_of(options.machine);
  std::vector<Record> records;
  // Before anything is run, so that a bad name is not found at the end, and after each case, so
  // that a run that is stopped leaves what it has.
  const auto save = [&] {
    if (!options.csv.empty()) write_csv(options.csv, records, origin);
  };
  save();
  bench::ProgressLine progress;
  print_head();
  for (const std::string& name : options.tables) {
    const Table& table = find_table(name);
    for (const Case& one : table.cases(options.size)) {
      progress.show(text("kerf_convergence: ", name, ", ", one.label));
      records.push_back(run_case(table, one, options.threads));
      progress.clear();
      print_row(records.back());
      save();
    }
  }
  return kDone;
}

int run(int argc, char** argv) {
  const Options options = parse_options(argc, argv);
  if (options.help) {
    std::fputs(usage().c_str(), stdout);
  } else if (options.list) {
    std::fputs(listing().c_str(), stdout);
  } else if (!options.markdown.empty()) {
    std::fputs(markdown_tables(read_csv(options.markdown)).c_str(), stdout);
  } else if (!options.plot.empty()) {
    bench::write_svg(plot_svg(read_csv(options.plot)), options.svg, "--svg");
  } else {
    return measure(options);
  }
  return kDone;
}

}  // namespace

int main(int argc, char** argv) {
  return bench::run_program("kerf_convergence", "choose fewer tables",
                            [&] { return run(argc, argv); });
}
