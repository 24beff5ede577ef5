// SPDX-License-Identifier: MIT
#include "bench/csv.hpp"

#include <charconv>
#include <cmath>
#include <fstream>
#include <sstream>

#include "core/base/error.hpp"

namespace kerf::bench {
namespace {

std::vector<std::string> split(const std::string& line) {
  std::vector<std::string> out(1);
  bool quoted = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (line[i] == '"' && quoted && i + 1 < line.size() && line[i + 1] == '"')
      out.back() += line[i++];  // two quotes stand for one
    else if (line[i] == '"')
      quoted = !quoted;
    else if (line[i] == ',' && !quoted)
      out.emplace_back();
    else
      out.back() += line[i];
  }
  return out;
}

}  // namespace

std::string csv_field(double value, int digits) {
  if (std::isnan(value)) return "";
  std::ostringstream out;
  out.precision(digits);
  out << value;
  return out.str();
}

std::string csv_field(const std::string& words) {
  if (words.find_first_of(",\"") == std::string::npos) return words;
  std::string out = "\"";
  for (const char c : words) out += c == '"' ? "\"\"" : std::string(1, c);
  return out + '"';
}

void write_file(const std::filesystem::path& file, const std::string& content,
                const std::string& option) {
  std::ofstream stream(file);
  stream << content;
  stream.close();
  expects(stream.good(), text(option, " ", file.string(), ": cannot be written"));
}

CsvReader::CsvReader(const std::filesystem::path& file, const std::vector<std::string>& needed)
    : file_(file), in_(file) {
  expects(in_.good(), text(file.string(), ": cannot be read"));
  std::string line;
  std::getline(in_, line);
  for (const std::string& name : split(line)) column_.emplace(name, column_.size());
  for (const std::string& name : needed)
    expects(column_.contains(name), text(file.string(), ":1: the column ", name, " is missing"));
}

bool CsvReader::next() {
  std::string line;
  if (!std::getline(in_, line)) return false;
  ++line_;
  fields_ = split(line);
  return true;
}

std::string CsvReader::at(const std::string& column) const {
  const auto found = column_.find(column);
  return found != column_.end() && found->second < fields_.size() ? fields_[found->second] : "";
}

double CsvReader::value(const std::string& column) const {
  const std::string words = at(column);
  if (words.empty()) return kNone;
  double result = 0;
  const auto end = words.data() + words.size();
  const auto [stop, error] = std::from_chars(words.data(), end, result);
  expects(error == std::errc() && stop == end,
          text(where(), ": ", column, " is no number: '", words, "'"));
  return result;
}

std::string CsvReader::where() const { return text(file_.string(), ":", line_); }

void write_csv(const std::filesystem::path& file, const std::vector<Row>& rows,
               const Origin& origin) {
  constexpr int kCountDigits = 15;
  std::ostringstream out;
  out << "scene,backend,threads,precision,cells,vertices,levels,phase,ms_min,ms_median,"
         "ns_per_cell,gb_per_s,residual,state_hash,commit,build,machine,of_ceiling,peak_bytes,"
         "launches,bytes_copied\n";
  for (const Row& r : rows)
    out << r.scene << ',' << r.backend << ',' << r.threads << ',' << r.precision << ','
        << csv_field(r.cells, kCountDigits) << ',' << csv_field(r.vertices, kCountDigits) << ','
        << (r.levels > 0 ? std::to_string(r.levels) : "") << ',' << r.phase << ','
        << csv_field(r.ms_min) << ',' << csv_field(r.ms_median) << ',' << csv_field(r.ns_per_cell)
        << ',' << csv_field(r.gb_per_s) << ',' << csv_field(r.residual) << ',' << r.state_hash
        << ',' << origin.commit << ',' << origin.build << ',' << origin.machine << ','
        << csv_field(r.of_ceiling, 3) << ',' << csv_field(r.peak_bytes, kCountDigits) << ','
        << csv_field(r.launches, kCountDigits) << ',' << csv_field(r.bytes_copied, kCountDigits)
        << '\n';
  write_file(file, out.str(), "--csv");
}

std::vector<Row> read_csv(const std::filesystem::path& file) {
  CsvReader in(file, {"scene", "backend", "threads", "precision", "cells", "phase", "ns_per_cell"});
  std::vector<Row> out;
  while (in.next()) {
    Row row;
    row.scene = in.at("scene");
    row.backend = in.at("backend");
    row.precision = in.at("precision");
    row.phase = in.at("phase");
    row.cells = in.value("cells");
    row.ns_per_cell = in.value("ns_per_cell");
    const double threads = in.value("threads");
    expects(threads >= 1 && row.cells > 0 && row.ns_per_cell >= 0,
            text(in.where(), ": threads, cells or ns_per_cell is missing"));
    row.threads = static_cast<int>(threads);
    out.push_back(std::move(row));
  }
  return out;
}

}  // namespace kerf::bench
