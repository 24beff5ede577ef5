// SPDX-License-Identifier: MIT
#include "bench/csv.hpp"

#include <charconv>
#include <cmath>
#include <fstream>
#include <map>
#include <sstream>

#include "core/base/error.hpp"

namespace kerf::bench {
namespace {

std::string field(double value, int digits = 6) {
  if (std::isnan(value)) return "";
  std::ostringstream out;
  out.precision(digits);
  out << value;
  return out.str();
}

std::vector<std::string> split(const std::string& line) {
  std::vector<std::string> out;
  std::istringstream in(line);
  for (std::string part; std::getline(in, part, ',');) out.push_back(part);
  if (!line.empty() && line.back() == ',') out.emplace_back();
  return out;
}

}  // namespace

void write_csv(const std::filesystem::path& file, const std::vector<Row>& rows,
               const Origin& origin) {
  constexpr int kCountDigits = 15;
  std::ostringstream out;
  out << "scene,backend,threads,precision,cells,vertices,levels,phase,ms_min,ms_median,"
         "ns_per_cell,gb_per_s,residual,state_hash,commit,build,machine,of_ceiling,peak_bytes,"
         "launches,bytes_copied\n";
  for (const Row& r : rows)
    out << r.scene << ',' << r.backend << ',' << r.threads << ',' << r.precision << ','
        << field(r.cells, kCountDigits) << ',' << field(r.vertices, kCountDigits) << ','
        << (r.levels > 0 ? std::to_string(r.levels) : "") << ',' << r.phase << ','
        << field(r.ms_min) << ',' << field(r.ms_median) << ',' << field(r.ns_per_cell) << ','
        << field(r.gb_per_s) << ',' << field(r.residual) << ',' << r.state_hash << ','
        << origin.commit << ',' << origin.build << ',' << origin.machine << ','
        << field(r.of_ceiling, 3) << ',' << field(r.peak_bytes, kCountDigits) << ','
        << field(r.launches, kCountDigits) << ',' << field(r.bytes_copied, kCountDigits) << '\n';
  std::ofstream stream(file);
  stream << out.str();
  stream.close();
  expects(stream.good(), text("--csv ", file.string(), ": cannot be written"));
}

std::vector<Row> read_csv(const std::filesystem::path& file) {
  std::ifstream in(file);
  expects(in.good(), text(file.string(), ": cannot be read"));
  std::string line;
  std::getline(in, line);
  std::map<std::string, std::size_t> column;
  for (const std::string& name : split(line)) column.emplace(name, column.size());
  for (const char* name :
       {"scene", "backend", "threads", "precision", "cells", "phase", "ns_per_cell"})
    expects(column.contains(name), text(file.string(), ":1: the column ", name, " is missing"));

  std::vector<Row> out;
  for (int number = 2; std::getline(in, line); ++number) {
    const std::vector<std::string> parts = split(line);
    const auto at = [&](const char* name) {
      const auto found = column.find(name);
      return found != column.end() && found->second < parts.size() ? parts[found->second]
                                                                   : std::string();
    };
    const auto value = [&](const char* name) {
      const std::string text_of = at(name);
      if (text_of.empty()) return kNone;
      double result = 0;
      const auto end = text_of.data() + text_of.size();
      const auto [stop, error] = std::from_chars(text_of.data(), end, result);
      expects(error == std::errc() && stop == end,
              text(file.string(), ":", number, ": ", name, " is no number: '", text_of, "'"));
      return result;
    };
    Row row;
    row.scene = at("scene");
    row.backend = at("backend");
    row.precision = at("precision");
    row.phase = at("phase");
    row.cells = value("cells");
    row.ns_per_cell = value("ns_per_cell");
    const double threads = value("threads");
    expects(threads >= 1 && row.cells > 0 && row.ns_per_cell >= 0,
            text(file.string(), ":", number, ": threads, cells or ns_per_cell is missing"));
    row.threads = static_cast<int>(threads);
    out.push_back(std::move(row));
  }
  return out;
}

}  // namespace kerf::bench
