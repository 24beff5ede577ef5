// SPDX-License-Identifier: MIT
//
// A picture of the deformed body with its cut faces in colour.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "app/camera.hpp"
#include "core/surface/surface_mesh.hpp"

namespace kerf {

struct PreviewOptions {
  Vec3d up{0, 1, 0};  ///< points up in the picture; need not be of unit length
  int width = 1200, height = 900;
  int samples = 4;           ///< per pixel and direction at edges; elsewhere few suffice
  int threads = 0;           ///< 0: as many as the machine has
  bool (*stop)() = nullptr;  ///< whether to give up, asked now and then: Error (unavailable)
  std::optional<View> view = std::nullopt;  ///< none: where most of the cut faces are seen

  double aspect() const { return static_cast<double>(width) / height; }
};

/// Whether this build can draw.
bool can_draw_preview();
/// @throws Error (unavailable) if it cannot. All below begin with it.
void require_preview();

/// The view, of a handful around the body, that shows most of the cut faces; a three-quarter view
/// from the front if none does.
/// @throws Error (bad_input) if there is nothing to draw.
View choose_view(const SurfaceMesh& mesh, const PreviewOptions& options = {});

/// Draws `mesh` at reference + displacement, in one picture of those that `framing` holds;
/// options.up and options.view do not matter. Rows from above, three bytes of sRGB for each pixel.
/// The same bits for any thread count.
std::vector<std::uint8_t> draw_pixels(const SurfaceMesh& mesh, const Framing& framing,
                                      const PreviewOptions& options);

/// The same as a PNG file.
/// @throws Error (bad_input) if the file cannot be written.
void draw_preview(const std::filesystem::path& file, const SurfaceMesh& mesh,
                  const Framing& framing, const PreviewOptions& options);

/// A PNG file of nothing but `mesh`.
/// @throws Error (bad_input) if there is nothing to draw, or the file cannot be written.
void draw_preview(const std::filesystem::path& file, const SurfaceMesh& mesh,
                  const PreviewOptions& options = {});

}  // namespace kerf
