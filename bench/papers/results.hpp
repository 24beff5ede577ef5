// SPDX-License-Identifier: MIT
//
// What a run of kerf_papers found: single figures, each beside what the paper prints, and points of
// curves. Columns: docs/papers.md.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "bench/csv.hpp"

namespace kerf::papers {

using bench::kNone;

struct Figure {
  std::string experiment;  ///< name out of experiments()
  std::string body;
  std::string method;  ///< empty: it does not depend on one
  std::string quantity, unit;
  double printed = kNone;     ///< in the paper; no number: not there
  double ours = kNone;        ///< no number: left out
  bench::Origin origin = {};  ///< nothing in it: this run
};

struct Point {
  std::string experiment, panel, series;
  double x = 0, y = 0;
  bool mark = false;  ///< the end of structural set-up
};

struct Results {
  std::vector<Figure> figures;
  std::vector<Point> points;

  void add(Figure figure) { figures.push_back(std::move(figure)); }
  /// The figure with these names; null: there is none.
  const Figure* find(const std::string& experiment, const std::string& body,
                     const std::string& method, const std::string& quantity) const;
  /// Its value here; no number if there is none.
  double ours(const std::string& experiment, const std::string& body, const std::string& method,
              const std::string& quantity) const;
};

/// Names of the files in a folder of results.
inline constexpr const char* kFiguresFile = "papers.csv";
inline constexpr const char* kCurvesFile = "papers-curves.csv";

/// All but what some experiments found.
Results without(Results results, const std::vector<std::string>& experiments);

/// @throws Error (bad_input) if a file cannot be written.
void write_results(const std::filesystem::path& folder, const Results& results,
                   const bench::Origin& origin);
/// @throws Error (bad_input) that names the file and the line.
Results read_results(const std::filesystem::path& folder);

}  // namespace kerf::papers
