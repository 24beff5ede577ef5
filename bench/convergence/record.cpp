// SPDX-License-Identifier: MIT
#include "bench/convergence/record.hpp"

#include <charconv>
#include <cmath>
#include <sstream>

#include "core/base/error.hpp"

namespace kerf::convergence {
namespace {

using bench::csv_field;

std::string joined(const std::vector<std::int32_t>& vertices) {
  std::string out;
  for (const auto v : vertices) out += (out.empty() ? "" : "/") + std::to_string(v);
  return out;
}

std::vector<std::int32_t> parted(const std::string& words, const std::string& where) {
  std::vector<std::int32_t> out;
  const char *at = words.data(), *const end = at + words.size();
  while (at < end) {
    const auto [stop, error] = std::from_chars(at, end, out.emplace_back());
    expects(error == std::errc() && (stop == end || *stop == '/'),
            text(where, ": vertices are no numbers with / between: '", words, "'"));
    at = stop + 1;
  }
  return out;
}

}  // namespace

void write_csv(const std::filesystem::path& file, const std::vector<Record>& records,
               const bench::Origin& origin) {
  std::ostringstream out;
  out << "table,case,body,cells,levels,vertices,hierarchy,cycle,smoother,sweeps,omega,poisson,"
         "courant,factor,cg_1e6,cg_1e10,three_cycles,seconds_per_cycle,commit,build,machine\n";
  for (const Record& r : records)
    out << r.table << ',' << csv_field(r.label) << ',' << r.body << ',' << r.cells << ','
        << r.levels() << ',' << joined(r.vertices) << ',' << r.hierarchy << ',' << r.cycle << ','
        << r.smoother << ',' << r.sweeps << ',' << csv_field(r.omega) << ',' << csv_field(r.poisson)
        << ',' << csv_field(r.courant) << ',' << csv_field(r.factor) << ',' << csv_field(r.cg_1e6)
        << ',' << csv_field(r.cg_1e10) << ',' << csv_field(r.three_cycles) << ','
        << csv_field(r.seconds_per_cycle) << ',' << origin.commit << ',' << origin.build << ','
        << origin.machine << '\n';
  bench::write_file(file, out.str(), "--csv");
}

std::vector<Record> read_csv(const std::filesystem::path& file) {
  bench::CsvReader in(file, {"table", "case", "body", "cells", "vertices", "factor"});
  std::vector<Record> out;
  while (in.next()) {
    Record r;
    r.table = in.at("table");
    r.label = in.at("case");
    r.body = in.at("body");
    const double cells = in.value("cells");
    expects(cells >= 1, text(in.where(), ": cells is missing"));
    r.cells = static_cast<int>(cells);
    r.vertices = parted(in.at("vertices"), in.where());
    const std::pair<const char*, std::string Record::*> words[] = {
        {"hierarchy", &Record::hierarchy},
        {"cycle", &Record::cycle},
        {"smoother", &Record::smoother},
        {"sweeps", &Record::sweeps}};
    for (const auto& [column, member] : words) r.*member = in.at(column);
    const std::pair<const char*, double Record::*> numbers[] = {
        {"omega", &Record::omega},
        {"poisson", &Record::poisson},
        {"courant", &Record::courant},
        {"factor", &Record::factor},
        {"cg_1e6", &Record::cg_1e6},
        {"cg_1e10", &Record::cg_1e10},
        {"three_cycles", &Record::three_cycles},
        {"seconds_per_cycle", &Record::seconds_per_cycle}};
    for (const auto& [column, member] : numbers) r.*member = in.value(column);
    out.push_back(std::move(r));
  }
  expects(!out.empty(), text(file.string(), ": has no row"));
  return out;
}

}  // namespace kerf::convergence
