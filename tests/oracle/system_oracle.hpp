// SPDX-License-Identifier: MIT
//
// The matrices and vectors of a body as global Eigen objects. Shares no code with kernels/,
// core/levels/ and core/solve/; unknown = 3 vertex + component.
#pragma once

#include <Eigen/Sparse>
#include <cstdint>
#include <span>
#include <vector>

#include "core/backend.hpp"
#include "tests/oracle/element_oracle.hpp"
#include "tests/oracle/levels_oracle.hpp"

namespace kerf::oracle {

using Sparse = Eigen::SparseMatrix<double>;
using Vector = Eigen::VectorXd;

struct Material {
  double young, poisson, density;
};

/// What the finest level is made of.
struct Physics {
  double spacing = 0;  ///< side of a finest cell, m
  std::vector<Material> materials;
  std::vector<std::uint8_t> material;  ///< per cell
  bool lumped_mass = false;
};

/// Zero in held components.
Vector masked(const Vector& x, const std::vector<std::uint8_t>& fixed);
Sparse masked(const Sparse& A, const std::vector<std::uint8_t>& rows,
              const std::vector<std::uint8_t>& columns);

/// The proper rotation nearest to the mean deformation gradient of each cell.
std::vector<Matrix3> rotations(const Grid& grid, const Physics& physics, const Vector& u);

/// scale.stiffness [R] K [R]^T + scale.mass M, hanging corners interpolated, nothing held.
Sparse assemble(const Grid& grid, const Physics& physics, const std::vector<Matrix3>& R,
                const OperatorScale& scale);

/// sum of [R] K ([R]^T (x + u) - x).
Vector elastic_force(const Grid& grid, const Physics& physics, const std::vector<Matrix3>& R,
                     const Vector& u);

/// P, unknowns of `fine` by unknowns of `coarse`; nothing held.
Sparse prolongation_matrix(const Grid& fine, const Grid& coarse);

/// A level's matrix from what a backend keeps of each cell (300 scalars, rows of a lower triangle).
Sparse assemble_stored(const Backend& backend, int number, const Level& level);

/// 3x3 diagonal blocks, inverted on the components that are not held.
Sparse inverse_diagonal(const Sparse& A, const std::vector<std::uint8_t>& fixed);

/// One sweep over the vertices in the given order, each seeing the values before it.
void gauss_seidel(const Sparse& A, const Sparse& inverse, const std::vector<std::int32_t>& order,
                  double omega, const Vector& f, Vector& u);

/// The polynomial of given degree that is least on [lower, upper] and 1 at 0, of D^-1 A, on the
/// error: step k is Richardson's with the k-th root.
void chebyshev(const Sparse& A, const Sparse& inverse, double lower, double upper, int degree,
               const Vector& f, Vector& u);

/// Of a symmetric matrix, ascending. Here, since each file that has such a solver takes ten seconds
/// to compile.
Vector eigenvalues(const Eigen::MatrixXd& A);

/// Largest eigenvalue of D^-1 A over the components that are not held.
double largest_eigenvalue(const Sparse& A, const std::vector<std::uint8_t>& fixed);

/// A u = f over the components that are not held; zero in the others.
Vector solve(const Sparse& A, const std::vector<std::uint8_t>& fixed, const Vector& f);

}  // namespace kerf::oracle
