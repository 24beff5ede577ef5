// SPDX-License-Identifier: MIT
#include "bench/options.hpp"

#include <functional>
#include <iomanip>
#include <map>
#include <sstream>

#include "bench/candidates.hpp"
#include "bench/command_line.hpp"
#include "bench/phases.hpp"
#include "core/base/error.hpp"

namespace kerf::bench {
namespace {

constexpr const char* kAll = "all";

Names scene_names() {
  Names out = names_of(scenes());
  out.emplace_back("machine");  // the ceilings alone
  return out;
}

// Powers of two below the number of cores, and that number.
std::vector<int> all_threads() {
  std::vector<int> out;
  for (int n = 1; n < cores(); n *= 2) out.push_back(n);
  out.push_back(cores());
  return out;
}

std::vector<int> choose_threads(const std::string& list) {
  if (list == kAll) return all_threads();
  return numbers("--threads", list, 1024);
}

using Setter = std::function<void(Options&, const std::string&)>;

const std::map<std::string, Setter>& setters() {
  static const std::map<std::string, Setter> all{
      {"--scene",
       [](Options& o, const std::string& v) {
         o.scenes = choose("--scene", "scene", v, scene_names());
       }},
      {"--backend",
       [](Options& o, const std::string& v) {
         o.backends = choose("--backend", "backend", v, names_of(candidates()));
         o.all_backends = v == kAll;
       }},
      {"--compare",
       [](Options& o, const std::string& v) {
         o.compare = split(v);
         expects(o.compare.size() == 2, "--compare needs two backends, as in cpu,cuda");
         o.backends = choose("--compare", "backend", v, names_of(candidates()));
       }},
      {"--threads", [](Options& o, const std::string& v) { o.threads = choose_threads(v); }},
      {"--precision",
       [](Options& o, const std::string& v) {
         o.precisions = choose("--precision", "precision", v, {"mixed", "double"});
         o.all_precisions = v == kAll;
       }},
      {"--phase",
       [](Options& o, const std::string& v) {
         o.phases = choose("--phase", "phase", v, names_of(phases()));
       }},
      {"--repeat",
       [](Options& o, const std::string& v) { o.repeat = number("--repeat", v, 1, 1000); }},
      {"--seconds",
       [](Options& o, const std::string& v) { o.seconds = number("--seconds", v, 0.0, 1e6); }},
      {"--give-up",
       [](Options& o, const std::string& v) { o.give_up = number("--give-up", v, 0.0, 1e6); }},
      {"--size", [](Options& o, const std::string& v) { o.size = size_named(v); }},
      {"--csv", [](Options& o, const std::string& v) { o.csv = v; }},
      {"--meshes", [](Options& o, const std::string& v) { o.meshes = v; }},
      {"--machine", [](Options& o, const std::string& v) { o.machine = v; }},
      {"--plot", [](Options& o, const std::string& v) { o.plot = v; }},
      {"--svg", [](Options& o, const std::string& v) { o.svg = v; }}};
  return all;
}

void check(const Options& o) {
  if (o.list || o.help) return;
  expects(o.plot.empty() == o.svg.empty(), "--plot FILE.csv and --svg FILE.svg go together");
  expects(o.scenes.empty() != o.plot.empty(),
          "give either --scene or --plot; --list names the scenes, --help all options");
}

}  // namespace

Options parse_options(int argc, const char* const* argv) {
  Options out;
  out.threads = {cores()};
  out.phases = names_of(phases());
  read_arguments(argc, argv, setters(), out);
  check(out);
  return out;
}

std::string usage() {
  return "usage: kerf_bench --scene A,B [options]    run and print a table\n"
         "       kerf_bench --plot FILE.csv --svg FILE.svg\n"
         "       kerf_bench --list                   scenes, backends, phases\n"
         "\n"
         "  --backend LIST     what runs (default: cpu)\n"
         "  --compare A,B      runs these two backends; ends with a table of both side by side\n"
         "  --threads LIST     numbers of threads (default: all cores)\n"
         "  --precision LIST   mixed, double (default: double)\n"
         "  --phase LIST       what is timed (default: all)\n"
         "  --repeat N         runs of each after one that warms up (default: 5); short ones more\n"
         "  --seconds S        no further run of what has taken so long (default: no limit)\n"
         "  --give-up S        longest run of a solve; beyond, it has no row (default: no limit)\n"
         "  --size full|small  small: for a quick look and for tests\n"
         "  --csv FILE         write the table there too\n"
         "  --meshes DIR       where real meshes are (default: $KERF_MESHES, ../shared/meshes)\n"
         "  --machine NAME     for the column of that name (default: from the processor)\n"
         "\n"
         "A list is names with commas between, or `all`.\n"
         "Exit status: 0 done; 2 bad input; 4 no such backend or out of memory.\n";
}

std::string listing() {
  std::ostringstream out;
  const auto part = [&](const char* title, const auto& table) {
    out << title << '\n';
    for (const auto& entry : table)
      out << "  " << std::left << std::setw(21) << entry.name << entry.what << '\n';
  };
  part("scenes", scenes());
  out << "  " << std::left << std::setw(21) << "machine"
      << "no body: the ceilings alone, which every run measures\n";
  part("backends and baselines", candidates());
  part("phases", phases());
  return out.str();
}

}  // namespace kerf::bench
