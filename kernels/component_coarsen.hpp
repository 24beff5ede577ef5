// SPDX-License-Identifier: MIT
//
// The Galerkin product of one pair of components (i, k) at a time: of a cell matrix the 8 x 8
// scalars that couple component i of its corners or slots with component k. Transfer mixes corners
// and no components, so six pairs (i >= k) of a coarse matrix are six tasks that share nothing but
// what they read; each fits into the registers of a thread, where a whole matrix of 300 scalars
// does not.
//
// Finest children enter by the forces C_ab of mode_coarsen.hpp, here C_ab[i][k] for one (i, k): by
// their Walsh sums over the octants, w the axes whose halves are told apart,
//     S(S, S') = 1/4 sum over a in S, b in S' of (1/2)^|w| (1/3)^|both| C_ab[w],
//     w = (S \ a) xor (S' \ b), both = (S \ a) and (S' \ b),
// and the matrix over corners is H^T S H. Mass likewise, without a and b.
//
// Shapes  Matrices T[8][8], row: corner or slot of component i, column: of component k.
// Units   As modes.hpp.
// Source  Derived here; the product is that of Dick, Georgii, Westermann 2011 [DGW11], section 6.4,
//         equation (2).
#pragma once

#include "kernels/layout.hpp"
#include "kernels/modes.hpp"
#include "kernels/transfer.hpp"
#include "kernels/unrolled.hpp"

