// SPDX-License-Identifier: MIT
#include "core/geometry/winding.hpp"

#include <cmath>
#include <numbers>
#include <numeric>

namespace kerf {
namespace {

// Distance from a cluster's centre, in radii, beyond which its dipole stands for it. Measured on
// an open bunny: the largest error is below kFarFieldError of the test.
constexpr double kFar = 3.0;

std::uint64_t spread(std::uint64_t v) {  // 21 bits to every third bit
  v = (v | v << 32) & 0x1f00000000ffffu;
  v = (v | v << 16) & 0x1f0000ff0000ffu;
  v = (v | v << 8) & 0x100f00f00f00f00fu;
  v = (v | v << 4) & 0x10c30c30c30c30c3u;
  return (v | v << 2) & 0x1249249249249249u;
}

std::uint64_t morton(const Vec3d& p, const Box3& box) {
  constexpr double kSteps = (1 << 21) - 1;
  std::uint64_t code = 0;
  for (int d = 0; d < 3; ++d) {
    const double width = box.hi[d] - box.lo[d];
    const double u = width > 0 ? std::clamp((p[d] - box.lo[d]) / width, 0.0, 1.0) : 0;
    code |= spread(static_cast<std::uint64_t>(u * kSteps)) << d;
  }
  return code;
}

double reach_squared(const Box3& box, const Vec3d& center) {
  Vec3d far{};
  for (int d = 0; d < 3; ++d) far[d] = std::max(center[d] - box.lo[d], box.hi[d] - center[d]);
  return kFar * kFar * dot(far, far);
}

}  // namespace

double solid_angle_fraction(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& p) {
  // Van Oosterom, Strackee 1983.
  const Vec3d u = a - p, v = b - p, w = c - p;
  const double lu = norm(u), lv = norm(v), lw = norm(w);
  const double det = dot(u, cross(v, w));
  const double den = lu * lv * lw + dot(u, v) * lw + dot(v, w) * lu + dot(w, u) * lv;
  if (det == 0) return 0;  // in its plane: seen from the edge, or p on it
  return std::atan2(det, den) / (2 * std::numbers::pi);
}

double winding_number(const TriangleMesh& mesh, const Vec3d& p) {
  double sum = 0;
  for (const auto& t : mesh.triangles)
    sum += solid_angle_fraction(mesh.points[static_cast<std::size_t>(t[0])],
                                mesh.points[static_cast<std::size_t>(t[1])],
                                mesh.points[static_cast<std::size_t>(t[2])], p);
  return sum;
}

WindingTree::WindingTree(const TriangleMesh& mesh) {
  const Box3 box = mesh.bounds();
  std::vector<std::pair<std::uint64_t, std::size_t>> order(mesh.triangles.size());
  const auto corner = [&](std::size_t i, unsigned k) {
    return mesh.points[static_cast<std::size_t>(mesh.triangles[i][k])];
  };
  for (std::size_t i = 0; i < order.size(); ++i)
    order[i] = {morton((1.0 / 3) * (corner(i, 0) + corner(i, 1) + corner(i, 2)), box), i};
  std::sort(order.begin(), order.end());
  triangles_.reserve(order.size());
  for (const auto& [code, i] : order)
    triangles_.push_back({corner(i, 0), corner(i, 1), corner(i, 2)});

  level_begin_.push_back(0);
  for (std::size_t first = 0; first < triangles_.size(); first += kFan) {
    Cluster leaf;
    for (std::size_t i = first; i < std::min(first + kFan, triangles_.size()); ++i) {
      const auto& [a, b, c] = triangles_[i];
      const Vec3d n = 0.5 * cross(b - a, c - a);
      const double area = norm(n);
      for (const Vec3d& p : triangles_[i]) leaf.box.add(p);
      leaf.center += (area / 3) * (a + b + c);
      leaf.dipole += n;
      leaf.area += area;
    }
    leaf.center = leaf.area > 0 ? (1 / leaf.area) * leaf.center : leaf.box.lo;
    leaf.reach = reach_squared(leaf.box, leaf.center);
    clusters_.push_back(leaf);
  }
  while (clusters_.size() - level_begin_.back() > 1) {
    const std::size_t begin = level_begin_.back(), end = clusters_.size();
    level_begin_.push_back(end);
    for (std::size_t first = begin; first < end; first += kFan) {
      Cluster joined;
      for (std::size_t i = first; i < std::min(first + kFan, end); ++i) {
        const Cluster& part = clusters_[i];
        joined.box.add(part.box);
        joined.center += part.area * part.center;
        joined.dipole += part.dipole;
        joined.area += part.area;
      }
      joined.center = joined.area > 0 ? (1 / joined.area) * joined.center : joined.box.lo;
      joined.reach = reach_squared(joined.box, joined.center);
      clusters_.push_back(joined);
    }
  }
}

double WindingTree::operator()(const Vec3d& p) const {
  if (clusters_.empty()) return 0;
  double sum = 0;
  std::array<Entry, kStack> stack;
  std::size_t height = 0;
  stack[height++] = {level_begin_.size() - 1, 0};
  while (height > 0) {
    const auto [level, index] = stack[--height];
    const Cluster& cluster = clusters_[level_begin_[level] + index];
    const Vec3d d = cluster.center - p;
    const double distance2 = dot(d, d);
    if (distance2 > cluster.reach) {
      sum += dot(cluster.dipole, d) / (4 * std::numbers::pi * distance2 * std::sqrt(distance2));
    } else if (level == 0) {
      for (std::size_t i = kFan * index; i < std::min(kFan * (index + 1), triangles_.size()); ++i)
        sum += solid_angle_fraction(triangles_[i][0], triangles_[i][1], triangles_[i][2], p);
    } else {
      const std::size_t below = level_begin_[level] - level_begin_[level - 1];
      for (std::size_t i = kFan * index; i < std::min(kFan * (index + 1), below); ++i)
        stack[height++] = {level - 1, i};
    }
  }
  return sum;
}

bool WindingTree::touches(const Box3& box) const {
  if (clusters_.empty()) return false;
  std::array<Entry, kStack> stack;
  std::size_t height = 0;
  stack[height++] = {level_begin_.size() - 1, 0};
  while (height > 0) {
    const auto [level, index] = stack[--height];
    if (!clusters_[level_begin_[level] + index].box.overlaps(box)) continue;
    if (level == 0) {
      for (std::size_t i = kFan * index; i < std::min(kFan * (index + 1), triangles_.size()); ++i) {
        Box3 own;
        for (const Vec3d& p : triangles_[i]) own.add(p);
        if (own.overlaps(box)) return true;
      }
    } else {
      const std::size_t below = level_begin_[level] - level_begin_[level - 1];
      for (std::size_t i = kFan * index; i < std::min(kFan * (index + 1), below); ++i)
        stack[height++] = {level - 1, i};
    }
  }
  return false;
}

}  // namespace kerf
