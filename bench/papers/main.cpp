// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "app/commands.hpp"
#include "bench/command_line.hpp"
#include "bench/papers/criteria.hpp"
#include "bench/papers/experiments.hpp"
#include "bench/papers/options.hpp"
#include "bench/papers/report.hpp"
#include "bench/progress_line.hpp"

namespace {

using namespace kerf;
using namespace kerf::papers;

int measure(const Options& options) {
  std::filesystem::create_directories(options.out);
  const bench::Origin origin = bench::origin_of(options.machine);
  bench::ProgressLine progress;
  Context context;
  context.size = options.size;
  context.folders = bench::mesh_folders(options.meshes);
  context.threads = options.threads;
  context.all_threads = bench::cores();
  context.repeat = options.repeat;
  context.give_up = options.give_up;
  context.doing = [&](const std::string& what) { progress.show("kerf_papers: " + what); };
  context.note = [&](const std::string& what) {
    progress.clear();
    std::fprintf(stderr, "kerf_papers: %s\n", what.c_str());
  };
  // What other experiments found in that folder before stays.
  if (std::filesystem::exists(std::filesystem::path(options.out) / kFiguresFile))
    context.results = without(read_results(options.out), options.experiments);
  // Before anything is run, so that a folder that cannot be written is not found at the end, and
  // after each experiment, so that a run that is stopped leaves what it has.
  write_results(options.out, context.results, origin);
  for (const Experiment& experiment : experiments()) {
    if (std::find(options.experiments.begin(), options.experiments.end(), experiment.name) ==
        options.experiments.end())
      continue;
    papers::run(context, experiment);
    write_results(options.out, context.results, origin);
  }
  progress.clear();
  write_report(options.out, context.results);
  std::fputs(markdown(context.results).c_str(), stdout);
  return kDone;
}

int run(int argc, char** argv) {
  const Options options = parse_options(argc, argv);
  if (options.help) {
    std::fputs(usage().c_str(), stdout);
  } else if (options.list) {
    std::fputs(listing().c_str(), stdout);
  } else if (!options.render.empty()) {
    write_report(options.render, read_results(options.render));
  } else {
    return measure(options);
  }
  return kDone;
}

}  // namespace

int main(int argc, char** argv) {
  return bench::run_program("kerf_papers", "leave out the larger bodies, or use --size small",
                            [&] { return run(argc, argv); });
}
