// SPDX-License-Identifier: MIT
#include "bench/papers/report.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include "bench/command_line.hpp"
#include "bench/papers/criteria.hpp"
#include "bench/papers/experiments.hpp"
#include "core/base/error.hpp"

namespace kerf::papers {
namespace {

using bench::Chart;
using bench::ChartPanel;
using bench::ChartSeries;

template <class Item, class Of>
std::vector<std::string> distinct(const std::vector<Item>& items, const Of& of) {
  std::vector<std::string> out;
  for (const Item& item : items) {
    const std::string one = of(item);
    if (std::find(out.begin(), out.end(), one) == out.end()) out.push_back(one);
  }
  return out;
}

// Whole numbers whole, others with three digits.
std::string number(double value) {
  if (std::isnan(value)) return "";
  if (std::abs(value) >= 1000 || (value == std::floor(value) && std::abs(value) < 1e9))
    return bench::formatted("%.0f", value);
  return bench::formatted("%.3g", value);
}

std::string unit_of(const Figure& f) { return f.unit == "1" ? "" : " [" + f.unit + "]"; }

// Rows are bodies, columns quantities with the paper's value and ours.
void body_table(const std::vector<Figure>& figures, std::ostringstream& out) {
  const auto column = [](const Figure& f) {
    return f.quantity + unit_of(f) + (f.method.empty() ? "" : ", " + f.method);
  };
  const std::vector<std::string> columns = distinct(figures, column);
  const std::vector<std::string> rows = distinct(figures, [](const Figure& f) { return f.body; });
  const auto is_printed = [&](const std::string& name) {
    return std::any_of(figures.begin(), figures.end(), [&](const Figure& f) {
      return column(f) == name && !std::isnan(f.printed);
    });
  };
  out << "| |";
  for (const std::string& name : columns) out << ' ' << name << " |";
  out << "\n|---|";
  for (std::size_t i = 0; i < columns.size(); ++i) out << "---|";
  out << '\n';
  for (const std::string& row : rows) {
    out << "| " << row << " |";
    for (const std::string& name : columns) {
      const auto found = std::find_if(figures.begin(), figures.end(), [&](const Figure& f) {
        return f.body == row && column(f) == name;
      });
      if (found == figures.end()) {
        out << " |";
        continue;
      }
      const std::string printed = number(found->printed), ours = number(found->ours);
      out << ' ' << (is_printed(name) ? (printed.empty() ? "-" : printed) + " / " : std::string())
          << (ours.empty() ? "-" : ours) << " |";
    }
    out << '\n';
  }
}

// Where there are many methods, each has a row of its own.
void methods_to_rows(std::vector<Figure>& figures) {
  for (Figure& f : figures)
    if (const std::string method = std::exchange(f.method, ""); !method.empty())
      f.body += ": " + method;
}

void criteria_table(const Results& results, std::ostringstream& out) {
  out << "\n### Criteria\n\n| | must hold | seen | |\n|---|---|---|---|\n";
  for (const Criterion& c : criteria(results))
    out << "| " << c.id << " | " << c.statement << " | " << c.seen << " | "
        << (c.is_report ? "reported"
            : c.met     ? (*c.met ? "met" : "**not met**")
                        : "not run")
        << " |\n";
}

Chart curves(const Results& results, const std::string& experiment) {
  Chart out;
  std::vector<Point> points;
  for (const Point& p : results.points)
    if (p.experiment == experiment) points.push_back(p);
  for (const std::string& name : distinct(points, [](const Point& p) { return p.panel; })) {
    ChartPanel panel;
    panel.title = name;
    panel.y_label = "error";
    for (const Point& p : points) {
      if (p.panel != name) continue;
      const auto found = std::find_if(panel.series.begin(), panel.series.end(),
                                      [&](const ChartSeries& s) { return s.name == p.series; });
      ChartSeries& series = found != panel.series.end()
                                ? *found
                                : panel.series.emplace_back(ChartSeries{p.series, {}});
      series.markers = false;
      series.points.push_back({p.x, p.y, ""});
      if (p.mark) series.crosses.push_back({p.x, p.y, "structural set-up"});
    }
    out.panels.push_back(std::move(panel));
  }
  return out;
}

}  // namespace

std::string markdown(const Results& results) {
  std::ostringstream out;
  for (const Experiment& experiment : experiments()) {
    std::vector<Figure> figures;
    for (const Figure& f : results.figures)
      if (f.experiment == experiment.name) figures.push_back(f);
    if (figures.empty()) continue;
    if (figures.front().experiment == "figure12") methods_to_rows(figures);
    out << "\n### " << experiment.what << "\n\nPrinted / ours.\n\n";
    body_table(figures, out);
  }
  criteria_table(results, out);
  return out.str();
}

Chart figure10_chart(const Results& results) {
  // A panel for each body and solver.
  const std::string kerf = text(": ", kKerfMethod);
  Results parted;
  for (Point p : results.points) {
    const bool is_kerf = p.series.ends_with(kerf);
    if (is_kerf) p.series.resize(p.series.size() - kerf.size());
    if (const std::size_t at = p.series.find(": "); at != std::string::npos) {
      p.panel = p.series.substr(0, at);
      p.series = p.series.substr(at + 2);
    }
    p.panel += text(", ", is_kerf ? kKerfMethod : kPaperMethod);
    parted.points.push_back(std::move(p));
  }
  Chart out = curves(parted, "figure10");
  out.title = "Error over cycles";
  for (ChartPanel& panel : out.panels) {
    panel.x_label = "cycles";
    panel.log_x = false;
  }
  return out;
}

Chart figure12_chart(const Results& results) {
  Chart out = curves(results, "figure12");
  out.title = "Error over time; crosses: the end of structural set-up";
  const double least = 1e-4;  // s: where no structure is set up, the first point is at zero
  for (ChartPanel& panel : out.panels) {
    panel.x_label = "seconds";
    for (ChartSeries& series : panel.series)
      for (auto* points : {&series.points, &series.crosses})
        std::erase_if(*points, [&](const auto& point) { return !(point.x >= least); });
  }
  return out;
}

Chart cost_chart(const Results& results) {
  ChartPanel panel;
  panel.title = "A time step after the cut";
  panel.x_label = "cells";
  panel.y_label = "seconds";
  const struct {
    const char *step, *cells, *name;
  } grids[] = {{"step", "cells after the cut", "octree"},
               {"step on the uniform grid", "cells of the uniform grid", "uniform"}};
  for (const auto& grid : grids)
    for (const char* method : {kPaperMethod, kKerfMethod}) {
      ChartSeries ours{text(grid.name, ", ", method), {}},
          printed{text(grid.name, ", printed"), {}};
      ours.line = printed.line = false;
      for (const Figure& f : results.figures) {
        if (f.experiment != "table1" || f.quantity != grid.step || f.method != method) continue;
        const Figure* cells = results.find("table1", f.body, "", grid.cells);
        if (cells == nullptr) continue;
        ours.points.push_back({cells->ours, f.ours, f.body});
        printed.points.push_back({cells->printed, f.printed, f.body});
      }
      if (!ours.points.empty()) panel.series.push_back(std::move(ours));
      if (method == std::string(kPaperMethod) && !printed.points.empty())
        panel.series.push_back(std::move(printed));
    }
  Chart out;
  out.title = "Cost over size, one core";
  if (!panel.series.empty()) out.panels.push_back(std::move(panel));
  return out;
}

void write_report(const std::filesystem::path& folder, const Results& results) {
  bench::write_file(folder / "papers.md", markdown(results), "--out");
  const std::pair<const char*, Chart> charts[] = {{"figure10.svg", figure10_chart(results)},
                                                  {"figure12.svg", figure12_chart(results)},
                                                  {"cost.svg", cost_chart(results)}};
  for (const auto& [name, chart] : charts)
    if (!chart.panels.empty()) bench::write_svg(bench::chart_svg(chart), folder / name, "--out");
}

}  // namespace kerf::papers
