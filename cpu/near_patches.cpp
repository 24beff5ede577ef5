// SPDX-License-Identifier: MIT
#include "cpu/near_patches.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <memory>
#include <type_traits>
#include <vector>

#include "cpu/patch_draft.hpp"

namespace kerf::cpu {
namespace {

/// x, y, z, and nothing.
typedef double Place __attribute__((vector_size(32)));
/// The same, rounded: half as much of a patch to keep in the cache.
typedef float RoundedPlace __attribute__((vector_size(16)));
typedef float FourPlaces __attribute__((vector_size(64)));

/// As Box3, three sides at a time. What is not a number is left out.
template <class P>
class PlaceBox {
 public:
  void add(const P& p) { add(p, p); }
  void add(const P& lo, const P& hi) {
    lo_ = lo < lo_ ? lo : lo_;
    hi_ = hi > hi_ ? hi : hi_;
  }
  void add(const PlaceBox& other) { add(other.lo_, other.hi_); }
  Box3 box() const { return {{lo_[0], lo_[1], lo_[2]}, {hi_[0], hi_[1], hi_[2]}}; }
  /// Of vectors of four places each.
  PlaceBox<RoundedPlace> of_all() const {
    RoundedPlace lo[4], hi[4];
    __builtin_memcpy(&lo, &lo_, sizeof lo);
    __builtin_memcpy(&hi, &hi_, sizeof hi);
    PlaceBox<RoundedPlace> out;
    for (int n = 0; n < 4; ++n) out.add(lo[n], hi[n]);
    return out;
  }

 private:
  using S = std::decay_t<decltype(P{}[0])>;
  P lo_ = P{} + std::numeric_limits<S>::infinity(), hi_ = -lo_;
};

/// A box around what was rounded to get it.
Box3 before_rounding(const PlaceBox<RoundedPlace>& rounded) {
  using Float = std::numeric_limits<float>;
  constexpr double kRounding = Float::epsilon(), kLeast = Float::min();
  Box3 box = rounded.box();
  for (int d = 0; d < 3; ++d) {
    const double by = kRounding * std::max(std::abs(box.lo[d]), std::abs(box.hi[d])) + kLeast;
    box.lo[d] -= by;
    box.hi[d] += by;
  }
  return box;
}

class NearPatches {
 public:
  NearPatches(const PatchedLevel& level, double spacing, std::span<const double> displacement,
              const BladeReach& reach)
      : level_(level), spacing_(spacing), displacement_(displacement), reach_(reach) {}

