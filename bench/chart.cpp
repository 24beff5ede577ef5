// SPDX-License-Identifier: MIT
#include "bench/chart.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iomanip>
#include <limits>
#include <sstream>
#include <utility>

#include "bench/csv.hpp"
#include "core/base/error.hpp"

namespace kerf::bench {
namespace {

// All lengths in pixels.
constexpr double kPanelWidth = 230, kPanelHeight = 170;
constexpr double kEdge = 10, kTop = 30, kPanelTitle = 22, kLegendStep = 16, kLetter = 6.2;
constexpr double kLeft = 66, kBottom = 38;  // beside and below a panel: names of ticks and axes
constexpr double kGap = 16;                 // between panels
constexpr double kMarker = 4, kCross = 6;
constexpr int kMostTicks = 7;

// The first seven are told apart also by eyes that mix up red and green. Source  Okabe, Ito 2008.
constexpr const char* kColours[] = {"#0072b2", "#e69f00", "#009e73", "#cc79a7",
                                    "#d55e00", "#56b4e9", "#000000", "#a09000",
                                    "#7f7f7f", "#8c564b", "#6a3d9a", "#b2df8a"};
constexpr const char* kInk = "#222";
constexpr std::size_t kShapeCount = 6;

using Names = std::vector<std::string>;

void add_once(Names& names, const std::string& name) {
  if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
}

std::size_t index_of(const Names& names, const std::string& name) {
  return static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin());
}

/// About, in the smaller size.
double width_of(const std::string& words) { return kLetter * static_cast<double>(words.size()); }

std::string escaped(const std::string& raw) {
  std::string out;
  for (const char c : raw) {
    if (c == '&')
      out += "&amp;";
    else if (c == '<')
      out += "&lt;";
    else if (c == '>')
      out += "&gt;";
    else if (c == '"')
      out += "&quot;";
    else  // XML has no other control characters, not even as entities
      out += static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t' ? ' ' : c;
  }
  return out;
}

std::string tick_text(double value) {
  char out[32];
  const double size = std::abs(value);
  if (size >= 1e9 || (size > 0 && size < 1e-3)) {
    constexpr double kRounding = 1e-9;
    const int e = static_cast<int>(std::floor(std::log10(size) + kRounding));
    std::snprintf(out, sizeof out, "%.4ge%d", value / std::pow(10.0, e), e);
  } else if (size >= 1e6) {
    std::snprintf(out, sizeof out, "%gM", value / 1e6);
  } else if (size >= 1e3) {
    std::snprintf(out, sizeof out, "%gk", value / 1e3);
  } else {
    std::snprintf(out, sizeof out, "%g", value);
  }
  return out;
}

/// Multiples of 1, 2 or 5 times a power of ten; of at least `least_step`.
std::vector<double> tidy_ticks(double low, double high, double least_step = 0) {
  const double least = std::max(least_step, (high - low) / (kMostTicks - 1));
  const double power = std::pow(10, std::floor(std::log10(least)));
  double step = 10 * power;
  for (const double factor : {5.0, 2.0, 1.0})
    if (factor * power >= least) step = factor * power;
  std::vector<double> out;
  const double first = std::ceil(low / step);
  for (int i = 0; i < kMostTicks; ++i)
    if (const double value = (first + i) * step; value <= high) out.push_back(value);
  return out;
}

/// An axis over `length` pixels. Ends are stored as logarithms where it is logarithmic.
struct Axis {
  bool logarithmic = true;
  double length = 0;
  double low = std::numeric_limits<double>::infinity(), high = -low;
  bool whole = true;  // counts have no ticks between them

  bool takes(double value) const { return std::isfinite(value) && (!logarithmic || value > 0); }
  bool empty() const { return !(low <= high); }
  double place(double value) const { return logarithmic ? std::log10(value) : value; }
  void add(double value) {
    whole = whole && value == std::floor(value);
    low = std::min(low, place(value));
    high = std::max(high, place(value));
  }

  /// So that no marker sits on the frame, and a single value has a range.
  void widen() {
    if (empty()) return;
    const double size = std::max(std::abs(low), std::abs(high));
    double least = logarithmic ? 0.05 : 1e-9 * size;
    if (low == high && !logarithmic) least = size > 0 ? 0.1 * size : 1;
    const double margin = std::max(least, 0.06 * (high - low));
    low -= margin;
    high += margin;
  }

