// SPDX-License-Identifier: MIT
//
// Hanging corners and the weights between a cell and its parent.
//
// A cell has eight slots: the unknown vertices on which it depends. Slot i is the vertex at corner
// i of the cell, unless that corner hangs (it lies in the middle of an edge or a face of a larger
// neighbour and is no unknown). Then slot i is the vertex at corner i of the geometric parent: the
// cube of twice the side that has corner o of the cell as its own corner o. o is the octant.
//
//      2-----------3      The lower xy face of a parent and its child of octant 0. Both lie on a
//      larger |           |      cell below, so corners 1, 2 and 3 of the child hang. 2.....3     |
//      slot 0 = corner 0, shared with the parent    corner 1 = mean of slots 0, 1 |     :     |
//      slots 1, 2, 3 = the parent's corners         corner 2 = mean of slots 0, 2 0-----1-----1
//      slots 4..7 = corners 4..7                    corner 3 = mean of slots 0..3
//
// Fold code  16 bits: bits 0-7 say which corners hang, bits 8-10 hold o. 0x000 for a regular cell.
// Needs      Corner o does not hang, nor the opposite one (the middle of the parent). A corner
// whose
//            two bits differ from o hangs on a face, so the two corners between it and o hang on
//            the edges of that face: fold_is_valid.
// Source     Dick, Georgii, Westermann 2011 [DGW11], section 6.4; Sampath, Biros 2010 [SB10].
#pragma once

#include "kernels/layout.hpp"
#include "kernels/mat3.hpp"
#include "kernels/unrolled.hpp"

