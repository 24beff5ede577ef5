// SPDX-License-Identifier: MIT
//
// Sparse Cholesky factorisation of one level: the coarsest level of the cycle, and the direct
// baseline on level 0. Symbolic work once per topology, numeric work once per set of values.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/levels/hierarchy.hpp"

namespace kerf {

/// Lower triangle of the assembled matrix of a level, by columns; unknown = 3 vertex + component.
/// Held components have a unit diagonal and nothing else.
class AssembledLevel {
 public:
  using ReadCell = std::function<void(std::int32_t cell, std::span<double> packed)>;

  explicit AssembledLevel(const Level& level);
  /// Sums the cell matrices (300 doubles each, kernels/layout.hpp) in the order of the cells.
  void assemble(const Level& level, const ReadCell& read_cell);
  /// For Galerkin matrices of a coarse level. Where supports hold most vertices of a few fine
  /// cells, fewer free ones are left than the coarse vertices above them, and the matrix is
  /// singular, though the body is held. A relative share of the diagonal makes it definite, if it
  /// is far above the rounding of the matrices; what it changes the transfer to the finer level
  /// sends to zero.
  void strengthen_diagonal(double share);
  static constexpr double kShare = 1e-12;  ///< of matrices in double

  int unknowns() const { return static_cast<int>(column_begin.size()) - 1; }
  std::vector<int> column_begin;  ///< per unknown + 1
  std::vector<int> row;           ///< ascending in a column, the diagonal first
  std::vector<double> value;

 private:
  int position(int row_vertex, int row_component, int column_vertex, int column_component) const;
  std::vector<int> block_begin_;  // per vertex + 1, into block_row_
  std::vector<int> block_row_;    // vertices >= the column's, ascending
};

enum class CholeskyEngine {
  simplicial,  ///< Eigen: the same bits everywhere, for the coarsest level
  supernodal,  ///< CHOLMOD where it was built in, else as simplicial; for large systems
};

class SparseCholesky {
 public:
  explicit SparseCholesky(CholeskyEngine engine);
  ~SparseCholesky();
  SparseCholesky(SparseCholesky&&) noexcept;
  SparseCholesky& operator=(SparseCholesky&&) noexcept;

  void analyse(const AssembledLevel& matrix);  ///< fill-reducing order, pattern of the factor
  /// @returns whether the matrix is positive definite beyond rounding; if not, there is no factor.
  bool factor(const AssembledLevel& matrix);
  void solve(std::span<const double> right, std::span<double> solution) const;
  std::size_t factor_entries() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// "CHOLMOD 3.0.14", or "Eigen" where CHOLMOD was switched off.
std::string supernodal_engine_name();

}  // namespace kerf
