// SPDX-License-Identifier: MIT
#include "core/geometry/predicates.hpp"

#include <cmath>

#include "core/base/error.hpp"

namespace kerf {
namespace {

struct Wide3 {
  Int128 x, y, z;
};

Int3 difference(const Int3& a, const Int3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

Wide3 cross_wide(const Int3& a, const Int3& b) {
  return {static_cast<Int128>(a[1]) * b[2] - static_cast<Int128>(a[2]) * b[1],
          static_cast<Int128>(a[2]) * b[0] - static_cast<Int128>(a[0]) * b[2],
          static_cast<Int128>(a[0]) * b[1] - static_cast<Int128>(a[1]) * b[0]};
}

Int128 dot_wide(const Wide3& a, const Int3& b) { return a.x * b[0] + a.y * b[1] + a.z * b[2]; }

int sign(Int128 v) { return v > 0 ? 1 : (v < 0 ? -1 : 0); }

// Sign of value + e d.x + e^2 d.y + e^3 d.z.
int sign_moved(Int128 value, const Wide3& d) {
  if (value != 0) return sign(value);
  if (d.x != 0) return sign(d.x);
  if (d.y != 0) return sign(d.y);
  return sign(d.z);
}

}  // namespace

Quantiser::Quantiser(const Box3& everything) {
  double half = 0;
  for (int d = 0; d < 3; ++d) {
    expects(std::isfinite(everything.lo[d]) && std::isfinite(everything.hi[d]) &&
                everything.lo[d] <= everything.hi[d],
            "a box with finite corners is needed, got one that is empty or not finite");
    half = std::max(half, 0.5 * everything.hi[d] - 0.5 * everything.lo[d]);
  }
  int exponent = 0;
  constexpr int kLeastExponent = -900;  // keeps the unit a normal number
  if (half > 0) std::frexp(half, &exponent);
  unit_ = std::ldexp(1.0, std::max(exponent, kLeastExponent) - 40);
  for (int d = 0; d < 3; ++d)
    origin_[d] = unit_ * std::nearbyint((0.5 * everything.lo[d] + 0.5 * everything.hi[d]) / unit_);
}

Quantiser::Quantiser(const Vec3d& origin, double unit) : origin_(origin), unit_(unit) {
  expects(unit > 0 && std::isfinite(unit), "the unit of a lattice must be positive and finite");
}

Int3 Quantiser::operator()(const Vec3d& p) const {
  Int3 out{};
  for (int d = 0; d < 3; ++d) {
    const double scaled = std::nearbyint((p[d] - origin_[d]) / unit_);
    if (!(std::abs(scaled) <= static_cast<double>(kMaxCoordinate)))  // also NaN
      throw Error(ErrorKind::bad_input,
                  text("coordinate ", p[d], " is not finite or far outside the body"));
    out[static_cast<unsigned>(d)] = static_cast<std::int64_t>(scaled);
  }
  return out;
}

Vec3d Quantiser::position(const Int3& p) const {
  return {origin_.x + unit_ * static_cast<double>(p[0]),
          origin_.y + unit_ * static_cast<double>(p[1]),
          origin_.z + unit_ * static_cast<double>(p[2])};
}

int side_of_plane(const Int3& a, const Int3& b, const Int3& c, const Int3& p) {
  const Wide3 n = cross_wide(difference(b, a), difference(c, a));
  return sign_moved(dot_wide(n, difference(p, a)), n);
}

int line_side(const Int3& p, const Int3& q, const Int3& u, const Int3& v) {
  // Moving p and q by d adds d . ((q - p) x (v - u)): the terms quadratic in d vanish.
  const Int3 pq = difference(q, p);
  const Int128 det = dot_wide(cross_wide(difference(u, p), difference(v, p)), pq);
  if (det != 0) return sign(det);
  return sign_moved(0, cross_wide(pq, difference(v, u)));
}

int segment_crosses_triangle(const Int3& p, const Int3& q, const Int3& a, const Int3& b,
                             const Int3& c, double* t) {
  const Wide3 n = cross_wide(difference(b, a), difference(c, a));
  const Int128 at_p = dot_wide(n, difference(p, a)), at_q = dot_wide(n, difference(q, a));
  const int side_p = sign_moved(at_p, n);
  if (side_p == 0 || side_p == sign_moved(at_q, n)) return 0;
  // The ends are apart, so pq is parallel to no edge, and no side below is 0.
  const int s = line_side(p, q, a, b);
  if (line_side(p, q, b, c) != s || line_side(p, q, c, a) != s) return 0;
  if (t != nullptr) {
    const double to_p = std::abs(static_cast<double>(at_p));
    *t = to_p / (to_p + std::abs(static_cast<double>(at_q)));
  }
  return -side_p;
}

}  // namespace kerf
