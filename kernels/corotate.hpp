// SPDX-License-Identifier: MIT
//
// The matrix of one finest cell in the deformed frame, where a stored one is wanted: the readable
// reference of apply_cell, the child of the first coarsening, the block of a smoother.
//
// Layout  Packed lower triangle of 24x24, layout.hpp; by corners: coarsen_cell with fold_weights
//         brings it to slots.
// Units   stiffness = E side in N/m, mass = rho side^3; K and M of a unit cube with E = 1, rho = 1.
// Source  Dick, Georgii, Westermann 2011 [DGW11], sections 5 and 6.4.
#pragma once

#include "kernels/hex_element.hpp"
#include "kernels/mat3.hpp"

namespace kerf::kernels {

/// Block (i, j) of stiffness [R] K [R]^T + mass M (x) I.
template <class T>
KERF_HD Mat3<T> rotate_block(const HexStiffness<T>& K, const HexMass<T>& M, const Mat3<T>& R,
                             T stiffness, T mass, int i, int j) {
  Mat3<T> block;
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b) block[a][b] = stiffness * K.k[3 * i + a][3 * j + b];
  block = R * block * transpose(R);
  const T share = mass * M.m[i][j];
  for (int a = 0; a < 3; ++a) block[a][a] += share;
  return block;
}

/// out = the packed matrix stiffness [R] K [R]^T + mass M (x) I.
///
/// Shapes  out: kEntries scalars to write, T* or CellEntries<T>.
template <class T, class Out>
KERF_HD void cell_matrix(const HexStiffness<T>& K, const HexMass<T>& M, const Mat3<T>& R,
                         T stiffness, T mass, Out out) {
  for (int i = 0; i < kCorners; ++i)
    for (int j = 0; j <= i; ++j) {
      const Mat3<T> block = rotate_block(K, M, R, stiffness, mass, i, j);
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b)
          if (i != j || b <= a) out[packed_index(3 * i + a, 3 * j + b)] = block[a][b];
    }
}

/// The diagonal block of one corner of the same matrix.
template <class T>
KERF_HD Sym3<T> cell_diagonal(const HexStiffness<T>& K, const HexMass<T>& M, const Mat3<T>& R,
                              T stiffness, T mass, int corner) {
  return lower_triangle(rotate_block(K, M, R, stiffness, mass, corner, corner));
}

}  // namespace kerf::kernels
