// SPDX-License-Identifier: MIT
//
// The coarsest level: its matrix assembled, inverted in place, and applied.
//
// Layout  Dense, n x n, n = 3 vertices: entry (i, j) at i n + j; both triangles.
// Order   Blocked Gauss-Jordan elimination of a symmetric positive definite matrix, kBlock rows at
// a
//         time, without pivoting: every entry is one thread's, and sums run in rising order.
// Source  Golub, Van Loan 2013, 3.2 and 4.2 (no pivoting is needed).
#pragma once

#include "gpu/level_view.hpp"
#include "kernels/residual.hpp"

namespace kerf::gpu {

inline constexpr int kBlock = 16;   // rows that are eliminated at once
inline constexpr int kSlices = 16;  // of a row of the inverse, a thread each
/// A pivot is what is left of a diagonal entry when the unknowns before it are eliminated; see
/// core/solve/sparse_cholesky.cpp, which has the same limit.
inline constexpr double kSingular = 1e-13;

/// The rows of one vertex: its incidences in their order. The matrix is zero before.
template <class T>
struct AssembleVertex {
  LevelView level;
  const T* matrices;
  double share;  ///< of the diagonal that is added to it
  double* A;
  double* diagonal;

  KERF_HD void operator()(std::int32_t vertex) const {
    const auto n = 3 * static_cast<std::size_t>(level.vertices);
    const std::int32_t* const incidence = level.incidence + level.incidence_begin[vertex];
    for (std::int32_t k = 0; k < level.incidence_count[vertex]; ++k) {
      const std::int32_t cell = incidence[k] / kCorners;
      const int i = incidence[k] % kCorners;
      const auto from =
          kernels::cell_entries(matrices, static_cast<std::size_t>(cell), kEntries, kTileLog2);
      for (int j = 0; j < kCorners; ++j)
        for (int a = 0; a < 3; ++a)
          for (int b = 0; b < 3; ++b)
            A[(3 * static_cast<std::size_t>(vertex) + static_cast<std::size_t>(a)) * n +
              3 * static_cast<std::size_t>(level.slot(cell, j)) + static_cast<std::size_t>(b)] +=
                static_cast<double>(kernels::symmetric_entry(from, 3 * i + a, 3 * j + b));
    }
    for (int a = 0; a < 3; ++a) {
      const std::size_t row = 3 * static_cast<std::size_t>(vertex) + static_cast<std::size_t>(a);
      double& entry = A[row * n + row];
      entry = ((level.fixed[vertex] >> a) & 1) != 0 ? 1 : entry * (1 + share);
      diagonal[row] = entry;
    }
  }
};

/// P = the inverse of the block of rows first to first + rows. One thread. A pivot that is lost in
/// rounding sets `failed`, and counts as infinite.
struct InvertBlock {
  std::int32_t n, first, rows;
  const double* A;
  const double* diagonal;
  double* P;  ///< kBlock x kBlock
  double* failed;

  KERF_HD void operator()(std::int32_t) const {
    double block[kBlock][kBlock];  // near the thread, which reads it some thousand times
    for (int i = 0; i < rows; ++i)
      for (int j = 0; j < rows; ++j) block[i][j] = A[entry(first + i, first + j)];
    for (int k = 0; k < rows; ++k) {
      const double left = block[k][k];
      const bool is_pivot = left > kSingular * diagonal[first + k];
      if (!is_pivot) *failed = 1;
      const double pivot = is_pivot ? 1 / left : 0;
      for (int j = 0; j < rows; ++j)
        if (j != k) block[k][j] *= pivot;
      for (int i = 0; i < rows; ++i) {
        if (i == k) continue;
        const double factor = block[i][k];
        for (int j = 0; j < rows; ++j)
          if (j != k) block[i][j] = fma(-factor, block[k][j], block[i][j]);
        block[i][k] = -factor * pivot;
      }
      block[k][k] = pivot;
    }
    for (int i = 0; i < rows; ++i)
      for (int j = 0; j < rows; ++j) P[i * kBlock + j] = block[i][j];
  }

 private:
  KERF_HD std::size_t entry(std::int32_t i, std::int32_t j) const {
    return static_cast<std::size_t>(i) * static_cast<std::size_t>(n) + static_cast<std::size_t>(j);
  }
};

/// Copies of the block's columns, and its rows times P: what all other entries need.
struct EliminationPanels {
  std::int32_t n, first, rows;
  const double* A;
  const double* P;
  double *columns, *times_P;  ///< kBlock x n each: row c is column first + c; row c of P A

  KERF_HD void operator()(std::int32_t i) const {
    for (int c = 0; c < rows; ++c) {
      columns[at(c, i)] = A[at(i, first + c)];
      double sum = 0;
      for (int d = 0; d < rows; ++d) sum = fma(P[c * kBlock + d], A[at(first + d, i)], sum);
      times_P[at(c, i)] = sum;
    }
  }

 private:
  KERF_HD std::size_t at(std::int32_t i, std::int32_t j) const {
    return static_cast<std::size_t>(i) * static_cast<std::size_t>(n) + static_cast<std::size_t>(j);
  }
};

/// One entry: a thread each.
struct Eliminate {
  std::int32_t n, first, rows;
  double* A;
  const double *P, *columns, *times_P;

  KERF_HD void operator()(std::int32_t index) const {
    const std::int32_t i = index / n, j = index % n;
    const std::int32_t row = i - first, column = j - first;
    const bool in_rows = row >= 0 && row < rows, in_columns = column >= 0 && column < rows;
    double value = in_rows || in_columns ? 0 : A[index];
    if (in_rows && in_columns) {
      value = P[row * kBlock + column];
    } else if (in_rows) {
      value = times_P[at(row, j)];
    } else if (in_columns) {
      for (int c = 0; c < rows; ++c) value = fma(-columns[at(c, i)], P[c * kBlock + column], value);
    } else {
      for (int c = 0; c < rows; ++c) value = fma(-columns[at(c, i)], times_P[at(c, j)], value);
    }
    A[index] = value;
  }

 private:
  KERF_HD std::size_t at(std::int32_t i, std::int32_t j) const {
    return static_cast<std::size_t>(i) * static_cast<std::size_t>(n) + static_cast<std::size_t>(j);
  }
};

/// Slice s of row i of the inverse times f; the inverse is symmetric, so that threads side by side
/// read entries side by side.
template <class T>
struct DenseSlice {
  std::int32_t n;
  const T* inverse;
  const T* f;
  T* slices;  ///< kSlices x n

  KERF_HD void operator()(std::int32_t index) const {
    const std::int32_t i = index % n, s = index / n;
    const std::int32_t length = (n + kSlices - 1) / kSlices;
    const std::int32_t begin = s * length, end = begin + length < n ? begin + length : n;
    T sum = T(0);
    for (std::int32_t j = begin; j < end; ++j)
      sum = fma(inverse[static_cast<std::size_t>(j) * static_cast<std::size_t>(n) +
                        static_cast<std::size_t>(i)],
                f[j], sum);
    slices[index] = sum;
  }
};

/// u = the sum of the slices; zero in held components.
template <class T>
struct DenseSum {
  std::int32_t n;
  const std::uint8_t* fixed;
  const T* slices;
  T* u;

  KERF_HD void operator()(std::int32_t i) const {
    T sum = T(0);
    for (int s = 0; s < kSlices; ++s) sum += slices[s * n + i];
    u[i] = ((fixed[i / 3] >> (i % 3)) & 1) != 0 ? T(0) : sum;
  }
};

}  // namespace kerf::gpu
