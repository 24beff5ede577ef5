// SPDX-License-Identifier: MIT
#include "app/preview.hpp"

#include <embree3/rtcore.h>
#include <png.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>
#include <thread>
#include <vector>

#include "app/preview_surface.hpp"
#include "core/base/error.hpp"

namespace kerf {
namespace {

using kernels::Vec3;
using Vec = Vec3<float>;

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kHalfHeight = 0.25f;  // tangent of half the vertical angle of view
constexpr float kMargin = 0.84f;      // part of the picture that the body may fill
constexpr int kScoutWidth = 160, kScoutHeight = 120;

Vec unit(const Vec& v) { return v * (1.0f / norm(v)); }
Vec to_float(const Vec3d& v) {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}
Vec mix(const Vec& a, const Vec& b, float t) { return a + (b - a) * t; }
Vec times(const Vec& a, const Vec& b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }

/// Linear colours of cut faces; then around the colour circle by the golden angle.
Vec cut_colour(std::int32_t id) {
  static constexpr std::array<Vec, 6> kColours{{{0.62f, 0.030f, 0.035f},
                                                {0.020f, 0.16f, 0.62f},
                                                {0.015f, 0.36f, 0.17f},
                                                {0.80f, 0.33f, 0.010f},
                                                {0.28f, 0.050f, 0.50f},
                                                {0.010f, 0.38f, 0.48f}}};
  if (id >= 1 && id <= static_cast<std::int32_t>(kColours.size()))
    return kColours[static_cast<std::size_t>(id - 1)];
  const float hue = 2 * kPi * 0.381966f * static_cast<float>(id);
  return {0.30f + 0.28f * std::cos(hue), 0.30f + 0.28f * std::cos(hue - 2.094f),
          0.30f + 0.28f * std::cos(hue + 2.094f)};
}
constexpr Vec kBodyColour{0.60f, 0.475f, 0.36f};

/// The surface in Embree, scaled so that what is framed has a box of diagonal 1 around the origin.
class RayScene {
 public:
  explicit RayScene(const PreviewSurface& surface) : surface_(surface) {
    Box3 box;
    for (const auto p : surface.framed) box.add(surface.points[p]);
    const Vec3d middle = 0.5 * (box.lo + box.hi);
    const double diagonal = norm(box.extent());
    const double scale = diagonal > 0 ? 1 / diagonal : 1;
    cell_ = static_cast<float>(surface.cell * scale);
    for (const auto& p : surface.points) points_.push_back(to_float((p - middle) * scale));
    for (const auto p : surface.framed) framed_.push_back(points_[p]);

    device_ = rtcNewDevice("verbose=0");
    if (device_ == nullptr)
      throw Error(ErrorKind::unavailable, "preview: Embree does not start on this machine");
    scene_ = rtcNewScene(device_);
    RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_QUAD);
    auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(Vec), points_.size()));
    auto* quads = static_cast<std::uint32_t*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT4,
                                4 * sizeof(std::uint32_t), surface.quads.size()));
    std::memcpy(vertices, points_.data(), points_.size() * sizeof(Vec));
    std::memcpy(quads, surface.quads.data(), surface.quads.size() * sizeof(surface.quads[0]));
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene_);
  }
  ~RayScene() {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }
  RayScene(const RayScene&) = delete;
  RayScene& operator=(const RayScene&) = delete;

  struct Hit {
    bool found = false;
    float distance = 0;
    Vec normal;
    std::int32_t cut_id = 0;
  };

  Hit trace(const Vec& origin, const Vec& direction) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    RTCRayHit ray{};
    fill(ray.ray, origin, direction, std::numeric_limits<float>::infinity());
    ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(scene_, &context, &ray);
    Hit hit;
    if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return hit;
    hit.found = true;
    hit.distance = ray.ray.tfar;
    const auto& corner = surface_.normal_of[ray.hit.primID];
    const float u = ray.hit.u, v = ray.hit.v;
    const auto normal = [&](std::size_t k) { return to_float(surface_.normals[corner[k]]); };
    hit.normal = (1 - u) * (1 - v) * normal(0) + u * (1 - v) * normal(1) + u * v * normal(2) +
                 (1 - u) * v * normal(3);
    const float length = norm(hit.normal);
    hit.normal = length > 0 ? hit.normal * (1 / length) : direction * -1.0f;
    if (dot(hit.normal, direction) > 0) {  // seen at a grazing angle: keep it on the near side
      hit.normal -= (1.01f * dot(hit.normal, direction)) * direction;
      hit.normal = unit(hit.normal);
    }
    hit.cut_id = surface_.cut_id[ray.hit.primID];
    return hit;
  }

  bool occluded(const Vec& origin, const Vec& direction, float reach) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    RTCRay ray{};
    fill(ray, origin, direction, reach);
    rtcOccluded1(scene_, &context, &ray);
    return ray.tfar < 0;
  }

  const std::vector<Vec>& framed() const { return framed_; }
  float cell() const { return cell_; }

 private:
  static void fill(RTCRay& ray, const Vec& o, const Vec& d, float reach) {
    ray.org_x = o.x, ray.org_y = o.y, ray.org_z = o.z;
    ray.dir_x = d.x, ray.dir_y = d.y, ray.dir_z = d.z;
    ray.tnear = 0;
    ray.tfar = reach;
    ray.mask = ~0u;
  }

  const PreviewSurface& surface_;
  std::vector<Vec> points_, framed_;
  float cell_ = 0;
  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
};

