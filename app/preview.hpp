// SPDX-License-Identifier: MIT
//
// A picture of the deformed body with its cut faces in colour.
#pragma once

#include <filesystem>

#include "core/simulation.hpp"

namespace kerf {

struct PreviewOptions {
  Vec3d up{0, 1, 0};  ///< points up in the picture; need not be of unit length
  int width = 1200, height = 900;
  int samples = 2;     ///< per pixel and direction
  int occlusion = 12;  ///< rays for ambient light, per sample
};

/// Whether this build can draw.
bool can_draw_preview();

/// Draws the boundary faces of `snapshot` at points + displacement. The view is the one of a
/// handful around the body that shows most of the cut faces. The same bits for any thread count.
/// @throws Error (unavailable) if this build cannot draw; Error (bad_input) if the file cannot be
/// written.
void draw_preview(const std::filesystem::path& file, const Snapshot& snapshot,
                  const PreviewOptions& options = {});

}  // namespace kerf
