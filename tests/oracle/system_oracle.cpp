// SPDX-License-Identifier: MIT
#include "tests/oracle/system_oracle.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/SparseCholesky>
#include <cmath>
#include <map>
#include <numbers>
#include <stdexcept>

namespace kerf::oracle {
namespace {

using Triplets = std::vector<Eigen::Triplet<double>>;

bool held(const std::vector<std::uint8_t>& fixed, Eigen::Index unknown) {
  return ((fixed[static_cast<std::size_t>(unknown / 3)] >> (unknown % 3)) & 1) != 0;
}

/// Free unknowns in order, and the place of each unknown among them.
struct Free {
  explicit Free(const std::vector<std::uint8_t>& fixed) : place(3 * fixed.size(), -1) {
    for (std::size_t i = 0; i < place.size(); ++i)
      if (!held(fixed, static_cast<Eigen::Index>(i))) {
        place[i] = static_cast<int>(unknown.size());
        unknown.push_back(static_cast<int>(i));
      }
  }
  std::vector<int> unknown, place;
};

/// The eight corners of a cell from the vertices.
Vector24 corner_values(const std::array<Weights, 8>& corners, const Vector& u) {
  Vector24 out = Vector24::Zero();
  for (int i = 0; i < 8; ++i)
    for (const auto& [v, w] : corners[static_cast<std::size_t>(i)])
      out.segment<3>(3 * i) += w * u.segment<3>(3 * v);
  return out;
}

/// Adds W^T A W with W from the vertices to the corners.
void scatter(const Matrix24& A, const std::array<Weights, 8>& corners, Triplets& out) {
  for (int i = 0; i < 8; ++i)
    for (const auto& [v, wv] : corners[static_cast<std::size_t>(i)])
      for (int j = 0; j < 8; ++j)
        for (const auto& [w, ww] : corners[static_cast<std::size_t>(j)])
          for (int a = 0; a < 3; ++a)
            for (int b = 0; b < 3; ++b)
              out.emplace_back(3 * v + a, 3 * w + b, wv * ww * A(3 * i + a, 3 * j + b));
}

Sparse from_triplets(Eigen::Index rows, Eigen::Index columns, const Triplets& triplets) {
  Sparse A(rows, columns);
  A.setFromTriplets(triplets.begin(), triplets.end());
  return A;
}

/// Stiffness of E = 1 and mass of density 1, by Poisson ratio and side.
class Elements {
 public:
  explicit Elements(bool lumped) : lumped_(lumped) {}
  const Matrix24& K(double poisson, double side) {
    const auto [at, fresh] = K_.try_emplace({poisson, side});
    if (fresh) at->second = stiffness(poisson, side);
    return at->second;
  }
  const Matrix24& M(double side) {
    const auto [at, fresh] = M_.try_emplace(side);
    if (fresh)
      at->second =
          lumped_ ? Matrix24(side * side * side / 8 * Matrix24::Identity()) : expand(mass(side));
    return at->second;
  }