struct Camera {
  Vec eye, right, up, back;
  float half_width = 0;

  /// Direction through a point of the picture, x and y in [0, 1] from the upper left.
  Vec ray(float x, float y) const {
    return unit((2 * x - 1) * half_width * right + (1 - 2 * y) * kHalfHeight * up - back);
  }
};

/// Looks along -back, from as near as the body fits.
Camera fit_camera(const std::vector<Vec>& points, const Vec& back, const Vec& world_up,
                  float aspect) {
  Camera camera;
  camera.back = back;
  camera.right = unit(cross(world_up, back));
  camera.up = cross(back, camera.right);
  camera.half_width = kHalfHeight * aspect;
  const float huge = std::numeric_limits<float>::max();
  float x_lo = huge, x_hi = -huge, y_lo = huge, y_hi = -huge;
  for (const auto& p : points) {
    const float x = dot(p, camera.right), y = dot(p, camera.up);
    x_lo = std::min(x_lo, x), x_hi = std::max(x_hi, x);
    y_lo = std::min(y_lo, y), y_hi = std::max(y_hi, y);
  }
  const float cx = 0.5f * (x_lo + x_hi), cy = 0.5f * (y_lo + y_hi);
  float distance = 0.1f;
  for (const auto& p : points) {
    const float z = dot(p, back);
    distance =
        std::max({distance, z + std::abs(dot(p, camera.right) - cx) / (kMargin * camera.half_width),
                  z + std::abs(dot(p, camera.up) - cy) / (kMargin * kHalfHeight)});
  }
  camera.eye = cx * camera.right + cy * camera.up + distance * back;
  return camera;
}

/// Two directions square to `up`, such that the picture's front is +z where up is y.
std::array<Vec, 2> horizontal_axes(const Vec& up) {
  const Vec hint = std::abs(up.z) < 0.9f ? Vec{0, 0, 1} : Vec{0, -1, 0};
  const Vec side = unit(cross(up, hint));
  return {side, cross(side, up)};
}

/// The view that shows most of the cut faces; a three-quarter view from the front if none does.
Camera choose_camera(const RayScene& scene, const Vec& up, float aspect) {
  const auto [side, front] = horizontal_axes(up);
  const auto direction = [&, s = side, f = front](float azimuth, float elevation) {
    const float a = azimuth * kPi / 180, e = elevation * kPi / 180;
    return std::cos(e) * (std::sin(a) * s + std::cos(a) * f) + std::sin(e) * up;
  };
  Camera best = fit_camera(scene.framed(), direction(35, 22), up, aspect);
  int most = kScoutWidth * kScoutHeight / 2000;  // a handful of pixels does not decide the view
  for (const float elevation : {14.0f, 30.0f, 46.0f})
    for (float azimuth = 5; azimuth < 360; azimuth += 30) {
      const Camera camera = fit_camera(scene.framed(), direction(azimuth, elevation), up, aspect);
      int seen = 0;
      for (int y = 0; y < kScoutHeight; ++y)
        for (int x = 0; x < kScoutWidth; ++x) {
          const auto hit =
              scene.trace(camera.eye, camera.ray((static_cast<float>(x) + 0.5f) / kScoutWidth,
                                                 (static_cast<float>(y) + 0.5f) / kScoutHeight));
          seen += hit.found && hit.cut_id > 0;
        }
      if (seen > most) {
        most = seen;
        best = camera;
      }
    }
  return best;
}

