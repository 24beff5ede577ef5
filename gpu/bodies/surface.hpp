// SPDX-License-Identifier: MIT
//
// A surface that moves with the cells of level 0. As cpu/surface_loops.cpp.
#pragma once

#include "gpu/level_view.hpp"
#include "kernels/surface.hpp"
#include "kernels/transfer.hpp"

namespace kerf::gpu {

/// A point of a surface: BoundPoint in core/surface/surface_view.hpp.
struct SurfacePoint {
  Vec3<double> reference, local;
  std::int32_t cell;
};

struct MovePoint {
  LevelView level;
  const SurfacePoint* points;
  const double* displacement;
  Vec3<double>* positions;

  KERF_HD void operator()(std::int32_t p) const {
    const SurfacePoint& point = points[p];
    Vec3<double> position = point.reference;
    if (point.cell >= 0) {
      Vec3<double> at[kCorners], corners[kCorners];
      load_slots(level, point.cell, displacement, at);
      kernels::unfold(at, level.fold[point.cell], corners);
      position += kernels::trilinear(corners, point.local);
    }
    positions[p] = position;
  }
};

struct FaceNormal {
  const std::int32_t* corners;  ///< three a triangle
  const Vec3<double>* positions;
  Vec3<double>* faces;

  KERF_HD void operator()(std::int32_t t) const {
    faces[t] = kernels::area_normal(positions[corners[3 * t]], positions[corners[3 * t + 1]],
                                    positions[corners[3 * t + 2]]);
  }
};

/// The normals of a point: each list of corners that share one is a run of the point's corners.
struct PointNormals {
  const std::int32_t *first_corner, *next_corner, *normal_of;
  const Vec3<double>* faces;
  Vec3<double>* normals;

  KERF_HD void operator()(std::int32_t p) const {
    for (std::int32_t c = first_corner[p]; c >= 0;) {
      const std::int32_t normal = normal_of[c];
      Vec3<double> sum{};
      for (; c >= 0 && normal_of[c] == normal; c = next_corner[c]) sum += faces[c / 3];
      normals[normal] = kernels::unit_or_z(sum);
    }
  }
};

}  // namespace kerf::gpu
