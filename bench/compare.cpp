// SPDX-License-Identifier: MIT
#include "bench/compare.hpp"

#include <cstdio>

namespace kerf::bench {
namespace {

bool same_work(const Row& a, const Row& b) {
  return a.scene == b.scene && a.phase == b.phase && a.precision == b.precision;
}

/// The fastest of the rows that do what `like` does; null if there is none.
const Row* fastest(const std::vector<Row>& rows, const Row& like, const std::string& backend) {
  const Row* out = nullptr;
  for (const Row& row : rows)
    if (row.backend == backend && same_work(row, like) &&
        (out == nullptr || row.ms_min < out->ms_min))
      out = &row;
  return out;
}

}  // namespace

std::string comparison(const std::vector<Row>& rows, const std::string& first,
                       const std::string& second) {
  char line[160];
  std::snprintf(line, sizeof line, "%-16s %-19s %-9s %7s %12s %12s %8s\n", "scene", "phase",
                "precision", "threads", (first + " ms").c_str(), (second + " ms").c_str(), "ratio");
  std::string out = line;
  for (const Row& row : rows) {
    if (row.backend != first || &row != fastest(rows, row, first)) continue;
    const Row* const other = fastest(rows, row, second);
    if (other == nullptr) continue;
    std::snprintf(line, sizeof line, "%-16s %-19s %-9s %7d %12.4g %12.4g %8.3g\n",
                  row.scene.c_str(), row.phase.c_str(), row.precision.c_str(), row.threads,
                  row.ms_min, other->ms_min, row.ms_min / other->ms_min);
    out += line;
  }
  return out;
}

}  // namespace kerf::bench
