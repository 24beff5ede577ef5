// SPDX-License-Identifier: MIT
//
// What one stored cell matrix contributes to A u: whole, by one row of blocks, and its diagonal.
//
// Layout  A: packed lower triangle by slots, T* or CellEntries<T> (layout.hpp).
// Order   Sums run over columns in rising order, so that a row alone and the whole agree in every
//         bit.
// Units   A in N/m, u in m, result in N.
// Source  Dick, Georgii, Westermann 2011 [DGW11], section 6.4.
#pragma once

#include "kernels/layout.hpp"
#include "kernels/mat3.hpp"

namespace kerf::kernels {

/// Entry (row, col) of the full matrix.
template <class Matrix>
KERF_HD auto symmetric_entry(const Matrix& A, int row, int col) {
  const auto value = row >= col ? A[packed_index(row, col)] : A[packed_index(col, row)];
  return value;
}

/// Block (i, j) of the full matrix.
template <class T, class Matrix>
KERF_HD Mat3<T> packed_block(const Matrix& A, int i, int j) {
  Mat3<T> block;
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b) block[a][b] = symmetric_entry(A, 3 * i + a, 3 * j + b);
  return block;
}

/// Diagonal block of a slot.
template <class T, class Matrix>
KERF_HD Sym3<T> packed_diagonal(const Matrix& A, int slot) {
  const int r = 3 * slot;
  return {A[packed_index(r, r)],         A[packed_index(r + 1, r)],
          A[packed_index(r + 2, r)],     A[packed_index(r + 1, r + 1)],
          A[packed_index(r + 2, r + 1)], A[packed_index(r + 2, r + 2)]};
}

/// y = A u, each entry read once.
template <class T, class Matrix>
KERF_HD void apply_packed(const Matrix& A, const Vec3<T> (&u)[kCorners], Vec3<T> (&y)[kCorners]) {
  T in[kUnknowns], out[kUnknowns];
  KERF_UNROLL
  for (int i = 0; i < kUnknowns; ++i) in[i] = u[i / 3][i % 3];
  KERF_UNROLL
  for (int row = 0; row < kUnknowns; ++row) {
    T sum = T(0);
    KERF_UNROLL
    for (int col = 0; col < row; ++col) {
      const T a = A[packed_index(row, col)];
      sum = fma(a, in[col], sum);
      out[col] = fma(a, in[row], out[col]);
    }
    out[row] = fma(A[packed_index(row, row)], in[row], sum);
  }
  KERF_UNROLL
  for (int i = 0; i < kCorners; ++i) y[i] = {out[3 * i], out[3 * i + 1], out[3 * i + 2]};
}

/// Row `slot` of A u: what this cell contributes to one vertex.
template <class T, class Matrix>
KERF_HD Vec3<T> apply_packed_row(const Matrix& A, int slot, const Vec3<T> (&u)[kCorners]) {
  Vec3<T> y;
  for (int a = 0; a < 3; ++a) {
    T sum = T(0);
    for (int col = 0; col < kUnknowns; ++col)
      sum = fma(T(symmetric_entry(A, 3 * slot + a, col)), u[col / 3][col % 3], sum);
    y[a] = sum;
  }
  return y;
}

}  // namespace kerf::kernels