  /// `at`: room for the places of the points.
  void look(const Patch& patch, std::vector<RoundedPlace>& at, NearCells& out) const {
    constexpr float kNowhere = std::numeric_limits<float>::quiet_NaN();
    at.resize(static_cast<std::size_t>(patch.points));
    Place sum{};  // finite as long as all are
    PlaceBox<Place> bounds;
    const auto add = [&](std::int32_t packed, std::uint16_t point) {
      const Place p = position(packed);
      bounds.add(p);
      sum += 0 * p;
      at[point] = __builtin_convertvector(p, RoundedPlace);
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
    if (!fits_single(out.bounds)) return add_all(patch, out);
    std::fill_n(at.begin() + kNothing, kNothings, RoundedPlace{kNowhere, kNowhere, kNowhere, 0});
    const auto end = static_cast<std::size_t>(patch.groups.end());
    for (auto g = static_cast<std::size_t>(patch.groups.first); g < end; g += kTogether)
      look_at_groups(g, std::min(kTogether, end - g), at.data(), out);
  }

  bool meets_opened(std::int32_t cell) const {
    Vec3d at[8];
    for (std::size_t i = 0; i < 8; ++i) {
      const Place p = slot(cell, i);
      at[i] = {p[0], p[1], p[2]};
    }
    return may_meet_opened(at, reach_);
  }

 private:
  static constexpr std::int32_t kAhead = 32;
  static constexpr std::size_t kTogether = 8;

  static bool fits_single(const Box3& box) {
    constexpr double kMost = std::numeric_limits<float>::max();
    return std::max({std::abs(box.lo.x), std::abs(box.lo.y), std::abs(box.lo.z), std::abs(box.hi.x),
                     std::abs(box.hi.y), std::abs(box.hi.z)}) < kMost / 4;
  }
  void add_all(const Patch& patch, NearCells& out) const {
    std::copy_if(level_.cell.begin() + kGroup * patch.groups.first,
                 level_.cell.begin() + kGroup * patch.groups.end(), std::back_inserter(out.cells),
                 [](std::int32_t c) { return c >= 0; });
  }

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

  Place slot(std::int32_t cell, std::size_t i) const {
    return position(level_.packed[level_.level->slots[cell][i]]);
  }

  const std::uint16_t* slots_of(std::size_t g) const {
    return level_.folded(g) ? level_.slots.data() + 8 * kGroup * std::size_t(level_.slots_at[g])
                            : level_.corners_of(g);
  }
  /// Of the points of the slots of a group.
  PlaceBox<RoundedPlace> box_of(std::size_t g, const RoundedPlace* at) const {
    const int run = level_.folded(g) ? 1 : run_of(static_cast<RowKind>(level_.row[g]));
    if (run == kGroup) return box_of_rows<kGroup>(level_.heads.data() + kHeads * g, at);
    if (run == kGroup / 2) return box_of_rows<kGroup / 2>(level_.heads.data() + kHeads * g, at);
    if (run == kGroup / 4) return box_of_rows<kGroup / 4>(level_.heads.data() + kHeads * g, at);
    const std::uint16_t* const slots = slots_of(g);
    PlaceBox<RoundedPlace> box;
    for (std::size_t n = 0; n < 8 * kGroup; ++n) box.add(at[slots[n]]);
    return box;
  }
  /// In a row the points of each edge follow their first one.
  template <int run>
  static PlaceBox<RoundedPlace> box_of_rows(const std::uint16_t* heads, const RoundedPlace* at) {
    PlaceBox<FourPlaces> box;
    for (int edge = 0; edge < 4; ++edge)
      for (int k = 0; k < kGroup; k += run) {
        const RoundedPlace* const first = at + heads[4 * edge + k / (kGroup / 4)];
        FourPlaces four;
        for (int n = 0; n < run; n += 4) {
          __builtin_memcpy(&four, first + n, sizeof four);
          box.add(four);
        }
        __builtin_memcpy(&four, first + run - 3, sizeof four);  // the last one
        box.add(four);
      }
    return box.of_all();
  }

  /// Several groups that follow each other, and so mostly lie together, from `first` on.
  void look_at_groups(std::size_t first, std::size_t count, const RoundedPlace* at,
                      NearCells& out) const {
    PlaceBox<RoundedPlace> all, of[kTogether];
    for (std::size_t n = 0; n < count; ++n) all.add(of[n] = box_of(first + n, at));
    if (!reach_.may_meet(before_rounding(all), false)) return;
    for (std::size_t n = 0; n < count; ++n)
      if (reach_.may_meet(before_rounding(of[n]), false)) look_at_cells(first + n, at, out);
  }

  void look_at_cells(std::size_t g, const RoundedPlace* at, NearCells& out) const {
    const std::uint16_t* const slots = slots_of(g);
    for (std::size_t k = 0; k < kGroup; ++k) {
      const std::int32_t c = level_.cell[kGroup * g + k];
      if (c < 0) continue;
      PlaceBox<RoundedPlace> rounded;
      for (std::size_t i = 0; i < 8; ++i) rounded.add(at[slots[kGroup * i + k]]);
      if (reach_.may_meet(before_rounding(rounded), false)) out.cells.push_back(c);
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
  for_parts(
      0, static_cast<std::int32_t>(parts.size()), threads,
      [] { return std::make_unique<std::vector<RoundedPlace>>(); },
      [&](std::int32_t p, std::vector<RoundedPlace>& at) {
        near.look(level.patches[p], at, parts[p]);
      });
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