/// A fixed sequence in the unit square, shifted by a hash of the pixel [Cranley, Patterson 1976].
class Samples {
 public:
  explicit Samples(std::uint32_t pixel) : a_(hash(2 * pixel)), b_(hash(2 * pixel + 1)) {}
  std::array<float, 2> next() {  // the additive recurrence R2, in 32-bit fixed point
    a_ += 3242174889u;
    b_ += 2447445414u;
    return {static_cast<float>(a_ >> 8) * 0x1p-24f, static_cast<float>(b_ >> 8) * 0x1p-24f};
  }

 private:
  static std::uint32_t hash(std::uint32_t x) {
    x ^= x >> 16, x *= 0x7feb352du, x ^= x >> 15, x *= 0x846ca68bu, x ^= x >> 16;
    return x;
  }
  std::uint32_t a_, b_;
};

Vec around(const Vec& axis, float cosine, float angle) {
  const Vec hint = std::abs(axis.x) < 0.8f ? Vec{1, 0, 0} : Vec{0, 1, 0};
  const Vec u = unit(cross(axis, hint)), v = cross(axis, u);
  const float sine = std::sqrt(std::max(0.0f, 1 - cosine * cosine));
  return cosine * axis + sine * (std::cos(angle) * u + std::sin(angle) * v);
}

class Painter {
 public:
  Painter(const RayScene& scene, const Camera& camera, const Vec& up, const PreviewOptions& options)
      : scene_(scene), camera_(camera), up_(up), options_(options) {
    key_ = unit(0.75f * camera.back + 0.95f * up - 0.55f * camera.right);
    fill_ = unit(0.5f * camera.back + 0.2f * up + 0.9f * camera.right);
    for (const auto& p : scene.framed()) ground_ = std::min(ground_, dot(p, up));
  }

  Vec pixel(int px, int py) const {
    Samples samples(static_cast<std::uint32_t>(py * options_.width + px));
    Vec sum;
    const int n = options_.samples;
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i) {
        const float x =
            (static_cast<float>(px) + (static_cast<float>(i) + 0.5f) / static_cast<float>(n)) /
            static_cast<float>(options_.width);
        const float y =
            (static_cast<float>(py) + (static_cast<float>(j) + 0.5f) / static_cast<float>(n)) /
            static_cast<float>(options_.height);
        sum += shade(camera_.ray(x, y), y, samples);
      }
    return sum * (1.0f / static_cast<float>(n * n));
  }

 private:
  static constexpr float kReach = 0.5f;  // of ambient occlusion, in diagonals
  static constexpr float kFar = 10.0f;   // beyond the body
  static constexpr int kSunRays = 3;
  static constexpr Vec kBounce{0.30f, 0.27f,
                               0.25f};  // light from faces nearby: wounds are not black

  Vec shade(const Vec& direction, float y, Samples& samples) const {
    const auto hit = scene_.trace(camera_.eye, direction);
    const Vec background = mix({0.93f, 0.93f, 0.925f}, {0.78f, 0.79f, 0.80f}, y);
    if (!hit.found) return background * ground_light(direction, samples);
    const Vec base = hit.cut_id > 0 ? cut_colour(hit.cut_id) : kBodyColour;
    const Vec place = camera_.eye + hit.distance * direction + (0.4f * scene_.cell()) * hit.normal;
    const Vec ambient = ambient_light(place, hit.normal, samples);
    const float lit = std::max(0.0f, dot(hit.normal, key_)) * sunlight(place, samples);
    const float soft = std::max(0.0f, dot(hit.normal, fill_));
    const Vec half = unit(key_ - direction);
    const float shine = 0.05f * lit * std::pow(std::max(0.0f, dot(hit.normal, half)), 24.0f);
    const Vec light =
        0.70f * ambient + lit * Vec{0.80f, 0.77f, 0.72f} + 0.13f * soft * Vec{0.85f, 0.92f, 1.0f};
    return times(base, light) + Vec{shine, shine, shine};
  }

  /// Sky from above, a little light back from the ground.
  Vec ambient_light(const Vec& place, const Vec& normal, Samples& samples) const {
    Vec sum;
    for (int k = 0; k < options_.occlusion; ++k) {
      const auto [a, b] = samples.next();
      const Vec direction = around(normal, std::sqrt(a), 2 * kPi * b);
      if (scene_.occluded(place, direction, kReach)) {
        sum += kBounce;
        continue;
      }
      const float height = 0.5f + 0.5f * dot(direction, up_);
      sum += mix({0.55f, 0.52f, 0.49f}, {0.98f, 1.0f, 1.04f}, height);
    }
    return sum * (1.0f / static_cast<float>(options_.occlusion));
  }

  float sunlight(const Vec& place, Samples& samples) const {
    int open = 0;
    for (int k = 0; k < kSunRays; ++k) {
      const auto [a, b] = samples.next();
      const Vec direction = around(key_, 1 - 0.010f * a, 2 * kPi * b);  // a disc of 8 degrees
      open += !scene_.occluded(place, direction, kFar);
    }
    return static_cast<float>(open) / kSunRays;
  }

  /// How bright the background is where it is ground: darker beside and under the body.
  float ground_light(const Vec& direction, Samples& samples) const {
    const float fall = dot(direction, up_);
    if (fall >= -1e-4f) return 1;
    const float t = (ground_ - dot(camera_.eye, up_)) / fall;
    if (t <= 0) return 1;
    const Vec place = camera_.eye + t * direction;
    const float away = norm(place - dot(place, up_) * up_);
    if (away > 1.6f) return 1;
    const int rays = options_.occlusion;
    int open = 0;
    for (int k = 0; k < rays; ++k) {
      const auto [a, b] = samples.next();
      open += !scene_.occluded(place + 1e-3f * up_, around(up_, std::sqrt(a), 2 * kPi * b), kReach);
    }
    const float sky = static_cast<float>(open) / static_cast<float>(rays);
    const float sun = sunlight(place + 1e-3f * up_, samples);
    const float fade = std::min(1.0f, std::max(0.0f, (1.6f - away) / 0.6f));
    return 1 - fade * (0.55f * (1 - sky) + 0.16f * (1 - sun));
  }

  const RayScene& scene_;
  const Camera& camera_;
  Vec up_, key_, fill_;
  const PreviewOptions& options_;
  float ground_ = std::numeric_limits<float>::max();
};

