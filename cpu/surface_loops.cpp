// SPDX-License-Identifier: MIT
#include "cpu/surface_loops.hpp"

namespace kerf::cpu {

void surface_normals(const SurfaceView& surface, std::span<const Vec3d> positions,
                     std::span<Vec3d> normals, std::span<Vec3d> faces, int threads) {
  for_points(surface.triangles.size(), threads, [&](std::int32_t t) {
    const auto& [a, b, c] = surface.triangles[t];
    faces[t] = kernels::area_normal(positions[a], positions[b], positions[c]);
  });
  for_points(surface.points.size(), threads, [&](std::int32_t p) {
    for (std::int32_t c = surface.first_corner[p]; c >= 0;) {
      const std::int32_t normal = surface.normal_of[c];
      Vec3d sum{};
      for (; c >= 0 && surface.normal_of[c] == normal; c = surface.next_corner[c])
        sum += faces[c / 3];
      normals[normal] = kernels::unit_or_z(sum);
    }
  });
}

}  // namespace kerf::cpu
