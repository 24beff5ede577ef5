// SPDX-License-Identifier: MIT
//
// The light in a picture: a low sun with a soft edge, a sky, a ground, and what things are made of.
#pragma once

#include <array>
#include <cstdint>

#include "app/camera.hpp"
#include "app/ray_scene.hpp"

namespace kerf {

/// Numbers that fill the unit square evenly: the additive recurrence R2 from a start that differs
/// from pixel to pixel [Cranley, Patterson 1976; Roberts 2018]. In 32-bit fixed point.
class Samples {
 public:
  Samples(std::uint32_t pixel, std::uint32_t purpose);
  std::array<float, 2> next() {
    a_ += 3242174889u;
    b_ += 2447445414u;
    return {static_cast<float>(a_ >> 8) * 0x1p-24f, static_cast<float>(b_ >> 8) * 0x1p-24f};
  }
  static std::uint32_t hash(std::uint32_t x);

 private:
  std::uint32_t a_, b_;
};

/// One each for what a pixel draws from.
struct PixelSamples {
  explicit PixelSamples(std::uint32_t pixel)
      : place(pixel, 0), sky(pixel, 1), sun(pixel, 2), gloss(pixel, 3) {}
  Samples place, sky, sun, gloss;
};

/// What is seen along a ray: base * light + shine, in linear RGB. Light is kept apart because it
/// varies little from pixel to pixel, so that its noise can be filtered away.
struct Look {
  static constexpr std::int32_t kBackdrop = -1;

  Vec3f base, light, shine;
  Vec3f normal;
  float distance = 0;
  std::int32_t cut_id = kBackdrop;
};

class Studio {
 public:
  /// Keeps a reference to `scene`.
  Studio(const RayScene& scene, const Framing& framing);

  /// Through a point of the picture, x and y in [0, 1] from the upper left. `rays` to the sky.
  Look look(float x, float y, int rays, PixelSamples& samples) const;

  /// The place that was seen at `distance`.
  Vec3f place(float x, float y, float distance) const;

 private:
  Look look_at_ground(const Vec3f& direction, const Vec3f& backdrop, float distance, int rays,
                      PixelSamples& samples) const;
  Look look_at_surface(const Vec3f& direction, const RayScene::Hit& hit, int rays,
                       PixelSamples& samples) const;
  Vec3f sky(const Vec3f& direction) const;
  Vec3f arriving(const Vec3f& place, const Vec3f& direction) const;
  Vec3f skylight(const Vec3f& place, const Vec3f& normal, int rays, Samples& samples) const;
  float sunlight(const Vec3f& place, int rays, Samples& samples) const;

  const RayScene& scene_;
  Camera camera_;
  Vec3f up_, sun_, fill_, rim_;
  float ground_;
};

}  // namespace kerf