  double at(double value) const { return length * (place(value) - low) / (high - low); }

  std::vector<double> ticks() const {
    if (empty()) return {};
    if (!logarithmic) return tidy_ticks(low, high, whole ? 1 : 0);
    std::vector<double> out = powers({1});
    if (out.size() < 2) out = powers({1, 2, 5});
    return out.size() < 2 ? tidy_ticks(std::pow(10, low), std::pow(10, high)) : out;
  }

 private:
  /// Powers of ten and their multiples, of so many decades only every second, third ...
  std::vector<double> powers(const std::vector<double>& factors) const {
    const int first = static_cast<int>(std::floor(low)), last = static_cast<int>(std::floor(high));
    const int stride = 1 + (last - static_cast<int>(std::ceil(low))) / kMostTicks;
    std::vector<double> out;
    for (int e = first; e <= last; ++e)
      for (const double factor : factors) {
        const double value = factor * std::pow(10.0, e);
        if (e % stride == 0 && place(value) >= low && place(value) <= high) out.push_back(value);
      }
    return out;
  }
};

struct Axes {
  Axis x, y;

  explicit Axes(const ChartPanel& like) : x{like.log_x, kPanelWidth}, y{like.log_y, kPanelHeight} {}
  bool takes(const ChartPoint& p) const { return x.takes(p.x) && y.takes(p.y); }
  void add(const ChartPanel& panel) {
    for (const ChartSeries& series : panel.series)
      for (const auto* points : {&series.points, &series.crosses})
        for (const ChartPoint& p : *points)
          if (takes(p)) {
            x.add(p.x);
            y.add(p.y);
          }
    if (panel.from_zero && !panel.log_y && !y.empty()) y.add(0);
  }
  void widen() {
    x.widen();
    y.widen();
  }
};

/// Where the corner of a panel is, and which names stand beside it.
struct Place {
  double left = 0, top = 0;
  bool names_x = true, names_y = true;
};

class Drawing {
 public:
  explicit Drawing(const Chart& chart) : chart_(chart) {
    // Series without a shape come first, since theirs is the circle.
    const auto each = [&](const auto& take) {
      for (const ChartPanel& panel : chart.panels)
        for (const ChartSeries& series : panel.series) take(series);
    };
    each([&](const ChartSeries& s) { add_once(names_, s.name); });
    each([&](const ChartSeries& s) {
      if (s.shape_name.empty()) add_once(shapes_, "");
    });
    each([&](const ChartSeries& s) { add_once(shapes_, s.shape_name); });
    out_ << std::fixed << std::setprecision(1);
    set_axes();
  }

  std::string draw() {
    const int count = static_cast<int>(chart_.panels.size());
    const int columns = std::clamp(chart_.columns, 1, count);
    const int lines = (count + columns - 1) / columns;
    const double across = kPanelWidth + kGap + (chart_.same_axes ? 0 : kLeft);
    const double down = kPanelTitle + kPanelHeight + kGap + (chart_.same_axes ? 0 : kBottom);
    const double right = kEdge + columns * across + (chart_.same_axes ? kLeft : 0);
    const double bottom = kTop + lines * down + (chart_.same_axes ? kBottom : 0);
    head(std::max(right + legend_width(), 2 * kEdge + 1.3 * width_of(chart_.title)),
         std::max(bottom, kTop + kPanelTitle + legend_height()));
    for (int i = 0; i < count; ++i) {
      Place place{kEdge + kLeft + i % columns * across, kTop + kPanelTitle + i / columns * down};
      if (chart_.same_axes) {
        place.names_x = i + columns >= count;
        place.names_y = i % columns == 0;
      }
      const auto n = static_cast<std::size_t>(i);
      panel(chart_.panels[n], axes_[chart_.same_axes ? 0 : n], place);
    }
    legend(right, kTop + kPanelTitle + kLegendStep / 2);
    out_ << "</svg>\n";
    return out_.str();
  }

