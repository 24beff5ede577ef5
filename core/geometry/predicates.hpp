// SPDX-License-Identifier: MIT
//
// Exact predicates on integer coordinates, without ties.
//
// Points are mapped once to an integer lattice (Quantiser); from there on every decision is exact,
// and decisions about neighbouring triangles agree. Ties are broken by simulation of simplicity:
// the tested point or segment is moved by one common infinitesimal (e, e^2, e^3) along x, y, z,
// 0 < e << 1; triangles stay. So a moved segment never touches an edge or a corner, and it crosses
// a closed surface as often as topology demands.
//
// Needs   |coordinate| <= 2^40. Differences are then <= 2^41, entries of a cross product <= 2^83,
//         determinants <= 3 * 2^41 * 2^83 = 3 * 2^124 < 2^126, which fits 128 signed bits.
// Source  Edelsbrunner, Muecke 1990, Simulation of simplicity.
#pragma once

#include <array>
#include <cstdint>

#include "core/geometry/vec.hpp"

namespace kerf {

__extension__ typedef __int128 Int128;
using Int3 = std::array<std::int64_t, 3>;  ///< a point of the integer lattice

inline constexpr std::int64_t kMaxCoordinate = std::int64_t{1} << 40;

/// Maps positions in m to the integer lattice, component by component, by rounding to nearest: the
/// same bits in give the same integers out, and order is kept.
class Quantiser {
 public:
  /// A lattice as fine as 2^40 allows around `everything` that will be mapped. The unit is a power
  /// of two and the origin a multiple of it, so that no position is moved by more than half a unit.
  /// @throws Error (bad_input) if the box is empty or not finite.
  explicit Quantiser(const Box3& everything);
  /// A lattice of the caller's choice: integer 0 is at `origin`, m; `unit` in m.
  Quantiser(const Vec3d& origin, double unit);

  /// @throws Error (bad_input) for a position that is not finite or beyond 2^40 units.
  Int3 operator()(const Vec3d& p) const;
  Vec3d position(const Int3& p) const;   ///< m
  double unit() const { return unit_; }  ///< m

 private:
  Vec3d origin_{};
  double unit_ = 1;
};

/// Sign of n . (p - a), n = (b - a) x (c - a), for the moved point p: +1 where n points to, else
/// -1. 0 only if the triangle has no area.
int side_of_plane(const Int3& a, const Int3& b, const Int3& c, const Int3& p);

/// Sign of (q - p) . ((u - p) x (v - p)) for the moved segment pq: on which side its line passes
/// the edge uv. Antisymmetric in u, v. 0 only if pq and uv are parallel (or points).
int line_side(const Int3& p, const Int3& q, const Int3& u, const Int3& v);

/// Whether the moved segment pq crosses the triangle: +1 along its normal (b - a) x (c - a), -1
/// against it, 0 not at all. A triangle without area is never crossed. If it crosses, and `t` is
/// given, *t in [0, 1] is where along pq, as well as a double can say it.
int segment_crosses_triangle(const Int3& p, const Int3& q, const Int3& a, const Int3& b,
                             const Int3& c, double* t = nullptr);

/// line_side for the line through the moved point p along +axis: which side of the edge uv.
inline int axis_line_side(int axis, const Int3& p, const Int3& u, const Int3& v) {
  const auto i = static_cast<unsigned>(axis + 1) % 3, j = static_cast<unsigned>(axis + 2) % 3;
  const Int128 det = static_cast<Int128>(u[i] - p[i]) * (v[j] - p[j]) -
                     static_cast<Int128>(u[j] - p[j]) * (v[i] - p[i]);
  if (det != 0) return det > 0 ? 1 : -1;
  // d/de along i and j of the cross product; the smaller axis has the larger infinitesimal.
  const std::int64_t along_i = u[j] - v[j], along_j = v[i] - u[i];
  const std::int64_t first = i < j ? along_i : along_j, second = i < j ? along_j : along_i;
  const std::int64_t tie = first != 0 ? first : second;
  return tie > 0 ? 1 : (tie < 0 ? -1 : 0);
}

/// Whether the line along +axis through the moved point p meets the triangle: +1 if it does along
/// the normal (b - a) x (c - a), -1 against it, 0 not at all. Agrees with
/// segment_crosses_triangle for every segment of that line.
inline int axis_line_crosses_triangle(int axis, const Int3& p, const Int3& a, const Int3& b,
                                      const Int3& c) {
  const int s = axis_line_side(axis, p, a, b);
  if (s == 0 || axis_line_side(axis, p, b, c) != s || axis_line_side(axis, p, c, a) != s) return 0;
  return s;
}

}  // namespace kerf
