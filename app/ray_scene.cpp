// SPDX-License-Identifier: MIT
#include "app/ray_scene.hpp"

#include <embree3/rtcore.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <new>

#include "core/base/error.hpp"

namespace kerf {
namespace {

constexpr float kLift = 2e-5f;  // of the diagonal: above the rounding of a hit, below any detail

Vec3f to_float(const Vec3d& v) {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

void fill(RTCRay& ray, const Vec3f& o, const Vec3f& d) {
  ray.org_x = o.x, ray.org_y = o.y, ray.org_z = o.z;
  ray.dir_x = d.x, ray.dir_y = d.y, ray.dir_z = d.z;
  ray.tnear = 0;
  ray.tfar = std::numeric_limits<float>::infinity();
  ray.mask = ~0u;
}

RTCRayHit shoot(RTCScene scene, const Vec3f& origin, const Vec3f& direction) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRayHit ray{};
  fill(ray.ray, origin, direction);
  ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(scene, &context, &ray);
  return ray;
}

}  // namespace

RayScene::RayScene(const SurfaceMesh& mesh, const Framing& framing)
    : mesh_(mesh),
      device_(rtcNewDevice("verbose=0"), rtcReleaseDevice),
      scene_(nullptr, rtcReleaseScene) {
  points_.reserve(mesh.reference.size());
  for (std::size_t i = 0; i < mesh.reference.size(); ++i)
    points_.push_back(framing.to_picture(mesh.reference[i] + mesh.displacement[i]));
  if (device_ == nullptr)
    throw Error(ErrorKind::unavailable, "Embree does not start on this machine");
  scene_.reset(rtcNewScene(device_.get()));
  rtcSetSceneFlags(scene_.get(), RTC_SCENE_FLAG_ROBUST);  // no ray slips through between triangles
  RTCGeometry geometry = rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                           sizeof(Vec3f), points_.size());
  auto* triangles = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                            sizeof(mesh.triangles[0]), mesh.triangles.size());
  if (vertices == nullptr || triangles == nullptr) throw std::bad_alloc();
  std::memcpy(vertices, points_.data(), points_.size() * sizeof(Vec3f));
  std::memcpy(triangles, mesh.triangles.data(), mesh.triangles.size() * sizeof(mesh.triangles[0]));
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene_.get(), geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene_.get());
}

RayScene::Hit RayScene::trace(const Vec3f& origin, const Vec3f& direction) const {
  const RTCRayHit ray = shoot(scene_.get(), origin, direction);
  Hit hit;
  if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return hit;
  hit.found = true;
  hit.distance = ray.ray.tfar;
  hit.cut_id = mesh_.cut_id[ray.hit.primID];
  const auto& corners = mesh_.triangles[ray.hit.primID];
  const auto& normal_of = mesh_.normal_of[ray.hit.primID];
  const std::array<float, 3> weight{1 - ray.hit.u - ray.hit.v, ray.hit.u, ray.hit.v};
  const Vec3f flat = origin + hit.distance * direction;
  // The triangle is flat and its shading is not, so its own edge would throw a shadow on it. Rays
  // to the light start from the curved surface that the normals describe [Hanika 2021].
  Vec3f place;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3f normal = to_float(mesh_.normals[static_cast<std::size_t>(normal_of[k])]);
    const Vec3f& corner = points_[static_cast<std::size_t>(corners[k])];
    hit.normal += weight[k] * normal;
    place += weight[k] * (flat - std::min(0.0f, dot(flat - corner, normal)) * normal);
  }
  Vec3f face{ray.hit.Ng_x, ray.hit.Ng_y, ray.hit.Ng_z};
  const float area = norm(face), length = norm(hit.normal);
  face = area > 0 ? face * (1 / area) : -direction;
  hit.normal = length > 0 ? hit.normal * (1 / length) : face;
  if (dot(face, direction) > 0) {  // seen from inside, where parts of the body overlap
    face = -face;
    hit.normal = -hit.normal;
    place = flat;
  }
  hit.place = place + kLift * face;
  const float away = dot(hit.normal, direction);
  if (away > 0) {  // seen at a grazing angle: keep the normal on the near side
    hit.normal -= (1.01f * away) * direction;
    hit.normal *= 1 / norm(hit.normal);
  }
  return hit;
}

RayScene::Hit RayScene::nearest(const Vec3f& origin, const Vec3f& direction) const {
  const RTCRayHit ray = shoot(scene_.get(), origin, direction);
  Hit hit;
  if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return hit;
  hit.found = true;
  hit.distance = ray.ray.tfar;
  hit.cut_id = mesh_.cut_id[ray.hit.primID];
  return hit;
}

bool RayScene::occluded(const Vec3f& origin, const Vec3f& direction) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRay ray{};
  fill(ray, origin, direction);
  rtcOccluded1(scene_.get(), &context, &ray);
  return ray.tfar < 0;
}

}  // namespace kerf
