// SPDX-License-Identifier: MIT
//
// The diagonal 3x3 block of a cell at one slot, where corners of the cell hang.
//
// A slot moves its own corner and the hanging ones that are means of it: column j of the fold W.
// Its modes m = H w_j, eight scalars, say all about it, so that no matrix is brought from corners
// to slots: the block is sum over s, t of m_s m_t S(s, t). In a finest cell S is made of C_ab
// (mode_coarsen.hpp), and of m there remains the Gram matrix of the gradients of that movement,
//     G_ab = sum over U without a and b of 3^-|U| m_(U + a) m_(U + b),
//     D = stiffness ((b + e) R G R^T + e tr G I) + mass      (b, e of ModeStiffness).
//
// Source  Derived here.
#pragma once

#include "kernels/mode_coarsen.hpp"
#include "kernels/transfer.hpp"

namespace kerf::kernels {

/// The modes of what a slot moves.
template <class T>
KERF_HD void slot_modes(FoldCode code, int slot, T (&m)[kCorners]) {
  T w[kCorners][kCorners];
  fold_weights(code, w);
  for (int i = 0; i < kCorners; ++i) m[i] = w[i][slot];
  to_modes(m);
}

/// Whether a slot moves corners other than its own, or not even that.
KERF_HD constexpr bool is_folded_slot(FoldCode code, int slot) {
  if (is_hanging(code, slot)) return true;
  const int o = fold_octant(code);
  for (int i = 0; i < kCorners; ++i)
    if (is_hanging(code, i) && is_between(o, i, slot)) return true;
  return false;
}

/// What a finest cell needs of the modes of a slot.
template <class T>
struct SlotGram {
  Sym3<T> gradients;  // G
  T mass;
};

/// Shapes  mass: of ModeConstants.
template <class T>
KERF_HD SlotGram<T> slot_gram(const T (&m)[kCorners], const T (&mass)[4]) {
  T G[3][3];
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b <= a; ++b) {
      const int bit_a = 1 << a, bit_b = 1 << b;
      G[a][b] = T(0);
      for (int U = 0; U < kCorners; ++U)
        if ((U & (bit_a | bit_b)) == 0)
          G[a][b] += third_power<T>(mode_axes(U)) * m[U | bit_a] * m[U | bit_b];
    }
  SlotGram<T> out{{G[0][0], G[1][0], G[2][0], G[1][1], G[2][1], G[2][2]}, T(0)};
  for (int s = 0; s < kCorners; ++s) out.mass += mass[mode_axes(s)] * m[s] * m[s];
  return out;
}

/// D = the block of a finest cell. 60 slots.
template <class T>
KERF_HD void finest_slot_block(const Mat3<T>& R, T stiffness, T mass,
                               const ModeConstants<T>& constants, const SlotGram<T>& of,
                               Sym3<T>& D) {
  const T e = stiffness * constants.stiffness.e;
  const T both = stiffness * (constants.stiffness.b + constants.stiffness.e);
  const Sym3<T>& G = of.gradients;
  T turned[3][3];  // both R G
  for (int i = 0; i < 3; ++i) {
    const T x = both * R[i][0], y = both * R[i][1], z = both * R[i][2];
    turned[i][0] = fma(x, G.xx, fma(y, G.xy, z * G.xz));
    turned[i][1] = fma(x, G.xy, fma(y, G.yy, z * G.yz));
    turned[i][2] = fma(x, G.xz, fma(y, G.yz, z * G.zz));
  }
  const auto entry = [&](int i, int k, const T& start) {
    return fma(turned[i][0], R[k][0],
               fma(turned[i][1], R[k][1], fma(turned[i][2], R[k][2], start)));
  };
  const T all = fma(e, G.xx + G.yy + G.zz, mass * of.mass);
  D = {entry(0, 0, all), entry(0, 1, T(0)), entry(0, 2, T(0)),
       entry(1, 1, all), entry(1, 2, T(0)), entry(2, 2, all)};
}

/// D = the block of a cell whose matrix by modes is stored. Some 260 slots.
template <bool with_translations, class T, class Matrix>
KERF_HD void stored_slot_block(const Matrix& A, const T (&m)[kCorners], Sym3<T>& D) {
  constexpr int modes = with_translations ? 8 : 7;
  T sum[6];
  for (T& entry : sum) entry = T(0);
  // As the entries lie.
  unrolled<modes>([&](auto row) {
    constexpr int s = 7 - decltype(row)::value;
    unrolled<decltype(row)::value + 1>([&](auto col) {
      constexpr int t = 7 - decltype(col)::value;
      const T weight = m[s] * m[t];
      const T twice = s == t ? weight : weight + weight;
      for (int i = 0; i < 3; ++i)
        for (int k = 0; k <= i; ++k) {
          T& to = sum[packed_index(i, k)];
          to = fma(i == k ? twice : weight, A[mode_entry(s, i, t, k)], to);
          if (i != k && s != t) to = fma(weight, A[mode_entry(t, i, s, k)], to);
        }
    });
  });
  D = {sum[0], sum[1], sum[3], sum[2], sum[4], sum[5]};
}

}  // namespace kerf::kernels