 private:
  void set_axes() {
    for (const ChartPanel& panel : chart_.panels) {
      if (axes_.empty() || !chart_.same_axes) axes_.emplace_back(panel);
      Axes& axes = axes_.back();
      expects(axes.x.logarithmic == panel.log_x && axes.y.logarithmic == panel.log_y,
              "panels that share their axes must agree on which are logarithmic");
      axes.add(panel);
    }
    expects(std::any_of(axes_.begin(), axes_.end(), [](const Axes& a) { return !a.x.empty(); }),
            "there is nothing to plot");
    for (Axes& axes : axes_) axes.widen();
  }

  void head(double width, double height) {
    out_ << "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"" << width << "\" height=\""
         << height << "\" viewBox=\"0 0 " << width << ' ' << height
         << "\" font-family=\"sans-serif\" font-size=\"11\" fill=\"" << kInk << "\">\n"
         << "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n";
    label(kEdge, 20, "start", chart_.title, 14);
  }

  void label(double x, double y, const char* anchor, const std::string& words, int size = 11,
             const std::string& more = "") {
    if (words.empty()) return;
    out_ << "<text x=\"" << x << "\" y=\"" << y << "\" text-anchor=\"" << anchor
         << "\" font-size=\"" << size << "\"" << more << ">" << escaped(words) << "</text>\n";
  }

  void grid_line(double x1, double y1, double x2, double y2) {
    out_ << "<line x1=\"" << x1 << "\" y1=\"" << y1 << "\" x2=\"" << x2 << "\" y2=\"" << y2
         << "\" stroke=\"#ddd\"/>\n";
  }

  void frame(const ChartPanel& panel, const Axes& axes, const Place& at) {
    const double base = at.top + kPanelHeight;
    label(at.left, at.top - 6, "start", panel.title, 12);
    for (const double value : axes.x.ticks()) {
      const double x = at.left + axes.x.at(value);
      grid_line(x, at.top, x, base);
      if (at.names_x) label(x, base + 14, "middle", tick_text(value));
    }
    for (const double value : axes.y.ticks()) {
      const double y = base - axes.y.at(value);
      grid_line(at.left, y, at.left + kPanelWidth, y);
      if (at.names_y) label(at.left - 6, y + 4, "end", tick_text(value));
    }
    if (at.names_x) label(at.left + kPanelWidth / 2, base + 30, "middle", panel.x_label);
    if (at.names_y) {
      std::ostringstream turn;
      const double x = at.left - 52, y = at.top + kPanelHeight / 2;
      turn << " transform=\"rotate(-90 " << x << ' ' << y << ")\"";
      label(x, y, "middle", panel.y_label, 11, turn.str());
    }
    out_ << "<rect x=\"" << at.left << "\" y=\"" << at.top << "\" width=\"" << kPanelWidth
         << "\" height=\"" << kPanelHeight << "\" fill=\"none\" stroke=\"#888\"/>\n";
  }

  // Lines first, so that no marker lies below one.
  void panel(const ChartPanel& panel, const Axes& axes, const Place& at) {
    frame(panel, axes, at);
    const auto each = [&](const std::vector<ChartPoint>& points, const auto& take) {
      for (const ChartPoint& p : points)
        if (axes.takes(p))
          take(at.left + axes.x.at(p.x), at.top + kPanelHeight - axes.y.at(p.y), p.title);
    };
    for (const ChartSeries& series : panel.series) {
      if (!series.line) continue;
      std::ostringstream path;
      path << std::fixed << std::setprecision(1);
      each(series.points, [&](double x, double y, const std::string&) {
        path << (path.tellp() == 0 ? 'M' : 'L') << x << ' ' << y;
      });
      if (path.tellp() > 0)
        out_ << "<path d=\"" << path.str() << "\" fill=\"none\" stroke=\"" << colour(series.name)
             << "\" stroke-width=\"1.2\"/>\n";
    }
    for (const ChartSeries& series : panel.series) {
      const std::size_t shape = index_of(shapes_, series.shape_name);
      const auto name = colour(series.name);
      if (series.markers)
        each(series.points, [&](double x, double y, const std::string& title) {
          marker(x, y, shape, name, title);
        });
      each(series.crosses,
           [&](double x, double y, const std::string& title) { cross(x, y, name, title); });
    }
  }

