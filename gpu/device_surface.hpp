// SPDX-License-Identifier: MIT
//
// A surface bound to the cells of level 0, on a device: what binds it is sent where it changed.
#pragma once

#include <array>

#include "gpu/device_backend.hpp"

namespace kerf::gpu {

template <class Device, class S>
void DeviceBackend<Device, S>::move_points(std::span<const BoundPoint> points, int displacement,
                                           std::span<Vec3d> positions) {
  points_.sync(points, [](const BoundPoint& p) {
    SurfacePoint out{};
    out.reference = p.reference;
    out.local = p.local;
    out.cell = p.cell;
    return out;
  });
  positions_.assign(points.size());
  run(count_of(points),
      MovePoint{levels_[0].view(), points_.data(), exact_vector(displacement), positions_.data()});
  positions_.read(0, positions);
}

template <class Device, class S>
void DeviceBackend<Device, S>::surface_normals(const SurfaceView& surface,
                                               std::span<const Vec3d> positions,
                                               std::span<Vec3d> normals) {
  const auto as_it_is = [](const auto& value) { return value; };
  const std::span<const std::int32_t> corners(
      surface.triangles.empty() ? nullptr : surface.triangles[0].data(),
      3 * surface.triangles.size());
  corners_.sync(corners, as_it_is);
  first_corner_.sync(surface.first_corner, as_it_is);
  next_corner_.sync(surface.next_corner, as_it_is);
  normal_of_.sync(surface.normal_of, as_it_is);
  rest_.sync(positions, as_it_is);
  faces_.assign(surface.triangles.size());
  normals_.upload(std::span<const Vec3d>(normals));  // free slots keep theirs
  run(count_of(surface.triangles), FaceNormal{corners_.data(), rest_.data(), faces_.data()});
  run(count_of(surface.points), PointNormals{first_corner_.data(), next_corner_.data(),
                                             normal_of_.data(), faces_.data(), normals_.data()});
  normals_.read(0, normals);
}

}  // namespace kerf::gpu
