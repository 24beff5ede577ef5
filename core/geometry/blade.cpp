// SPDX-License-Identifier: MIT
#include "core/geometry/blade.hpp"

#include <cmath>

#include "core/base/error.hpp"

namespace kerf {
namespace {

void check_lines(const std::vector<CutLine>& lines) {
  expects(lines.size() >= 2, text("a blade needs at least two cut lines, got ", lines.size()));
  for (std::size_t i = 0; i < lines.size(); ++i) {
    expects(lines[i].size() >= 2,
            text("cut line ", i, " needs at least two points, got ", lines[i].size()));
    expects(lines[i].size() == lines[0].size(),
            text("all cut lines of a blade need the same number of points: line 0 has ",
                 lines[0].size(), ", line ", i, " has ", lines[i].size()));
    for (std::size_t j = 0; j < lines[i].size(); ++j) {
      const Vec3d& p = lines[i][j];
      expects(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z),
              text("point ", j, " of cut line ", i, " is not finite"));
    }
  }
}

}  // namespace

TriangleMesh sweep(const std::vector<CutLine>& lines) {
  check_lines(lines);
  const auto across = static_cast<std::int32_t>(lines[0].size());
  TriangleMesh blade;
  for (const CutLine& line : lines)
    blade.points.insert(blade.points.end(), line.begin(), line.end());
  // a = (line i, point j); b is next along the line, d next in time, c both.
  for (std::int32_t i = 0; i + 1 < static_cast<std::int32_t>(lines.size()); ++i)
    for (std::int32_t j = 0; j + 1 < across; ++j) {
      const std::int32_t a = i * across + j, b = a + 1, d = a + across, c = d + 1;
      blade.triangles.push_back({a, b, c});
      blade.triangles.push_back({a, c, d});
    }
  return blade;
}

CutLine edge_at(const std::vector<CutLine>& lines, double t) {
  check_lines(lines);
  expects(t >= 0 && t <= 1, text("the time along a blade's path must lie in [0, 1], got ", t));
  const double place = t * static_cast<double>(lines.size() - 1);
  const auto before = static_cast<std::size_t>(place);
  const double s = place - static_cast<double>(before);
  if (s == 0) return lines[before];
  CutLine edge(lines[before].size());
  for (std::size_t j = 0; j < edge.size(); ++j)
    edge[j] = (1 - s) * lines[before][j] + s * lines[before + 1][j];
  return edge;
}

TriangleMesh sweep_between(const std::vector<CutLine>& lines, double t0, double t1) {
  check_lines(lines);
  expects(0 <= t0 && t0 < t1 && t1 <= 1,
          text("a part of a blade's path needs 0 <= t0 < t1 <= 1, got ", t0, " and ", t1));
  const double first = t0 * static_cast<double>(lines.size() - 1);
  const double last = t1 * static_cast<double>(lines.size() - 1);
  std::vector<CutLine> part{edge_at(lines, t0)};
  for (std::size_t k = 0; k < lines.size(); ++k)
    if (first < static_cast<double>(k) && static_cast<double>(k) < last) part.push_back(lines[k]);
  part.push_back(edge_at(lines, t1));
  return sweep(part);
}

}  // namespace kerf
