// SPDX-License-Identifier: MIT
#include "app/corner_normals.hpp"

#include <bit>
#include <unordered_map>

namespace kerf {
namespace {

// Opposite normals leave this much of each other, by rounding in single precision.
constexpr double kCancelled = 1e-6;

using Key = std::array<std::uint32_t, 4>;  // point, and the bits of a normal

struct KeyHash {
  std::size_t operator()(const Key& key) const {
    std::uint64_t hash = 0;
    for (const std::uint32_t part : key) {
      hash = (hash ^ part) * 0x9E3779B97F4A7C15U;
      hash ^= hash >> 29;
    }
    return static_cast<std::size_t>(hash);
  }
};

Key key_of(std::int32_t point, const Vec3f& n) {
  return {static_cast<std::uint32_t>(point), std::bit_cast<std::uint32_t>(n.x),
          std::bit_cast<std::uint32_t>(n.y), std::bit_cast<std::uint32_t>(n.z)};
}

Vec3f to_float(const Vec3d& v) {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

}  // namespace

CornerNormals corner_normals(std::span<const std::array<std::int32_t, 3>> triangles,
                             std::span<const std::array<Vec3f, 3>> normals) {
  CornerNormals out;
  out.triangles.resize(triangles.size());
  std::unordered_map<Key, std::int32_t, KeyHash> number;
  number.reserve(triangles.size());  // a closed surface has about half as many points
  for (std::size_t t = 0; t < triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [entry, added] = number.try_emplace(key_of(triangles[t][k], normals[t][k]),
                                                     static_cast<std::int32_t>(out.point.size()));
      out.triangles[t][k] = entry->second;
      if (!added) continue;
      out.point.push_back(triangles[t][k]);
      out.normal.push_back(normals[t][k]);
    }
  return out;
}

std::vector<std::array<Vec3f, 3>> triangle_normals(const SurfaceMesh& surface) {
  std::vector<std::array<Vec3f, 3>> out(surface.triangles.size());
  for (std::size_t t = 0; t < out.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k)
      out[t][k] = to_float(surface.normals[static_cast<std::size_t>(surface.normal_of[t][k])]);
  return out;
}

std::vector<Vec3f> point_normals(const CornerNormals& corners, std::size_t points) {
  std::vector<Vec3d> sum(points);
  std::vector<Vec3f> out(points);  // the first until it is known that the sum is not zero
  std::vector<bool> met(points, false);
  for (std::size_t i = 0; i < corners.point.size(); ++i) {
    const auto p = static_cast<std::size_t>(corners.point[i]);
    const Vec3f& n = corners.normal[i];
    sum[p] += Vec3d{n.x, n.y, n.z};
    if (!met[p]) out[p] = n;
    met[p] = true;
  }
  for (std::size_t p = 0; p < points; ++p) {
    const double length = norm(sum[p]);
    if (length > kCancelled) out[p] = to_float((1 / length) * sum[p]);
  }
  return out;
}

}  // namespace kerf