 private:
  bool lumped_;
  std::map<std::pair<double, double>, Matrix24> K_;
  std::map<double, Matrix24> M_;
};

}  // namespace

Vector masked(const Vector& x, const std::vector<std::uint8_t>& fixed) {
  Vector out = x;
  for (Eigen::Index i = 0; i < x.size(); ++i)
    if (held(fixed, i)) out(i) = 0;
  return out;
}

Sparse masked(const Sparse& A, const std::vector<std::uint8_t>& rows,
              const std::vector<std::uint8_t>& columns) {
  Sparse out = A;
  out.prune([&](Eigen::Index row, Eigen::Index column, double) {
    return !held(rows, row) && !held(columns, column);
  });
  return out;
}

std::vector<Matrix3> rotations(const Grid& grid, const Physics& physics, const Vector& u) {
  std::vector<Matrix3> out;
  for (std::size_t c = 0; c < grid.cells.size(); ++c) {
    const double side = physics.spacing * grid.cells[c].size;
    const Vector24 x = corner_positions(side) + corner_values(grid.corner[c], u);
    Matrix3 F = Matrix3::Zero();
    for (int axis = 0; axis < 3; ++axis)  // the mean over four edges
      for (int i = 0; i < 8; ++i)
        if ((i >> axis) & 1)
          F.col(axis) += (x.segment<3>(3 * i) - x.segment<3>(3 * (i ^ (1 << axis)))) / (4 * side);
    out.push_back(best_rotation(F));
  }
  return out;
}

Sparse assemble(const Grid& grid, const Physics& physics, const std::vector<Matrix3>& R,
                const OperatorScale& scale) {
  Elements elements(physics.lumped_mass);
  Triplets triplets;
  for (std::size_t c = 0; c < grid.cells.size(); ++c) {
    const double side = physics.spacing * grid.cells[c].size;
    const Material& m = physics.materials[physics.material[c]];
    const Matrix24 A = scale.stiffness * m.young * rotated(elements.K(m.poisson, side), R[c]) +
                       scale.mass * m.density * elements.M(side);
    scatter(A, grid.corner[c], triplets);
  }
  const auto n = 3 * static_cast<Eigen::Index>(grid.point.size());
  return from_triplets(n, n, triplets);
}

Vector elastic_force(const Grid& grid, const Physics& physics, const std::vector<Matrix3>& R,
                     const Vector& u) {
  Elements elements(physics.lumped_mass);
  Vector out = Vector::Zero(u.size());
  for (std::size_t c = 0; c < grid.cells.size(); ++c) {
    const double side = physics.spacing * grid.cells[c].size;
    const Material& m = physics.materials[physics.material[c]];
    const Vector24 x = corner_positions(side), now = x + corner_values(grid.corner[c], u);
    Vector24 back, forth;
    for (int i = 0; i < 8; ++i)
      back.segment<3>(3 * i) = R[c].transpose() * now.segment<3>(3 * i) - x.segment<3>(3 * i);
    const Vector24 f = m.young * elements.K(m.poisson, side) * back;
    for (int i = 0; i < 8; ++i) forth.segment<3>(3 * i) = R[c] * f.segment<3>(3 * i);
    for (int i = 0; i < 8; ++i)
      for (const auto& [v, w] : grid.corner[c][static_cast<std::size_t>(i)])
        out.segment<3>(3 * v) += w * forth.segment<3>(3 * i);
  }
  return out;
}

Sparse prolongation_matrix(const Grid& fine, const Grid& coarse) {
  const std::vector<Weights> weights = prolongation(fine, coarse);
  Triplets triplets;
  for (std::size_t v = 0; v < weights.size(); ++v)
    for (const auto& [m, w] : weights[v])
      for (int c = 0; c < 3; ++c) triplets.emplace_back(3 * static_cast<int>(v) + c, 3 * m + c, w);
  return from_triplets(3 * static_cast<Eigen::Index>(fine.point.size()),
                       3 * static_cast<Eigen::Index>(coarse.point.size()), triplets);
}

Sparse assemble_stored(const Backend& backend, int number, const Level& level) {
  Triplets triplets;
  std::vector<double> packed(300);
  for (std::int32_t c = 0; c < level.cells(); ++c) {
    backend.read_cell_matrix(number, c, packed);
    std::size_t at = 0;
    for (int row = 0; row < 24; ++row)
      for (int column = 0; column <= row; ++column, ++at) {
        const int p = 3 * level.slots[c][row / 3] + row % 3;
        const int q = 3 * level.slots[c][column / 3] + column % 3;
        triplets.emplace_back(p, q, packed[at]);
        if (row != column) triplets.emplace_back(q, p, packed[at]);
      }
  }
  const auto n = 3 * static_cast<Eigen::Index>(level.point.size());
  return from_triplets(n, n, triplets);
}

Sparse inverse_diagonal(const Sparse& A, const std::vector<std::uint8_t>& fixed) {
  Triplets triplets;
  for (int v = 0; v < A.rows() / 3; ++v) {
    std::vector<int> free;
    for (int c = 0; c < 3; ++c)
      if (!held(fixed, 3 * v + c)) free.push_back(3 * v + c);
    const auto n = static_cast<Eigen::Index>(free.size());
    if (n == 0) continue;
    Eigen::MatrixXd block(n, n);
    for (Eigen::Index i = 0; i < n; ++i)
      for (Eigen::Index j = 0; j < n; ++j) block(i, j) = A.coeff(free[i], free[j]);
    const Eigen::MatrixXd inverse = block.inverse();
    for (Eigen::Index i = 0; i < n; ++i)
      for (Eigen::Index j = 0; j < n; ++j) triplets.emplace_back(free[i], free[j], inverse(i, j));
  }
  return from_triplets(A.rows(), A.rows(), triplets);
}

void gauss_seidel(const Sparse& A, const Sparse& inverse, const std::vector<std::int32_t>& order,
                  double omega, const Vector& f, Vector& u) {
  for (const std::int32_t v : order) {
    Vector3 r = f.segment<3>(3 * v);
    for (int c = 0; c < 3; ++c) r(c) -= A.col(3 * v + c).dot(u);  // A is symmetric
    for (int c = 0; c < 3; ++c) {
      double step = 0;
      for (int d = 0; d < 3; ++d) step += inverse.coeff(3 * v + c, 3 * v + d) * r(d);
      u(3 * v + c) += omega * step;
    }
  }
}

void chebyshev(const Sparse& A, const Sparse& inverse, double lower, double upper, int degree,
               const Vector& f, Vector& u) {
  for (int k = 0; k < degree; ++k) {
    const double root = 0.5 * (upper + lower) +
                        0.5 * (upper - lower) * std::cos(std::numbers::pi * (k + 0.5) / degree);
    const Vector r = f - A * u;
    u += inverse * r / root;
  }
}

Vector eigenvalues(const Eigen::MatrixXd& A) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(A, Eigen::EigenvaluesOnly).eigenvalues();
}

