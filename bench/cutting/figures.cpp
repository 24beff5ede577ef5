// SPDX-License-Identifier: MIT
#include "bench/cutting/figures.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iomanip>
#include <sstream>
#include <utility>

#include "core/base/error.hpp"

namespace kerf::cutting {
namespace {

constexpr double kSolved = 1e-8;  // what the linear solver leaves is less

// ---- tables

std::string number(const char* format, double value) {
  if (std::isnan(value)) return "";
  char out[32];
  std::snprintf(out, sizeof out, format, value);
  return out;
}

std::vector<std::string> scenes_of(const std::vector<Record>& records) {
  std::vector<std::string> out;
  for (const Record& r : records)
    if (std::find(out.begin(), out.end(), r.scene) == out.end()) out.push_back(r.scene);
  return out;
}

std::vector<std::string> methods_of(const std::vector<Record>& records) {
  std::vector<std::string> out;
  for (const Record& r : records)
    if (std::find(out.begin(), out.end(), r.method) == out.end()) out.push_back(r.method);
  return out;
}

void scene_table(const std::vector<Record>& records, const std::string& scene,
                 std::ostringstream& out) {
  constexpr double kMiB = 1 << 20;
  out << "\n### " << scene
      << "\n\n| method | size | cells | unknowns | value / exact | limit / exact | order to it | "
         "error "
         "| order | energy error | order | spread | removed | cycles | s | MiB |\n"
         "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n";
  for (const Record& r : records) {
    if (r.scene != scene) continue;
    out << "| " << r.method << " | " << r.size << " | " << r.cost.cells << " | " << r.cost.unknowns
        << " | " << number("%.4f", r.value / r.exact) << " | " << number("%.4f", r.limit / r.exact)
        << " | " << number("%.2f", r.order_of_differences) << " | " << number("%.2e", r.error)
        << " | " << number("%.2f", r.order) << " | " << number("%.2e", r.energy_error) << " | "
        << number("%.2f", r.energy_order) << " | " << number("%.1e", r.spread) << " | "
        << number("%.3f", r.cost.removed) << " | " << r.cost.cycles << " | "
        << number("%.2f", r.cost.seconds()) << " | " << number("%.1f", r.cost.bytes / kMiB)
        << " |\n";
  }
}

/// What a method needs for an error, between two of its sizes; no number beyond them.
struct Need {
  double cells = kNone, seconds = kNone;
};

Need need_for(double error, const std::string& scene, const std::string& method,
              const std::vector<Record>& records) {
  const Record* before = nullptr;  // of the size below
  for (const Record& r : records) {
    if (r.scene != scene || r.method != method) continue;
    if (before != nullptr && before->error >= error && error >= r.error && r.error > 0) {
      const double part = std::log(before->error / error) / std::log(before->error / r.error);
      const auto between = [&](double a, double b) { return a * std::pow(b / a, part); };
      return {between(static_cast<double>(before->cost.cells), static_cast<double>(r.cost.cells)),
              between(before->cost.seconds(), r.cost.seconds())};
    }
    before = &r;
  }
  return {};
}

// The largest size of both, and what the octree needs for the error of the grid one size below.
void compare_octree(const std::vector<Record>& records, std::ostringstream& out) {
  const std::string grid = name_of(Method::uniform), octree = name_of(Method::octree);
  out << "\n### Octree against the uniform grid\n\n"
         "| scene | size | cells | bytes | s | s to solve | error | error of the grid with half "
         "the size "
         "| cells for it | s for it |\n|---|---|---|---|---|---|---|---|---|---|\n";
  const auto ratio = [](double a, double b) { return number("%.2f", a / b); };
  for (const std::string& scene : scenes_of(records)) {
    const Record *a = nullptr, *b = nullptr, *half = nullptr;
    for (const Record& r : records) {
      if (r.scene != scene) continue;
      if (r.method == octree) b = &r;
      if (r.method == grid) half = std::exchange(a, &r);
    }
    if (a == nullptr || b == nullptr || half == nullptr || a->size != b->size) continue;
    const Need need = need_for(half->error, scene, octree, records);
    out << "| " << scene << " | " << a->size << " | "
        << ratio(static_cast<double>(b->cost.cells), static_cast<double>(a->cost.cells)) << " | "
        << ratio(b->cost.bytes, a->cost.bytes) << " | "
        << ratio(b->cost.seconds(), a->cost.seconds()) << " | "
        << ratio(b->cost.solve, a->cost.solve) << " | "
        << (a->error > kSolved ? ratio(b->error, a->error) : "") << " | "
        << number("%.1e", half->error) << " | "
        << ratio(need.cells, static_cast<double>(half->cost.cells)) << " | "
        << ratio(need.seconds, half->cost.seconds()) << " |\n";
  }
}

// The largest size of each.
void phase_table(const std::vector<Record>& records, std::ostringstream& out) {
  constexpr double kMiB = 1 << 20;
  out << "\n### Seconds by phase, and memory\n\n"
         "| scene | method | cells | octree | cut | structure | values | solve | cycles | MiB held "
         "| "
         "MiB at most |\n|---|---|---|---|---|---|---|---|---|---|---|\n";
  for (const std::string& scene : scenes_of(records))
    for (const std::string& method : methods_of(records)) {
      const Record* last = nullptr;
      for (const Record& r : records)
        if (r.scene == scene && r.method == method) last = &r;
      if (last == nullptr) continue;
      const Cost& c = last->cost;
      out << "| " << scene << " | " << method << " | " << c.cells;
      for (const double seconds : {c.octree, c.cut, c.structure, c.values, c.solve})
        out << " | " << number("%.2f", seconds);
      out << " | " << c.cycles << " | " << number("%.0f", c.bytes / kMiB) << " | "
          << number("%.0f", c.peak_bytes / kMiB) << " |\n";
    }
}

// ---- plots; all lengths in pixels

constexpr double kWidth = 230, kHeight = 160, kLeft = 64, kTop = 52, kGap = 66, kLegend = 130;
// Told apart also by eyes that mix up red and green. Source  Okabe, Ito 2008.
constexpr const char* kColours[] = {"#0072b2", "#e69f00", "#009e73", "#cc79a7", "#d55e00"};

/// A logarithmic axis over `length` pixels.
struct Axis {
  double low = 1e300, high = 0, length = 0;

