// SPDX-License-Identifier: MIT
//
// Solids with a closed form. A lattice line meets each in at most two closed intervals, and a
// link's crossings are the ends of those intervals.
#include <array>
#include <cmath>

#include "core/base/error.hpp"
#include "core/body/link_walk.hpp"
#include "core/body/solid.hpp"

namespace kerf {
namespace {

// Where a line along an axis enters and leaves the material; coordinates along that axis, m.
struct Interval {
  double lo, hi;
};

struct Intervals {
  std::array<Interval, 2> part{};
  int count = 0;
  void add(double lo, double hi) { part[static_cast<unsigned>(count++)] = {lo, hi}; }
};

class Shape : public Solid {
 public:
  SolidSamples sample(const Lattice& lattice) const override;

 protected:
  virtual bool contains(const Vec3d& p) const = 0;
  /// The line through p, which lies near the shape, along `axis`; at least one interval.
  virtual Intervals meet(int axis, const Vec3d& p) const = 0;
  /// Outward and not zero, of the surface point p, met by a line along `axis`; sign: +1 where the
  /// line leaves the material.
  virtual Vec3d normal(int axis, const Vec3d& p, int sign) const = 0;

 private:
  LinkHit hit(int axis, const Vec3d& lower, double spacing, double at, int sign) const;
};

int nearest(const Intervals& intervals, double x) {
  int best = 0;
  double best_distance = std::numeric_limits<double>::infinity();
  for (int i = 0; i < intervals.count; ++i) {
    const Interval& part = intervals.part[static_cast<unsigned>(i)];
    const double distance = std::max({part.lo - x, x - part.hi, 0.0});
    if (distance < best_distance) {
      best_distance = distance;
      best = i;
    }
  }
  return best;
}

LinkHit Shape::hit(int axis, const Vec3d& lower, double spacing, double at, int sign) const {
  Vec3d p = lower;
  p[axis] = at;
  Vec3d n = normal(axis, p, sign);
  n *= 1 / norm(n);
  return {std::clamp((at - lower[axis]) / spacing, 0.0, 1.0), n};
}

SolidSamples Shape::sample(const Lattice& lattice) const {
  SolidSamples out;
  out.inside.resize(lattice.cells());
  for (std::size_t i = 0; i < out.inside.size(); ++i)
    out.inside[i] = contains(lattice.center(lattice.cell(i))) ? 1 : 0;
  const double h = lattice.spacing;
  for_each_link(
      lattice, out.inside, [&](LinkKey key, const Vec3i& c, int axis, bool p_in, bool q_in) {
        const Vec3d p = lattice.center(c);
        Vec3i d = c;
        ++d[static_cast<unsigned>(axis)];
        const Vec3d q = lattice.center(d);
        if (p_in != q_in && contains(p_in ? q : p)) {  // the lattice ends in the material
          const LinkHit cut = half_way(axis, p_in);
          out.crossings.emplace_back(key, make_link_cut(cut, cut, h));
          return;
        }
        const Intervals parts = meet(axis, p);
        const auto part = [&](int i) { return parts.part[static_cast<unsigned>(i)]; };
        int first = nearest(parts, p[axis]), last = nearest(parts, q[axis]);
        if (p_in && q_in) {
          if (first == last) return;
          const LinkHit a = hit(axis, p, h, part(first).hi, 1);
          const LinkHit b = hit(axis, p, h, part(last).lo, -1);
          out.crossings.emplace_back(key, make_link_cut(a, b, h));
        } else if (p_in) {
          while (last > first && part(last).hi > q[axis]) --last;
          out.crossings.emplace_back(key, make_link_cut(hit(axis, p, h, part(first).hi, 1),
                                                        hit(axis, p, h, part(last).hi, 1), h));
        } else {
          while (first < last && part(first).lo < p[axis]) ++first;
          out.crossings.emplace_back(key, make_link_cut(hit(axis, p, h, part(first).lo, -1),
                                                        hit(axis, p, h, part(last).lo, -1), h));
        }
      });
  return out;
}

void check_box(const Box3& box, const char* what) {
  for (int d = 0; d < 3; ++d)
    expects(std::isfinite(box.lo[d]) && std::isfinite(box.hi[d]) && box.lo[d] < box.hi[d],
            text(what, " needs finite corners and a positive size along every axis"));
}

class BoxShape final : public Shape {
 public:
  explicit BoxShape(const Box3& box) : box_(box) {}
  Box3 bounds() const override { return box_; }

 protected:
  bool contains(const Vec3d& p) const override { return box_.contains(p); }
  Intervals meet(int axis, const Vec3d&) const override {
    Intervals out;
    out.add(box_.lo[axis], box_.hi[axis]);
    return out;
  }
  Vec3d normal(int axis, const Vec3d&, int sign) const override {
    Vec3d n{};
    n[axis] = sign;
    return n;
  }

