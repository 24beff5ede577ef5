// SPDX-License-Identifier: MIT
#include "cpu/near_patches.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "cpu/patch_draft.hpp"

namespace kerf::cpu {
namespace {

/// x, y, z, and nothing.
typedef double Place __attribute__((vector_size(32)));

/// As Box3, three sides at a time. What is not a number is left out.
class PlaceBox {
 public:
  void add(const Place& p) {
    lo_ = p < lo_ ? p : lo_;
    hi_ = p > hi_ ? p : hi_;
  }
  Box3 box() const { return {{lo_[0], lo_[1], lo_[2]}, {hi_[0], hi_[1], hi_[2]}}; }

 private:
  static constexpr double kFar = std::numeric_limits<double>::infinity();
  Place lo_{kFar, kFar, kFar, kFar}, hi_{-kFar, -kFar, -kFar, -kFar};
};

class NearPatches {
 public:
  NearPatches(const PatchedLevel& level, double spacing, std::span<const double> displacement,
              const BladeReach& reach)
      : level_(level), spacing_(spacing), displacement_(displacement), reach_(reach) {}

  /// `at`: room for the places of the points.
  void look(const Patch& patch, std::vector<Place>& at, NearCells& out) const {
    at.resize(static_cast<std::size_t>(patch.points));
    Place sum{};  // finite as long as all are
    PlaceBox bounds;
    const auto add = [&](std::int32_t packed, std::uint16_t point) {
      const Place p = position(packed);
      bounds.add(p);
      sum += 0 * p;
      at[point] = p;
    };
    for (std::int32_t v = patch.own.first; v < patch.own.end(); ++v) {
      prefetch_place(std::min(v + kAhead, patch.own.end() - 1));
      if (level_.vertex[v] >= 0) add(v, level_.own_point[v]);
    }
    for (std::int32_t k = patch.copies.first; k < patch.copies.end(); ++k)
      add(level_.copy_vertex[k], level_.copy_point[k]);
    out.finite = std::isfinite(sum[0] + sum[1] + sum[2]);
    out.bounds = bounds.box();
    if (!reach_.may_meet(out.bounds, false)) return;
    for (std::int32_t g = patch.groups.first; g < patch.groups.end(); ++g)
      look_at_group(static_cast<std::size_t>(g), at, out);
  }

  bool meets_opened(std::int32_t cell) const {
    Vec3d at[8];
    for (std::size_t i = 0; i < 8; ++i) {
      const Place p = position(level_.packed[level_.level->slots[cell][i]]);
      at[i] = {p[0], p[1], p[2]};
    }
    return may_meet_opened(at, reach_);
  }

 private:
  static constexpr std::int32_t kAhead = 32;

  /// Vertices of a patch are numbered anew, and their places lie anywhere.
  void prefetch_place(std::int32_t packed) const {
    const std::int32_t vertex = level_.vertex[packed];
    if (vertex >= 0) prefetch(level_.level->point.data(), static_cast<std::size_t>(vertex), 1);
  }
  Place position(std::int32_t packed) const {
    const double* u = displacement_.data() + scalar_of(packed);
    const Vec3i& x = level_.level->point[level_.vertex[packed]];
    return Place{x[0] * spacing_ + u[0], x[1] * spacing_ + u[kGroup],
                 x[2] * spacing_ + u[2 * kGroup], 0};
  }

  void look_at_group(std::size_t g, const std::vector<Place>& at, NearCells& out) const {
    const std::uint16_t* slots =
        level_.folded(g) ? level_.slots.data() + 8 * kGroup * std::size_t(level_.slots_at[g])
                         : level_.corners.data() + 8 * kGroup * g;
    // In a row the right end of a cell is the left one of the next.
    const auto row = static_cast<RowKind>(level_.row[g]);
    const auto run = static_cast<std::size_t>(level_.folded(g) ? 1 : run_of(row));
    PlaceBox all;
    for (std::size_t i = 0; i < 8; ++i) {
      const std::size_t step = i % 2 == 0 ? 1 : run;
      for (std::size_t k = step - 1; k < kGroup; k += step)
        if (const std::uint16_t point = slots[kGroup * i + k]; point != kNothing)
          all.add(at[point]);
    }
    if (!reach_.may_meet(all.box(), false)) return;
    for (std::size_t k = 0; k < kGroup; ++k) {
      const std::int32_t c = level_.cell[kGroup * g + k];
      if (c < 0) continue;
      PlaceBox box;
      for (std::size_t i = 0; i < 8; ++i) box.add(at[slots[kGroup * i + k]]);
      if (reach_.may_meet(box.box(), false)) out.cells.push_back(c);
    }
  }

  const PatchedLevel& level_;
  double spacing_;
  std::span<const double> displacement_;
  const BladeReach& reach_;
};

}  // namespace

NearCells find_near(const PatchedLevel& level, double spacing, std::span<const double> displacement,
                    const BladeReach& reach, std::span<const std::int32_t> opened, int threads) {
  const NearPatches near(level, spacing, displacement, reach);
  std::vector<NearCells> parts(level.patches.size());
  for_patches(
      0, static_cast<std::int32_t>(parts.size()), threads,
      [] { return std::make_unique<std::vector<Place>>(); },
      [&](std::int32_t p, std::vector<Place>& at) { near.look(level.patches[p], at, parts[p]); });
  NearCells out;
  for (const NearCells& part : parts) {
    out.bounds.add(part.bounds);
    out.finite = out.finite && part.finite;
    out.cells.insert(out.cells.end(), part.cells.begin(), part.cells.end());
  }
  std::vector<std::int32_t> met;
  for (const std::int32_t c : opened)
    if (near.meets_opened(c)) met.push_back(c);
  add_opened(met, out);
  return out;
}

}  // namespace kerf::cpu
