// SPDX-License-Identifier: MIT
//
// The loops that move a surface, for both CPU backends.
#pragma once

#include <span>
#include <vector>

#include "core/levels/hierarchy.hpp"
#include "core/surface/surface_view.hpp"

namespace kerf::cpu {

/// Shapes  u: three a vertex of level 0, m.
void move_points(const Level& level, std::span<const BoundPoint> points, const double* u,
                 std::span<Vec3d> positions, int threads);

/// Shapes  faces: room for the area normals, kept from call to call.
void surface_normals(const SurfaceView& surface, std::span<const Vec3d> positions,
                     std::span<Vec3d> normals, std::vector<Vec3d>& faces, int threads);

}  // namespace kerf::cpu
