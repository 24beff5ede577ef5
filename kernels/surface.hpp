// SPDX-License-Identifier: MIT
//
// A surface that moves with cells: where its points are, and their normals.
#pragma once

#include "kernels/layout.hpp"
#include "kernels/mat3.hpp"

namespace kerf::kernels {

/// The trilinear field of a cell at a point, inside the cell or a little beside it.
///
/// Shapes  corners: a value per corner x + 2y + 4z; at: from corner 0, in sides of the cell.
/// Errors  corners that are all zero give exactly zero.
/// Source  [WDW13] section 3: inter- and extrapolation from the nearest cell.
template <class T>
KERF_HD Vec3<T> trilinear(const Vec3<T> (&corners)[kCorners], const Vec3<T>& at) {
  Vec3<T> along[4];
  for (int i = 0; i < 4; ++i)
    along[i] = corners[2 * i] + at.x * (corners[2 * i + 1] - corners[2 * i]);
  const Vec3<T> low = along[0] + at.y * (along[1] - along[0]);
  const Vec3<T> high = along[2] + at.y * (along[3] - along[2]);
  return low + at.z * (high - low);
}

/// Twice the area of a triangle along its normal, outward if it is counter-clockwise from outside.
template <class T>
KERF_HD Vec3<T> area_normal(const Vec3<T>& a, const Vec3<T>& b, const Vec3<T>& c) {
  return cross(b - a, c - a);
}

/// The unit vector along v; +z for a zero vector, so that a collapsed face gives no NaN.
///
/// Errors  divided by the largest component first: no overflow, no underflow.
template <class T>
KERF_HD Vec3<T> unit_or_z(const Vec3<T>& v) {
  T largest = T(0);
  for (int d = 0; d < 3; ++d) {
    const T size = v[d] < T(0) ? -v[d] : v[d];
    if (size > largest) largest = size;
  }
  if (!(largest > T(0))) return {T(0), T(0), T(1)};
  const Vec3<T> scaled{v.x / largest, v.y / largest, v.z / largest};
  return (T(1) / norm(scaled)) * scaled;
}

}  // namespace kerf::kernels
