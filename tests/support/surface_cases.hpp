// SPDX-License-Identifier: MIT
//
// Bodies with surfaces, at rest.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "core/body/pieces.hpp"
#include "core/body/solid.hpp"
#include "core/body/voxelise.hpp"
#include "core/surface/surface.hpp"
#include "tests/support/surface_checks.hpp"

namespace kerf::test {

inline const SurfaceMethod kMethods[] = {SurfaceMethod::dual_contouring,
                                         SurfaceMethod::splitting_cubes};

inline std::string method_name(SurfaceMethod method) {
  return method == SurfaceMethod::dual_contouring ? "DualContouring" : "SplittingCubes";
}

/// The mesh of a bound surface at rest. Its normals are not computed.
inline SurfaceMesh mesh_at_rest(const Surface& surface, const LinkedOctree& body) {
  const std::vector<Vec3d> normals(surface.view().normals, {1, 0, 0});
  return surface.mesh(surface.store().reference, normals, label_pieces(body, nullptr));
}

/// The same of a body without a surface yet.
inline SurfaceMesh surface_of(const LinkedOctree& body, SurfaceMethod method) {
  Surface surface(body, method);
  surface.bind(body);
  return mesh_at_rest(surface, body);
}

inline LinkedOctree octree_of(const Solid& solid, int resolution, int refinement) {
  return {voxelise(solid, make_lattice(solid.bounds(), resolution, refinement)), refinement};
}

/// Connected parts of a surface.
inline std::size_t part_count(const SurfaceMesh& mesh) {
  std::size_t count = 0;
  mesh_parts(mesh, &count);
  return count;
}

/// V - E + F of each part, in the order of their first points.
inline std::vector<std::int64_t> euler_numbers(const SurfaceMesh& mesh) {
  std::size_t count = 0;
  const std::vector<std::int32_t> part = mesh_parts(mesh, &count);
  std::vector<std::int64_t> twice(count, 0);
  for (const std::int32_t p : part)
    if (p >= 0) twice[static_cast<std::size_t>(p)] += 2;
  for (const auto& t : mesh.triangles)
    --twice[static_cast<std::size_t>(part[static_cast<std::size_t>(t[0])])];
  for (std::int64_t& number : twice) number /= 2;
  return twice;
}

/// Every triangle lies within one piece, and every piece has triangles.
inline ::testing::AssertionResult pieces_are_apart(const SurfaceMesh& mesh, std::size_t pieces) {
  std::vector<char> seen(pieces, 0);
  for (const auto& t : mesh.triangles) {
    const std::int32_t piece = mesh.piece[static_cast<std::size_t>(t[0])];
    seen[static_cast<std::size_t>(piece)] = 1;
    for (const std::int32_t v : t)
      if (mesh.piece[static_cast<std::size_t>(v)] != piece)
        return ::testing::AssertionFailure() << "a triangle joins pieces " << piece << " and "
                                             << mesh.piece[static_cast<std::size_t>(v)];
  }
  for (std::size_t i = 0; i < pieces; ++i)
    if (seen[i] == 0) return ::testing::AssertionFailure() << "piece " << i << " has no surface";
  return ::testing::AssertionSuccess();
}

inline Vec3d point_of(const SurfaceMesh& mesh, std::int32_t p) {
  return mesh.reference[static_cast<std::size_t>(p)];
}

/// Twice the area of a triangle along its normal, at rest.
inline Vec3d face_of(const SurfaceMesh& mesh, const std::array<std::int32_t, 3>& t) {
  const Vec3d a = point_of(mesh, t[0]);
  return cross(point_of(mesh, t[1]) - a, point_of(mesh, t[2]) - a);
}

}  // namespace kerf::test
