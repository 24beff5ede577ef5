// SPDX-License-Identifier: MIT
#include <cstdio>

#include "app/commands.hpp"
#include "bench/command_line.hpp"
#include "bench/cutting/figures.hpp"
#include "bench/cutting/options.hpp"
#include "bench/cutting/scenes.hpp"
#include "bench/progress.hpp"
#include "core/base/error.hpp"

namespace {

using namespace kerf;
using namespace kerf::cutting;
using bench::formatted;

void print_head() {
  std::printf("%-13s %-14s %5s %9s %9s %10s %6s %10s %6s %9s %7s %6s\n", "scene", "method", "size",
              "cells", "unknowns", "error", "order", "energy_err", "order", "spread", "seconds",
              "MiB");
}

void print_row(const Record& r) {
  constexpr double kMiB = 1 << 20;
  std::printf("%-13s %-14s %5d %9zu %9zu %10s %6s %10s %6s %9s %7.2f %6.1f\n", r.scene.c_str(),
              r.method.c_str(), r.size, r.cost.cells, r.cost.unknowns,
              formatted("%.3e", r.error).c_str(), formatted("%.2f", r.order).c_str(),
              formatted("%.3e", r.energy_error).c_str(), formatted("%.2f", r.energy_order).c_str(),
              formatted("%.1e", r.spread).c_str(), r.cost.seconds(), r.cost.bytes / kMiB);
  std::fflush(stdout);
}

int measure(const Options& options) {
  const bench::Origin origin = bench::origin_of(options.machine);
  std::vector<Record> records;
  // Before anything is run, so that a bad name is not found at the end, and after each run, so that
  // one that is stopped leaves what it has.
  const auto save = [&] {
    if (!options.json.empty()) write_json(options.json, records, origin);
  };
  save();
  bench::Progress progress;
  int status = kDone;
  print_head();
  for (const std::string& name : options.scenes) {
    const Scene& scene = find_scene(name);
    std::vector<int> sizes = options.sizes.empty() ? scene.sizes : options.sizes;
    if (options.smallest) sizes = {scene.sizes.front()};
    for (const Method method : options.methods)
      for (const int size : sizes) {
        const std::string what = text("kerf_cutting: ", name, ", ", name_of(method), ", ", size);
        progress.show(what);
        try {
          records.push_back(run_scene(scene, method, size, options.threads));
        } catch (const Error& error) {
          if (error.kind() != ErrorKind::bad_input) throw;
          // At some sizes a blade takes off a piece that nothing holds; the others can still run.
          progress.clear();
          std::fprintf(stderr, "%s: left out: %s\n", what.c_str(), error.what());
          status = kBadInput;
          continue;
        }
        add_orders(records);
        progress.clear();
        print_row(records.back());
        save();
      }
  }
  return status;
}

int run(int argc, char** argv) {
  const Options options = parse_options(argc, argv);
  if (options.help) {
    std::fputs(usage().c_str(), stdout);
  } else if (options.list) {
    std::fputs(listing().c_str(), stdout);
  } else if (!options.table.empty()) {
    std::fputs(markdown_tables(read_json(options.table)).c_str(), stdout);
  } else if (!options.plot.empty()) {
    write_plot(read_json(options.plot), options.svg);
  } else {
    return measure(options);
  }
  return kDone;
}

}  // namespace

int main(int argc, char** argv) {
  return bench::run_program("kerf_cutting", "choose smaller --sizes",
                            [&] { return run(argc, argv); });
}
