// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cstdio>
#include <set>

#include "app/bounded_wait.hpp"
#include "app/commands.hpp"
#include "bench/command_line.hpp"
#include "bench/compare.hpp"
#include "bench/measure.hpp"
#include "bench/options.hpp"
#include "bench/plot.hpp"
#include "bench/progress_line.hpp"
#include "gpu/cuda_backend.hpp"

namespace {

using namespace kerf;
using namespace kerf::bench;

/// The table on standard output; on a terminal, a line on standard error that says what runs.
class Console {
 public:
  void head() {
    std::printf("%-16s %-19s %-10s %7s %-9s %10s %10s %11s %8s %7s %9s\n", "scene", "phase",
                "backend", "threads", "precision", "ms_min", "ms_median", "ns_per_cell", "gb_per_s",
                "of_ceil", "residual");
  }
  void row(const Row& r) {
    clear();
    std::printf("%-16s %-19s %-10s %7d %-9s %10.4g %10.4g %11.4g %8s %7s %9s\n", r.scene.c_str(),
                r.phase.c_str(), r.backend.c_str(), r.threads, r.precision.c_str(), r.ms_min,
                r.ms_median, r.ns_per_cell, formatted("%.3g", r.gb_per_s).c_str(),
                formatted("%.2g", r.of_ceiling).c_str(), formatted("%.2g", r.residual).c_str());
    std::fflush(stdout);
  }
  void note(const std::string& line) {
    if (!notes_.insert(line).second) return;  // each once
    clear();
    std::fprintf(stderr, "kerf_bench: %s\n", line.c_str());
  }
  void progress(const std::string& line) { progress_.show(line); }

 private:
  void clear() { progress_.clear(); }

  ProgressLine progress_;
  std::set<std::string> notes_;
};

// Before anything is measured, so that a bad name is not found after an hour, and after each scene,
// so that a run that is stopped leaves what it has.
void save(const Options& options, std::vector<Row> all, const std::vector<Row>& rows) {
  if (options.csv.empty()) return;
  all.insert(all.end(), rows.begin(), rows.end());
  write_csv(options.csv, all, origin_of(options.machine));
}

int measure(const Options& options) {
  Console console;
  const Listener listener{[&](const Row& row) { console.row(row); },
                          [&](const std::string& line) { console.note(line); },
                          [&](const std::string& line) { console.progress(line); }};
  Ceilings ceilings(options.threads, options.size == Size::small);
  std::vector<Row> rows;
  save(options, {}, {});
  // Where it was asked for by name and there is none, this is the error.
  const bool gpu =
      std::find(options.backends.begin(), options.backends.end(), "cuda") != options.backends.end();
  if (gpu && (!options.all_backends || cuda_problem().empty())) ceilings.add_gpu();
  console.head();
  for (const std::string& scene : options.scenes) {
    console.progress(scene + ": measuring the machine");
    ceilings.measure();
    if (scene == "machine") continue;
    const std::vector<Row> more = measure_scene(scene, options, ceilings, listener);
    rows.insert(rows.end(), more.begin(), more.end());
    save(options, ceiling_rows(ceilings), rows);
  }
  const std::vector<Row> machine = ceiling_rows(ceilings);
  for (const Row& row : machine) console.row(row);
  save(options, machine, rows);
  if (!options.compare.empty())
    std::printf("\n%s", comparison(rows, options.compare[0], options.compare[1]).c_str());
  return kDone;
}

int run(int argc, char** argv) {
  const Options options = parse_options(argc, argv);
  if (options.help) {
    std::fputs(usage().c_str(), stdout);
  } else if (options.list) {
    std::fputs(listing().c_str(), stdout);
  } else if (!options.plot.empty()) {
    write_plot(read_csv(options.plot), options.svg);
  } else {
    return measure(options);
  }
  return kDone;
}

}  // namespace

int main(int argc, char** argv) {
  bound_waiting(argv);
  return run_program("kerf_bench", "choose a smaller scene or fewer threads at once",
                     [&] { return run(argc, argv); });
}
