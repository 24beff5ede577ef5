// SPDX-License-Identifier: MIT
#include "bench/cutting/options.hpp"

#include <algorithm>
#include <charconv>
#include <iomanip>
#include <map>
#include <sstream>
#include <thread>

#include "app/scene_toml.hpp"
#include "bench/cutting/scenes.hpp"
#include "core/base/error.hpp"

namespace kerf::cutting {
namespace {

using Names = std::vector<std::string>;

Names split(const std::string& list) {
  Names out;
  std::istringstream in(list + ",");
  for (std::string one; std::getline(in, one, ',');) out.push_back(one);
  return out;
}

template <class Table>
Names names_of(const Table& table) {
  Names out;
  for (const auto& entry : table) out.emplace_back(entry.name);
  return out;
}

std::string unknown(const std::string& kind, const std::string& name, const Names& known) {
  const std::string near = nearest_name(name, known);
  if (!near.empty()) return text("no ", kind, " '", name, "'; did you mean '", near, "'?");
  std::string all;
  for (const std::string& one : known) all += (all.empty() ? "" : ", ") + one;
  return text("no ", kind, " '", name, "'; there are: ", all);
}

Names choose(const std::string& kind, const std::string& list, const Names& known) {
  if (list == "all") return known;
  Names out;
  for (const std::string& name : split(list)) {
    expects(std::find(known.begin(), known.end(), name) != known.end(), unknown(kind, name, known));
    if (std::find(out.begin(), out.end(), name) == out.end()) out.push_back(name);
  }
  return out;
}

int number(const std::string& option, const std::string& value, int most) {
  int out = 0;
  const char* end = value.data() + value.size();
  const auto [stop, error] = std::from_chars(value.data(), end, out);
  expects(error == std::errc() && stop == end && out >= 1 && out <= most,
          text(option, " must be a number from 1 to ", most, ", not '", value, "'"));
  return out;
}

void set_methods(Options& o, const std::string& list) {
  o.methods.clear();
  const Names chosen = choose("method", list, names_of(methods()));
  for (const std::string& name : chosen)
    for (const MethodInfo& info : methods())
      if (name == info.name) o.methods.push_back(info.method);
}

void set_sizes(Options& o, const std::string& list) {
  constexpr int kMost = 1024;
  o.sizes.clear();
  o.smallest = list == "smallest";
  if (o.smallest) return;
  for (const std::string& one : split(list)) o.sizes.push_back(number("--sizes", one, kMost));
  std::sort(o.sizes.begin(), o.sizes.end());
  o.sizes.erase(std::unique(o.sizes.begin(), o.sizes.end()), o.sizes.end());
}

using Setter = void (*)(Options&, const std::string&);

const std::map<std::string, Setter>& setters() {
  static const std::map<std::string, Setter> all{
      {"--scene",
       [](Options& o, const std::string& v) { o.scenes = choose("scene", v, names_of(scenes())); }},
      {"--method", set_methods},
      {"--sizes", set_sizes},
      {"--threads",
       [](Options& o, const std::string& v) { o.threads = number("--threads", v, 1024); }},
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
  out.threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  set_methods(out, "all");
  for (int i = 1; i < argc; ++i) {
    const std::string name = argv[i];
    if (name == "--list" || name == "--help" || name == "-h") {
      (name == "--list" ? out.list : out.help) = true;
      continue;
    }
    const auto setter = setters().find(name);
    if (setter == setters().end()) {
      Names known{"--list", "--help"};
      for (const auto& [option, set] : setters()) known.push_back(option);
      throw Error(ErrorKind::bad_input, unknown("option", name, known));
    }
    expects(i + 1 < argc && argv[i + 1][0] != '\0', name + " needs a value");
    setter->second(out, argv[++i]);
  }
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
