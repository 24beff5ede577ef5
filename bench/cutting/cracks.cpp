// SPDX-License-Identifier: MIT
//
// Scenes with cracks: cuts that end inside the body.
#include <cmath>
#include <numbers>

#include "bench/cutting/blades.hpp"
#include "bench/cutting/exact.hpp"
#include "bench/cutting/scenes.hpp"
#include "core/base/error.hpp"

namespace kerf::cutting {
namespace {

constexpr double kRadius = 1, kPressure = 1;

/// A round crack in the middle of a box that is twice as wide in every direction. The exact
/// displacement is prescribed on the box, so that no infinite body is needed. Planes of symmetry
/// through the middle halve the box.
struct CrackBody {
  double tilt = 0;  // of the normal, from z towards x, rad
  bool quarter = false;

  Vec3d normal() const { return {std::sin(tilt), 0, std::cos(tilt)}; }
  double part() const { return quarter ? 0.25 : 0.5; }
  Shape shape(int size) const {
    constexpr double kBox = 2 * kRadius;
    return {{{quarter ? 0 : -kBox, 0, -kBox}, {kBox, kBox, kBox}},
            4 * size,
            kMaterial,
            {disk_blade(kBeside * normal(), normal(), kRadius)}};
  }
};

Holder hold_box(const CrackBody& body, const Box3& box, const PennyCrack& exact) {
  return [&body, box, &exact](const Vec3d& p) {
    const auto at = [](double a, double b) { return std::abs(a - b) < kBeside; };
    const bool outside = at(p.x, box.hi.x) || at(p.y, box.hi.y) || at(p.z, box.hi.z) ||
                         at(p.z, box.lo.z) || (!body.quarter && at(p.x, box.lo.x));
    if (outside) return Hold{7, exact.displacement(p)};
    int fixed = at(p.y, 0) ? 2 : 0;
    if (body.quarter && at(p.x, 0)) fixed |= 1;
    return Hold{static_cast<std::uint8_t>(fixed), {}};
  };
}

/// Pressure on both sides of a cut, as equal shares of each face for its four vertices.
std::vector<double> pressure_on(const StaticProblem& problem, double pressure) {
  std::vector<double> out(3 * problem.level().point.size(), 0.0);
  for (const CutFace& face : cut_faces(problem.body()))
    for (const std::int32_t v : face.vertices)
      for (int d = 0; d < 3; ++d)
        out[3 * static_cast<std::size_t>(v) + static_cast<std::size_t>(d)] -=
            0.25 * pressure * face.area * face.normal[d];
  return out;
}

/// Of the displacement along the normal at the vertices of the sides of the crack.
double opening_error(const StaticProblem& problem, const Vec3d& normal, const PennyCrack& exact) {
  double error2 = 0, exact2 = 0;
  for (const CutFace& face : cut_faces(problem.body())) {
    const double along = dot(face.normal, normal);
    if (along == 0) continue;  // the side of a step says nothing about its half
    for (const std::int32_t v : face.vertices) {
      const Vec3d p = problem.place(v);
      const Vec3d in_plane = p - dot(p, normal) * normal;
      const double half = 0.5 * exact.opening(norm(in_plane));
      const double found = (along < 0 ? 1 : -1) * dot(problem.displacement(v), normal);
      error2 += std::abs(along) * (found - half) * (found - half);
      exact2 += std::abs(along) * half * half;
    }
  }
  return std::sqrt(error2 / exact2);
}

/// Of the crack, as the cut made it: of its two sides, seen along the normal.
double cut_area(const StaticProblem& problem, const Vec3d& normal) {
  double out = 0;
  for (const CutFace& face : cut_faces(problem.body()))
    out += 0.5 * std::abs(dot(face.normal, normal)) * face.area;
  return out;
}

struct CrackResult {
  double volume = 0, area = 0;  // of the whole crack, m^3, m^2
  double opening_error = 0, work = 0, h = 0;
  Cost cost;
};

CrackResult open_crack(const CrackBody& body, Method method, int size, int threads) {
  const PennyCrack exact(body.normal(), kRadius, kPressure, kMaterial);
  const Shape shape = body.shape(size);
  StaticProblem problem(shape, method, threads, hold_box(body, shape.box, exact));
  problem.solve(pressure_on(problem, kPressure));
  CrackResult out;
  out.work = problem.half_work() / body.part();
  out.volume = 2 * out.work / kPressure;
  out.area = cut_area(problem, body.normal()) / body.part();
  out.opening_error = opening_error(problem, body.normal(), exact);
  out.cost = problem.cost();
  out.h = problem.body().hierarchy.spacing;
  return out;
}

}  // namespace

Record penny_crack(Method method, int size, int threads) {
  const CrackBody body{0, true};
  const CrackResult found = open_crack(body, method, size, threads);
  const PennyCrack exact(body.normal(), kRadius, kPressure, kMaterial);
  Record out;
  out.value = found.volume;
  out.exact = exact.volume();
  out.parts = {{"volume", out.value, out.exact},
               {"area", found.area, std::numbers::pi * kRadius * kRadius}};
  out.error = found.opening_error;
  out.set_energy(found.work, exact.energy());
  out.cost = found.cost;
  out.h = found.h;
  return out;
}

Record tilted_crack(Method method, int size, int threads) {
  constexpr int kStep = 15, kLast = 90;  // degrees
  constexpr int kAngles = kLast / kStep + 1;
  Record out;
  double error2 = 0, energy = 0, exact_energy = 0;
  for (int angle = 0; angle <= kLast; angle += kStep) {
    const CrackBody body{angle * std::numbers::pi / 180, false};
    const CrackResult found = open_crack(body, method, size, threads);
    const PennyCrack exact(body.normal(), kRadius, kPressure, kMaterial);
    out.parts.push_back({text(angle, " degrees"), found.volume, exact.volume()});
    out.value += found.volume / kAngles;
    out.exact = exact.volume();
    error2 += found.opening_error * found.opening_error / kAngles;
    energy += found.work / kAngles;
    exact_energy = exact.energy();
    out.cost.add(found.cost);
    out.h = found.h;
  }
  out.error = std::sqrt(error2);
  out.set_energy(energy, exact_energy);
  out.set_spread();
  return out;
}

// Rollers hold both broad sides, the far end is clamped.
Record double_cantilever(Method method, int size, int threads) {
  constexpr double kLength = 10, kSlit = 6, kHeight = 1, kThickness = 1, kForce = 1;
  constexpr double kLoaded = 0.25 * kHeight;  // the part of an arm that the force is spread over
  const Shape shape{
      {{0, -kHeight, 0}, {kLength, kHeight, kThickness}},
      static_cast<int>(kLength) * size,
      kMaterial,
      {{{{-1, kBeside, -1}, {kSlit, kBeside, -1}, {kSlit, kBeside, 2}, {-1, kBeside, 2}},
        {{0, 1, 2}, {0, 2, 3}}}}};
  StaticProblem problem(shape, method, threads, [&](const Vec3d& p) {
    if (p.x > kLength - kBeside) return Hold{7, {}};
    const bool side = p.z < kBeside || p.z > kThickness - kBeside;
    return Hold{static_cast<std::uint8_t>(side ? 4 : 0), {}};
  });
  constexpr double kFar = 100;
  problem.solve(problem.force_of(
      {BoxForce{{{-kFar, 2 * kBeside, -kFar}, {kLoaded, kFar, kFar}}, {0, kForce, 0}},
       BoxForce{{{-kFar, -kFar, -kFar}, {kLoaded, 0, kFar}}, {0, -kForce, 0}}}));

  const DoubleCantilever exact{kSlit - 0.5 * kLoaded, kHeight, kForce / kThickness, kMaterial};
  Record out;
  out.value = 2 * problem.half_work() / kForce;  // the mean opening where the force is
  out.exact = exact.opening();
  out.error = std::abs(out.value - out.exact) / out.exact;
  out.set_energy(problem.energy(), 0.5 * kForce * exact.opening());
  out.cost = problem.cost();
  out.h = problem.body().hierarchy.spacing;
  return out;
}

}  // namespace kerf::cutting
