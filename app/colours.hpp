// SPDX-License-Identifier: MIT
//
// The colours of the body and of its cuts, the same in pictures and in surface files.
#pragma once

#include <array>
#include <cstdint>

#include "core/geometry/vec.hpp"

namespace kerf {

/// Linear RGB in [0, 1] of a cut's faces; id 0 is the object's own surface.
kernels::Vec3<float> cut_colour(std::int32_t id);

/// The same in sRGB, as files with a byte per channel want it.
std::array<std::uint8_t, 3> cut_colour_bytes(std::int32_t id);

}  // namespace kerf
