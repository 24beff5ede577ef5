// SPDX-License-Identifier: MIT
#include "bench/plot.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iomanip>
#include <sstream>

#include "core/base/error.hpp"

namespace kerf::bench {
namespace {

// All lengths in pixels.
constexpr int kColumns = 4;
constexpr double kPanelWidth = 220, kPanelHeight = 170;
constexpr double kLeft = 62, kTop = 30, kGap = 16, kTitle = 22, kLegend = 190;
constexpr double kMarker = 4;

// The first eight are told apart also by eyes that mix up red and green. Source  Okabe, Ito 2008.
constexpr const char* kColours[] = {"#0072b2", "#e69f00", "#009e73", "#cc79a7",
                                    "#d55e00", "#56b4e9", "#000000", "#a09000",
                                    "#7f7f7f", "#8c564b", "#6a3d9a", "#b2df8a"};
constexpr int kColourCount = 12;
constexpr int kShapeCount = 6;

/// Each value once, in the order in which they come.
template <class Of>
std::vector<std::string> distinct(const std::vector<Row>& rows, const Of& of) {
  std::vector<std::string> out;
  for (const Row& row : rows)
    if (std::find(out.begin(), out.end(), of(row)) == out.end()) out.push_back(of(row));
  return out;
}

std::size_t index_of(const std::vector<std::string>& all, const std::string& one) {
  return static_cast<std::size_t>(std::find(all.begin(), all.end(), one) - all.begin());
}

std::string variant(const Row& row) {
  return text(row.backend, ", ", row.threads, row.threads == 1 ? " thread" : " threads",
              row.precision == "double" ? "" : ", " + row.precision);
}

std::string escaped(const std::string& raw) {
  std::string out;
  for (const char c : raw) out += c == '<' ? "&lt;" : c == '&' ? "&amp;" : std::string(1, c);
  return out;
}

/// A logarithmic axis over `length` pixels, between tidy ends.
struct Axis {
  double low = 1e300, high = 0, length = 0;

  void add(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  void widen() {  // so that no marker sits on the frame
    low *= 0.7;
    high *= 1.4;
  }
  double at(double value) const { return length * std::log(value / low) / std::log(high / low); }
  /// Powers of ten, and where fewer than two of them fit also their double and quintuple.
  std::vector<double> ticks() const {
    for (const bool dense : {false, true}) {
      std::vector<double> out;
      for (int e = -12; e <= 15; ++e)
        for (const double factor : {1.0, 2.0, 5.0}) {
          const double value = factor * std::pow(10.0, e);
          if (value >= low && value <= high && (dense || factor == 1)) out.push_back(value);
        }
      if (out.size() >= 2 || dense) return out;
    }
    return {};
  }
};

std::string tick_text(double value) {
  char out[32];
  if (value >= 1e6)
    std::snprintf(out, sizeof out, "%gM", value / 1e6);
  else if (value >= 1e3)
    std::snprintf(out, sizeof out, "%gk", value / 1e3);
  else
    std::snprintf(out, sizeof out, "%g", value);
  return out;
}

class Plot {
 public:
  explicit Plot(std::vector<Row> rows)
      : rows_(std::move(rows)),
        phases_(distinct(rows_, [](const Row& r) { return r.phase; })),
        scenes_(distinct(rows_, [](const Row& r) { return r.scene; })),
        variants_(distinct(rows_, variant)) {
    for (const Row& row : rows_) {
      x_.add(row.cells);
      y_.add(row.ns_per_cell);
    }
    x_.widen();
    y_.widen();
    x_.length = kPanelWidth;
    y_.length = kPanelHeight;
    out_ << std::fixed << std::setprecision(1);
  }

  std::string draw() {
    const auto count = static_cast<int>(phases_.size());
    const int columns = std::min(count, kColumns), lines = (count + columns - 1) / columns;
    const double width = kLeft + columns * (kPanelWidth + kGap) + kLegend;
    const double legend_height = 16.0 * static_cast<double>(scenes_.size() + variants_.size() + 4);
    const double height =
        std::max(kTop + lines * (kPanelHeight + kGap + kTitle) + 44, kTop + kTitle + legend_height);
    out_ << "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"" << width << "\" height=\""
         << height << "\" viewBox=\"0 0 " << width << ' ' << height
         << "\" font-family=\"sans-serif\" font-size=\"11\" fill=\"#222\">\n"
         << "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n";
    label(kLeft, 18, "start", "Nanoseconds a cell against cells of level 0, fastest run", 14);
    for (int i = 0; i < count; ++i) {
      const bool lowest = i + columns >= count;
      panel(phases_[static_cast<std::size_t>(i)], kLeft + (i % columns) * (kPanelWidth + kGap),
            kTop + kTitle + i / columns * (kPanelHeight + kGap + kTitle), i % columns == 0, lowest);
    }
    legend(kLeft + columns * (kPanelWidth + kGap) + 10, kTop + kTitle);
    out_ << "</svg>\n";
    return out_.str();
  }

 private:
  void label(double x, double y, const char* anchor, const std::string& words, int size = 11) {
    out_ << "<text x=\"" << x << "\" y=\"" << y << "\" text-anchor=\"" << anchor
         << "\" font-size=\"" << size << "\">" << escaped(words) << "</text>\n";
  }

