// SPDX-License-Identifier: MIT
#include "bench/papers/results.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <sstream>

#include "bench/command_line.hpp"
#include "core/base/error.hpp"

namespace kerf::papers {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFigureHead =
    "experiment,body,method,quantity,unit,printed,ours,commit,build,machine";
constexpr const char* kCurveHead = "experiment,panel,series,x,y,mark";

std::string field(double value) {
  if (std::isnan(value)) return "";
  std::ostringstream out;
  out.precision(7);
  out << value;
  return out.str();
}

// Names of ours have no commas.
std::string plain(const std::string& name) {
  ensures(name.find_first_of(",\"\n") == std::string::npos, "a name without commas: " + name);
  return name;
}

void write(const fs::path& file, const std::string& content) {
  std::ofstream stream(file);
  stream << content;
  stream.close();
  expects(stream.good(), text("--out: ", file.string(), " cannot be written"));
}

// Calls line(parts, where) for each line below the head.
template <class Line>
void read(const fs::path& file, const std::string& head, const Line& line) {
  std::ifstream in(file);
  expects(in.good(), text(file.string(), ": cannot be read"));
  std::string raw;
  std::getline(in, raw);
  expects(raw == head, text(file.string(), ":1: the columns must be ", head));
  const std::size_t columns = bench::split(head).size();
  for (int number = 2; std::getline(in, raw); ++number) {
    const std::string where = text(file.string(), ":", number);
    const std::vector<std::string> parts = bench::split(raw);
    expects(parts.size() == columns,
            text(where, ": ", parts.size(), " fields instead of ", columns));
    line(parts, where);
  }
}

double number(const std::string& raw, const std::string& where, const char* column) {
  if (raw.empty()) return kNone;
  double out = 0;
  const char* const end = raw.data() + raw.size();
  const auto [stop, error] = std::from_chars(raw.data(), end, out);
  expects(error == std::errc() && stop == end,
          text(where, ": ", column, " is no number: '", raw, "'"));
  return out;
}

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
  const std::string here =
      text(plain(origin.commit), ',', plain(origin.build), ',', plain(origin.machine));
  std::ostringstream figures, curves;
  figures << kFigureHead << '\n';
  for (const Figure& f : results.figures)
    figures << plain(f.experiment) << ',' << plain(f.body) << ',' << plain(f.method) << ','
            << plain(f.quantity) << ',' << plain(f.unit) << ',' << field(f.printed) << ','
            << field(f.ours) << ',' << (f.origin.empty() ? here : f.origin) << '\n';
  curves << kCurveHead << '\n';
  for (const Point& p : results.points)
    curves << plain(p.experiment) << ',' << plain(p.panel) << ',' << plain(p.series) << ','
           << field(p.x) << ',' << field(p.y) << ',' << (p.mark ? "1" : "") << '\n';
  write(folder / kFiguresFile, figures.str());
  write(folder / kCurvesFile, curves.str());
}

Results read_results(const fs::path& folder) {
  Results out;
  read(folder / kFiguresFile, kFigureHead, [&](const auto& p, const std::string& where) {
    out.add({p[0], p[1], p[2], p[3], p[4], number(p[5], where, "printed"),
             number(p[6], where, "ours"), text(p[7], ',', p[8], ',', p[9])});
  });
  read(folder / kCurvesFile, kCurveHead, [&](const auto& p, const std::string& where) {
    out.points.push_back(
        {p[0], p[1], p[2], number(p[3], where, "x"), number(p[4], where, "y"), !p[5].empty()});
  });
  return out;
}

}  // namespace kerf::papers