 private:
  Box3 box_;
};

class EllipsoidShape final : public Shape {
 public:
  EllipsoidShape(const Vec3d& center, const Vec3d& radii) : center_(center), radii_(radii) {}
  Box3 bounds() const override { return {center_ - radii_, center_ + radii_}; }

 protected:
  bool contains(const Vec3d& p) const override {
    const Vec3d u = scaled(p);
    return dot(u, u) <= 1;
  }
  Intervals meet(int axis, const Vec3d& p) const override {
    Vec3d u = scaled(p);
    u[axis] = 0;
    const double half = radii_[axis] * std::sqrt(std::max(0.0, 1 - dot(u, u)));
    Intervals out;
    out.add(center_[axis] - half, center_[axis] + half);
    return out;
  }
  Vec3d normal(int axis, const Vec3d& p, int sign) const override {
    Vec3d n = scaled(p);
    for (int d = 0; d < 3; ++d) n[d] /= radii_[d];
    if (norm(n) == 0) n[axis] = sign;
    return n;
  }

 private:
  Vec3d scaled(const Vec3d& p) const {
    const Vec3d d = p - center_;
    return {d.x / radii_.x, d.y / radii_.y, d.z / radii_.z};
  }
  Vec3d center_, radii_;
};

class CylinderShell final : public Shape {
 public:
  CylinderShell(const Box3& box, double thickness)
      : box_(box), middle_(0.5 * (box.lo + box.hi)), outer_(0.5 * box.extent()), inner_(outer_) {
    inner_.x -= thickness;
    inner_.z -= thickness;
  }
  Box3 bounds() const override { return box_; }

 protected:
  bool contains(const Vec3d& p) const override {
    return box_.lo.y <= p.y && p.y <= box_.hi.y && round(p, outer_) <= 1 && round(p, inner_) >= 1;
  }
  Intervals meet(int axis, const Vec3d& p) const override {
    Intervals out;
    if (axis == 1) {
      out.add(box_.lo.y, box_.hi.y);
      return out;
    }
    const double far = half_width(axis, p, outer_), near = half_width(axis, p, inner_);
    const double m = middle_[axis];
    if (near > 0) {
      out.add(m - far, m - near);
      out.add(m + near, m + far);
    } else {
      out.add(m - far, m + far);
    }
    return out;
  }
  Vec3d normal(int axis, const Vec3d& p, int sign) const override {
    Vec3d n{};
    if (axis == 1) {
      n.y = sign;
      return n;
    }
    // The hollow is left towards the middle of the line, the outside away from it.
    const bool hollow = (p[axis] > middle_[axis]) == (sign < 0);
    const Vec3d& radii = hollow ? inner_ : outer_;
    const double side = hollow ? -1 : 1;
    n.x = side * (p.x - middle_.x) / (radii.x * radii.x);
    n.z = side * (p.z - middle_.z) / (radii.z * radii.z);
    if (norm(n) == 0) n[axis] = sign;
    return n;
  }

 private:
  double round(const Vec3d& p, const Vec3d& radii) const {
    const double x = (p.x - middle_.x) / radii.x, z = (p.z - middle_.z) / radii.z;
    return x * x + z * z;
  }
  double half_width(int axis, const Vec3d& p, const Vec3d& radii) const {
    const int other = 2 - axis;
    const double u = (p[other] - middle_[other]) / radii[other];
    return radii[axis] * std::sqrt(std::max(0.0, 1 - u * u));
  }
  Box3 box_;
  Vec3d middle_, outer_, inner_;
};

}  // namespace

std::unique_ptr<Solid> make_box(const Box3& box) {
  check_box(box, "a box");
  return std::make_unique<BoxShape>(box);
}

std::unique_ptr<Solid> make_ellipsoid(const Vec3d& center, const Vec3d& radii) {
  for (int d = 0; d < 3; ++d)
    expects(std::isfinite(center[d]) && std::isfinite(radii[d]) && radii[d] > 0,
            "a sphere needs a finite centre and positive radii");
  return std::make_unique<EllipsoidShape>(center, radii);
}

std::unique_ptr<Solid> make_cylinder_shell(const Box3& box, double thickness) {
  check_box(box, "a cylinder shell");
  const double radius = 0.5 * std::min(box.extent().x, box.extent().z);
  expects(thickness > 0 && thickness < radius,
          text("the thickness of a cylinder shell must lie between 0 and its radius ", radius,
               " m, got ", thickness));
  return std::make_unique<CylinderShell>(box, thickness);
}

}  // namespace kerf