double largest_eigenvalue(const Sparse& A, const std::vector<std::uint8_t>& fixed) {
  const Free free(fixed);
  const auto n = static_cast<Eigen::Index>(free.unknown.size());
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(n, n), D = Eigen::MatrixXd::Zero(n, n);
  for (int column = 0; column < A.outerSize(); ++column)
    for (Sparse::InnerIterator it(A, column); it; ++it) {
      const int row = static_cast<int>(it.row()), i = free.place[row], j = free.place[column];
      if (i < 0 || j < 0) continue;
      dense(i, j) = it.value();
      if (row / 3 == column / 3) D(i, j) = it.value();
    }
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> solver(
      dense, D, Eigen::EigenvaluesOnly | Eigen::Ax_lBx);
  return solver.eigenvalues().maxCoeff();
}

Vector solve(const Sparse& A, const std::vector<std::uint8_t>& fixed, const Vector& f) {
  const Free free(fixed);
  Triplets triplets;
  for (int column = 0; column < A.outerSize(); ++column)
    for (Sparse::InnerIterator it(A, column); it; ++it) {
      const int i = free.place[static_cast<std::size_t>(it.row())], j = free.place[column];
      if (i >= 0 && j >= 0) triplets.emplace_back(i, j, it.value());
    }
  const auto n = static_cast<Eigen::Index>(free.unknown.size());
  Vector right(n);
  for (Eigen::Index i = 0; i < n; ++i) right(i) = f(free.unknown[i]);
  const Sparse reduced = from_triplets(n, n, triplets);
  const Eigen::SimplicialLDLT<Sparse> solver(reduced);
  if (solver.info() != Eigen::Success) throw std::runtime_error("the oracle's matrix is singular");
  Vector x = solver.solve(right);
  x += solver.solve(right - reduced * x);  // one step of refinement
  Vector out = Vector::Zero(f.size());
  for (Eigen::Index i = 0; i < n; ++i) out(free.unknown[i]) = x(i);
  return out;
}

}  // namespace kerf::oracle
