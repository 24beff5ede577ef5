// SPDX-License-Identifier: MIT
//
// Pictures of surfaces made by hand: where things are in them, their colours, and their bits.
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>

#include "app/preview.hpp"
#include "core/base/error.hpp"
#include "tests/support/solids.hpp"

namespace kerf {
namespace {

namespace fs = std::filesystem;
using test::add_part;
using test::make_box_surface;
using test::make_sphere;
using test::moved;

constexpr double kRounding = 1e-12;
constexpr double kSinglePrecision = 1e-5;  // of a picture, of points in single precision

/// A sphere whose half at +z is cut: id 1 where x < 0, id 2 elsewhere.
SurfaceMesh sphere_with_two_cuts() {
  return make_sphere({0.3, 0.1, -0.2}, 0.05, 24,
                     [](const Vec3d& n) { return n.z < 0 ? 0 : (n.x < 0 ? 1 : 2); });
}

/// Where a point is in the picture, x and y in [0, 1] from the upper left.
std::array<double, 2> project(const Framing& framing, const Vec3d& point) {
  const Camera camera = framing.camera();
  const Vec3f p = framing.to_picture(point) - camera.eye;
  const double away = -dot(p, camera.back);
  return {0.5 + 0.5 * dot(p, camera.right) / away / camera.half_width,
          0.5 - 0.5 * dot(p, camera.up) / away / camera.half_height};
}

/// The box in the picture of all points of `mesh`.
Box3 projected_box(const Framing& framing, const SurfaceMesh& mesh) {
  Box3 box;
  for (std::size_t i = 0; i < mesh.reference.size(); ++i) {
    const auto [x, y] = project(framing, mesh.position(static_cast<std::int32_t>(i)));
    box.add(Vec3d{x, y, 0});
  }
  return box;
}

Framing frame(const SurfaceMesh& mesh, const View& view, const Vec3d& up = {0, 1, 0},
              double aspect = 4.0 / 3) {
  Framing framing(view, up, aspect);
  framing.add(mesh);
  return framing;
}

TEST(Camera, AxesAreSquareForEveryViewAndUp) {
  for (const Vec3d& up : {Vec3d{0, 1, 0}, Vec3d{0, 0, 5}, Vec3d{0, 0, -1}, Vec3d{1, 2, -3},
                          Vec3d{0, 1e200, 0}, Vec3d{1e-200, 0, 0}})
    for (const double azimuth : {-170.0, 0.0, 35.0, 400.0})
      for (const double elevation : {-90.0, -10.0, 0.0, 46.0, 90.0}) {
        const ViewAxes axes = view_axes({azimuth, elevation}, up);
        SCOPED_TRACE(testing::Message()
                     << up.x << ' ' << up.y << ' ' << up.z << ", " << azimuth << ", " << elevation);
        EXPECT_NEAR(norm(axes.right), 1, kRounding);
        EXPECT_NEAR(norm(axes.up), 1, kRounding);
        EXPECT_NEAR(dot(axes.right, axes.up), 0, kRounding);
        EXPECT_LT(norm(cross(axes.right, axes.up) - axes.back), kRounding) << "right-handed";
        const double greatest = std::max({std::abs(up.x), std::abs(up.y), std::abs(up.z)});
        EXPECT_GE(dot(axes.up, up * (1 / greatest)), -kRounding) << "up points down";
      }
}

TEST(Camera, AzimuthGoesFromTheFrontToTheRight) {
  EXPECT_LT(norm(view_axes({0, 0}, {0, 1, 0}).back - Vec3d{0, 0, 1}), kRounding);
  EXPECT_LT(norm(view_axes({90, 0}, {0, 1, 0}).back - Vec3d{1, 0, 0}), kRounding);
  EXPECT_LT(norm(view_axes({12, 90}, {0, 1, 0}).back - Vec3d{0, 1, 0}), kRounding);
  EXPECT_LT(norm(view_axes({0, 0}, {0, 0, 0}).up - Vec3d{0, 1, 0}), kRounding) << "no up is y";
}

TEST(Framing, HoldsTheBodyInTheMiddleAndFillsThePicture) {
  SurfaceMesh mesh = make_box_surface({10, 20, 30}, {10.5, 20.1, 30.2});
  for (std::size_t i = 0; i < 8; ++i) mesh.displacement[i] = {0, 0.01 * double(i), 0};
  for (const double elevation : {-30.0, 0.0, 14.0, 90.0})
    for (const double aspect : {0.5, 1.0, 2.0}) {
      const Box3 box = projected_box(frame(mesh, {35, elevation}, {0, 1, 0}, aspect), mesh);
      SCOPED_TRACE(testing::Message() << elevation << ", " << aspect);
      // Borders that decide the distance are met exactly; what is between the others may hang a
      // little to one side, as near things look larger.
      const bool wide = box.extent().x > box.extent().y;
      EXPECT_NEAR(box.lo.x + box.hi.x, 1, wide ? kSinglePrecision : 0.1);
      EXPECT_NEAR(box.lo.y + box.hi.y, 1, wide ? 0.1 : kSinglePrecision);
      const double filled = std::max(box.extent().x, box.extent().y);
      EXPECT_GT(filled, 0.75);
      EXPECT_LT(filled, 0.90);
    }
}

TEST(Framing, CrumbsDoNotCount) {
  const SurfaceMesh body = make_sphere({0, 0, 0}, 1, 10);
  const SurfaceMesh crumb = make_box_surface({0, -5, 0}, {0.1, -4.9, 0.1});
  SurfaceMesh few = body, many = make_sphere({0, 0, 0}, 1, 24);
  add_part(few, crumb, 1);   // 12 of 372 triangles
  add_part(many, crumb, 1);  // 12 of 2220
  const View view{35, 22};
  EXPECT_GT(projected_box(frame(few, view), body).lo.y, -0.1);
  EXPECT_LT(projected_box(frame(few, view), body).extent().y, 0.5) << "it is a piece";
  EXPECT_GT(projected_box(frame(many, view), body).extent().y, 0.75) << "it is a crumb";
  EXPECT_NEAR(frame(many, view).ground(), frame(body, view).ground(), 0.01);
}

TEST(Framing, CrumbsCountWhereThereIsNothingElse) {
  SurfaceMesh mesh;
  for (int i = 0; i < 120; ++i)
    add_part(mesh, make_box_surface({1.0 * i, 0, 0}, {1.0 * i + 0.5, 1, 1}), i);
  const Box3 box = projected_box(frame(mesh, {0, 0}), mesh);
  EXPECT_GT(box.lo.x, 0);
  EXPECT_LT(box.hi.x, 1);
}

TEST(Framing, RefusesWhatCannotBeDrawn) {
  Framing framing({35, 22}, {0, 1, 0}, 1);
  EXPECT_THROW(framing.add({}), Error);
  SurfaceMesh box = make_box_surface({0, 0, 0}, {1, 1, 1});
  for (const double far : {1e16, std::numeric_limits<double>::quiet_NaN()}) {
    box.displacement[3].y = far;
    EXPECT_THROW(framing.add(box), Error) << far;
  }
}

/// Pictures of 160 x 120 pixels, of what `framing` holds.
class PictureTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!can_draw_preview()) GTEST_SKIP() << "built without Embree or libpng";
    options_.width = 160;
    options_.height = 120;
  }
  struct Rgb {
    int r, g, b;
    friend bool operator==(const Rgb&, const Rgb&) = default;
  };
  Rgb at(const std::vector<std::uint8_t>& rgb, int x, int y) const {
    const auto i = static_cast<std::size_t>(3 * (y * options_.width + x));
    return {rgb[i], rgb[i + 1], rgb[i + 2]};
  }
  Rgb at(const std::vector<std::uint8_t>& rgb, const std::array<double, 2>& place) const {
    return at(rgb, static_cast<int>(place[0] * options_.width),
              static_cast<int>(place[1] * options_.height));
  }
  static bool is_red(const Rgb& c) { return c.r > 2 * c.g && c.r > 2 * c.b; }
  static bool is_blue(const Rgb& c) { return c.b > c.r + 40 && c.b > c.g + 20; }
  static bool is_warm(const Rgb& c) { return c.r > c.g && c.g > c.b && !is_red(c); }
  static bool is_grey(const Rgb& c) {
    return std::max({c.r, c.g, c.b}) - std::min({c.r, c.g, c.b}) < 12;
  }

  PreviewOptions options_;
};

