// SPDX-License-Identifier: MIT
//
// The surface of a body at one moment, as files and pictures want it.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/geometry/vec.hpp"

namespace kerf {

/// A closed surface: every edge belongs to two triangles, which pass it in opposite directions. The
/// two sides of a cut lie at one place at rest and share no point, except along the cut's tip.
///
/// Points are shared by all triangles around them; normals are not: a point has one normal for each
/// cut id around it, two at the tip of a cut, and more at an edge of the object. So surfaces are
/// smooth and their edges sharp.
struct SurfaceMesh {
  std::vector<Vec3d> reference;     ///< per point: position at rest, m
  std::vector<Vec3d> displacement;  ///< per point, m
  std::vector<std::int32_t> piece;  ///< per point: the connected part that it moves with
  std::vector<std::array<std::int32_t, 3>> triangles;  ///< points, counter-clockwise from outside
  std::vector<std::array<std::int32_t, 3>> normal_of;  ///< per corner of a triangle, into normals
  std::vector<std::int32_t> cut_id;  ///< per triangle; 0: the object's own surface, 1, 2, ...: cuts
  std::vector<Vec3d> normals;        ///< unit, outward, of the deformed surface

  Vec3d position(std::int32_t point) const {
    return reference[static_cast<std::size_t>(point)] +
           displacement[static_cast<std::size_t>(point)];
  }
};

}  // namespace kerf
