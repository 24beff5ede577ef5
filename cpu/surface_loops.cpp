// SPDX-License-Identifier: MIT
#include "cpu/surface_loops.hpp"

#include "cpu/level_store.hpp"
#include "kernels/surface.hpp"
#include "kernels/transfer.hpp"

namespace kerf::cpu {
namespace {

constexpr std::int32_t kWorthPoints = 4096;  // below, waking the threads costs more

template <class Body>
void parallel(std::size_t count, int threads, const Body& body) {
  const auto items = static_cast<std::int32_t>(count);
#pragma omp parallel for num_threads(threads) schedule(static) if (items >= kWorthPoints)
  for (std::int32_t i = 0; i < items; ++i) body(i);
}

}  // namespace

void move_points(const Level& level, std::span<const BoundPoint> points, const double* u,
                 std::span<Vec3d> positions, int threads) {
  parallel(points.size(), threads, [&](std::int32_t p) {
    const BoundPoint& point = points[p];
    positions[p] = point.reference;
    if (point.cell < 0) return;
    Vec at[8], corners[8];
    for (int i = 0; i < 8; ++i) at[i] = cpu::load(u, level.slots[point.cell][i]);
    kernels::unfold(at, level.fold[point.cell], corners);
    positions[p] += kernels::trilinear(corners, point.local);
  });
}

void surface_normals(const SurfaceView& surface, std::span<const Vec3d> positions,
                     std::span<Vec3d> normals, std::vector<Vec3d>& faces, int threads) {
  faces.resize(surface.triangles.size());
  parallel(surface.triangles.size(), threads, [&](std::int32_t t) {
    const auto& [a, b, c] = surface.triangles[t];
    faces[t] = kernels::area_normal(positions[a], positions[b], positions[c]);
  });
  parallel(surface.points.size(), threads, [&](std::int32_t p) {
    for (std::int32_t c = surface.first_corner[p]; c >= 0;) {
      const std::int32_t normal = surface.normal_of[c];
      Vec sum{};
      for (; c >= 0 && surface.normal_of[c] == normal; c = surface.next_corner[c])
        sum += faces[c / 3];
      normals[normal] = kernels::unit_or_z(sum);
    }
  });
}

}  // namespace kerf::cpu
