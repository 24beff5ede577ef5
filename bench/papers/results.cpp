// SPDX-License-Identifier: MIT
#include "bench/papers/results.hpp"

#include <algorithm>
#include <sstream>

#include "core/base/error.hpp"

namespace kerf::papers {
namespace {

namespace fs = std::filesystem;

using bench::csv_field;

constexpr int kDigits = 7;

}  // namespace

const Figure* Results::find(const std::string& experiment, const std::string& body,
                            const std::string& method, const std::string& quantity) const {
  for (const Figure& f : figures)
    if (f.experiment == experiment && f.body == body && f.method == method &&
        f.quantity == quantity)
      return &f;
  return nullptr;
}

double Results::ours(const std::string& experiment, const std::string& body,
                     const std::string& method, const std::string& quantity) const {
  const Figure* found = find(experiment, body, method, quantity);
  return found == nullptr ? kNone : found->ours;
}

Results without(Results results, const std::vector<std::string>& experiments) {
  const auto is_one = [&](const auto& item) {
    return std::find(experiments.begin(), experiments.end(), item.experiment) != experiments.end();
  };
  std::erase_if(results.figures, is_one);
  std::erase_if(results.points, is_one);
  return results;
}

void write_results(const fs::path& folder, const Results& results, const bench::Origin& origin) {
  std::ostringstream figures, curves;
  figures << "experiment,body,method,quantity,unit,printed,ours,commit,build,machine\n";
  for (const Figure& f : results.figures) {
    const bench::Origin& of = f.origin.commit.empty() ? origin : f.origin;
    figures << f.experiment << ',' << csv_field(f.body) << ',' << csv_field(f.method) << ','
            << csv_field(f.quantity) << ',' << f.unit << ',' << csv_field(f.printed, kDigits) << ','
            << csv_field(f.ours, kDigits) << ',' << of.commit << ',' << of.build << ','
            << csv_field(of.machine) << '\n';
  }
  curves << "experiment,panel,series,x,y,mark\n";
  for (const Point& p : results.points)
    curves << p.experiment << ',' << csv_field(p.panel) << ',' << csv_field(p.series) << ','
           << csv_field(p.x, kDigits) << ',' << csv_field(p.y, kDigits) << ','
           << (p.mark ? "1" : "") << '\n';
  bench::write_file(folder / kFiguresFile, figures.str(), "--out");
  bench::write_file(folder / kCurvesFile, curves.str(), "--out");
}

Results read_results(const fs::path& folder) {
  Results out;
  bench::CsvReader figures(folder / kFiguresFile,
                           {"experiment", "body", "method", "quantity", "printed", "ours"});
  while (figures.next()) {
    Figure f{figures.at("experiment"),
             figures.at("body"),
             figures.at("method"),
             figures.at("quantity"),
             figures.at("unit"),
             figures.value("printed"),
             figures.value("ours"),
             {figures.at("commit"), figures.at("build"), figures.at("machine")}};
    expects(!f.quantity.empty(), text(figures.where(), ": quantity is missing"));
    out.add(std::move(f));
  }
  bench::CsvReader curves(folder / kCurvesFile, {"experiment", "panel", "series", "x", "y"});
  while (curves.next())
    out.points.push_back({curves.at("experiment"), curves.at("panel"), curves.at("series"),
                          curves.value("x"), curves.value("y"), !curves.at("mark").empty()});
  return out;
}

}  // namespace kerf::papers
