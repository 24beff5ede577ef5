// SPDX-License-Identifier: MIT
//
// What must hold of every surface, from its triangles alone.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <tuple>
#include <vector>

#include "core/surface/surface_mesh.hpp"

namespace kerf::test {

/// Connected parts of a mesh over shared points; -1 for a point without triangles.
inline std::vector<std::int32_t> mesh_parts(const SurfaceMesh& mesh, std::size_t* count) {
  std::vector<std::int32_t> part(mesh.reference.size(), -1);
  std::vector<std::vector<std::int32_t>> around(mesh.reference.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (const std::int32_t v : mesh.triangles[t])
      around[static_cast<std::size_t>(v)].push_back(static_cast<std::int32_t>(t));
  std::int32_t parts = 0;
  for (std::size_t seed = 0; seed < part.size(); ++seed) {
    if (part[seed] >= 0 || around[seed].empty()) continue;
    std::vector<std::int32_t> stack{static_cast<std::int32_t>(seed)};
    part[seed] = parts;
    while (!stack.empty()) {
      const std::int32_t v = stack.back();
      stack.pop_back();
      for (const std::int32_t t : around[static_cast<std::size_t>(v)])
        for (const std::int32_t w : mesh.triangles[static_cast<std::size_t>(t)])
          if (part[static_cast<std::size_t>(w)] < 0) {
            part[static_cast<std::size_t>(w)] = parts;
            stack.push_back(w);
          }
    }
    ++parts;
  }
  if (count != nullptr) *count = static_cast<std::size_t>(parts);
  return part;
}

/// Whether every edge lies in exactly two triangles that pass it in opposite directions.
inline ::testing::AssertionResult is_closed_and_oriented(const SurfaceMesh& mesh) {
  std::vector<std::array<std::int32_t, 3>> edges;  // low, high, +1 or -1
  edges.reserve(3 * mesh.triangles.size());
  for (const auto& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::int32_t a = t[k], b = t[(k + 1) % 3];
      if (a == b) return ::testing::AssertionFailure() << "a triangle repeats point " << a;
      edges.push_back({std::min(a, b), std::max(a, b), a < b ? 1 : -1});
    }
  std::sort(edges.begin(), edges.end());
  for (std::size_t i = 0; i < edges.size();) {
    std::size_t j = i;
    int balance = 0;
    for (; j < edges.size() && edges[j][0] == edges[i][0] && edges[j][1] == edges[i][1]; ++j)
      balance += edges[j][2];
    if (j - i != 2 || balance != 0)
      return ::testing::AssertionFailure()
             << "edge " << edges[i][0] << "-" << edges[i][1] << " lies in " << j - i
             << " triangles, forth less back: " << balance;
    i = j;
  }
  return ::testing::AssertionSuccess();
}

/// Whether the triangles around each point form one closed fan. Needs a closed, oriented mesh.
inline ::testing::AssertionResult has_one_fan_per_point(const SurfaceMesh& mesh) {
  // Around v, triangle (v, a, b) leads from a to b.
  std::vector<std::map<std::int32_t, std::int32_t>> next(mesh.reference.size());
  for (const auto& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k)
      next[static_cast<std::size_t>(t[k])][t[(k + 1) % 3]] = t[(k + 2) % 3];
  for (std::size_t v = 0; v < next.size(); ++v) {
    if (next[v].empty())
      return ::testing::AssertionFailure() << "point " << v << " has no triangle";
    std::size_t steps = 0;
    std::int32_t at = next[v].begin()->first;
    do {
      at = next[v].at(at);
      ++steps;
    } while (at != next[v].begin()->first && steps <= next[v].size());
    if (steps != next[v].size())
      return ::testing::AssertionFailure()
             << "point " << v << " joins " << next[v].size() << " triangles, a fan holds " << steps;
  }
  return ::testing::AssertionSuccess();
}

inline ::testing::AssertionResult is_manifold(const SurfaceMesh& mesh) {
  const auto closed = is_closed_and_oriented(mesh);
  return closed ? has_one_fan_per_point(mesh) : closed;
}

/// V - E + F. Needs a closed mesh.
inline std::int64_t euler_number(const SurfaceMesh& mesh) {
  return static_cast<std::int64_t>(mesh.reference.size()) -
         static_cast<std::int64_t>(mesh.triangles.size()) / 2;
}

/// Enclosed volume, of the positions at rest, m^3.
inline double rest_volume(const SurfaceMesh& mesh) {
  double sum = 0;
  for (const auto& t : mesh.triangles) {
    const Vec3d &a = mesh.reference[static_cast<std::size_t>(t[0])],
                &b = mesh.reference[static_cast<std::size_t>(t[1])],
                &c = mesh.reference[static_cast<std::size_t>(t[2])];
    sum += dot(a, cross(b, c)) / 6;
  }
  return sum;
}

}  // namespace kerf::test
