// SPDX-License-Identifier: MIT
//
// The Galerkin product of one child cell: A_coarse += W^T A W.
//
// Layout  A and the coarse matrix: packed lower triangles by slots (layout.hpp). W: 8 x 8 scalars,
//         w[i][m] from the coarse slot m to the child's slot i (transfer_weights, or fold_weights
//         to bring a corner matrix to slots).
// Order   The children of a coarse cell must come in a fixed order: sums keep it to the bit.
// Source  Dick, Georgii, Westermann 2011 [DGW11], section 6.4, equation (2).
#pragma once

#include "kernels/residual.hpp"

namespace kerf::kernels {

/// The non-zeros of a weight matrix, by coarse slot.
template <class T>
struct WeightColumns {
  int count[kCorners];
  int child[kCorners][kCorners];
  T weight[kCorners][kCorners];
};

template <class T>
KERF_HD WeightColumns<T> compress_columns(const T (&w)[kCorners][kCorners]) {
  WeightColumns<T> out{};
  for (int m = 0; m < kCorners; ++m)
    for (int i = 0; i < kCorners; ++i) {
      if (w[i][m] == T(0)) continue;
      const int at = out.count[m]++;
      out.child[m][at] = i;
      out.weight[m][at] = w[i][m];
    }
  return out;
}

/// The full square of a packed matrix: read once, and by rows from here on.
template <class T, class Matrix>
KERF_HD void expand_packed(const Matrix& A, T (&full)[kUnknowns][kUnknowns]) {
  for (int row = 0; row < kUnknowns; ++row)
    for (int col = 0; col <= row; ++col)
      full[row][col] = full[col][row] = A[packed_index(row, col)];
}

/// strip = (A W)^T for one coarse slot: three rows of 24, sums of whole rows of A = A^T.
template <class T>
KERF_HD void gather_strip(const T (&full)[kUnknowns][kUnknowns], const WeightColumns<T>& columns,
                          int n, T (&strip)[3][kUnknowns]) {
  for (int b = 0; b < 3; ++b)
    for (int col = 0; col < kUnknowns; ++col) strip[b][col] = T(0);
  for (int k = 0; k < columns.count[n]; ++k)
    for (int b = 0; b < 3; ++b) {
      const int row = 3 * columns.child[n][k] + b;
      for (int col = 0; col < kUnknowns; ++col)
        strip[b][col] = fma(columns.weight[n][k], full[row][col], strip[b][col]);
    }
}

/// Block (m, n) of W^T A W from the strip of n.
template <class T>
KERF_HD Mat3<T> gather_block(const T (&strip)[3][kUnknowns], const WeightColumns<T>& columns,
                             int m) {
  Mat3<T> block{{{T(0), T(0), T(0)}, {T(0), T(0), T(0)}, {T(0), T(0), T(0)}}};
  for (int k = 0; k < columns.count[m]; ++k) {
    const int first = 3 * columns.child[m][k];
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b)
        block[a][b] = fma(columns.weight[m][k], strip[b][first + a], block[a][b]);
  }
  return block;
}

/// coarse += W^T A W.
///
/// Shapes  A: kEntries scalars to read; coarse: kEntries scalars to update; T* or CellEntries<T>.
/// Work    8 * 27 + about 110 products of 3x3 blocks for a regular child, of 4608 in equation (2).
template <class T, class Matrix, class Out>
KERF_HD void coarsen_cell(const Matrix& A, const T (&w)[kCorners][kCorners], Out coarse) {
  const WeightColumns<T> columns = compress_columns(w);
  T full[kUnknowns][kUnknowns];
  T strip[3][kUnknowns];
  expand_packed(A, full);
  for (int n = 0; n < kCorners; ++n) {
    if (columns.count[n] == 0) continue;
    gather_strip(full, columns, n, strip);
    for (int m = n; m < kCorners; ++m) {
      const Mat3<T> block = gather_block(strip, columns, m);
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < (m == n ? a + 1 : 3); ++b)
          coarse[packed_index(3 * m + a, 3 * n + b)] += block[a][b];
    }
  }
}

}  // namespace kerf::kernels