  void add(double value) {
    if (!(value > 0)) return;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  void widen() {  // so that no marker sits on the frame
    low *= 0.7;
    high *= 1.4;
  }
  bool empty() const { return !(low < high); }
  double at(double value) const { return length * std::log(value / low) / std::log(high / low); }
};

class Plot {
 public:
  explicit Plot(const std::vector<Record>& records)
      : records_(records), methods_(methods_of(records)) {
    out_ << std::fixed << std::setprecision(1);
  }

  std::string draw() {
    std::vector<std::string> all = scenes_of(records_);
    std::erase_if(all, [&](const std::string& scene) { return !has_errors(scene); });
    const double width = kLeft + 2 * (kWidth + kGap) + kLegend;
    const double height = kTop + static_cast<double>(all.size()) * (kHeight + kGap);
    out_ << "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"" << width << "\" height=\""
         << height << "\" viewBox=\"0 0 " << width << ' ' << height
         << "\" font-family=\"sans-serif\" font-size=\"11\" fill=\"#222\">\n"
         << "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n";
    label(kLeft, 18, "start", "Relative error of the displacement of cut bodies");
    double top = kTop;
    for (const std::string& scene : all) {
      panel(scene, "cells", kLeft, top,
            [](const Record& r) { return static_cast<double>(r.cost.cells); });
      panel(scene, "seconds", kLeft + kWidth + kGap, top,
            [](const Record& r) { return r.cost.seconds(); });
      top += kHeight + kGap;
    }
    for (std::size_t i = 0; i < methods_.size(); ++i) {
      const double y = kTop + 10 + 16 * static_cast<double>(i);
      circle(kLeft + 2 * (kWidth + kGap) - 40, y, i, methods_[i]);
      label(kLeft + 2 * (kWidth + kGap) - 30, y + 4, "start", methods_[i]);
    }
    out_ << "</svg>\n";
    return out_.str();
  }

