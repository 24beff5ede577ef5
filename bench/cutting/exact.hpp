// SPDX-License-Identifier: MIT
//
// Closed forms of linear elasticity that the scenes are measured against. Sources, and how good
// those are that are not exact: docs/cutting.md.
#pragma once

#include <vector>

#include "bench/cutting/body.hpp"
#include "core/geometry/vec.hpp"

namespace kerf::cutting {

/// A prism under its own weight, held at one end by what its exact solution does there. Exact.
/// Source  Timoshenko, Goodier 1970 [TG70], chapter 9.
struct HangingBar {
  double length = 1, area = 1;  ///< m, m^2
  double weight = 1;            ///< N/m^3, away from the held end; negative: it stands on it
  Elastic material;

  /// `along`: from the held end; `y`, `z` from the axis. Components likewise, m.
  Vec3d displacement(double along, double y, double z) const;
  double energy() const;  ///< J
};

/// A clamped beam of rectangular section under its own weight across it: bending and shear. It
/// leaves out what the clamp does to the section, of order (height / length)^2.
/// Source  [TG70] article 21; Cowper 1966 [C66] for the shear coefficient of a rectangle.
struct Beam {
  double length = 1;             ///< m
  double height = 1, width = 1;  ///< m, along the weight and across
  double weight = 1;             ///< N/m^3
  Elastic material;

  double tip() const;     ///< m
  double energy() const;  ///< J
};

/// Two arms that are pulled apart, in plane strain. From the stress intensity at the tip of the
/// slit between them, integrated over its length; the constant of integration is left out, a part
/// of order (height / length)^3.
/// Source  Foote, Buchwald 1985 [FB85].
struct DoubleCantilever {
  double length = 1;  ///< m, from the load to the tip
  double height = 1;  ///< m, of one arm
  double force = 1;   ///< N/m
  Elastic material;

  double opening() const;  ///< m, at the load
};

/// A circular crack under inner pressure in an infinite body. Exact.
/// Source  Sneddon 1946 [S46] for the opening. The displacement elsewhere is the sum of what each
///         part of the opening does, by the reciprocal theorem and Kelvin's point force, [TG70]
///         chapter 12.
class PennyCrack {
 public:
  PennyCrack(const Vec3d& normal, double radius, double pressure, const Elastic& material);

  double opening(double r) const;  ///< m, between both sides, at distance r from the middle
  double volume() const;           ///< m^3
  double energy() const;           ///< J, half the work of the pressure
  /// Needs  p is at least half a radius away from the crack, for the quadrature.
  Vec3d displacement(const Vec3d& p) const;

 private:
  struct Spot {
    Vec3d at;
    double volume;
  };
  Vec3d normal_;
  double radius_, pressure_;
  Elastic material_;
  std::vector<Spot> spots_;
};

}  // namespace kerf::cutting
