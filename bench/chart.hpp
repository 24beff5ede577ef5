// SPDX-License-Identifier: MIT
//
// Charts of results as SVG, for all benches: panels of lines and markers on logarithmic or linear
// axes.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace kerf::bench {

struct ChartPoint {
  double x = 0, y = 0;
  std::string title = "";  ///< tool tip; may be empty
};

struct ChartSeries {
  std::string name;                ///< in the legend, once over all panels; the colour goes by it
  std::vector<ChartPoint> points;  ///< joined by a line in their order if `line`
  std::string shape_name = "";     ///< second legend: markers go by it; empty: circles
  bool line = true;
  bool markers = true;
  std::vector<ChartPoint> crosses = {};  ///< larger x-shaped marks in the colour of the series
};

/// Points whose coordinates are not finite, or not positive on a logarithmic axis, are left out.
struct ChartPanel {
  std::string title, x_label, y_label;
  bool log_x = true, log_y = true;
  std::vector<ChartSeries> series;
  bool from_zero = false;  ///< a linear y axis has 0 on it
};

struct Chart {
  std::string title;
  std::vector<ChartPanel> panels;
  int columns = 2;
  bool same_axes = false;  ///< all panels share their ranges, and so must agree on their kinds
};

/// @throws Error (bad_input) if there is nothing to plot.
std::string chart_svg(const Chart& chart);

/// @throws Error (bad_input) naming `option` if the file cannot be written.
void write_svg(const std::string& svg, const std::filesystem::path& file,
               const std::string& option);

}  // namespace kerf::bench
