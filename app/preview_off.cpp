// SPDX-License-Identifier: MIT
//
// In place of preview.cpp where Embree or libpng is missing, or KERF_PREVIEW is off.
#include "app/preview.hpp"
#include "core/base/error.hpp"

namespace kerf {

bool can_draw_preview() { return false; }

void draw_preview(const std::filesystem::path&, const Snapshot&, const PreviewOptions&) {
  throw Error(ErrorKind::unavailable,
              "this build cannot draw preview.png; configure with -DKERF_PREVIEW=ON, or set "
              "output.preview = false");
}

}  // namespace kerf
