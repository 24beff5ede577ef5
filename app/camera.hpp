// SPDX-License-Identifier: MIT
//
// Where a picture is taken from, such that what it shows fills it. No drawing in here.
#pragma once

#include "core/surface/surface_mesh.hpp"

namespace kerf {

/// A direction to look from, in degrees. Azimuth 0 is the front: +z where up is y; from there it
/// goes to the right. Elevation 90 is straight above.
struct View {
  double azimuth = 35, elevation = 22;
};

/// Three directions of unit length, square to each other: right, up and back of a picture.
struct ViewAxes {
  Vec3d right, up, back;
};
/// `up` is the world's and need not be of unit length; if it is zero, y is up.
ViewAxes view_axes(const View& view, const Vec3d& up);

/// A pinhole in picture units: what is framed has a box of diagonal 1 around the origin.
struct Camera {
  Vec3f eye, right, up, back;
  float half_width = 0, half_height = 0;  ///< tangents of half the angles of view

  /// Direction, not of unit length, through a point of the picture; x and y in [0, 1] from the
  /// upper left.
  Vec3f ray(float x, float y) const {
    return (2 * x - 1) * half_width * right + (1 - 2 * y) * half_height * up - back;
  }
};

/// A camera that holds everything added to it, from as near as it may. Add one surface for one
/// picture, all surfaces of a series for a steady camera.
class Framing {
 public:
  /// `aspect`: width by height of the picture.
  Framing(const View& view, const Vec3d& up, double aspect);

  /// Crumbs, pieces with less than a hundredth of the triangles, do not count: they must not make
  /// the rest small when they fall out of the picture.
  /// @throws Error (bad_input) for a surface without triangles, or one that reaches too far.
  void add(const SurfaceMesh& mesh);

  Camera camera() const;  ///< needs a surface
  Vec3f to_picture(const Vec3d& world) const;
  Vec3f world_up() const;
  float ground() const;  ///< the lowest height along world_up, in picture units

 private:
  double scale() const;

  ViewAxes axes_;
  Vec3d world_up_;
  double half_width_, half_height_;  // tangents that the body may fill
  double aspect_;
  Box3 box_;
  double lowest_, nearest_;
  // Of all points with x, y, z along the axes: the greatest x + w z, w z - x, y + h z, h z - y.
  double right_, left_, top_, bottom_;
};

}  // namespace kerf
