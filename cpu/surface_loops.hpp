// SPDX-License-Identifier: MIT
//
// The loops that move a surface, for both CPU backends.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/levels/hierarchy.hpp"
#include "core/surface/surface_view.hpp"
#include "kernels/surface.hpp"
#include "kernels/transfer.hpp"

namespace kerf::cpu {

/// Calls body(i) for all i below count, on threads where that is worth it.
template <class Body>
void for_points(std::size_t count, int threads, const Body& body) {
  constexpr std::int32_t kWorthPoints = 4096;  // below, waking the threads costs more
  const auto items = static_cast<std::int32_t>(count);
#pragma omp parallel for num_threads(threads) schedule(static) if (items >= kWorthPoints)
  for (std::int32_t i = 0; i < items; ++i) body(i);
}

/// displacement(vertex of level 0): a vector, m.
template <class Displacement>
void move_points(const Level& level, std::span<const BoundPoint> points,
                 const Displacement& displacement, std::span<Vec3d> positions, int threads) {
  for_points(points.size(), threads, [&](std::int32_t p) {
    const BoundPoint& point = points[p];
    positions[p] = point.reference;
    if (point.cell < 0) return;
    Vec3d at[8], corners[8];
    for (int i = 0; i < 8; ++i) at[i] = displacement(level.slots[point.cell][i]);
    kernels::unfold(at, level.fold[point.cell], corners);
    positions[p] += kernels::trilinear(corners, point.local);
  });
}

/// Shapes  faces: room for the area normal of each triangle.
void surface_normals(const SurfaceView& surface, std::span<const Vec3d> positions,
                     std::span<Vec3d> normals, std::span<Vec3d> faces, int threads);

}  // namespace kerf::cpu
