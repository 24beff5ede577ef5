// SPDX-License-Identifier: MIT
#include "bench/convergence/figures.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "bench/chart.hpp"
#include "bench/command_line.hpp"
#include "bench/convergence/tables.hpp"
#include "core/base/error.hpp"

namespace kerf::convergence {
namespace {

using bench::formatted;

std::vector<Record> rows_of(const Table& table, const std::vector<Record>& records) {
  std::vector<Record> out;
  for (const Record& r : records)
    if (r.table == table.name) out.push_back(r);
  return out;
}

// The number of cells is in the title where all rows have the same, and in their labels else.
void markdown_table(const Table& table, const std::vector<Record>& rows, std::ostream& out) {
  const bool same = std::all_of(rows.begin(), rows.end(),
                                [&](const Record& r) { return r.cells == rows[0].cells; });
  out << "\n### " << table.what << (same ? text(", ", rows[0].cells, "^3") : "") << "\n\n| "
      << table.label_of
      << " | factor | CG 1e-6 | CG 1e-10 | three cycles | vertices by level |\n"
         "|---|---|---|---|---|---|\n";
  for (const Record& r : rows) {
    out << "| " << r.label << " | " << formatted("%.3f", r.factor) << " | "
        << formatted("%.0f", r.cg_1e6) << " | " << formatted("%.0f", r.cg_1e10) << " | "
        << formatted("%.2g", r.three_cycles) << " | ";
    for (std::size_t i = 0; i < r.vertices.size(); ++i)
      out << (i > 0 ? " / " : "") << r.vertices[i];
    out << " |\n";
  }
}

// ---- plots

/// A column that a picture is drawn over.
struct Abscissa {
  const char* column;
  const char* label;
  bool logarithmic;
  double (*of)(const Record& r);
};

const Abscissa& abscissa(const Table& table) {
  static const Abscissa all[] = {
      {"cells", "cells along an edge", true, [](const Record& r) { return double(r.cells); }},
      {"levels", "levels", false, [](const Record& r) { return double(r.levels()); }},
      {"poisson", "Poisson's ratio", false, [](const Record& r) { return r.poisson; }},
      {"omega", "omega", false, [](const Record& r) { return r.omega; }},
      {"courant", "time step in crossings; crosses: static", true,
       [](const Record& r) { return r.courant; }}};
  for (const Abscissa& one : all)
    if (table.x == std::string(one.column)) return one;
  throw Error(ErrorKind::internal, text("no picture is drawn over ", table.x));
}

/// What a curve has in common: all but its abscissa and the size.
std::string curve(const Record& r, const std::string& x) {
  std::string out = text(r.body, ", ", r.cycle, ", ", r.smoother);
  if (x != "omega" && r.omega != 1 && !std::isnan(r.omega)) out += text(" ", r.omega);
  if (r.sweeps == "forward") out += ", alone";
  if (x != "courant" && !std::isnan(r.courant)) out += ", dynamic";
  return out;
}

bench::ChartPanel panel(const Table& table, const std::vector<Record>& rows, const char* what,
                        double Record::*value) {
  const Abscissa& x = abscissa(table);
  double most = 0;
  for (const Record& r : rows) most = std::fmax(most, x.of(r));
  bench::ChartPanel out{
      text(table.name, ": ", what), x.label, what, x.logarithmic, false, {}, true};
  for (const Record& r : rows) {
    const std::string name = curve(r, table.x);
    auto at = std::find_if(out.series.begin(), out.series.end(),
                           [&](const bench::ChartSeries& s) { return s.name == name; });
    if (at == out.series.end()) at = out.series.insert(at, {name, {}});
    const std::string title = text(r.label, ": ", r.*value);
    if (std::isnan(x.of(r)))  // static, beyond the longest step
      at->crosses.push_back({3 * most, r.*value, title});
    else
      at->points.push_back({x.of(r), r.*value, title});
  }
  return out;
}

}  // namespace

std::string markdown_tables(const std::vector<Record>& records) {
  for (const Record& r : records) find_table(r.table);
  std::ostringstream out;
  for (const Table& table : tables())
    if (const auto rows = rows_of(table, records); !rows.empty()) markdown_table(table, rows, out);
  return out.str();
}

std::string plot_svg(const std::vector<Record>& records) {
  bench::Chart chart{"Convergence of cycles, and of conjugate gradients with them", {}};
  for (const Table& table : tables()) {
    const auto rows = rows_of(table, records);
    if (rows.empty() || *table.x == '\0') continue;
    chart.panels.push_back(panel(table, rows, "factor", &Record::factor));
    chart.panels.push_back(panel(table, rows, "CG iterations to 1e-6", &Record::cg_1e6));
  }
  return bench::chart_svg(chart);
}

}  // namespace kerf::convergence
