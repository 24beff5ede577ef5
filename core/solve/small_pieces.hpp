// SPDX-License-Identifier: MIT
//
// Pieces of a few cells, which are solved for directly.
//
// A tolerance relative to the whole body is nothing to a crumb: an error of 1e-4 of all forces is a
// few per cent of its weight, every step, and a piece that nothing holds turns it into spin. Nor do
// cycles serve it well: it is a corner of ever larger coarse cells, which extrapolate it. So its
// part of the solution, with which no other piece has to do on level 0, comes from a factor of its
// own.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/backend.hpp"

namespace kerf {

class SmallPieces {
 public:
  /// The cells of each. Those that are held altogether are left out.
  ///
  /// Needs  that no vertex of a piece is of a cell that it does not have.
  void set(const Level& finest, const std::vector<std::vector<std::int32_t>>& pieces);
  /// Of the operator and the rotations that the backend has. A piece whose matrix is not positive
  /// definite, that of one that may move freely without a mass, is left to others.
  void refresh(const Backend& backend);

  bool empty() const { return pieces_.empty(); }
  /// x = A^-1 b at the vertices of these pieces, as far as they have factors.
  void solve(Backend& backend, int b, int x) const;
  /// x = 0 there.
  void clear(Backend& backend, int x) const;
  std::size_t bytes() const;

 private:
  struct Piece {
    std::vector<std::int32_t> cells;
    std::vector<std::int32_t> vertices;  // ascending
    std::vector<double> factor;          // n by n, its lower triangle by columns; empty: none
  };

  std::vector<std::int32_t> solved_vertices() const;

  const Level* finest_ = nullptr;
  std::vector<Piece> pieces_;
};

}  // namespace kerf
