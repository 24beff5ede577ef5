// SPDX-License-Identifier: MIT
#include "bench/convergence/options.hpp"

#include <functional>
#include <iomanip>
#include <map>
#include <sstream>

#include "bench/command_line.hpp"
#include "bench/convergence/tables.hpp"
#include "core/base/error.hpp"

namespace kerf::convergence {
namespace {

using Setter = std::function<void(Options&, const std::string&)>;

const std::map<std::string, Setter>& setters() {
  static const std::map<std::string, Setter> all{
      {"--table",
       [](Options& o, const std::string& v) {
         o.tables = bench::choose("--table", "table", v, bench::names_of(tables()));
       }},
      {"--size", [](Options& o, const std::string& v) { o.size = bench::size_named(v); }},
      {"--threads",
       [](Options& o, const std::string& v) {
         o.threads = bench::number("--threads", v, 1, 1024);
       }},
      {"--csv", [](Options& o, const std::string& v) { o.csv = v; }},
      {"--machine", [](Options& o, const std::string& v) { o.machine = v; }},
      {"--markdown", [](Options& o, const std::string& v) { o.markdown = v; }},
      {"--plot", [](Options& o, const std::string& v) { o.plot = v; }},
      {"--svg", [](Options& o, const std::string& v) { o.svg = v; }}};
  return all;
}

void check(const Options& o) {
  if (o.list || o.help) return;
  expects(o.plot.empty() == o.svg.empty(), "--plot FILE.csv and --svg FILE.svg go together");
  const int tasks =
      (o.tables.empty() ? 0 : 1) + (o.plot.empty() ? 0 : 1) + (o.markdown.empty() ? 0 : 1);
  expects(tasks == 1,
          "give one of --table, --markdown and --plot; --list names the tables, --help all "
          "options");
}

}  // namespace

Options parse_options(int argc, const char* const* argv) {
  Options out;
  out.threads = bench::cores();
  bench::read_arguments(argc, argv, setters(), out);
  check(out);
  return out;
}

std::string usage() {
  return "usage: kerf_convergence --table A,B [options]    run and print\n"
         "       kerf_convergence --markdown FILE.csv      the tables of docs/convergence.md\n"
         "       kerf_convergence --plot FILE.csv --svg FILE.svg\n"
         "       kerf_convergence --list                   the tables\n"
         "\n"
         "  --size full|small  small: as the tests run them (default: full)\n"
         "  --threads N        (default: all cores)\n"
         "  --csv FILE         one line for each case: docs/convergence.md\n"
         "  --machine NAME     for the column of that name (default: from the processor)\n"
         "\n"
         "A list is names with commas between, or `all`.\n"
         "Exit status: 0 done; 2 bad input; 4 out of memory.\n";
}

std::string listing() {
  std::ostringstream out;
  out << "tables\n";
  for (const Table& table : tables())
    out << "  " << std::left << std::setw(9) << table.name << table.what << '\n';
  return out.str();
}

}  // namespace kerf::convergence
