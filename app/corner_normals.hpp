// SPDX-License-Identifier: MIT
//
// The normals of a surface as its files hold them: in single precision, told apart by their bits.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/surface/surface_mesh.hpp"

namespace kerf {

/// What the corners of triangles need told apart: each pair of a point and a normal once, in the
/// order in which the corners meet them. So the same corners give the same pairs, wherever their
/// normals come from.
struct CornerNormals {
  std::vector<std::int32_t> point;                     ///< per pair
  std::vector<Vec3f> normal;                           ///< per pair
  std::vector<std::array<std::int32_t, 3>> triangles;  ///< per corner: its pair
};

/// Needs  one entry of `normals` per triangle.
CornerNormals corner_normals(std::span<const std::array<std::int32_t, 3>> triangles,
                             std::span<const std::array<Vec3f, 3>> normals);

/// The normals of the three corners of every triangle of a surface.
std::vector<std::array<Vec3f, 3>> triangle_normals(const SurfaceMesh& surface);

/// One normal per point, for files that know no other: the sum of its normals, of unit length; the
/// first of them if that is zero; zero at a point of no triangle.
std::vector<Vec3f> point_normals(const CornerNormals& corners, std::size_t points);

}  // namespace kerf
