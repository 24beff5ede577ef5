// SPDX-License-Identifier: MIT
//
// What a backend needs of a surface to move it.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/geometry/vec.hpp"

namespace kerf {

/// A point that moves with a cell of level 0, by trilinear inter- or extrapolation.
struct BoundPoint {
  Vec3d reference{};       ///< m
  Vec3d local{};           ///< from the cell's low corner, in its sides; may leave [0, 1]
  std::int32_t cell = -1;  ///< -1: a free slot
};

/// What a backend needs of a surface; spans into a Surface, valid until it changes.
struct SurfaceView {
  std::span<const BoundPoint> points;
  std::span<const std::array<std::int32_t, 3>> triangles;
  std::span<const std::int32_t> first_corner;  ///< per point; lists as in TriangleStore
  std::span<const std::int32_t> next_corner;   ///< per corner of a triangle
  std::span<const std::int32_t> normal_of;     ///< per corner of a triangle
  std::size_t normals = 0;                     ///< slots
};

}  // namespace kerf
