// SPDX-License-Identifier: MIT
#include "app/colours.hpp"

#include <cmath>
#include <numbers>

namespace kerf {
namespace {

constexpr Vec3f kBodyColour{0.60f, 0.475f, 0.36f};

std::uint8_t to_srgb(float linear) {
  const float s =
      linear <= 0.0031308f ? 12.92f * linear : 1.055f * std::pow(linear, 1 / 2.4f) - 0.055f;
  return static_cast<std::uint8_t>(std::lround(255 * s));
}

}  // namespace

// A few colours that differ at a glance; then around the colour circle by the golden angle.
Vec3f cut_colour(std::int32_t id) {
  static constexpr std::array<Vec3f, 6> kColours{{{0.62f, 0.030f, 0.035f},
                                                  {0.020f, 0.16f, 0.62f},
                                                  {0.015f, 0.36f, 0.17f},
                                                  {0.80f, 0.33f, 0.010f},
                                                  {0.28f, 0.050f, 0.50f},
                                                  {0.010f, 0.38f, 0.48f}}};
  if (id <= 0) return kBodyColour;
  if (id <= static_cast<std::int32_t>(kColours.size()))
    return kColours[static_cast<std::size_t>(id - 1)];
  const float hue = 2 * std::numbers::pi_v<float> * 0.381966f * static_cast<float>(id);
  return {0.30f + 0.28f * std::cos(hue), 0.30f + 0.28f * std::cos(hue - 2.094f),
          0.30f + 0.28f * std::cos(hue + 2.094f)};
}

std::array<std::uint8_t, 3> cut_colour_bytes(std::int32_t id) {
  const Vec3f linear = cut_colour(id);
  return {to_srgb(linear.x), to_srgb(linear.y), to_srgb(linear.z)};
}

}  // namespace kerf
