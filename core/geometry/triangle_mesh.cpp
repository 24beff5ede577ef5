// SPDX-License-Identifier: MIT
#include "core/geometry/triangle_mesh.hpp"

#include <bit>
#include <cmath>
#include <unordered_map>

#include "core/base/error.hpp"

namespace kerf {
namespace {

struct PointHash {
  std::size_t operator()(const std::array<std::uint64_t, 3>& bits) const {
    std::uint64_t h = 0x9e3779b97f4a7c15u;
    for (const std::uint64_t b : bits) {
      h = (h ^ b) * 0xbf58476d1ce4e5b9u;
      h ^= h >> 31;
    }
    return static_cast<std::size_t>(h);
  }
};

// One side of a triangle: the edge's two points, lower first, and the direction as the last bit.
std::vector<std::array<std::uint64_t, 2>> sorted_half_edges(const TriangleMesh& mesh) {
  std::vector<std::array<std::uint64_t, 2>> halves;
  halves.reserve(3 * mesh.triangles.size());
  for (const auto& t : mesh.triangles) {
    if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) continue;
    for (unsigned i = 0; i < 3; ++i) {
      const auto a = static_cast<std::uint32_t>(t[i]),
                 b = static_cast<std::uint32_t>(t[(i + 1) % 3]);
      const std::uint64_t low = std::min(a, b), high = std::max(a, b);
      halves.push_back({low << 32 | high, a < b ? 0u : 1u});
    }
  }
  std::sort(halves.begin(), halves.end());
  return halves;
}

bool has_no_area(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  const Vec3d u = b - a, v = c - a, w = c - b;
  constexpr double kRounding = 8 * std::numeric_limits<double>::epsilon();  // of a cross product
  return norm(cross(u, v)) <= kRounding * std::max({dot(u, u), dot(v, v), dot(w, w)});
}

}  // namespace

Box3 TriangleMesh::bounds() const {
  Box3 box;
  for (const auto& t : triangles)
    for (const std::int32_t i : t) box.add(points[static_cast<std::size_t>(i)]);
  return box;
}

MeshReport inspect(const TriangleMesh& mesh) {
  MeshReport report;
  const auto halves = sorted_half_edges(mesh);
  for (std::size_t begin = 0, end = 0; begin < halves.size(); begin = end) {
    std::size_t back = 0;
    for (end = begin; end < halves.size() && halves[end][0] == halves[begin][0]; ++end)
      back += halves[end][1];
    const std::size_t count = end - begin;
    if (count == 1) ++report.boundary_edges;
    if (count > 2) ++report.nonmanifold_edges;
    if (count == 2 && back != 1) ++report.misoriented_edges;
    if (2 * back != count) ++report.unbalanced_edges;
  }
  const Box3 box = mesh.bounds();
  if (box.empty()) return report;
  const Vec3d middle = 0.5 * (box.lo + box.hi);
  for (const auto& t : mesh.triangles) {
    const Vec3d a = mesh.points[static_cast<std::size_t>(t[0])] - middle;
    const Vec3d b = mesh.points[static_cast<std::size_t>(t[1])] - middle;
    const Vec3d c = mesh.points[static_cast<std::size_t>(t[2])] - middle;
    if (has_no_area(a, b, c)) ++report.degenerate_triangles;
    report.volume += dot(a, cross(b, c)) / 6;
  }
  return report;
}

TriangleMesh weld(const TriangleMesh& mesh) {
  TriangleMesh out;
  std::unordered_map<std::array<std::uint64_t, 3>, std::int32_t, PointHash> first;
  first.reserve(mesh.points.size());
  std::vector<std::int32_t> merged(mesh.points.size());
  for (std::size_t i = 0; i < mesh.points.size(); ++i) {
    const Vec3d& p = mesh.points[i];
    std::array<std::uint64_t, 3> bits{};
    for (int d = 0; d < 3; ++d)
      bits[static_cast<unsigned>(d)] = std::bit_cast<std::uint64_t>(p[d] + 0.0);  // -0 becomes 0
    const auto next = static_cast<std::int32_t>(out.points.size());
    const auto [at, added] = first.try_emplace(bits, next);
    if (added) out.points.push_back(p);
    merged[i] = at->second;
  }
  out.triangles.reserve(mesh.triangles.size());
  for (const auto& t : mesh.triangles) {
    std::array<std::int32_t, 3> u{};
    for (unsigned i = 0; i < 3; ++i) u[i] = merged[static_cast<std::size_t>(t[i])];
    if (u[0] != u[1] && u[1] != u[2] && u[2] != u[0]) out.triangles.push_back(u);
  }
  return out;
}

void check_finite(const TriangleMesh& mesh, const std::string& name) {
  // The message is put together only when it is needed: meshes are large.
  for (std::size_t i = 0; i < mesh.points.size(); ++i) {
    const Vec3d& p = mesh.points[i];
    if (std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z)) continue;
    expects(false, text(name, ": point ", i, " (", p.x, ", ", p.y, ", ", p.z, ") is not finite"));
  }
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
    for (const std::int32_t k : mesh.triangles[i]) {
      if (k >= 0 && static_cast<std::size_t>(k) < mesh.points.size()) continue;
      expects(false, text(name, ": triangle ", i, " refers to point ", k, ", but there are ",
                          mesh.points.size(), " points"));
    }
}

}  // namespace kerf
