// SPDX-License-Identifier: MIT
#include "bench/papers/options.hpp"

#include <functional>
#include <iomanip>
#include <map>
#include <sstream>

#include "bench/command_line.hpp"
#include "bench/papers/experiments.hpp"
#include "core/base/error.hpp"

namespace kerf::papers {
namespace {

using Setter = std::function<void(Options&, const std::string&)>;

const std::map<std::string, Setter>& setters() {
  static const std::map<std::string, Setter> all{
      {"--experiment",
       [](Options& o, const std::string& v) {
         o.experiments =
             bench::choose("--experiment", "experiment", v, bench::names_of(experiments()));
       }},
      {"--out", [](Options& o, const std::string& v) { o.out = v; }},
      {"--render", [](Options& o, const std::string& v) { o.render = v; }},
      {"--meshes", [](Options& o, const std::string& v) { o.meshes = v; }},
      {"--machine", [](Options& o, const std::string& v) { o.machine = v; }},
      {"--size", [](Options& o, const std::string& v) { o.size = bench::size_named(v); }},
      {"--threads",
       [](Options& o, const std::string& v) {
         o.threads = bench::number("--threads", v, 1, 1024);
       }},
      {"--repeat",
       [](Options& o, const std::string& v) { o.repeat = bench::number("--repeat", v, 1, 1000); }},
      {"--give-up", [](Options& o, const std::string& v) {
         o.give_up = bench::number("--give-up", v, 1e-9, 1e9);
       }}};
  return all;
}

void check(const Options& o) {
  if (o.list || o.help) return;
  expects(
      o.experiments.empty() != o.render.empty(),
      "give one of --experiment and --render; --list names the experiments, --help all options");
  expects(o.experiments.empty() == o.out.empty(), "--experiment and --out FOLDER go together");
}

}  // namespace

Options parse_options(int argc, const char* const* argv) {
  Options out;
  bench::read_arguments(argc, argv, setters(), out);
  check(out);
  return out;
}

std::string usage() {
  return "usage: kerf_papers --experiment A,B --out FOLDER   run; write CSV, Markdown and plots\n"
         "       kerf_papers --render FOLDER                 Markdown and plots again, from the "
         "CSV\n"
         "       kerf_papers --list                          the tables and figures\n"
         "\n"
         "  --meshes A:B     folders with bunny00.off, armadillo.obj or .off, cheese.off, "
         "liver.obj\n"
         "                   (default: KERF_MESHES, then ../shared/meshes); what is missing is "
         "left\n"
         "                   out, and said\n"
         "  --threads N      where seconds count (default: 1, as in the papers)\n"
         "  --repeat N       runs of a time step, of which the fastest counts (default: 3)\n"
         "  --give-up S      longest run of a slow solver, s (default: 30)\n"
         "  --size small     bodies of some thousand cells, to try it\n"
         "  --machine NAME   for the column of that name (default: from the processor)\n"
         "\n"
         "A list is names with commas between, or `all`.\n"
         "Exit status: 0 done; 2 bad input; 4 out of memory.\n";
}

std::string listing() {
  std::ostringstream out;
  for (const Experiment& experiment : experiments())
    out << std::left << std::setw(10) << experiment.name << experiment.what << '\n';
  out << "bodies\n";
  for (const BodyInfo& info : bodies())
    out << "  " << std::left << std::setw(30) << info.name << "scenes/" << info.scene << '\n';
  return out.str();
}

}  // namespace kerf::papers