TEST_F(PictureTest, CutsAndBodyAreInTheirPlacesAndColours) {
  const SurfaceMesh mesh = sphere_with_two_cuts();
  const Vec3d centre{0.3, 0.1, -0.2};
  const Framing front = frame(mesh, {0, 10}), back = frame(mesh, {180, 10});
  const auto seen = draw_pixels(mesh, front, options_);
  EXPECT_TRUE(is_red(at(seen, project(front, centre + Vec3d{-0.02, 0, 0.045}))));
  EXPECT_TRUE(is_blue(at(seen, project(front, centre + Vec3d{0.02, 0, 0.045}))));
  EXPECT_TRUE(is_grey(at(seen, 3, 3)));
  EXPECT_TRUE(is_grey(at(seen, 156, 100)));
  const auto behind = draw_pixels(mesh, back, options_);
  EXPECT_TRUE(is_warm(at(behind, project(back, centre + Vec3d{0, 0, -0.05}))));
}

TEST_F(PictureTest, TheBodyStandsAboveItsShadow) {
  const SurfaceMesh mesh = make_box_surface({-1, 0, -1}, {1, 2, 1});
  const Framing framing = frame(mesh, {30, 20});
  const auto rgb = draw_pixels(mesh, framing, options_);
  // Beside the body, away from the light, and far away on the same row.
  const auto near = project(framing, {1.3, 0, -0.3});
  const Rgb dark = at(rgb, near), light = at(rgb, 3, static_cast<int>(near[1] * options_.height));
  EXPECT_LT(dark.g + 25, light.g);
}

