// SPDX-License-Identifier: MIT
#include "app/preview_surface.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace kerf {
namespace {

/// Taubin smoothing [Taubin 1995]: a shrinking and a growing step cancel for long waves, so that
/// the body keeps its volume.
constexpr int kSmoothingSteps = 24;
constexpr double kShrink = 0.5, kGrow = -0.53;
constexpr double kLargestMove = 0.5;  // cell sides
constexpr int kNormalSteps = 3;
constexpr double kCrumb = 0.01;  // of the faces: smaller pieces do not count for the frame

struct Edge {
  std::int32_t a, b;  // points, a < b
  std::int32_t quad;
};

/// Neighbours of each point, compressed; those along a rim only, if the point lies on one.
struct Neighbours {
  std::vector<std::int32_t> begin, list;
};

struct EdgeSets {
  std::vector<std::pair<std::int32_t, std::int32_t>> smooth, rim;
};

EdgeSets classify_edges(const PreviewSurface& s) {
  std::vector<Edge> edges;
  edges.reserve(4 * s.quads.size());
  for (std::size_t q = 0; q < s.quads.size(); ++q)
    for (std::size_t k = 0; k < 4; ++k) {
      const auto [a, b] = std::minmax(s.quads[q][k], s.quads[q][(k + 1) % 4]);
      edges.push_back({a, b, static_cast<std::int32_t>(q)});
    }
  std::sort(edges.begin(), edges.end(), [](const Edge& x, const Edge& y) {
    return std::array{x.a, x.b, x.quad} < std::array{y.a, y.b, y.quad};
  });
  EdgeSets sets;
  for (std::size_t i = 0; i < edges.size();) {
    std::size_t j = i;
    bool same = true;
    for (; j < edges.size() && edges[j].a == edges[i].a && edges[j].b == edges[i].b; ++j)
      same = same && s.cut_id[edges[j].quad] == s.cut_id[edges[i].quad];
    (same ? sets.smooth : sets.rim).emplace_back(edges[i].a, edges[i].b);
    i = j;
  }
  return sets;
}

Neighbours point_neighbours(const EdgeSets& edges, std::size_t points) {
  std::vector<std::uint8_t> on_rim(points, 0);
  for (const auto& [a, b] : edges.rim) on_rim[a] = on_rim[b] = 1;
  std::vector<std::pair<std::int32_t, std::int32_t>> pairs;
  for (const auto& [a, b] : edges.rim) pairs.insert(pairs.end(), {{a, b}, {b, a}});
  for (const auto& [a, b] : edges.smooth) {
    if (!on_rim[a]) pairs.emplace_back(a, b);
    if (!on_rim[b]) pairs.emplace_back(b, a);
  }
  std::sort(pairs.begin(), pairs.end());
  Neighbours n;
  n.begin.assign(points + 1, 0);
  for (const auto& [a, b] : pairs) {
    ++n.begin[a + 1];
    n.list.push_back(b);
  }
  for (std::size_t i = 0; i < points; ++i) n.begin[i + 1] += n.begin[i];
  return n;
}

/// One step of weight `factor` towards the mean of the neighbours.
void diffuse(std::vector<Vec3d>& values, const Neighbours& n, double factor) {
  const std::vector<Vec3d> old = values;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::int32_t begin = n.begin[i], end = n.begin[i + 1];
    if (begin == end) continue;
    Vec3d mean;
    for (std::int32_t k = begin; k < end; ++k) mean += old[n.list[k]];
    values[i] += factor * (mean * (1.0 / (end - begin)) - old[i]);
  }
}

void smooth_points(PreviewSurface& s, const Neighbours& n) {
  const std::vector<Vec3d> original = s.points;
  const double limit = kLargestMove * s.cell;
  for (int step = 0; step < kSmoothingSteps; ++step) {
    diffuse(s.points, n, kShrink);
    diffuse(s.points, n, kGrow);
    for (std::size_t i = 0; i < s.points.size(); ++i) {
      const Vec3d move = s.points[i] - original[i];
      const double length = norm(move);
      if (length > limit) s.points[i] = original[i] + move * (limit / length);
    }
  }
}

