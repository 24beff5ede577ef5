// SPDX-License-Identifier: MIT
//
// From light to pixels: many samples at edges, few elsewhere, and no noise.
#pragma once

#include <cstdint>
#include <vector>

#include "app/studio.hpp"

namespace kerf {

struct Canvas {
  int width = 0, height = 0;
  int samples = 4;           ///< per pixel and direction at edges
  int threads = 0;           ///< 0: as many as the machine has
  bool (*stop)() = nullptr;  ///< whether to give up, asked now and then, by any thread
};

/// Rows from above, three bytes of sRGB for each pixel. The same bits for any number of threads.
/// @throws Error (unavailable) if it was to give up.
std::vector<std::uint8_t> paint(const Studio& studio, const Canvas& canvas);

}  // namespace kerf