 private:
  static bool has_error(const Record& r) { return r.error > kSolved; }
  bool has_errors(const std::string& scene) const {
    return std::any_of(records_.begin(), records_.end(),
                       [&](const Record& r) { return r.scene == scene && has_error(r); });
  }
  void label(double x, double y, const char* anchor, const std::string& words) {
    out_ << "<text x=\"" << x << "\" y=\"" << y << "\" text-anchor=\"" << anchor << "\">" << words
         << "</text>\n";
  }
  void line(double x1, double y1, double x2, double y2, const char* colour) {
    out_ << "<line x1=\"" << x1 << "\" y1=\"" << y1 << "\" x2=\"" << x2 << "\" y2=\"" << y2
         << "\" stroke=\"" << colour << "\"/>\n";
  }
  void circle(double x, double y, std::size_t method, const std::string& title) {
    out_ << "<circle cx=\"" << x << "\" cy=\"" << y << "\" r=\"3.5\" fill=\""
         << kColours[method % std::size(kColours)] << "\"><title>" << title
         << "</title></circle>\n";
  }

  // Grid lines at powers of ten, named by them.
  void frame(double left, double top, const Axis& x, const Axis& y) {
    for (int e = -12; e <= 12; ++e) {
      const double value = std::pow(10.0, e);
      const std::string name = text("1e", e);
      if (value > x.low && value < x.high) {
        line(left + x.at(value), top, left + x.at(value), top + kHeight, "#ddd");
        label(left + x.at(value), top + kHeight + 14, "middle", name);
      }
      if (value > y.low && value < y.high) {
        const double at = top + kHeight - y.at(value);
        line(left, at, left + kWidth, at, "#ddd");
        label(left - 6, at + 4, "end", name);
      }
    }
    out_ << "<rect x=\"" << left << "\" y=\"" << top << "\" width=\"" << kWidth << "\" height=\""
         << kHeight << "\" fill=\"none\" stroke=\"#888\"/>\n";
  }

  template <class Of>
  void panel(const std::string& scene, const char* against, double left, double top, const Of& of) {
    Axis x, y;
    for (const Record& r : records_) {
      if (r.scene != scene || !has_error(r)) continue;
      x.add(of(r));
      y.add(r.error);
    }
    x.widen();
    y.widen();
    x.length = kWidth;
    y.length = kHeight;
    label(left, top - 6, "start", scene + ": error against " + against);
    if (x.empty() || y.empty()) return;
    frame(left, top, x, y);
    for (std::size_t m = 0; m < methods_.size(); ++m) {
      double px = 0, py = 0;
      bool first = true;
      for (const Record& r : records_) {
        if (r.scene != scene || r.method != methods_[m] || !has_error(r)) continue;
        const double cx = left + x.at(of(r)), cy = top + kHeight - y.at(r.error);
        if (!first) line(px, py, cx, cy, kColours[m % std::size(kColours)]);
        circle(cx, cy, m, text(r.method, ", size ", r.size, ": ", r.error));
        px = cx;
        py = cy;
        first = false;
      }
    }
  }

  const std::vector<Record>& records_;
  std::vector<std::string> methods_;
  std::ostringstream out_;
};

}  // namespace

std::string markdown_tables(const std::vector<Record>& records) {
  std::ostringstream out;
  for (const std::string& scene : scenes_of(records)) scene_table(records, scene, out);
  phase_table(records, out);
  compare_octree(records, out);
  return out.str();
}

std::string plot_svg(const std::vector<Record>& records) {
  expects(!records.empty(), "there is nothing to plot");
  return Plot(records).draw();
}

void write_plot(const std::vector<Record>& records, const std::filesystem::path& file) {
  const std::string svg = plot_svg(records);
  std::ofstream stream(file);
  stream << svg;
  stream.close();
  expects(stream.good(), text("--svg ", file.string(), ": cannot be written"));
}

}  // namespace kerf::cutting