/// One normal for each point and cut id, averaged over its quads by area, then over neighbours.
void make_normals(PreviewSurface& s) {
  std::map<std::pair<std::int32_t, std::int32_t>, std::int32_t> index;
  s.normal_of.resize(s.quads.size());
  for (std::size_t q = 0; q < s.quads.size(); ++q) {
    const auto& quad = s.quads[q];
    const Vec3d area =
        cross(s.points[quad[2]] - s.points[quad[0]], s.points[quad[3]] - s.points[quad[1]]);
    for (std::size_t k = 0; k < 4; ++k) {
      const auto [it, added] =
          index.try_emplace({quad[k], s.cut_id[q]}, static_cast<std::int32_t>(s.normals.size()));
      if (added) s.normals.emplace_back();
      s.normals[it->second] += area;
      s.normal_of[q][k] = it->second;
    }
  }
  EdgeSets edges;
  for (const auto& corners : s.normal_of)
    for (std::size_t k = 0; k < 4; ++k) edges.smooth.emplace_back(corners[k], corners[(k + 1) % 4]);
  const Neighbours n = point_neighbours(edges, s.normals.size());
  for (int step = 0; step < kNormalSteps; ++step) diffuse(s.normals, n, 0.6);
  for (auto& normal : s.normals) {
    const double length = norm(normal);
    normal = length > 0 ? normal * (1 / length) : Vec3d{0, 0, 1};
  }
}

/// Corners of face 2 axis + side, counter-clockwise from outside.
std::array<std::size_t, 4> face_corners(int face) {
  const int axis = face / 2, u = (axis + 1) % 3, v = (axis + 2) % 3;
  const std::size_t base = face % 2 == 1 ? std::size_t{1} << axis : 0;
  const std::size_t bu = std::size_t{1} << u, bv = std::size_t{1} << v;
  if (face % 2 == 1) return {base, base + bu, base + bu + bv, base + bv};
  return {base, base + bv, base + bu + bv, base + bu};
}

/// The points of pieces that are no crumbs.
std::vector<std::int32_t> framed_points(const PreviewSurface& s, const Snapshot& snapshot) {
  std::map<std::int32_t, std::size_t> faces;
  for (const auto& face : snapshot.boundary) ++faces[snapshot.piece[face.cell]];
  std::vector<std::uint8_t> framed(s.points.size(), 0);
  for (std::size_t q = 0; q < s.quads.size(); ++q) {
    const std::size_t size = faces[snapshot.piece[snapshot.boundary[q].cell]];
    if (static_cast<double>(size) < kCrumb * static_cast<double>(s.quads.size())) continue;
    for (const std::int32_t p : s.quads[q]) framed[p] = 1;
  }
  std::vector<std::int32_t> list;
  for (std::size_t i = 0; i < framed.size(); ++i)
    if (framed[i] != 0) list.push_back(static_cast<std::int32_t>(i));
  return list;
}

}  // namespace

PreviewSurface preview_surface(const Snapshot& snapshot) {
  PreviewSurface s;
  std::vector<std::int32_t> compact(snapshot.points.size(), -1);
  double sides = 0;
  for (const auto& face : snapshot.boundary) {
    std::array<std::int32_t, 4> quad;
    const auto corners = face_corners(face.face);
    for (std::size_t k = 0; k < 4; ++k) {
      const std::int32_t p = snapshot.cells[face.cell][corners[k]];
      if (compact[p] < 0) {
        compact[p] = static_cast<std::int32_t>(s.points.size());
        s.points.push_back(snapshot.points[p] + snapshot.displacement[p]);
      }
      quad[k] = compact[p];
    }
    s.quads.push_back(quad);
    s.cut_id.push_back(face.cut_id);
    sides += norm(s.points[quad[1]] - s.points[quad[0]]);
  }
  if (s.quads.empty()) return s;
  s.cell = sides / static_cast<double>(s.quads.size());
  s.framed = framed_points(s, snapshot);
  smooth_points(s, point_neighbours(classify_edges(s), s.points.size()));
  make_normals(s);
  return s;
}

}  // namespace kerf
