// SPDX-License-Identifier: MIT
//
// Scenes whose pieces are bars and beams.
#include <array>
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
  out.value = out.parts[0].value + out.parts[1].value;  // both move along x
  out.exact = out.parts[0].exact + out.parts[1].exact;
  out.error = std::sqrt(error2 / exact2);
  out.set_energy(problem.energy(), bar.halves[0].energy() + bar.halves[1].energy());
  // One half may gain what the other loses.
  out.energy_error = off / out.energy_exact;
  out.cost = problem.cost();
  out.h = problem.body().hierarchy.spacing;
  return out;
}

// A block that is cut into 3 x 3 rods along x. It is held at x = 0, and its weight pulls along y.
// `beside`: the cuts lie so far beyond y, z = 1, 2, m.
class RodBlock {
 public:
  static constexpr int kRods = 3;
  static constexpr double kLength = 8;

  explicit RodBlock(double beside) : planes_{0, 1 + beside, 2 + beside, kRods} {}

  Shape shape(int size) const {
    Shape out{
        {{0, 0, 0}, {kLength, kRods, kRods}}, static_cast<int>(kLength) * size, kMaterial, {}};
    for (std::size_t i = 1; i < kRods; ++i) {
      const double at = planes_[i] + kBeside;
      out.blades.push_back(plane_blade({0.5 * kLength, at, 0.5 * kRods}, {0, 1, 0}, 2 * kLength));
      out.blades.push_back(plane_blade({0.5 * kLength, 0.5 * kRods, at}, {0, 0, 1}, 2 * kLength));
    }
    return out;
  }
  Beam beam(std::size_t rod) const {
    return {kLength, width(rod % kRods), width(rod / kRods), 1, kMaterial};
  }
  /// The rod whose middle is nearest to a place.
  std::size_t rod_at(double y, double z) const { return nearest(y) + kRods * nearest(z); }

 private:
  double width(std::size_t i) const { return planes_[i + 1] - planes_[i]; }
  std::size_t nearest(double at) const {
    std::size_t out = 0;
    const auto off = [&](std::size_t i) {
      return std::abs(at - 0.5 * (planes_[i] + planes_[i + 1]));
    };
    for (std::size_t i = 1; i < kRods; ++i)
      if (off(i) < off(out)) out = i;
    return out;
  }

  std::array<double, kRods + 1> planes_;
};

/// Mean place in the section, and mean deflection, of the tip of each piece.
struct Tip {
  double y = 0, z = 0, deflection = 0;
  int vertices = 0;
};

std::vector<Tip> tips(const StaticProblem& problem) {
  std::vector<Tip> out(problem.pieces());
  for (std::int32_t v = 0; v < problem.level().vertices(); ++v) {
    const Vec3d p = problem.place(v);
    if (p.x < RodBlock::kLength - kBeside) continue;
    Tip& tip = out[static_cast<std::size_t>(problem.piece_of(v))];
    tip.y += p.y;
    tip.z += p.z;
    tip.deflection += problem.displacement(v).y;
    ++tip.vertices;
  }
  for (Tip& tip : out)
    for (double* sum : {&tip.y, &tip.z, &tip.deflection}) *sum /= tip.vertices;
  return out;
}

Record cut_into_rods(Method method, int size, int threads, double beside) {
  const RodBlock block(beside);
  StaticProblem problem(block.shape(size), method, threads, [](const Vec3d& p) {
    return Hold{static_cast<std::uint8_t>(p.x < kBeside ? 7 : 0), {}};
  });
  problem.solve(problem.force_of({Gravity{{0, 1, 0}}}));

  const std::vector<Tip> found = tips(problem);
  const std::vector<double> energies = problem.energy_by_piece();
  Record out;
  out.exact = 0;
  double error2 = 0, energy_off = 0, energy_exact = 0;
  for (std::size_t piece = 0; piece < problem.pieces(); ++piece) {
    const std::size_t rod = block.rod_at(found[piece].y, found[piece].z);
    const Beam beam = block.beam(rod);
    out.parts.push_back({text("rod ", rod + 1), found[piece].deflection, beam.tip()});
    const double part = 1.0 / static_cast<double>(problem.pieces());
    out.value += part * found[piece].deflection;
    out.exact += part * beam.tip();
    error2 += part * std::pow(found[piece].deflection / beam.tip() - 1, 2);
    energy_off += std::abs(energies[piece] - beam.energy());
    energy_exact += beam.energy();
  }
  out.error = std::sqrt(error2);
  out.set_energy(problem.energy(), energy_exact);
  out.energy_error = energy_off / energy_exact;  // one rod may gain what another loses
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

Record rods_on_grid(Method method, int size, int threads) {
  return cut_into_rods(method, size, threads, 0);
}

// At a third of a cell, for every size that is a power of two.
Record rods_between(Method method, int size, int threads) {
  return cut_into_rods(method, size, threads, 1.0 / 6);
}

}  // namespace kerf::cutting
