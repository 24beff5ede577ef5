// SPDX-License-Identifier: MIT
#include "app/camera.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>

#include "core/base/error.hpp"

namespace kerf {
namespace {

constexpr double kHalfHeight = 0.25;  // tangent of half the vertical angle of view
constexpr double kMargin = 0.82;      // part of the picture that the body may fill
constexpr double kCrumb = 0.01;       // of the triangles
constexpr double kFarthest = 1e15;    // m; single precision squares lengths on the way
constexpr double kLowest = -std::numeric_limits<double>::infinity();

Vec3f to_float(const Vec3d& v) {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

Vec3d unit_up(const Vec3d& up) {
  const double greatest = std::max({std::abs(up.x), std::abs(up.y), std::abs(up.z)});
  if (!(greatest > 0)) return {0, 1, 0};
  const Vec3d scaled = (1 / greatest) * up;  // its length neither overflows nor vanishes
  return scaled * (1 / norm(scaled));
}

/// Per point: whether it belongs to a piece that is no crumb; all do if there are crumbs only.
std::vector<std::uint8_t> framed_points(const SurfaceMesh& mesh) {
  const auto piece_of = [&](const auto& triangle) {
    return mesh.piece[static_cast<std::size_t>(triangle[0])];
  };
  std::map<std::int32_t, std::size_t> size;
  for (const auto& triangle : mesh.triangles) ++size[piece_of(triangle)];
  const double least = kCrumb * static_cast<double>(mesh.triangles.size());
  const bool only_crumbs = std::all_of(size.begin(), size.end(), [&](const auto& entry) {
    return static_cast<double>(entry.second) < least;
  });
  std::vector<std::uint8_t> framed(mesh.reference.size(), 0);
  for (const auto& triangle : mesh.triangles)
    if (only_crumbs || static_cast<double>(size[piece_of(triangle)]) >= least)
      for (const auto p : triangle) framed[static_cast<std::size_t>(p)] = 1;
  return framed;
}

}  // namespace

ViewAxes view_axes(const View& view, const Vec3d& up) {
  const Vec3d z = unit_up(up);
  const Vec3d hint = std::abs(z.z) < 0.9 ? Vec3d{0, 0, 1} : Vec3d{0, -1, 0};
  const Vec3d across = cross(z, hint);
  const Vec3d side = across * (1 / norm(across)), front = cross(side, z);
  const double a = view.azimuth * std::numbers::pi / 180;
  const double e = view.elevation * std::numbers::pi / 180;
  ViewAxes axes;
  axes.right = std::cos(a) * side - std::sin(a) * front;
  axes.back = std::cos(e) * (std::sin(a) * side + std::cos(a) * front) + std::sin(e) * z;
  axes.up = cross(axes.back, axes.right);
  return axes;
}

Framing::Framing(const View& view, const Vec3d& up, double aspect)
    : axes_(view_axes(view, up)),
      world_up_(unit_up(up)),
      half_width_(kMargin * kHalfHeight * aspect),
      half_height_(kMargin * kHalfHeight),
      aspect_(aspect),
      lowest_(-kLowest),
      nearest_(kLowest),
      right_(kLowest),
      left_(kLowest),
      top_(kLowest),
      bottom_(kLowest) {}

void Framing::add(const SurfaceMesh& mesh) {
  expects(!mesh.triangles.empty(), "the body has no surface to draw");
  const auto framed = framed_points(mesh);
  for (std::size_t i = 0; i < framed.size(); ++i) {
    const Vec3d p = mesh.reference[i] + mesh.displacement[i];
    expects(norm(p) < kFarthest, "the body reaches too far to be drawn");
    if (framed[i] == 0) continue;
    box_.add(p);
    const double x = dot(p, axes_.right), y = dot(p, axes_.up), z = dot(p, axes_.back);
    lowest_ = std::min(lowest_, dot(p, world_up_));
    nearest_ = std::max(nearest_, z);
    right_ = std::max(right_, x + half_width_ * z);
    left_ = std::max(left_, half_width_ * z - x);
    top_ = std::max(top_, y + half_height_ * z);
    bottom_ = std::max(bottom_, half_height_ * z - y);
  }
}

double Framing::scale() const {
  const double diagonal = norm(box_.extent());
  return diagonal > 0 ? 1 / diagonal : 1;
}

Vec3f Framing::to_picture(const Vec3d& world) const {
  return to_float((world - 0.5 * (box_.lo + box_.hi)) * scale());
}

Vec3f Framing::world_up() const { return to_float(world_up_); }

float Framing::ground() const {
  return static_cast<float>((lowest_ - dot(0.5 * (box_.lo + box_.hi), world_up_)) * scale());
}

Camera Framing::camera() const {
  // A point is inside the right border if x + w z <= X + w Z for the eye at X, Z; and so on. The
  // least Z that allows all borders centres what is framed, as seen in perspective.
  const double x = 0.5 * (right_ - left_), y = 0.5 * (top_ - bottom_);
  const double z =
      std::max({0.5 * (right_ + left_) / half_width_, 0.5 * (top_ + bottom_) / half_height_,
                nearest_ + 0.1 / scale()});  // not inside of what is thin and long
  Camera camera;
  camera.eye = to_picture(x * axes_.right + y * axes_.up + z * axes_.back);
  camera.right = to_float(axes_.right);
  camera.up = to_float(axes_.up);
  camera.back = to_float(axes_.back);
  camera.half_height = static_cast<float>(kHalfHeight);
  camera.half_width = static_cast<float>(kHalfHeight * aspect_);
  return camera;
}

}  // namespace kerf