TEST_F(PictureTest, SameBitsForAnyNumberOfThreads) {
  const SurfaceMesh mesh = sphere_with_two_cuts();
  const Framing framing = frame(mesh, {20, 20});
  options_.threads = 1;
  const auto one = draw_pixels(mesh, framing, options_);
  for (const int threads : {2, 5, 0}) {
    options_.threads = threads;
    EXPECT_EQ(draw_pixels(mesh, framing, options_), one) << threads;
  }
}

TEST_F(PictureTest, MoreSamplesChangeEdgesOnly) {
  const SurfaceMesh mesh = sphere_with_two_cuts();
  const Framing framing = frame(mesh, {0, 10});
  const auto coarse = draw_pixels(mesh, framing, options_);
  options_.samples = 8;
  const auto fine = draw_pixels(mesh, framing, options_);
  EXPECT_NE(coarse, fine);
  const auto place = project(framing, {0.28, 0.1, -0.155});
  EXPECT_EQ(at(coarse, place).r, at(fine, place).r);
}

/// Facets hide in shading by corner normals, also where light becomes shadow.
TEST_F(PictureTest, ACoarseSphereIsShadedLikeAFineOne) {
  const SurfaceMesh coarse = make_sphere({0, 0, 0}, 1, 8), fine = make_sphere({0, 0, 0}, 1, 96);
  const Framing framing = frame(fine, {0, 10});
  const auto a = draw_pixels(coarse, framing, options_), b = draw_pixels(fine, framing, options_);
  int greatest = 0;
  for (int y = 30; y < 90; ++y)  // well inside: the outlines differ
    for (int x = 50; x < 110; ++x)
      greatest = std::max(greatest, std::abs(at(a, x, y).g - at(b, x, y).g));
  // It is 3, from interpolation; 10 if rays to the light start from the facets themselves.
  EXPECT_LT(greatest, 6);
}

TEST_F(PictureTest, TheViewIsFromWhereTheCutIsSeen) {
  const auto cut_towards = [](const Vec3d& direction) {
    return make_sphere({0, 0, 0}, 1, 24, [=](const Vec3d& n) { return dot(n, direction) > 0.8; });
  };
  for (const Vec3d& up : {Vec3d{0, 1, 0}, Vec3d{0, 0, 1}})
    for (const Vec3d& direction : {Vec3d{1, 0, 0}, Vec3d{-0.6, -0.48, -0.64}}) {
      options_.up = up;
      const View view = choose_view(cut_towards(direction), options_);
      EXPECT_GT(dot(view_axes(view, up).back, direction), 0.5)
          << view.azimuth << ", " << view.elevation;
    }
  const View uncut = choose_view(make_sphere({0, 0, 0}, 1, 24), options_);
  EXPECT_EQ(uncut.azimuth, View{}.azimuth);
  EXPECT_EQ(uncut.elevation, View{}.elevation);
}

