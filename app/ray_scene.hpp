// SPDX-License-Identifier: MIT
//
// A surface in Embree: what a ray meets. Only in builds that can draw.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "app/camera.hpp"
#include "core/surface/surface_mesh.hpp"

struct RTCDeviceTy;  // Embree's, so that its headers stay in one file
struct RTCSceneTy;

namespace kerf {

/// The deformed surface in the units of the picture. Rays may be shot from several threads.
class RayScene {
 public:
  /// Keeps a reference to `mesh`.
  /// @throws Error (unavailable) if Embree does not start.
  RayScene(const SurfaceMesh& mesh, const Framing& framing);

  struct Hit {
    bool found = false;
    float distance = 0;
    std::int32_t cut_id = 0;
    Vec3f place;   ///< where rays to the light may start
    Vec3f normal;  ///< unit, smooth, towards the origin of the ray
  };
  /// `direction` is of unit length.
  Hit trace(const Vec3f& origin, const Vec3f& direction) const;

  /// The same without place and normal.
  Hit nearest(const Vec3f& origin, const Vec3f& direction) const;

  bool occluded(const Vec3f& origin, const Vec3f& direction) const;

 private:
  const SurfaceMesh& mesh_;
  std::vector<Vec3f> points_;
  std::unique_ptr<RTCDeviceTy, void (*)(RTCDeviceTy*)> device_;
  std::unique_ptr<RTCSceneTy, void (*)(RTCSceneTy*)> scene_;
};

}  // namespace kerf