namespace kerf::kernels {

/// The six pairs of components: (0,0) (1,0) (1,1) (2,0) (2,1) (2,2).
inline constexpr int kComponentPairs = 6;
struct ComponentPair {
  int i, k;  ///< i >= k
};
KERF_HD constexpr ComponentPair component_pair(int number) {
  const int i = number == 0 ? 0 : number < 3 ? 1 : 2;
  return {i, number - i * (i + 1) / 2};
}

/// Place in a packed triangle of the entry that couples component i of slot p with k of slot q.
/// Which of the two is the row follows from the slots, since i >= k; so a place is a constant and a
/// product where slots are constants.
KERF_HD constexpr int pair_entry(int p, int q, ComponentPair pair) {
  const bool below = p >= q;
  const int m = below ? p : q, n = below ? q : p;
  const int i = below ? pair.i : pair.k, k = below ? pair.k : pair.i;
  return (9 * m * m + 3 * m) / 2 + 3 * m * i + i * (i + 1) / 2 + 3 * n + k;
}

/// C_ab[i][k] of one finest cell, [3 a + b], and its inertia, [9].
template <class T>
KERF_HD void component_forces(const Mat3<T>& R, T stiffness, T mass, const ModeStiffness<T>& unit,
                              ComponentPair pair, T (&c)[10]) {
  // Selected and not indexed: what is indexed is no register.
  const auto row = [&](int i, int a) { return i == 0 ? R[0][a] : i == 1 ? R[1][a] : R[2][a]; };
  const bool same = pair.i == pair.k;
  const T b = stiffness * unit.b, e = stiffness * unit.e;
  unrolled<3>([&](auto m) {
    unrolled<3>([&](auto n) {
      const T sheared = row(pair.i, n) * row(pair.k, m) + (m == n && same ? T(1) : T(0));
      c[3 * m + n] = fma(b, row(pair.i, m) * row(pair.k, n), e * sheared);
    });
  });
  c[9] = same ? mass : T(0);
}

/// out = H^T out H, modes to corners on both sides.
template <class T>
KERF_HD void modes_to_corners(T (&out)[kCorners][kCorners]) {
  unrolled<kCorners>([&](auto s) { to_corners(out[s]); });
  unrolled<kCorners>([&](auto n) {
    T column[kCorners];
    unrolled<kCorners>([&](auto s) { column[s] = out[s][n]; });
    to_corners(column);
    unrolled<kCorners>([&](auto m) { out[m][n] = column[m]; });
  });
}

/// The matrix of one finest cell over its corners.
template <class T>
KERF_HD void component_matrix(const T (&c)[10], const T (&unit_mass)[4],
                              T (&out)[kCorners][kCorners]) {
  constexpr T kThird[3] = {T(1), T(1) / T(3), T(1) / T(9)};
  unrolled<kCorners>([&](auto s) {
    unrolled<kCorners>([&](auto t) {
      T sum = s == t ? unit_mass[mode_axes(s)] * c[9] : T(0);
      unrolled<9>([&](auto ab) {
        constexpr int kA = 1 << (ab / 3), kB = 1 << (ab % 3);
        if constexpr ((s & kA) != 0 && (t & kB) != 0 && (s ^ kA) == (t ^ kB))
          sum = fma(kThird[mode_axes(s ^ kA)], c[ab], sum);
      });
      out[s][t] = sum;
    });
  });
  modes_to_corners(out);
}

/// The octants of finest children of one coarse cell, c[quantity][octant], to their Walsh sums.
template <class T>
KERF_HD void component_sums(T (&c)[10][kCorners]) {
  unrolled<10>([&](auto q) { to_modes(c[q]); });
}

/// The matrix of their parent over its corners, from these sums.
template <class T>
KERF_HD void component_parent(const T (&c)[10][kCorners], const T (&unit_mass)[4],
                              T (&out)[kCorners][kCorners]) {
  constexpr T kHalf[4] = {T(1), T(1) / T(2), T(1) / T(4), T(1) / T(8)};
  constexpr T kThird[3] = {T(1), T(1) / T(3), T(1) / T(9)};
  // An axis that both modes have: the mean over a half and that of xi^2, a quarter of their sum.
  const T both = T(0.25) * (T(1) + unit_mass[1] / unit_mass[0]);
  const T shared[4] = {unit_mass[0], unit_mass[0] * both, unit_mass[0] * both * both,
                       unit_mass[0] * both * both * both};
  unrolled<kCorners>([&](auto s) {
    unrolled<kCorners>([&](auto t) {
      T sum = shared[mode_axes(s & t)] * (kHalf[mode_axes(s ^ t)] * c[9][s ^ t]);
      unrolled<9>([&](auto ab) {
        constexpr int kA = 1 << (ab / 3), kB = 1 << (ab % 3);
        if constexpr ((s & kA) != 0 && (t & kB) != 0) {
          constexpr int kLeft = s ^ kA, kRight = t ^ kB;
          constexpr T kWeight =
              T(0.25) * kHalf[mode_axes(kLeft ^ kRight)] * kThird[mode_axes(kLeft & kRight)];
          sum = fma(kWeight, c[ab][kLeft ^ kRight], sum);
        }
      });
      out[s][t] = sum;
    });
  });
  modes_to_corners(out);
}

/// A = P^T A P of a child without hanging corners in a parent without: axis by axis, in place.
template <class T>
KERF_HD void restrict_component(int place, T (&A)[kCorners][kCorners]) {
  unrolled<kCorners>([&](auto p) { restrict_plain<T>(place, A[p]); });
  unrolled<kCorners>([&](auto n) {
    T column[kCorners];
    unrolled<kCorners>([&](auto p) { column[p] = A[p][n]; });
    restrict_plain<T>(place, column);
    unrolled<kCorners>([&](auto m) { A[m][n] = column[m]; });
  });
}

/// sum += L^T A R, of any weights; loops, since few cells need them.
template <class T>
KERF_HD void add_weighted(const T (&A)[kCorners][kCorners], const T (&left)[kCorners][kCorners],
                          const T (&right)[kCorners][kCorners], T (&sum)[kCorners][kCorners]) {
  for (int n = 0; n < kCorners; ++n) {
    T column[kCorners];
    for (int p = 0; p < kCorners; ++p) {
      column[p] = T(0);
      for (int q = 0; q < kCorners; ++q) column[p] = fma(A[p][q], right[q][n], column[p]);
    }
    for (int m = 0; m < kCorners; ++m)
      for (int p = 0; p < kCorners; ++p) sum[m][n] = fma(left[p][m], column[p], sum[m][n]);
  }
}

/// weights = F diag(free) W: from the slots of a parent to one component of the corners of a finest
/// child, F by its fold and W by its place; slots that are held carry nothing.
template <class T>
KERF_HD void corner_weights(FoldCode child, int place, FoldCode parent, unsigned held,
                            T (&weights)[kCorners][kCorners]) {
  T fold[kCorners][kCorners], transfer[kCorners][kCorners];
  fold_weights(child, fold);
  transfer_weights(child, place, parent, transfer);
  for (int p = 0; p < kCorners; ++p)
    for (int m = 0; m < kCorners; ++m) {
      T sum = T(0);
      for (int s = 0; s < kCorners; ++s)
        if (((held >> s) & 1) == 0) sum = fma(fold[p][s], transfer[s][m], sum);
      weights[p][m] = sum;
    }
}

}  // namespace kerf::kernels