/// The middle of all red pixels.
std::array<double, 2> red_middle(const std::vector<std::uint8_t>& rgb, int width) {
  double x = 0, y = 0, count = 0;
  for (std::size_t i = 0; i < rgb.size() / 3; ++i)
    if (rgb[3 * i] > 2 * rgb[3 * i + 1] && rgb[3 * i] > 2 * rgb[3 * i + 2]) {
      x += static_cast<double>(i % static_cast<std::size_t>(width));
      y += static_cast<double>(i / static_cast<std::size_t>(width));
      ++count;
    }
  EXPECT_GT(count, 50);
  return {x / count, y / count};
}

TEST_F(PictureTest, WhatStandsStillInASeriesStaysInItsPlace) {
  const SurfaceMesh still =
      make_sphere({0, 0, 0}, 0.5, 24, [](const Vec3d& n) { return n.z > 0.5 ? 1 : 0; });
  std::vector<SurfaceMesh> series(3, still);
  for (int i = 0; i < 3; ++i)
    add_part(series[static_cast<std::size_t>(i)],
             moved(make_sphere({0.8, 0, 0}, 0.2, 12), {1.0 * i, 0.1 * i, 0}), 1);
  Framing framing({10, 15}, {0, 1, 0}, options_.aspect());
  for (const auto& mesh : series) framing.add(mesh);

  const auto first = draw_pixels(series.front(), framing, options_);
  const auto last = draw_pixels(series.back(), framing, options_);
  const auto alone = draw_pixels(series.back(), frame(series.back(), {10, 15}), options_);

  constexpr double kPixels = 0.1;  // light from the moving part may tip a pixel of the red's border
  const auto a = red_middle(first, options_.width), b = red_middle(last, options_.width);
  EXPECT_NEAR(a[0], b[0], kPixels);
  EXPECT_NEAR(a[1], b[1], kPixels);
  EXPECT_TRUE(at(first, 2, 117) == at(last, 2, 117)) << "the ground in front";
  for (const auto& mesh : series) {
    const Box3 box = projected_box(framing, mesh);
    EXPECT_TRUE(box.lo.x > 0 && box.hi.x < 1 && box.lo.y > 0 && box.hi.y < 1);
  }
  const auto alone_first = draw_pixels(series.front(), frame(series.front(), {10, 15}), options_);
  EXPECT_GT(
      std::abs(red_middle(alone_first, options_.width)[0] - red_middle(alone, options_.width)[0]),
      5)
      << "framed one by one, it would move";
}

TEST_F(PictureTest, FileIsAPngOfTheSizeAskedFor) {
  const fs::path file =
      fs::path(testing::TempDir()) / ("kerf_preview_" + std::to_string(getpid()) + ".png");
  draw_preview(file, sphere_with_two_cuts(), options_);
  std::ifstream in(file, std::ios::binary);
  const std::string png{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  fs::remove(file);
  ASSERT_GT(png.size(), 100u);
  EXPECT_EQ(png.substr(1, 3), "PNG");
  EXPECT_EQ(static_cast<std::uint8_t>(png[19]), 160);  // the last bytes of width and height
  EXPECT_EQ(static_cast<std::uint8_t>(png[23]), 120);
  EXPECT_THROW(draw_preview("/proc/kerf.png", sphere_with_two_cuts(), options_), Error);
  EXPECT_THROW(draw_preview(file, {}, options_), Error);
  EXPECT_FALSE(fs::exists(file));
}

TEST_F(PictureTest, IsGivenUpWhenItIsToStop) {
  static std::atomic<int> asked;
  asked = 0;
  options_.stop = [] { return ++asked > 20; };  // in the middle of its rows
  EXPECT_THROW(
      draw_pixels(sphere_with_two_cuts(), frame(sphere_with_two_cuts(), {10, 15}), options_),
      Error);
  EXPECT_LT(asked, options_.height);
}

}  // namespace
}  // namespace kerf