std::uint8_t encode(float linear) {  // sRGB
  const float c = std::min(1.0f, std::max(0.0f, linear));
  const float s = c <= 0.0031308f ? 12.92f * c : 1.055f * std::pow(c, 1 / 2.4f) - 0.055f;
  return static_cast<std::uint8_t>(std::lround(255 * s));
}

std::vector<std::uint8_t> paint(const Painter& painter, const PreviewOptions& options) {
  std::vector<std::uint8_t> rgb(3 * static_cast<std::size_t>(options.width) *
                                static_cast<std::size_t>(options.height));
  std::atomic<int> next{0};
  const auto work = [&] {
    for (int y = next++; y < options.height; y = next++)
      for (int x = 0; x < options.width; ++x) {
        const Vec colour = painter.pixel(x, y);
        const std::size_t at =
            3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(options.width) +
                 static_cast<std::size_t>(x));
        for (int d = 0; d < 3; ++d) rgb[at + static_cast<std::size_t>(d)] = encode(colour[d]);
      }
  };
  std::vector<std::jthread> threads(std::max(1u, std::thread::hardware_concurrency()));
  for (auto& thread : threads) thread = std::jthread(work);
  threads.clear();  // joins
  return rgb;
}

}  // namespace

bool can_draw_preview() { return true; }

void draw_preview(const std::filesystem::path& file, const Snapshot& snapshot,
                  const PreviewOptions& options) {
  const PreviewSurface surface = preview_surface(snapshot);
  expects(!surface.quads.empty(), "preview: the body has no surface to draw");
  // Single precision squares lengths on the way.
  constexpr double kFarthest = 1e15;
  for (std::size_t p = 0; p < snapshot.points.size(); ++p)
    expects(norm(snapshot.points[p] + snapshot.displacement[p]) < kFarthest,
            "preview: the body reaches too far to be drawn");
  const RayScene scene(surface);
  const double greatest =
      std::max({std::abs(options.up.x), std::abs(options.up.y), std::abs(options.up.z)});
  const Vec scaled = greatest > 0 ? to_float((1 / greatest) * options.up) : Vec{0, 1, 0};
  const Vec up = scaled * (1 / norm(scaled));
  const float aspect = static_cast<float>(options.width) / static_cast<float>(options.height);
  const Camera camera = choose_camera(scene, up, aspect);
  const std::vector<std::uint8_t> rgb = paint(Painter(scene, camera, up, options), options);

  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(options.width);
  image.height = static_cast<png_uint_32>(options.height);
  image.format = PNG_FORMAT_RGB;
  if (png_image_write_to_file(&image, file.string().c_str(), 0, rgb.data(), 0, nullptr) == 0)
    throw Error(ErrorKind::bad_input, text(file.string(), ": cannot be written: ", image.message));
}

}  // namespace kerf
