// SPDX-License-Identifier: MIT
#include "bench/cutting/exact.hpp"

#include <cmath>
#include <numbers>

namespace kerf::cutting {
namespace {

constexpr double kPi = std::numbers::pi;

double shear_stiffness(const Beam& beam) {
  const double nu = beam.material.poisson, kappa = 10 * (1 + nu) / (12 + 11 * nu);
  return kappa * beam.width * beam.height * beam.material.young / (2 * (1 + nu));
}

Vec3d any_across(const Vec3d& n) {
  const Vec3d other = std::abs(n.y) < 0.5 ? Vec3d{0, 1, 0} : Vec3d{1, 0, 0};
  const Vec3d out = cross(other, n);
  return (1 / norm(out)) * out;
}

}  // namespace

Vec3d HangingBar::displacement(double along, double y, double z) const {
  const double a = weight / material.young, nu = material.poisson;
  return {a * (length * along - 0.5 * along * along) - 0.5 * nu * a * (y * y + z * z),
          -nu * a * (length - along) * y, -nu * a * (length - along) * z};
}

double HangingBar::energy() const {
  return area * weight * weight * std::pow(length, 3) / (6 * material.young);
}

double Beam::tip() const {
  const double load = weight * width * height, inertia = width * std::pow(height, 3) / 12;
  return load * std::pow(length, 4) / (8 * material.young * inertia) +
         load * length * length / (2 * shear_stiffness(*this));
}

double Beam::energy() const {
  const double load = weight * width * height, inertia = width * std::pow(height, 3) / 12;
  return load * load * std::pow(length, 5) / (40 * material.young * inertia) +
         load * load * std::pow(length, 3) / (6 * shear_stiffness(*this));
}

// K = sqrt(12) P (a + 0.673 h) / h^1.5, energy release K^2 / E', and d(compliance)/da is twice
// that over P^2.
double DoubleCantilever::opening() const {
  constexpr double kReach = 0.673;  // heights by which an arm is longer than the slit
  const double young = material.young / (1 - material.poisson * material.poisson);
  return 8 * force * std::pow(length / height + kReach, 3) / young;
}

// Polar coordinates with r = radius sin(t): the opening is then smooth at the rim. Midpoints around
// converge faster than any power; Gauss points of order 8 outwards.
PennyCrack::PennyCrack(const Vec3d& normal, double radius, double pressure, const Elastic& material)
    : normal_(normal), radius_(radius), pressure_(pressure), material_(material) {
  constexpr int kAround = 24;
  constexpr double kAt[] = {0.1834346424956498, 0.5255324099163290, 0.7966664774136267,
                            0.9602898564975363};
  constexpr double kWeight[] = {0.3626837833783620, 0.3137066458778873, 0.2223810344533745,
                                0.1012285362903763};
  const Vec3d u = any_across(normal), v = cross(normal, u);
  for (int i = 0; i < 8; ++i) {
    const double t = 0.25 * kPi * (1 + (i % 2 == 0 ? 1 : -1) * kAt[i / 2]);
    const double r = radius * std::sin(t);
    const double ring = 0.25 * kPi * kWeight[i / 2] * r * radius * std::cos(t) * 2 * kPi;
    for (int k = 0; k < kAround; ++k) {
      const double angle = 2 * kPi * (k + 0.5) / kAround;
      spots_.push_back(
          {r * (std::cos(angle) * u + std::sin(angle) * v), opening(r) * ring / kAround});
    }
  }
}

double PennyCrack::opening(double r) const {
  const double nu = material_.poisson, part = 1 - r * r / (radius_ * radius_);
  return part <= 0
             ? 0
             : 8 * (1 - nu * nu) * pressure_ * radius_ / (kPi * material_.young) * std::sqrt(part);
}

double PennyCrack::volume() const {
  const double nu = material_.poisson;
  return 16 * (1 - nu * nu) * pressure_ * std::pow(radius_, 3) / (3 * material_.young);
}

double PennyCrack::energy() const { return 0.5 * pressure_ * volume(); }

// A small part that opens by the volume V along n moves a point at distance d in direction e by
// V / (8 pi (1 - nu) d^2) ((1 - 2 nu) (2 (n e) n - e) + 3 (n e)^2 e): the stress along n that a
// unit force there would cause at the part.
Vec3d PennyCrack::displacement(const Vec3d& p) const {
  const double nu = material_.poisson;
  Vec3d out{};
  for (const Spot& spot : spots_) {
    const Vec3d arm = p - spot.at;
    const double d = norm(arm);
    const Vec3d e = (1 / d) * arm;
    const double along = dot(normal_, e);
    out += spot.volume / (8 * kPi * (1 - nu) * d * d) *
           ((1 - 2 * nu) * (2 * along * normal_ - e) + 3 * along * along * e);
  }
  return out;
}

}  // namespace kerf::cutting
