// SPDX-License-Identifier: MIT
#include "app/preview.hpp"

#include <png.h>

#include <vector>

#include "app/painter.hpp"
#include "app/ray_scene.hpp"
#include "app/studio.hpp"
#include "core/base/error.hpp"

namespace kerf {
namespace {

constexpr int kScoutWidth = 160, kScoutHeight = 120;

Framing frame(const SurfaceMesh& mesh, const View& view, const PreviewOptions& options) {
  Framing framing(view, options.up, options.aspect());
  framing.add(mesh);
  return framing;
}

/// Points of a small picture in which a cut is seen.
int cut_points_seen(const RayScene& scene, const Camera& camera) {
  int seen = 0;
  for (int y = 0; y < kScoutHeight; ++y)
    for (int x = 0; x < kScoutWidth; ++x) {
      const Vec3f ray = camera.ray((static_cast<float>(x) + 0.5f) / kScoutWidth,
                                   (static_cast<float>(y) + 0.5f) / kScoutHeight);
      const auto hit = scene.nearest(camera.eye, ray * (1 / norm(ray)));
      seen += hit.found && hit.cut_id > 0;
    }
  return seen;
}

}  // namespace

bool can_draw_preview() { return true; }

void require_preview() {}

View choose_view(const SurfaceMesh& mesh, const PreviewOptions& options) {
  View best;
  // Picture units are the same for all views of one surface.
  const RayScene scene(mesh, frame(mesh, best, options));
  int most = kScoutWidth * kScoutHeight / 2000;  // a handful of points does not decide the view
  for (const double elevation : {14.0, 30.0, 46.0})
    for (double azimuth = 5; azimuth < 360; azimuth += 30) {
      const View view{azimuth, elevation};
      const int seen = cut_points_seen(scene, frame(mesh, view, options).camera());
      if (seen > most) {
        most = seen;
        best = view;
      }
    }
  return best;
}

std::vector<std::uint8_t> draw_pixels(const SurfaceMesh& mesh, const Framing& framing,
                                      const PreviewOptions& options) {
  const RayScene scene(mesh, framing);
  const Studio studio(scene, framing);
  return paint(studio,
               {options.width, options.height, options.samples, options.threads, options.stop});
}

void draw_preview(const std::filesystem::path& file, const SurfaceMesh& mesh,
                  const Framing& framing, const PreviewOptions& options) {
  const auto rgb = draw_pixels(mesh, framing, options);
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(options.width);
  image.height = static_cast<png_uint_32>(options.height);
  image.format = PNG_FORMAT_RGB;
  if (png_image_write_to_file(&image, file.string().c_str(), 0, rgb.data(), 0, nullptr) == 0)
    throw Error(ErrorKind::bad_input, text(file.string(), ": cannot be written: ", image.message));
}

void draw_preview(const std::filesystem::path& file, const SurfaceMesh& mesh,
                  const PreviewOptions& options) {
  const View view = options.view ? *options.view : choose_view(mesh, options);
  draw_preview(file, mesh, frame(mesh, view, options), options);
}

}  // namespace kerf
