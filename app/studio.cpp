// SPDX-License-Identifier: MIT
#include "app/studio.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "app/colours.hpp"

namespace kerf {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kSunSize = 0.012f;  // 1 - cosine of its radius: 9 degrees
constexpr float kNear = 1.7f;       // the ground is shaded up to here, in diagonals
constexpr Vec3f kSun{1.10f, 1.02f, 0.92f};
constexpr Vec3f kZenith{0.50f, 0.54f, 0.60f}, kHorizon{0.40f, 0.40f, 0.41f};
constexpr Vec3f kGround{0.34f, 0.32f, 0.30f};
constexpr Vec3f kFill{0.26f, 0.29f, 0.34f}, kRim{0.8f, 0.79f, 0.77f};
constexpr float kBounce = 0.75f;  // light on faces nearby: wounds are not black
constexpr float kSunOnGround = 0.36f;

Vec3f unit(const Vec3f& v) { return v * (1 / norm(v)); }
Vec3f mix(const Vec3f& a, const Vec3f& b, float t) { return a + (b - a) * t; }
Vec3f times(const Vec3f& a, const Vec3f& b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
float positive(float x) { return std::max(0.0f, x); }
float smooth(float x) {
  const float t = std::min(1.0f, positive(x));
  return t * t * (3 - 2 * t);
}

Vec3f around(const Vec3f& axis, float cosine, float angle) {
  const Vec3f hint = std::abs(axis.x) < 0.8f ? Vec3f{1, 0, 0} : Vec3f{0, 1, 0};
  const Vec3f u = unit(cross(axis, hint)), v = cross(axis, u);
  const float sine = std::sqrt(positive(1 - cosine * cosine));
  return cosine * axis + sine * (std::cos(angle) * u + std::sin(angle) * v);
}

/// Brighter behind the body than at the borders.
Vec3f backdrop(float x, float y) {
  const Vec3f column = mix({0.83f, 0.835f, 0.84f}, {0.68f, 0.68f, 0.68f}, smooth(y));
  const float dx = x - 0.5f, dy = y - 0.45f;
  return column * (1.03f - 0.30f * (dx * dx + dy * dy));
}

}  // namespace

std::uint32_t Samples::hash(std::uint32_t x) {
  x ^= x >> 16, x *= 0x7feb352du, x ^= x >> 15, x *= 0x846ca68bu, x ^= x >> 16;
  return x;
}

Samples::Samples(std::uint32_t pixel, std::uint32_t purpose)
    : a_(hash(hash(pixel) + 2 * purpose)), b_(hash(hash(pixel) + 2 * purpose + 1)) {}

Studio::Studio(const RayScene& scene, const Framing& framing)
    : scene_(scene), camera_(framing.camera()), up_(framing.world_up()), ground_(framing.ground()) {
  const Vec3f front = cross(camera_.right, up_);  // level, towards the eye
  sun_ = unit(0.36f * front + 0.90f * up_ - 0.78f * camera_.right);
  fill_ = unit(0.55f * front + 0.25f * up_ + 0.9f * camera_.right);
  rim_ = unit(-0.9f * front + 0.55f * up_ + 0.5f * camera_.right);
}

Vec3f Studio::place(float x, float y, float distance) const {
  return camera_.eye + distance * unit(camera_.ray(x, y));
}

Look Studio::look(float x, float y, int rays, PixelSamples& samples) const {
  const Vec3f direction = unit(camera_.ray(x, y));
  const auto hit = scene_.trace(camera_.eye, direction);
  const float fall = dot(direction, up_), height = dot(camera_.eye, up_) - ground_;
  const float ground =
      fall < -1e-4f && height > 0 ? -height / fall : std::numeric_limits<float>::infinity();
  if (hit.found && hit.distance <= ground + 1e-3f)
    return look_at_surface(direction, hit, rays, samples);
  return look_at_ground(direction, backdrop(x, y), ground, rays, samples);
}

/// The ground has no colour of its own: where nothing stands in its light it is the backdrop.
Look Studio::look_at_ground(const Vec3f& direction, const Vec3f& backdrop, float distance, int rays,
                            PixelSamples& samples) const {
  Look look;
  look.base = backdrop;
  look.light = {1, 1, 1};
  look.normal = up_;
  if (!(distance < 1e3f)) return look;
  look.distance = distance;
  const Vec3f place = camera_.eye + distance * direction + 1e-4f * up_;
  const float away = norm(place - dot(place, up_) * up_);
  const float shaded = smooth((kNear - away) / (0.6f * kNear));
  if (shaded <= 0) return look;
  Vec3f open;
  for (int k = 0; k < rays; ++k) {
    const auto [a, b] = samples.sky.next();
    const auto hit = scene_.nearest(place, around(up_, std::sqrt(a), 2 * kPi * b));
    open += hit.found ? 0.25f * cut_colour(hit.cut_id) : Vec3f{1, 1, 1};
  }
  const float sun = sunlight(place, std::max(1, rays / 2), samples.sun);
  const Vec3f light =
      (1 - kSunOnGround) / static_cast<float>(rays) * open + kSunOnGround * Vec3f{sun, sun, sun};
  look.light = mix(look.light, light, shaded);
  return look;
}

Look Studio::look_at_surface(const Vec3f& direction, const RayScene::Hit& hit, int rays,
                             PixelSamples& samples) const {
  Look look;
  look.cut_id = hit.cut_id;
  look.distance = hit.distance;
  look.normal = hit.normal;
  look.base = cut_colour(hit.cut_id);
  const float facing = positive(dot(hit.normal, sun_));
  const float sun = facing > 0 ? sunlight(hit.place, std::max(1, rays / 2), samples.sun) : 0.0f;
  look.light = skylight(hit.place, hit.normal, rays, samples.sky) + facing * sun * kSun;

  const float cosine = std::min(1.0f, positive(-dot(direction, hit.normal)));
  const float graze = 1 - cosine, graze5 = graze * graze * graze * graze * graze;
  const Vec3f half = unit(sun_ - direction);
  const float spread = positive(dot(hit.normal, half));
  if (hit.cut_id > 0) {  // moist
    const Vec3f mirror = direction + 2 * cosine * hit.normal;
    const auto [a, b] = samples.gloss.next();
    const Vec3f seen = arriving(hit.place, around(unit(mirror), 1 - 0.04f * a, 2 * kPi * b));
    look.shine =
        (0.04f + 0.3f * graze5) * seen + (facing * sun * 0.25f * std::pow(spread, 60.0f)) * kSun;
  } else {  // matt, with a bloom where it turns away
    look.shine = (facing * sun * 0.035f * std::pow(spread, 18.0f)) * kSun +
                 0.10f * graze5 * times(look.base, look.light);
  }
  return look;
}

Vec3f Studio::sky(const Vec3f& direction) const {
  const auto lobe = [&](const Vec3f& axis) {
    const float c = positive(dot(direction, axis));
    return c * c * c * c;
  };
  return mix(kHorizon, kZenith, positive(dot(direction, up_))) + lobe(fill_) * kFill +
         lobe(rim_) * kRim;
}

/// What comes to `place` from `direction`. What is near is darker than what is far, since it stands
/// in the shadow of the place itself: this is why corners are dark.
Vec3f Studio::arriving(const Vec3f& place, const Vec3f& direction) const {
  const auto hit = scene_.nearest(place, direction);
  const float fall = dot(direction, up_), height = dot(place, up_) - ground_;
  const bool down = fall < -1e-4f && height > -1e-3f;
  const float ground = down ? -positive(height) / fall : std::numeric_limits<float>::infinity();
  if (hit.found && hit.distance < ground)
    return kBounce * (0.4f + 0.6f * smooth(hit.distance / 0.12f)) * cut_colour(hit.cut_id);
  if (down) return (0.2f + 0.8f * smooth(ground / 0.3f)) * kGround;
  return sky(direction);
}

Vec3f Studio::skylight(const Vec3f& place, const Vec3f& normal, int rays, Samples& samples) const {
  Vec3f sum;
  for (int k = 0; k < rays; ++k) {
    const auto [a, b] = samples.next();
    sum += arriving(place, around(normal, std::sqrt(a), 2 * kPi * b));
  }
  return sum * (1 / static_cast<float>(rays));
}

float Studio::sunlight(const Vec3f& place, int rays, Samples& samples) const {
  int open = 0;
  for (int k = 0; k < rays; ++k) {
    const auto [a, b] = samples.next();
    open += !scene_.occluded(place, around(sun_, 1 - kSunSize * a, 2 * kPi * b));
  }
  return static_cast<float>(open) / static_cast<float>(rays);
}

}  // namespace kerf
