// SPDX-License-Identifier: MIT
//
// What a blade may meet: where vertices are, and marks on cells. As near_cells in
// core/levels/corners.hpp and BladeReach in core/body/cut.hpp, with the same roundings.
#pragma once

#include <limits>

#include "gpu/level_view.hpp"

namespace kerf::gpu {

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A box and, of the neighbourhood of a triangle, the plane in it.
struct BladeSlab {
  Vec3<double> lo, hi, normal, point;
};

struct ReachView {
  Vec3<double> lo, hi;
  double margin;
  std::int32_t slabs;
  const BladeSlab* slab;
  double beyond;  ///< how far links that were cut may reach, in extents of their cell

  static KERF_HD bool overlap(const Vec3<double>& lo, const Vec3<double>& hi,
                              const Vec3<double>& other_lo, const Vec3<double>& other_hi) {
    for (int d = 0; d < 3; ++d)
      if (!(lo[d] <= other_hi[d] && other_lo[d] <= hi[d])) return false;
    return true;
  }
  /// Whether links of a cell whose vertices lie in a box may be met.
  KERF_HD bool may_meet(Vec3<double> box_lo, Vec3<double> box_hi, bool has_cut_links) const {
    if (has_cut_links) {
      const Vec3<double> by = beyond * (box_hi - box_lo);
      box_lo = box_lo - by;
      box_hi = box_hi + by;
    }
    if (!overlap(box_lo, box_hi, lo, hi)) return false;
    bool meets = slabs == 0;
    for (std::int32_t k = 0; k < slabs && !meets; ++k) {
      const BladeSlab& s = slab[k];
      if (!overlap(box_lo, box_hi, s.lo, s.hi)) continue;
      const Vec3<double> to_center = 0.5 * box_lo + 0.5 * box_hi - s.point;
      double reach = margin, distance = 0;
      for (int d = 0; d < 3; ++d) {
        const double n = s.normal[d];
        reach += 0.5001 * (n < 0 ? -n : n) * (box_hi[d] - box_lo[d]);
        distance += n * to_center[d];
      }
      meets = (distance < 0 ? -distance : distance) <= reach;
    }
    return meets;
  }
};

/// Positions of vertices of level 0, from the origin of the lattice, m.
struct VertexPlaces {
  const std::uint64_t* key;  ///< LatticePoint
  double spacing;
  const double* displacement;

  KERF_HD Vec3<double> at(std::int32_t vertex) const {
    constexpr int kBits = 21;
    constexpr std::uint64_t kMask = (std::uint64_t{1} << kBits) - 1;
    const Vec3<double> u = load(displacement, vertex);
    Vec3<double> out;
    for (int d = 0; d < 3; ++d)
      out[d] = static_cast<double>(key[vertex] >> (kBits * d) & kMask) * spacing + u[d];
    return out;
  }
};

/// The bounds of all vertices, by lanes, and a sum that is finite as long as all positions are.
struct BoundVertices {
  static constexpr int kValues = 7;  // lo, hi, sum
  VertexPlaces places;
  std::int32_t vertices, lanes;
  double* out;  ///< kValues x lanes

  KERF_HD void operator()(std::int32_t lane) const {
    double value[kValues] = {kInfinity,  kInfinity,  kInfinity, -kInfinity,
                             -kInfinity, -kInfinity, 0};
    for (std::int32_t v = lane; v < vertices; v += lanes) {
      const Vec3<double> p = places.at(v);
      for (int d = 0; d < 3; ++d) {
        value[d] = p[d] < value[d] ? p[d] : value[d];
        value[3 + d] = p[d] > value[3 + d] ? p[d] : value[3 + d];
      }
      value[6] += 0 * (p.x + p.y + p.z);
    }
    for (int n = 0; n < kValues; ++n) out[n * lanes + lane] = value[n];
  }
};
/// Of many lanes, each `fewer`-th.
struct FoldBounds {
  std::int32_t lanes, fewer;
  const double* from;
  double* out;  ///< BoundVertices::kValues x fewer

  KERF_HD void operator()(std::int32_t lane) const {
    for (int n = 0; n < BoundVertices::kValues; ++n) {
      const double* const of = from + n * lanes;
      double value = of[lane];
      for (std::int32_t p = lane + fewer; p < lanes; p += fewer) {
        if (n < 3)
          value = of[p] < value ? of[p] : value;
        else if (n < 6)
          value = of[p] > value ? of[p] : value;
        else
          value += of[p];
      }
      out[n * fewer + lane] = value;
    }
  }
};

/// A byte a cell: whether it may be met. `cells`: numbers, of such as have cut links; null: all, as
/// if they had none.
struct MarkNear {
  LevelView level;
  VertexPlaces places;
  ReachView reach;
  const std::int32_t* cells;
  std::uint8_t* marks;

  KERF_HD void operator()(std::int32_t i) const {
    const std::int32_t cell = cells != nullptr ? cells[i] : i;
    Vec3<double> lo = places.at(level.slot(cell, 0)), hi = lo;
    for (int k = 1; k < kCorners; ++k) {
      const Vec3<double> p = places.at(level.slot(cell, k));
      for (int d = 0; d < 3; ++d) {
        lo[d] = p[d] < lo[d] ? p[d] : lo[d];
        hi[d] = p[d] > hi[d] ? p[d] : hi[d];
      }
    }
    marks[i] = reach.may_meet(lo, hi, cells != nullptr) ? 1 : 0;
  }
};
/// 32 marks to a word.
struct PackMarks {
  std::int32_t count;
  const std::uint8_t* marks;
  std::uint32_t* words;

  KERF_HD void operator()(std::int32_t word) const {
    std::uint32_t bits = 0;
    for (int k = 0; k < 32; ++k) {
      const std::int32_t i = 32 * word + k;
      if (i < count && marks[i] != 0) bits |= std::uint32_t{1} << k;
    }
    words[word] = bits;
  }
};

}  // namespace kerf::gpu
