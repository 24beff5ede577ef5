// SPDX-License-Identifier: MIT
#include "core/fem/held.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

#include "core/base/error.hpp"

namespace kerf {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

struct Piece {
  Box3 box;  // m
  std::int32_t cells = 0, first = -1;
  double volume = 0;               // finest cells
  bool met = false;                // some component of some vertex is held
  Matrix6 gram = Matrix6::Zero();  // of what the held components see of the six rigid motions
};

std::size_t piece_of(const Level& level, std::span<const std::int32_t> piece, std::int32_t vertex) {
  return static_cast<std::size_t>(piece[level.incidences_of(vertex)[0] / 8]);
}

std::vector<Piece> measure(const Lattice& lattice, const Level& level,
                           std::span<const std::int32_t> piece, std::size_t pieces) {
  std::vector<Piece> out(pieces);
  for (std::int32_t c = 0; c < level.cells(); ++c) {
    Piece& p = out[piece[c]];
    if (p.first < 0) p.first = c;
    ++p.cells;
    p.volume += std::ldexp(1.0, 3 * level.size_log2[c]);
    const double side = lattice.spacing * (1 << level.size_log2[c]);
    const Vec3d low = lattice.point(level.corner[c]);
    p.box.add(low);
    p.box.add(low + Vec3d{side, side, side});
  }
  for (std::int32_t v = 0; v < level.vertices(); ++v) {
    if (level.fixed[v] == 0) continue;
    Piece& p = out[piece_of(level, piece, v)];
    p.met = true;
    const double size = norm(p.box.extent());
    const Vec3d arm =
        (1 / size) * (lattice.point(level.point[v]) - 0.5 * p.box.lo - 0.5 * p.box.hi);
    for (int c = 0; c < 3; ++c) {
      if (((level.fixed[v] >> c) & 1) == 0) continue;
      Vec3d direction{};
      direction[c] = 1;
      const Vec3d turn = cross(arm, direction);
      Vector6 row;
      row << direction.x, direction.y, direction.z, turn.x, turn.y, turn.z;
      p.gram += row * row.transpose();
    }
  }
  return out;
}

bool holds_all_motions(const Matrix6& gram) {
  // A support of one cell on a body of a thousand holds turns by some 1e-6 of slides; rounding
  // leaves 1e-15.
  constexpr double kFree = 1e-11;
  const Vector6 values = Eigen::SelfAdjointEigenSolver<Matrix6>(gram).eigenvalues();
  return values[0] > kFree * values[5];
}

[[noreturn]] void throw_free(const Lattice& lattice, const Level& level, const Piece& piece,
                             std::size_t number, std::size_t pieces) {
  const Vec3d at = lattice.point(level.corner[piece.first]);
  throw Error(ErrorKind::bad_input,
              text("static mode: piece ", number, " of ", pieces, " (", piece.cells,
                   " cells, near x = ", at.x, ", y = ", at.y, ", z = ", at.z, " m) is held by ",
                   piece.met ? "supports that let it slide or turn" : "no support",
                   ", so it has no equilibrium of its own; hold it with a [[support]], keep the "
                   "cut from separating it, or use time.mode = \"dynamic\""));
}

}  // namespace

FrozenCrumbs hold_crumbs(const Lattice& lattice, std::span<const std::int32_t> piece,
                         std::size_t pieces, Level& level) {
  constexpr double kCrumb = 1e-3;  // of the volume of the body
  std::vector<Piece> all = measure(lattice, level, piece, pieces);
  double volume = 0;
  for (const Piece& p : all) volume += p.volume;
  FrozenCrumbs out;
  std::vector<char> frozen(pieces, 0);
  std::int32_t cells = 0;
  for (std::size_t p = 0; p < pieces; ++p) {
    if (all[p].met && holds_all_motions(all[p].gram)) continue;
    if (all[p].volume > kCrumb * volume) throw_free(lattice, level, all[p], p, pieces);
    frozen[p] = 1;
    ++out.pieces;
    cells += all[p].cells;
  }
  if (out.pieces == 0) return out;
  for (std::int32_t v = 0; v < level.vertices(); ++v) {
    if (frozen[piece_of(level, piece, v)] == 0) continue;
    for (std::size_t c = 0; c < 3; ++c)
      if (((level.fixed[v] >> c) & 1) == 0)
        out.components.push_back(3 * static_cast<std::size_t>(v) + c);
    level.fixed[v] = 7;
  }
  out.warning = text("static mode: ", out.pieces, " crumbs of ", cells,
                     " cells in all hang on nothing and stay where they are; a finer "
                     "body.resolution or another path of the blade avoids them");
  return out;
}

}  // namespace kerf
