// SPDX-License-Identifier: MIT
//
// Scenes whose pieces are bars and beams.
#include <cmath>

#include "bench/cutting/blades.hpp"
#include "bench/cutting/exact.hpp"
#include "bench/cutting/scenes.hpp"
#include "core/base/error.hpp"

namespace kerf::cutting {
namespace {

// A bar along x, cut across. Its weight pulls towards +x: one half hangs from its end, the other
// stands on its own.
constexpr double kBarLength = 4;
constexpr Elastic kMaterial{1000, 0.3, 1};

struct CutBar {
  HangingBar halves[2];

  explicit CutBar(double cut)
      : halves{{cut, 1, 1, kMaterial}, {kBarLength - cut, 1, -1, kMaterial}} {}
  Vec3d displacement(int half, const Vec3d& p) const {
    const Vec3d u =
        halves[half].displacement(half == 0 ? p.x : kBarLength - p.x, p.y - 0.5, p.z - 0.5);
    return {half == 0 ? u.x : -u.x, u.y, u.z};
  }
};

/// Mean displacements of the free face of a half, and errors of all its vertices.
struct HalfResult {
  double found = 0, exact = 0;  // along x, at the free face
  double error2 = 0, exact2 = 0;
};

HalfResult measure_half(const StaticProblem& problem, const CutBar& bar, double cut, int half,
                        std::int32_t piece) {
  double end = half == 0 ? 0 : kBarLength;  // where the piece ends, by its vertices
  const auto further = [&](double x) { return half == 0 ? x > end : x < end; };
  for (std::int32_t v = 0; v < problem.level().vertices(); ++v)
    if (problem.piece_of(v) == piece && further(problem.place(v).x)) end = problem.place(v).x;
  HalfResult out;
  int count = 0;
  for (std::int32_t v = 0; v < problem.level().vertices(); ++v) {
    if (problem.piece_of(v) != piece) continue;
    const Vec3d p = problem.place(v), u = problem.displacement(v);
    const Vec3d exact = bar.displacement(half, p), off = u - exact;
    out.error2 += dot(off, off);
    out.exact2 += dot(exact, exact);
    if (p.x != end) continue;
    ++count;
    out.found += u.x;
    out.exact += bar.displacement(half, {cut, p.y, p.z}).x;
  }
  out.found /= count;
  out.exact /= count;
  return out;
}

Record cut_bar(Method method, int size, int threads, double cut) {
  const Shape shape{{{0, 0, 0}, {kBarLength, 1, 1}},
                    static_cast<int>(kBarLength) * size,
                    kMaterial,
                    {plane_blade({cut + kBeside, 0.5, 0.5}, {1, 0, 0}, 2)}};
  const CutBar bar(cut);
  StaticProblem problem(shape, method, threads, [&](const Vec3d& p) {
    const bool low = p.x<kBeside, high = p.x> kBarLength - kBeside;
    return low || high ? Hold{7, bar.displacement(low ? 0 : 1, p)} : Hold{};
  });
  problem.solve(problem.force_of({Gravity{{1, 0, 0}}}));

  Record out;
  const std::vector<double> energies = problem.energy_by_piece();
  double error2 = 0, exact2 = 0, off = 0;
  for (int half = 0; half < 2; ++half) {
    std::int32_t piece = -1;  // that is held at this end
    for (std::int32_t v = 0; v < problem.level().vertices(); ++v)
      if (std::abs(problem.place(v).x - half * kBarLength) < kBeside) piece = problem.piece_of(v);
    const HalfResult result = measure_half(problem, bar, cut, half, piece);
    out.parts.push_back({half == 0 ? "hanging" : "standing", result.found, result.exact});
    off += std::abs(energies[static_cast<std::size_t>(piece)] - bar.halves[half].energy());
    error2 += result.error2;
    exact2 += result.exact2;
  }
  out.value = out.parts[0].value - out.parts[1].value;
  out.exact = out.parts[0].exact - out.parts[1].exact;
  out.error = std::sqrt(error2 / exact2);
  out.set_energy(problem.energy(), bar.halves[0].energy() + bar.halves[1].energy());
  // One half may gain what the other loses.
  out.energy_error = off / out.energy_exact;
  out.cost = problem.cost();
  out.h = problem.body().hierarchy.spacing;
  return out;
}

}  // namespace

Record bar_on_grid(Method method, int size, int threads) {
  return cut_bar(method, size, threads, 0.5 * kBarLength);
}

// At a third of a cell, for every size that is a power of two.
Record bar_between(Method method, int size, int threads) {
  return cut_bar(method, size, threads, 0.5 * kBarLength + 1.0 / 12);
}

// The block is held at x = 0 and its weight pulls along y.
Record rods(Method method, int size, int threads) {
  constexpr int kRods = 3;
  constexpr double kLength = 8;  // rods are 1 x 1 across
  Shape shape{
      {{0, 0, 0}, {kLength, kRods, kRods}}, static_cast<int>(kLength) * size, kMaterial, {}};
  for (int i = 1; i < kRods; ++i) {
    shape.blades.push_back(
        plane_blade({0.5 * kLength, i + kBeside, 0.5 * kRods}, {0, 1, 0}, 2 * kLength));
    shape.blades.push_back(
        plane_blade({0.5 * kLength, 0.5 * kRods, i + kBeside}, {0, 0, 1}, 2 * kLength));
  }
  StaticProblem problem(shape, method, threads, [](const Vec3d& p) {
    return Hold{p.x < kBeside ? std::uint8_t{7} : std::uint8_t{0}, {}};
  });
  problem.solve(problem.force_of({Gravity{{0, 1, 0}}}));

  const SquareBeam beam{kLength, 1, 1, kMaterial};
  Record out;
  std::vector<double> sum(problem.pieces()), count(problem.pieces());
  for (std::int32_t v = 0; v < problem.level().vertices(); ++v) {
    if (problem.place(v).x < kLength - kBeside) continue;
    const auto piece = static_cast<std::size_t>(problem.piece_of(v));
    sum[piece] += problem.displacement(v).y;
    ++count[piece];
  }
  for (std::size_t piece = 0; piece < problem.pieces(); ++piece) {
    out.parts.push_back({text("rod ", piece + 1), sum[piece] / count[piece], beam.tip()});
    out.value += out.parts.back().value / static_cast<double>(problem.pieces());
  }
  out.exact = beam.tip();
  out.error = std::abs(out.value - out.exact) / out.exact;
  out.set_energy(problem.energy(), kRods * kRods * beam.energy());
  out.set_spread();
  out.cost = problem.cost();
  out.h = problem.body().hierarchy.spacing;
  return out;
}

}  // namespace kerf::cutting
