// SPDX-License-Identifier: MIT
//
// The same cuts in different orders.
#include <algorithm>
#include <cmath>

#include "bench/cutting/blades.hpp"
#include "bench/cutting/scenes.hpp"
#include "scenes/comb.hpp"

namespace kerf::cutting {
namespace {

struct Answer {
  double deflection = 0, energy = 0;
};

/// Mean displacement of the upper part of a cube under its weight across.
Answer deflection(const Shape& shape, Method method, int threads, Record& out) {
  StaticProblem problem(shape, method, threads, [](const Vec3d& p) {
    return Hold{static_cast<std::uint8_t>(p.y < kBeside ? 7 : 0), {}};
  });
  problem.solve(problem.force_of({Gravity{{1, 0, 0.5}}}));
  double sum = 0;
  int count = 0;
  for (std::int32_t v = 0; v < problem.level().vertices(); ++v) {
    if (problem.place(v).y < 1 - kBeside) continue;
    sum += problem.displacement(v).x;
    ++count;
  }
  out.cost.add(problem.cost());
  out.h = problem.body().hierarchy.spacing;
  return {sum / count, problem.energy()};
}

/// Two blades each in two oblique directions, as in [DGW11] section 8.2, down to the middle of the
/// cube; one beside the first, nearer than a cell of the smaller sizes; and one that is tilted and
/// crosses them. That is smaller than a rod between them, so that nothing comes off.
std::vector<TriangleMesh> blades() {
  constexpr double kTurn = 0.5, kDepth = 0.5, kBesideFirst = 0.04;
  std::vector<TriangleMesh> out = scenes::comb(1, 2, kDepth, kTurn);
  TriangleMesh second = out[0];
  for (Vec3d& p : second.points) p += kBesideFirst * Vec3d{std::cos(kTurn), 0, std::sin(kTurn)};
  out.push_back(second);
  out.push_back(plane_blade({0.65, 0.65, 0.55}, {0.6, 0.8, 0}, 0.12));
  return out;
}

}  // namespace

// The first answer stands for the exact one: there is no closed form, and none is needed to tell
// whether two answers are the same.
Record cut_orders(Method method, int size, int threads) {
  const std::vector<TriangleMesh> forward = blades();
  std::vector<TriangleMesh> backward(forward.rbegin(), forward.rend());
  std::vector<TriangleMesh> mixed = forward;
  std::rotate(mixed.begin(), mixed.begin() + 2, mixed.end());
  std::vector<TriangleMesh> twice = backward;
  twice.insert(twice.end(), forward.begin(), forward.end());
  const std::pair<const char*, const std::vector<TriangleMesh>*> all[] = {
      {"forward", &forward}, {"backward", &backward}, {"mixed", &mixed}, {"twice", &twice}};

  Record out;
  for (const auto& [name, order] : all) {
    const Answer answer =
        deflection({{{0, 0, 0}, {1, 1, 1}}, size, kMaterial, *order}, method, threads, out);
    out.parts.push_back({name, answer.deflection});
    if (out.parts.size() == 1) {
      out.energy = out.energy_exact = answer.energy;
      out.value = out.exact = answer.deflection;
      out.error = out.energy_error = 0;
    }
    out.error = std::max(out.error, std::abs(answer.deflection / out.exact - 1));
    out.energy_error = std::max(out.energy_error, std::abs(answer.energy / out.energy_exact - 1));
  }
  out.set_spread();
  return out;
}

}  // namespace kerf::cutting
