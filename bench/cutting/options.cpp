// SPDX-License-Identifier: MIT
#include "bench/cutting/options.hpp"

#include <functional>
#include <iomanip>
#include <map>
#include <sstream>

#include "bench/command_line.hpp"
#include "bench/cutting/scenes.hpp"
#include "core/base/error.hpp"

namespace kerf::cutting {
namespace {

using bench::choose;
using bench::names_of;

void set_methods(Options& o, const std::string& list) {
  o.methods.clear();
  for (const std::string& name : choose("--method", "method", list, names_of(methods())))
    for (const MethodInfo& info : methods())
      if (name == info.name) o.methods.push_back(info.method);
}

void set_sizes(Options& o, const std::string& list) {
  constexpr int kMost = 1024;
  o.smallest = list == "smallest";
  o.sizes = o.smallest ? std::vector<int>() : bench::numbers("--sizes", list, kMost);
}

using Setter = std::function<void(Options&, const std::string&)>;

const std::map<std::string, Setter>& setters() {
  static const std::map<std::string, Setter> all{
      {"--scene",
       [](Options& o, const std::string& v) {
         o.scenes = choose("--scene", "scene", v, names_of(scenes()));
       }},
      {"--method", set_methods},
      {"--sizes", set_sizes},
      {"--threads",
       [](Options& o, const std::string& v) {
         o.threads = bench::number("--threads", v, 1, 1024);
       }},
      {"--json", [](Options& o, const std::string& v) { o.json = v; }},
      {"--machine", [](Options& o, const std::string& v) { o.machine = v; }},
      {"--plot", [](Options& o, const std::string& v) { o.plot = v; }},
      {"--svg", [](Options& o, const std::string& v) { o.svg = v; }},
      {"--table", [](Options& o, const std::string& v) { o.table = v; }}};
  return all;
}

void check(const Options& o) {
  if (o.list || o.help) return;
  expects(o.plot.empty() == o.svg.empty(), "--plot FILE.jsonl and --svg FILE.svg go together");
  const int tasks =
      (o.scenes.empty() ? 0 : 1) + (o.plot.empty() ? 0 : 1) + (o.table.empty() ? 0 : 1);
  expects(tasks == 1,
          "give one of --scene, --plot and --table; --list names the scenes, --help all options");
}

}  // namespace

Options parse_options(int argc, const char* const* argv) {
  Options out;
  out.threads = bench::cores();
  set_methods(out, "all");
  bench::read_arguments(argc, argv, setters(), out);
  check(out);
  return out;
}

std::string usage() {
  return "usage: kerf_cutting --scene A,B [options]    run and print a table\n"
         "       kerf_cutting --table FILE.jsonl       the same as Markdown, from a file\n"
         "       kerf_cutting --plot FILE.jsonl --svg FILE.svg\n"
         "       kerf_cutting --list                   scenes, their sizes, methods\n"
         "\n"
         "  --method LIST   how the body is cut (default: all)\n"
         "  --sizes LIST    cells along the length that --list names (default: those of the "
         "scene);\n"
         "                  smallest: the smallest of the scene\n"
         "  --threads N     (default: all cores)\n"
         "  --json FILE     one line of JSON for each result: docs/cutting.md\n"
         "  --machine NAME  for the key of that name (default: from the processor)\n"
         "\n"
         "A list is names with commas between, or `all`.\n"
         "Exit status: 0 done; 2 bad input, or a size that a scene cannot have; 4 out of memory.\n";
}

std::string listing() {
  std::ostringstream out;
  out << "scenes\n";
  for (const Scene& scene : scenes()) {
    out << "  " << std::left << std::setw(15) << scene.name << scene.what << "\n  " << std::setw(15)
        << ""
        << "sizes:";
    for (const int size : scene.sizes) out << ' ' << size;
    out << " cells along " << scene.size_of << '\n';
  }
  out << "methods\n";
  for (const MethodInfo& info : methods())
    out << "  " << std::left << std::setw(15) << info.name << info.what << '\n';
  return out.str();
}

}  // namespace kerf::cutting
