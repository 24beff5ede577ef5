// SPDX-License-Identifier: MIT
//
// The Galerkin product of eight children over the corners of cubes, for matrices that have no short
// form in modes: those of partly held cells.
//
// Along an axis, l and h the ends of a parent's edge, a low child has its ends at l and (l + h) /
// 2, a high one at (l + h) / 2 and h. One axis after the other, both children of a half in one
// pass; coarsen_cell takes them one by one and weighs all corners at once.
//
// Layout  Packed lower triangle (layout.hpp) over the unknowns 3 corner + component. Corners are
//         those of a cube; hanging corners are the caller's.
// Source  Derived here; the product is that of Dick, Georgii, Westermann 2011 [DGW11],
//         section 6.4, equation (2).
#pragma once

#include "kernels/layout.hpp"
#include "kernels/unrolled.hpp"

namespace kerf::kernels {

/// Place of the entry that couples component i of corner p with component k of corner r.
KERF_HD constexpr int corner_entry(int p, int i, int r, int k) {
  const int a = 3 * p + i, b = 3 * r + k;
  return a >= b ? packed_index(a, b) : packed_index(b, a);
}

/// The products of the low and of the high child along an axis, for the unknowns (p, i) and (r, k)
/// of the low side and their partners on the high side. Which: 1 the low one, 2 the high one, 3
/// both.
template <int axis, int which, int p, int i, int r, int k, class T, class Out>
KERF_HD void coarsen_corner_quad(const T* low, const T* high, Out out) {
  constexpr int q = p | (1 << axis), u = r | (1 << axis);
  constexpr int pr = corner_entry(p, i, r, k), pu = corner_entry(p, i, u, k);
  constexpr int qr = corner_entry(q, i, r, k), qu = corner_entry(q, i, u, k);
  constexpr bool has_low = (which & 1) != 0, has_high = (which & 2) != 0;
  const T half = T(0.5);
  // What the points in the middle of the edge have, shared by both ends.
  T middle;
  if constexpr (has_low && has_high)
    middle = T(0.25) * (low[qu] + high[pr]);
  else
    middle = T(0.25) * (has_low ? low[qu] : high[pr]);
  T p_to_u, q_to_r;
  if constexpr (has_low && has_high) {
    p_to_u = half * (low[pu] + high[pu]);
    q_to_r = half * (low[qr] + high[qr]);
  } else {
    p_to_u = half * (has_low ? low[pu] : high[pu]);
    q_to_r = half * (has_low ? low[qr] : high[qr]);
  }
  T at_low = middle, at_high = middle;
  if constexpr (has_low) at_low += low[pr] + half * (low[pu] + low[qr]);
  if constexpr (has_high) at_high += high[qu] + half * (high[pu] + high[qr]);
  out[pr] = at_low;
  out[qu] = at_high;
  out[pu] = middle + p_to_u;
  if constexpr (qr != pu) out[qr] = middle + q_to_r;
}

/// out = the halves along an axis brought together.
template <int axis, int which, class T, class Out>
KERF_HD void coarsen_corner_axis(const T* low, const T* high, Out out) {
  unrolled<12>([&](auto row) {
    unrolled<decltype(row)::value + 1>([&](auto col) {
      // Unknown 3 n + i of the four corners of the low side; n has their two other bits.
      constexpr int below = (1 << axis) - 1;
      constexpr int n = decltype(row)::value / 3, m = decltype(col)::value / 3;
      constexpr int p = (n & below) | ((n & ~below) << 1), r = (m & below) | ((m & ~below) << 1);
      coarsen_corner_quad<axis, which, p, decltype(row)::value % 3, r, decltype(col)::value % 3>(
          low, high, out);
    });
  });
}

/// The same for the halves that are there: bit 0 of `present` for the low one, bit 1 for the high.
template <int axis, class T, class Out>
KERF_HD void coarsen_corner_halves(const T* low, const T* high, unsigned present, Out out) {
  if (present == 3)
    coarsen_corner_axis<axis, 3>(low, high, out);
  else if (present == 1)
    coarsen_corner_axis<axis, 1>(low, high, out);
  else if (present == 2)
    coarsen_corner_axis<axis, 2>(low, high, out);
}

/// out = the matrix of a parent of any eight children over its corners. Some 900 slots a child. An
/// absent child counts as zeros and is not asked for. Nothing is written where all are absent.
///
/// Shapes  child(octant, entries): puts its kEntries scalars; asked once for each octant with its
///         bit in `present`, rising. out: kEntries scalars to write.
template <class T, class Children, class Out>
KERF_HD void coarsen_corners(const Children& child, unsigned present, Out out) {
  // Depth first, as coarsen_modes.
  T children[2][kEntries], along_x[2][kEntries], along_y[2][kEntries];
  unsigned halves = 0;
  for (int z = 0; z < 2; ++z) {
    unsigned quarters = 0;
    for (int y = 0; y < 2; ++y) {
      const int octant = 4 * z + 2 * y;
      const unsigned both = (present >> octant) & 3U;
      for (int x = 0; x < 2; ++x)
        if (((both >> x) & 1U) != 0) child(octant + x, children[x]);
      coarsen_corner_halves<0, T>(children[0], children[1], both, static_cast<T*>(along_x[y]));
      if (both != 0) quarters |= 1U << y;
    }
    coarsen_corner_halves<1, T>(along_x[0], along_x[1], quarters, static_cast<T*>(along_y[z]));
    if (quarters != 0) halves |= 1U << z;
  }
  coarsen_corner_halves<2, T>(along_y[0], along_y[1], halves, out);
}

}  // namespace kerf::kernels