  void line(double x1, double y1, double x2, double y2) {
    out_ << "<line x1=\"" << x1 << "\" y1=\"" << y1 << "\" x2=\"" << x2 << "\" y2=\"" << y2
         << "\" stroke=\"#ddd\"/>\n";
  }

  void panel(const std::string& phase, double left, double top, bool first, bool lowest) {
    label(left, top - 6, "start", phase, 12);
    for (const double value : x_.ticks()) {
      const double x = left + x_.at(value);
      line(x, top, x, top + kPanelHeight);
      if (lowest) label(x, top + kPanelHeight + 14, "middle", tick_text(value));
    }
    for (const double value : y_.ticks()) {
      const double y = top + kPanelHeight - y_.at(value);
      line(left, y, left + kPanelWidth, y);
      if (first) label(left - 6, y + 4, "end", tick_text(value));
    }
    if (lowest) label(left + kPanelWidth / 2, top + kPanelHeight + 30, "middle", "cells");
    if (first) label(left - 6, top - 6, "end", "ns/cell");
    out_ << "<rect x=\"" << left << "\" y=\"" << top << "\" width=\"" << kPanelWidth
         << "\" height=\"" << kPanelHeight << "\" fill=\"none\" stroke=\"#888\"/>\n";
    for (const Row& row : rows_)
      if (row.phase == phase)
        marker(left + x_.at(row.cells), top + kPanelHeight - y_.at(row.ns_per_cell),
               index_of(scenes_, row.scene),
               kColours[index_of(variants_, variant(row)) % kColourCount],
               text(row.scene, ", ", variant(row), ": ", row.ns_per_cell, " ns a cell"));
  }

  // Open shapes, so that those that meet stay visible; the seventh scene is the first one filled.
  void marker(double x, double y, std::size_t shape, const std::string& colour,
              const std::string& title) {
    const double r = kMarker;
    std::ostringstream path;
    path << std::fixed << std::setprecision(1);
    const auto polygon = [&](std::initializer_list<std::pair<double, double>> points) {
      char command = 'M';
      for (const auto& [dx, dy] : points) {
        path << command << x + r * dx << ' ' << y + r * dy;
        command = 'L';
      }
      path << 'Z';
    };
    switch (shape % kShapeCount) {
      case 0:  // a circle, of two arcs
        path << 'M' << x - r << ' ' << y << 'a' << r << ' ' << r << " 0 1 0 " << 2 * r << " 0a" << r
             << ' ' << r << " 0 1 0 " << -2 * r << " 0";
        break;
      case 1:
        polygon({{-0.9, -0.9}, {0.9, -0.9}, {0.9, 0.9}, {-0.9, 0.9}});
        break;
      case 2:
        polygon({{0, -1.2}, {1.1, 0.8}, {-1.1, 0.8}});
        break;
      case 3:
        polygon({{0, 1.2}, {1.1, -0.8}, {-1.1, -0.8}});
        break;
      case 4:
        polygon({{0, -1.3}, {1.3, 0}, {0, 1.3}, {-1.3, 0}});
        break;
      default:
        polygon({{-1, -1}, {0, 0}, {1, -1}, {0, 0}, {1, 1}, {0, 0}, {-1, 1}, {0, 0}});
        break;
    }
    out_ << "<path d=\"" << path.str() << "\" stroke=\"" << colour
         << "\" stroke-width=\"1.3\" fill=\"" << (shape / kShapeCount % 2 == 1 ? colour : "none")
         << "\"><title>" << escaped(title) << "</title></path>\n";
  }

  void legend(double left, double y) {
    constexpr double kStep = 16;
    for (std::size_t i = 0; i < variants_.size(); ++i, y += kStep) {
      out_ << "<rect x=\"" << left - 5 << "\" y=\"" << y - 5
           << "\" width=\"10\" height=\"10\" fill=\"" << kColours[i % kColourCount] << "\"/>\n";
      label(left + 12, y + 4, "start", variants_[i]);
    }
    y += kStep;
    for (std::size_t i = 0; i < scenes_.size(); ++i, y += kStep) {
      marker(left, y, i, "#222", scenes_[i]);
      label(left + 12, y + 4, "start", scenes_[i]);
    }
  }

  std::vector<Row> rows_;
  std::vector<std::string> phases_, scenes_, variants_;
  Axis x_, y_;
  std::ostringstream out_;
};

}  // namespace

std::string plot_svg(const std::vector<Row>& rows) {
  std::vector<Row> kept;
  for (const Row& row : rows)
    if (row.scene != "machine" && row.ns_per_cell > 0) kept.push_back(row);
  expects(!kept.empty(), "the table has no row to plot, beside the ceilings of the machine");
  return Plot(std::move(kept)).draw();
}

void write_plot(const std::vector<Row>& rows, const std::filesystem::path& file) {
  const std::string svg = plot_svg(rows);
  std::ofstream stream(file);
  stream << svg;
  stream.close();
  expects(stream.good(), text("--svg ", file.string(), ": cannot be written"));
}

}  // namespace kerf::bench
