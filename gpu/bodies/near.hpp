// SPDX-License-Identifier: MIT
//
// What a blade may meet: where vertices are, and marks on cells. As near_cells in
// core/levels/corners.hpp, with the same roundings.
#pragma once

#include <limits>

#include "gpu/level_view.hpp"
#include "kernels/blade_reach.hpp"
#include "kernels/layout.hpp"

namespace kerf::gpu {

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Positions of vertices of level 0, from the origin of the lattice, m.
struct VertexPlaces {
  const std::uint64_t* key;  ///< LatticePoint
  double spacing;
  const double* displacement;

  KERF_HD Vec3<double> at(std::int32_t vertex) const {
    const Vec3<double> u = load(displacement, vertex);
    Vec3<double> out;
    for (int d = 0; d < 3; ++d)
      out[d] = kernels::lattice_coordinate(key[vertex], d) * spacing + u[d];
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

/// A byte a cell: whether it may be met, or what lies `beyond` it, in its extents. `cells`:
/// numbers; null: all.
struct MarkNear {
  LevelView level;
  VertexPlaces places;
  kernels::BladeNeighbourhood blade;
  double beyond;
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
    marks[i] = kernels::may_meet(blade, lo, hi, beyond) ? 1 : 0;
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
