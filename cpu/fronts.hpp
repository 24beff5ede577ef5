// SPDX-License-Identifier: MIT
//
// The structure of a sparse Cholesky factor in dense pieces: fronts, for the coarsest level.
//
// Vertices that are not connected are parted first. Connected ones are parted by a plane, the one
// with the fewest vertices between for what it parts; those on the far side that touch the near one
// lie between. So on with all parts. What is left in the end, and what lies between, is a front:
// its columns are eliminated together, from a dense matrix over them and over the rows below in
// which they, or the fronts below them, have entries.
//
// Layout  A front has its columns first, up to a multiple of four, then its rows; all up to a
//         multiple of eight: `height` places. What is between has ones on the diagonal and zeros
//         else.
// Source  [G73] for nested dissection, [DR83] for fronts.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/levels/hierarchy.hpp"
#include "core/solve/sparse_cholesky.hpp"

namespace kerf::cpu {

struct Front {
  /// A 3x3 block of the assembled level, or the lower triangle of one on the diagonal.
  struct Block {
    int value, length;  // where its first column begins, and how long the whole column is
    int row, column;    // places of its first entry here, row >= column
    bool transposed;    // whether it is so here

    /// Of the value in row r and column c: see AssembledLevel.
    int at(int r, int c) const { return value + c * length - c * (c + 1) / 2 + r; }
  };
  std::vector<int> vertices;   // columns: 3 times 3 * vertex + component
  std::vector<int> rows;       // vertices, each eliminated by a later front
  std::vector<int> row_place;  // per vertex in rows: the place of its x in the front above
  std::vector<Block> blocks;
  std::vector<int> below;  // fronts, rising
  std::size_t at = 0;      // of its columns in the factor
  int depth = 0;           // fronts below it have less

  int columns() const { return 3 * static_cast<int>(vertices.size()); }
  int padded_columns() const { return (columns() + 3) & ~3; }
  std::size_t entries_of_factor() const {
    return static_cast<std::size_t>(height()) * static_cast<std::size_t>(padded_columns());
  }
  int height() const { return (padded_columns() + 3 * static_cast<int>(rows.size()) + 7) & ~7; }
};

struct Fronts {
  std::vector<Front> all;                  // in the order of elimination
  std::vector<std::vector<int>> by_depth;  // those of one depth need nothing of each other
  std::size_t entries = 0;                 // of the factor
  /// For solving side by side: fronts that need nothing of other branches, each in the order of
  /// elimination, and those above them. No tree of several fronts in a branch has more than half of
  /// the entries; there are some twenty branches at the most.
  std::vector<std::vector<int>> branches;
  std::vector<int> trunk;

  Fronts() = default;
  Fronts(const Level& level, const AssembledLevel& matrix);

 private:
  void part();
};

}  // namespace kerf::cpu