  const char* colour(const std::string& name) const {
    return kColours[index_of(names_, name) % std::size(kColours)];
  }

  void cross(double x, double y, const char* colour, const std::string& title) {
    std::ostringstream path;
    path << std::fixed << std::setprecision(1) << 'M' << x - kCross << ' ' << y - kCross << 'l'
         << 2 * kCross << ' ' << 2 * kCross << "m0 " << -2 * kCross << 'l' << -2 * kCross << ' '
         << 2 * kCross;
    mark(path.str(), colour, "none", 2, title);
  }

  // The inside of an open mark shows its tool tip too.
  void mark(const std::string& path, const char* stroke, const char* fill, double width,
            const std::string& title) {
    out_ << "<path d=\"" << path << "\" stroke=\"" << stroke << "\" stroke-width=\"" << width
         << "\" fill=\"" << fill << "\" pointer-events=\"all\"";
    if (title.empty())
      out_ << "/>\n";
    else
      out_ << "><title>" << escaped(title) << "</title></path>\n";
  }

  // Open shapes, so that those that meet stay visible; the seventh shape is the first one filled.
  void marker(double x, double y, std::size_t shape, const char* colour, const std::string& title) {
    using Corners = std::vector<std::pair<double, double>>;
    static const Corners kShapes[kShapeCount] = {
        {},  // a circle
        {{-0.9, -0.9}, {0.9, -0.9}, {0.9, 0.9}, {-0.9, 0.9}},
        {{0, -1.2}, {1.1, 0.8}, {-1.1, 0.8}},
        {{0, 1.2}, {1.1, -0.8}, {-1.1, -0.8}},
        {{0, -1.3}, {1.3, 0}, {0, 1.3}, {-1.3, 0}},
        {{-1, -1}, {0, 0}, {1, -1}, {0, 0}, {1, 1}, {0, 0}, {-1, 1}, {0, 0}}};
    const double r = kMarker;
    std::ostringstream path;
    path << std::fixed << std::setprecision(1);
    char command = 'M';
    for (const auto& [dx, dy] : kShapes[shape % kShapeCount]) {
      path << command << x + r * dx << ' ' << y + r * dy;
      command = 'L';
    }
    if (shape % kShapeCount == 0)  // of two arcs
      path << 'M' << x - r << ' ' << y << 'a' << r << ' ' << r << " 0 1 0 " << 2 * r << " 0a" << r
           << ' ' << r << " 0 1 0 " << -2 * r << " 0";
    path << 'Z';
    mark(path.str(), colour, shape / kShapeCount % 2 == 1 ? colour : "none", 1.3, title);
  }

  double legend_width() const {
    double longest = 0;
    for (const Names* names : {&names_, &shapes_})
      for (const std::string& name : *names) longest = std::max(longest, width_of(name));
    return longest > 0 ? longest + 2 * kEdge + 12 : 0;
  }
  double legend_height() const {
    return kLegendStep * static_cast<double>(names_.size() + shapes_.size() + 2);
  }

  void legend(double left, double y) {
    for (const std::string& name : names_) {
      if (name.empty()) continue;
      out_ << "<rect x=\"" << left - 5 << "\" y=\"" << y - 5
           << "\" width=\"10\" height=\"10\" fill=\"" << colour(name) << "\"/>\n";
      label(left + 12, y + 4, "start", name);
      y += kLegendStep;
    }
    y += kLegendStep;
    for (std::size_t i = 0; i < shapes_.size(); ++i) {
      if (shapes_[i].empty()) continue;
      marker(left, y, i, kInk, shapes_[i]);
      label(left + 12, y + 4, "start", shapes_[i]);
      y += kLegendStep;
    }
  }

  const Chart& chart_;
  Names names_, shapes_;
  std::vector<Axes> axes_;  // one if all share theirs
  std::ostringstream out_;
};

}  // namespace

std::string chart_svg(const Chart& chart) { return Drawing(chart).draw(); }

void write_svg(const std::string& svg, const std::filesystem::path& file,
               const std::string& option) {
  write_file(file, svg, option);
}

}  // namespace kerf::bench
