// SPDX-License-Identifier: MIT
//
// OFF and PLY, read here: assimp 5.2 runs past its buffers, or for ever, on damaged files of these
// two kinds, and keeps single precision.
#pragma once

#include <string>
#include <string_view>

#include "core/geometry/triangle_mesh.hpp"

namespace kerf {

/// ASCII OFF, with or without colours and normals, which are passed over.
/// @throws Error (bad_input) that begins with `name`.
TriangleMesh parse_off(std::string_view bytes, const std::string& name);

/// PLY: ASCII, or binary of either byte order; elements and properties that say nothing about
/// points or faces are passed over.
/// @throws Error (bad_input) that begins with `name`.
TriangleMesh parse_ply(std::string_view bytes, const std::string& name);

/// Adds the triangles of a polygon, a fan about its first point. Where the polygon is not convex
/// the fan folds back on itself, which leaves every winding number as it is.
template <class Index>
void add_polygon(TriangleMesh& mesh, const Index* points, std::size_t count, std::size_t first) {
  const auto at = [&](std::size_t k) {
    return static_cast<std::int32_t>(first + static_cast<std::size_t>(points[k]));
  };
  for (std::size_t k = 2; k < count; ++k) mesh.triangles.push_back({at(0), at(k - 1), at(k)});
}

}  // namespace kerf
