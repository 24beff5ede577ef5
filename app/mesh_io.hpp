// SPDX-License-Identifier: MIT
//
// Triangle meshes from files.
#pragma once

#include <filesystem>

#include "core/geometry/triangle_mesh.hpp"

namespace kerf {

/// Reads OBJ, PLY, OFF or STL, ASCII or binary. Sub-meshes are joined, polygons split into
/// triangles, and points with equal coordinates welded.
///
/// OFF and PLY keep double precision. OBJ and STL are read by assimp, which (as Debian builds it)
/// keeps single precision: coordinates are good to 6e-8 of their size, so a small body far from
/// the origin loses detail.
///
/// @throws Error (bad_input) that names the file: it is missing, a folder, unreadable, empty,
/// damaged, of an unknown kind, without triangles, or holds a coordinate that is not finite.
TriangleMesh read_mesh(const std::filesystem::path& path);

}  // namespace kerf
