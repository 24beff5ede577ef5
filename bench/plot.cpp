// SPDX-License-Identifier: MIT
#include "bench/plot.hpp"

#include <algorithm>

#include "bench/chart.hpp"
#include "core/base/error.hpp"

namespace kerf::bench {
namespace {

std::string variant(const Row& row) {
  return text(row.backend, ", ", row.threads, row.threads == 1 ? " thread" : " threads",
              row.precision == "double" ? "" : ", " + row.precision);
}

/// The one for which `is` holds, at the end if it is new.
template <class T, class Is>
T& find_or_add(std::vector<T>& all, const Is& is, const T& fresh) {
  const auto found = std::find_if(all.begin(), all.end(), is);
  if (found != all.end()) return *found;
  all.push_back(fresh);
  return all.back();
}

}  // namespace

std::string plot_svg(const std::vector<Row>& rows) {
  Chart chart{"Nanoseconds a cell against cells of level 0, fastest run", {}, 4, true};
  for (const Row& row : rows) {
    if (row.scene == "machine" || !(row.ns_per_cell > 0)) continue;
    const std::string name = variant(row);
    ChartPanel& panel =
        find_or_add(chart.panels, [&](const ChartPanel& p) { return p.title == row.phase; },
                    {row.phase, "cells", "ns a cell", true, true, {}});
    ChartSeries& series = find_or_add(
        panel.series,
        [&](const ChartSeries& s) { return s.name == name && s.shape_name == row.scene; },
        {name, {}, row.scene, false});
    series.points.push_back({row.cells, row.ns_per_cell,
                             text(row.scene, ", ", name, ": ", row.ns_per_cell, " ns a cell")});
  }
  expects(!chart.panels.empty(),
          "the table has no row to plot, beside the ceilings of the machine");
  return chart_svg(chart);
}

void write_plot(const std::vector<Row>& rows, const std::filesystem::path& file) {
  write_svg(plot_svg(rows), file, "--svg");
}

}  // namespace kerf::bench
