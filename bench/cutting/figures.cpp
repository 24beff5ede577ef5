// SPDX-License-Identifier: MIT
#include "bench/cutting/figures.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <sstream>
#include <utility>

#include "bench/chart.hpp"
#include "core/base/error.hpp"

namespace kerf::cutting {
namespace {

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

// ---- plots

template <class Of>
bench::ChartPanel panel(const std::vector<Record>& records, const std::string& scene,
                        const char* against, const Of& of) {
  bench::ChartPanel out{
      text(scene, ": error against ", against), against, "relative error", true, true, {}};
  for (const std::string& method : methods_of(records)) {
    bench::ChartSeries series{method, {}};
    for (const Record& r : records)
      if (r.scene == scene && r.method == method && r.error > kSolved)
        series.points.push_back({of(r), r.error, text(method, ", size ", r.size, ": ", r.error)});
    if (!series.points.empty()) out.series.push_back(std::move(series));
  }
  return out;
}

}  // namespace

std::string markdown_tables(const std::vector<Record>& records) {
  std::ostringstream out;
  for (const std::string& scene : scenes_of(records)) scene_table(records, scene, out);
  phase_table(records, out);
  compare_octree(records, out);
  return out.str();
}

std::string plot_svg(const std::vector<Record>& records) {
  bench::Chart chart{"Relative error of the displacement of cut bodies", {}};
  for (const std::string& scene : scenes_of(records)) {
    auto by_cells = panel(records, scene, "cells",
                          [](const Record& r) { return static_cast<double>(r.cost.cells); });
    if (by_cells.series.empty()) continue;  // solved to rounding
    chart.panels.push_back(std::move(by_cells));
    chart.panels.push_back(
        panel(records, scene, "seconds", [](const Record& r) { return r.cost.seconds(); }));
  }
  return bench::chart_svg(chart);
}

void write_plot(const std::vector<Record>& records, const std::filesystem::path& file) {
  bench::write_svg(plot_svg(records), file, "--svg");
}

}  // namespace kerf::cutting
