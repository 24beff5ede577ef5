// SPDX-License-Identifier: MIT
//
// Spheres and boxes as surfaces, for pictures of them.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>

#include "core/surface/surface_mesh.hpp"

namespace kerf::test {

/// Adds `part` as a piece of its own number.
inline void add_part(SurfaceMesh& mesh, const SurfaceMesh& part, std::int32_t piece) {
  const auto points = static_cast<std::int32_t>(mesh.reference.size());
  const auto normals = static_cast<std::int32_t>(mesh.normals.size());
  mesh.reference.insert(mesh.reference.end(), part.reference.begin(), part.reference.end());
  mesh.displacement.insert(mesh.displacement.end(), part.displacement.begin(),
                           part.displacement.end());
  mesh.piece.insert(mesh.piece.end(), part.reference.size(), piece);
  for (const auto& t : part.triangles)
    mesh.triangles.push_back({t[0] + points, t[1] + points, t[2] + points});
  for (const auto& n : part.normal_of)
    mesh.normal_of.push_back({n[0] + normals, n[1] + normals, n[2] + normals});
  mesh.cut_id.insert(mesh.cut_id.end(), part.cut_id.begin(), part.cut_id.end());
  mesh.normals.insert(mesh.normals.end(), part.normals.begin(), part.normals.end());
}

inline SurfaceMesh moved(SurfaceMesh mesh, const Vec3d& by) {
  for (auto& u : mesh.displacement) u += by;
  return mesh;
}

/// A sphere of 4 n (n - 1) triangles with its axis along y; `cut_id` of a triangle from the unit
/// vector to its middle.
inline SurfaceMesh make_sphere(const Vec3d& centre, double radius, int n,
                               const std::function<std::int32_t(const Vec3d&)>& cut_id = {}) {
  SurfaceMesh mesh;
  const auto add_point = [&](double polar, double around) {
    const Vec3d normal{std::sin(polar) * std::sin(around), std::cos(polar),
                       std::sin(polar) * std::cos(around)};
    mesh.normals.push_back(normal);
    mesh.reference.push_back(centre + radius * normal);
  };
  const auto add_triangle = [&](std::int32_t a, std::int32_t b, std::int32_t c) {
    mesh.triangles.push_back({a, b, c});
    const Vec3d middle = mesh.normals[static_cast<std::size_t>(a)] +
                         mesh.normals[static_cast<std::size_t>(b)] +
                         mesh.normals[static_cast<std::size_t>(c)];
    mesh.cut_id.push_back(cut_id ? cut_id(middle * (1 / norm(middle))) : 0);
  };
  const double pi = std::numbers::pi;
  add_point(0, 0);
  for (int i = 1; i < n; ++i)
    for (int j = 0; j < 2 * n; ++j) add_point(pi * i / n, pi * j / n);
  add_point(pi, 0);
  const auto last = static_cast<std::int32_t>(mesh.reference.size()) - 1;
  const auto at = [&](int i, int j) { return 1 + (i - 1) * 2 * n + j % (2 * n); };
  for (int j = 0; j < 2 * n; ++j) {
    add_triangle(0, at(1, j), at(1, j + 1));
    for (int i = 1; i + 1 < n; ++i) {
      add_triangle(at(i, j), at(i + 1, j), at(i + 1, j + 1));
      add_triangle(at(i, j), at(i + 1, j + 1), at(i, j + 1));
    }
    add_triangle(at(n - 1, j), last, at(n - 1, j + 1));
  }
  mesh.normal_of = mesh.triangles;
  mesh.displacement.resize(mesh.reference.size());
  mesh.piece.assign(mesh.reference.size(), 0);
  return mesh;
}

/// A box; `cut_id` of the face that looks along an axis, in the order -x, +x, -y, +y, -z, +z.
inline SurfaceMesh make_box_surface(const Vec3d& lo, const Vec3d& hi,
                                    const std::array<std::int32_t, 6>& cut_id = {}) {
  SurfaceMesh mesh;
  for (int k = 0; k < 8; ++k)
    mesh.reference.push_back(
        {(k & 1) != 0 ? hi.x : lo.x, (k & 2) != 0 ? hi.y : lo.y, (k & 4) != 0 ? hi.z : lo.z});
  for (int face = 0; face < 6; ++face) {
    const int axis = face / 2, u = 1 << (axis + 1) % 3, v = 1 << (axis + 2) % 3;
    const int base = face % 2 == 1 ? 1 << axis : 0;
    const std::array<std::int32_t, 4> quad =
        face % 2 == 1 ? std::array<std::int32_t, 4>{base, base + u, base + u + v, base + v}
                      : std::array<std::int32_t, 4>{base, base + v, base + u + v, base + u};
    mesh.triangles.push_back({quad[0], quad[1], quad[2]});
    mesh.triangles.push_back({quad[0], quad[2], quad[3]});
    Vec3d normal;
    normal[axis] = face % 2 == 1 ? 1 : -1;
    mesh.normals.push_back(normal);
    for (int k = 0; k < 2; ++k) {
      mesh.normal_of.push_back({face, face, face});
      mesh.cut_id.push_back(cut_id[static_cast<std::size_t>(face)]);
    }
  }
  mesh.displacement.resize(8);
  mesh.piece.assign(8, 0);
  return mesh;
}

}  // namespace kerf::test
