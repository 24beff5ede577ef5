// SPDX-License-Identifier: MIT
//
// Distances to triangles, and what lies on them.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "core/geometry/triangle_mesh.hpp"

namespace kerf::test {

inline double segment_distance(const Vec3d& p, const Vec3d& a, const Vec3d& b) {
  const Vec3d along = b - a;
  const double length2 = dot(along, along);
  const double t = length2 > 0 ? std::clamp(dot(p - a, along) / length2, 0.0, 1.0) : 0;
  return norm(p - a - t * along);
}

/// From p to the nearest point of a triangle: above its inside, to its plane; else to its edges.
inline double triangle_distance(const Vec3d& p, const std::array<Vec3d, 3>& x) {
  const Vec3d n = cross(x[1] - x[0], x[2] - x[0]);
  bool above = norm(n) > 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3d &a = x[k], &b = x[(k + 1) % 3];
    above = above && dot(cross(b - a, p - a), n) >= 0;
    least = std::min(least, segment_distance(p, a, b));
  }
  return above ? std::abs(dot(n, p - x[0])) / norm(n) : least;
}

/// The nearest of many triangles, in buckets of a grid of about the size of the triangles.
class TriangleFinder {
 public:
  /// @param bucket  side of a bucket; distances far above it are slow
  TriangleFinder(TriangleMesh mesh, double bucket) : mesh_(std::move(mesh)), bucket_(bucket) {
    const Box3 box = mesh_.bounds();
    origin_ = box.lo;
    for (int d = 0; d < 3; ++d)
      size_[static_cast<std::size_t>(d)] = 1 + static_cast<int>((box.hi[d] - box.lo[d]) / bucket);
    buckets_.resize(static_cast<std::size_t>(size_[0]) * static_cast<std::size_t>(size_[1]) *
                    static_cast<std::size_t>(size_[2]));
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
      Box3 of;
      for (const Vec3d& p : corners(t)) of.add(p);
      const Vec3i lo = place(of.lo), hi = place(of.hi);
      for_box(lo, hi, [&](std::size_t i) { buckets_[i].push_back(t); });
    }
  }

  double distance(const Vec3d& p) const {
    double least = std::numeric_limits<double>::infinity();
    const int most = size_[0] + size_[1] + size_[2];
    const Vec3i at = place(p);
    // Rings of buckets around p, until no other can hold a nearer triangle. A point beside the grid
    // is at least as far from each as its nearest bucket is.
    for (int ring = 0; ring <= most; ++ring) {
      if (least <= bucket_ * std::max(ring - 1.0, 0.0)) break;
      for_box({at[0] - ring, at[1] - ring, at[2] - ring},
              {at[0] + ring, at[1] + ring, at[2] + ring}, [&](std::size_t i) {
                if (ring_of(i, at) != ring) return;
                for (const std::size_t t : buckets_[i])
                  least = std::min(least, triangle_distance(p, corners(t)));
              });
    }
    return least;
  }

  std::array<Vec3d, 3> corners(std::size_t t) const {
    const auto& [a, b, c] = mesh_.triangles[t];
    return {mesh_.points[static_cast<std::size_t>(a)], mesh_.points[static_cast<std::size_t>(b)],
            mesh_.points[static_cast<std::size_t>(c)]};
  }

 private:
  Vec3i place(const Vec3d& p) const {
    Vec3i out;
    for (int d = 0; d < 3; ++d) {
      const auto i = static_cast<std::size_t>(d);
      out[i] = std::clamp(static_cast<int>((p[d] - origin_[d]) / bucket_), 0, size_[i] - 1);
    }
    return out;
  }
  template <class F>
  void for_box(const Vec3i& lo, const Vec3i& hi, const F& f) const {
    for (int z = std::max(lo[2], 0); z <= std::min(hi[2], size_[2] - 1); ++z)
      for (int y = std::max(lo[1], 0); y <= std::min(hi[1], size_[1] - 1); ++y)
        for (int x = std::max(lo[0], 0); x <= std::min(hi[0], size_[0] - 1); ++x)
          f(static_cast<std::size_t>(x + size_[0] * (y + size_[1] * z)));
  }
  int ring_of(std::size_t i, const Vec3i& at) const {
    const int n = static_cast<int>(i);
    return std::max({std::abs(n % size_[0] - at[0]), std::abs(n / size_[0] % size_[1] - at[1]),
                     std::abs(n / size_[0] / size_[1] - at[2])});
  }

  TriangleMesh mesh_;
  double bucket_;
  Vec3d origin_{};
  Vec3i size_{};
  std::vector<std::vector<std::size_t>> buckets_;
};

/// Calls f for points all over a triangle: its corners, and `n` rows between them.
template <class F>
void sample_triangle(const std::array<Vec3d, 3>& x, int n, const F& f) {
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n - i; ++j)
      f((1.0 / n) * (1.0 * i * x[0] + 1.0 * j * x[1] + 1.0 * (n - i - j) * x[2]));
}

}  // namespace kerf::test