namespace kerf::kernels {

using FoldCode = std::uint16_t;

/// Place of a cell that its level passes on unchanged to the next: it is its own parent.
inline constexpr int kPassed = 8;

KERF_HD constexpr FoldCode fold_code(int hanging, int octant) {
  return static_cast<FoldCode>((hanging & 0xff) | ((octant & 7) << 8));
}
KERF_HD constexpr int fold_octant(FoldCode code) { return (code >> 8) & 7; }
KERF_HD constexpr bool is_hanging(FoldCode code, int corner) { return ((code >> corner) & 1) != 0; }
KERF_HD constexpr bool has_hanging(FoldCode code) { return (code & 0xff) != 0; }

/// 1 over the number of parent corners between o and i: 1, 1/2, 1/4, 1/8 by the bits they differ
/// in.
template <class T>
KERF_HD T mean_weight(int difference) {
  return T(1) /
         T((1 + (difference & 1)) * (1 + ((difference >> 1) & 1)) * (1 + ((difference >> 2) & 1)));
}

/// Whether j lies between o and i: the bits in which j differs from o are among those of i.
KERF_HD constexpr bool is_between(int o, int i, int j) { return ((j ^ o) & ~(i ^ o)) == 0; }

/// What `Needs` above asks of a code.
KERF_HD constexpr bool fold_is_valid(FoldCode code) {
  const int o = fold_octant(code);
  for (int i = 0; i < kCorners; ++i) {
    if (!is_hanging(code, i)) continue;
    if (i == o || (i ^ o) == 7) return false;
    for (int j = 0; j < kCorners; ++j)
      if (j != o && is_between(o, i, j) && !is_hanging(code, j)) return false;
  }
  return true;
}

/// Value at a corner from the values at the slots.
///
/// Shapes  slots: 8 values, of any type that adds and scales (a scalar or a Vec3<T>).
template <class T, class Value>
KERF_HD Value fold_corner(const Value (&slots)[kCorners], FoldCode code, int corner) {
  if (!is_hanging(code, corner)) return slots[corner];
  const int o = fold_octant(code);
  Value sum{};
  for (int j = 0; j < kCorners; ++j)
    if (is_between(o, corner, j)) sum += slots[j];
  return mean_weight<T>(corner ^ o) * sum;
}

/// W, corner by slot: corners = W slots.
template <class T>
KERF_HD void fold_weights(FoldCode code, T (&w)[kCorners][kCorners]) {
  const int o = fold_octant(code);
  for (int i = 0; i < kCorners; ++i)
    for (int j = 0; j < kCorners; ++j) {
      const T mean = is_between(o, i, j) ? mean_weight<T>(i ^ o) : T(0);
      w[i][j] = is_hanging(code, i) ? mean : T(i == j ? 1 : 0);
    }
}

/// u_corners = W u_slots.
template <class T>
KERF_HD void unfold(const Vec3<T> (&slots)[kCorners], FoldCode code, Vec3<T> (&corners)[kCorners]) {
  for (int i = 0; i < kCorners; ++i) corners[i] = fold_corner<T>(slots, code, i);
}

/// f_slots = W^T f_corners: forces at hanging corners go to the vertices that carry them.
template <class T>
KERF_HD void fold_transpose(const Vec3<T> (&corners)[kCorners], FoldCode code,
                            Vec3<T> (&slots)[kCorners]) {
  const int o = fold_octant(code);
  for (int j = 0; j < kCorners; ++j) {
    Vec3<T> sum = is_hanging(code, j) ? Vec3<T>{} : corners[j];
    for (int i = 0; i < kCorners; ++i)
      if (is_hanging(code, i) && is_between(o, i, j)) sum += mean_weight<T>(i ^ o) * corners[i];
    slots[j] = sum;
  }
}

/// w[i][m]: the value at slot i of a child from the values at the slots m of its parent.
/// A child's own corner i is the mean of the parent's corners between o and i; its hanging slot i
/// is the parent's corner i; a corner of the parent is then what the parent's fold says.
///
/// Shapes  place: octant 0..7 of the child in the parent, or kPassed (the identity).
/// Source  [DGW11], section 6.4, figure 7.
template <class T>
KERF_HD void transfer_weights(FoldCode child, int place, FoldCode parent,
                              T (&w)[kCorners][kCorners]) {
  if (place == kPassed) {
    for (int i = 0; i < kCorners; ++i)
      for (int m = 0; m < kCorners; ++m) w[i][m] = T(i == m ? 1 : 0);
    return;
  }
  T fold[kCorners][kCorners];
  fold_weights(parent, fold);
  for (int i = 0; i < kCorners; ++i) {
    const bool at_parent = is_hanging(child, i);
    const int first = at_parent ? i : place;  // the corners between first and i, averaged
    const T mean = mean_weight<T>(i ^ first);
    for (int m = 0; m < kCorners; ++m) {
      T sum = T(0);
      for (int j = 0; j < kCorners; ++j)
        if (is_between(first, i, j)) sum += fold[j][m];
      w[i][m] = mean * sum;
    }
  }
}

/// One axis of v = P^T v, from the corners of a child in the low or high half to its parent's.
template <int bit, class T, class Value>
KERF_HD void restrict_axis(bool is_high, Value (&v)[kCorners]) {
  unrolled<kCorners>([&](auto l) {
    if constexpr ((l & bit) == 0) {
      constexpr int kHigh = l | bit;
      if (is_high) {
        v[l] = T(0.5) * v[l];
        v[kHigh] += v[l];
      } else {
        v[kHigh] = T(0.5) * v[kHigh];
        v[l] += v[kHigh];
      }
    }
  });
}

/// v = P^T v of a child without hanging corners in a parent without, axis by axis: what
/// transfer_weights gives.
///
/// Shapes  v: 8 values, of any type that adds and scales (a scalar or a Vec3<T>).
template <class T, class Value>
KERF_HD void restrict_plain(int place, Value (&v)[kCorners]) {
  restrict_axis<1, T>((place & 1) != 0, v);
  restrict_axis<2, T>((place & 2) != 0, v);
  restrict_axis<4, T>((place & 4) != 0, v);
}

}  // namespace kerf::kernels
