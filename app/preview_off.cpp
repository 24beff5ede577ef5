// SPDX-License-Identifier: MIT
//
// In place of preview.cpp where Embree or libpng is missing, or KERF_PREVIEW is off.
#include "app/preview.hpp"
#include "core/base/error.hpp"

namespace kerf {

bool can_draw_preview() { return false; }

void require_preview() {
  throw Error(
      ErrorKind::unavailable,
      "this build cannot draw pictures; configure with -DKERF_PREVIEW=ON where Embree 3 and "
      "libpng are installed");
}

View choose_view(const SurfaceMesh&, const PreviewOptions&) {
  require_preview();
  return {};
}

std::vector<std::uint8_t> draw_pixels(const SurfaceMesh&, const Framing&, const PreviewOptions&) {
  require_preview();
  return {};
}

void draw_preview(const std::filesystem::path&, const SurfaceMesh&, const Framing&,
                  const PreviewOptions&) {
  require_preview();
}

void draw_preview(const std::filesystem::path&, const SurfaceMesh&, const PreviewOptions&) {
  require_preview();
}

}  // namespace kerf
