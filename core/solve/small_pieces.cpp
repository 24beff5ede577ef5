// SPDX-License-Identifier: MIT
#include "core/solve/small_pieces.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>

#include "core/base/array.hpp"
#include "kernels/layout.hpp"

namespace kerf {
namespace {

using Matrix = Eigen::Map<Eigen::MatrixXd>;
using ConstMatrix = Eigen::Map<const Eigen::MatrixXd>;

/// What a pivot has to keep of its entry. Of one that should be zero rounding leaves 1e-15 to 3e-12
/// (a row of eight cells); a mass leaves more than 1e-10 in a time step of 20 ms, for a millimetre
/// of what is as stiff as bone.
constexpr double kLeastPivot = 1e-11;

/// Adds the matrix of a cell, packed, to the lower triangle. `place`: of its slots.
void add_cell(const std::array<double, kernels::kEntries>& packed, const std::array<int, 8>& place,
              Matrix& to) {
  for (int p = 0; p < 24; ++p)
    for (int q = 0; q <= p; ++q) {
      const int row = 3 * place[static_cast<std::size_t>(p / 3)] + p % 3;
      const int column = 3 * place[static_cast<std::size_t>(q / 3)] + q % 3;
      to(std::max(row, column), std::min(row, column)) +=
          packed[static_cast<std::size_t>(kernels::packed_index(p, q))];
    }
}

}  // namespace

void SmallPieces::set(const Level& finest, const std::vector<std::vector<std::int32_t>>& pieces) {
  constexpr std::uint8_t kAll = 7;
  finest_ = &finest;
  pieces_.clear();
  for (const std::vector<std::int32_t>& cells : pieces) {
    std::vector<std::int32_t> vertices;
    for (const std::int32_t c : cells)
      vertices.insert(vertices.end(), finest.slots[c].begin(), finest.slots[c].end());
    std::sort(vertices.begin(), vertices.end());
    vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
    if (std::all_of(vertices.begin(), vertices.end(),
                    [&](std::int32_t v) { return finest.fixed[v] == kAll; }))
      continue;
    pieces_.push_back({cells, std::move(vertices), {}});
  }
}

void SmallPieces::refresh(const Backend& backend) {
  std::array<double, kernels::kEntries> packed;
  std::array<int, 8> place;
  for (Piece& piece : pieces_) {
    const auto n = static_cast<Eigen::Index>(3 * piece.vertices.size());
    piece.factor.assign(static_cast<std::size_t>(n * n), 0.0);
    Matrix matrix(piece.factor.data(), n, n);
    const auto place_of = [&](std::int32_t v) {
      const auto found = std::lower_bound(piece.vertices.begin(), piece.vertices.end(), v);
      return static_cast<int>(found - piece.vertices.begin());
    };
    for (const std::int32_t cell : piece.cells) {
      backend.read_cell_matrix(0, cell, packed);
      const auto& slots = finest_->slots[cell];
      std::transform(slots.begin(), slots.end(), place.begin(), place_of);
      add_cell(packed, place, matrix);
    }
    for (Eigen::Index k = 0; k < n; ++k)
      if ((finest_->fixed[piece.vertices[static_cast<std::size_t>(k / 3)]] >> (k % 3)) & 1)
        matrix(k, k) = 1;
    const Eigen::VectorXd diagonal = matrix.diagonal();
    const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> factor(matrix);
    const bool is_definite =
        factor.info() == Eigen::Success &&
        (matrix.diagonal().array().square() > kLeastPivot * diagonal.array()).all();
    if (!is_definite) piece.factor.clear();
  }
}

std::vector<std::int32_t> SmallPieces::solved_vertices() const {
  std::vector<std::int32_t> out;
  for (const Piece& piece : pieces_)
    if (!piece.factor.empty()) out.insert(out.end(), piece.vertices.begin(), piece.vertices.end());
  return out;
}

void SmallPieces::clear(Backend& backend, int x) const {
  const std::vector<std::int32_t> vertices = solved_vertices();
  backend.write_some(0, x, vertices, std::vector<double>(3 * vertices.size()));
}

void SmallPieces::solve(Backend& backend, int b, int x) const {
  const std::vector<std::int32_t> vertices = solved_vertices();
  std::vector<double> values(3 * vertices.size());
  backend.read_some(0, b, vertices, values);
  double* at = values.data();
  for (const Piece& piece : pieces_) {
    if (piece.factor.empty()) continue;
    const auto n = static_cast<Eigen::Index>(3 * piece.vertices.size());
    const auto lower = ConstMatrix(piece.factor.data(), n, n).triangularView<Eigen::Lower>();
    Eigen::Map<Eigen::VectorXd> part(at, n);
    lower.solveInPlace(part);
    lower.adjoint().solveInPlace(part);
    at += n;
  }
  backend.write_some(0, x, vertices, values);
}

std::size_t SmallPieces::bytes() const {
  std::size_t out = bytes_of(pieces_);
  for (const Piece& piece : pieces_)
    out += bytes_of(piece.cells) + bytes_of(piece.vertices) + bytes_of(piece.factor);
  return out;
}

}  // namespace kerf
