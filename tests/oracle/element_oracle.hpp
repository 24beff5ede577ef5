// SPDX-License-Identifier: MIT
//
// What one cell should be, computed the long way with Eigen. Shares no code with kernels/.
//
// Layout  Corner = x + 2 y + 4 z; unknown = 3 * corner + component.
#pragma once

#include <Eigen/Dense>

namespace kerf::oracle {

using Matrix3 = Eigen::Matrix3d;
using Matrix8 = Eigen::Matrix<double, 8, 8>;
using Matrix24 = Eigen::Matrix<double, 24, 24>;
using Vector3 = Eigen::Vector3d;
using Vector24 = Eigen::Matrix<double, 24, 1>;

/// Corner positions of a cube [0, side]^3.
Vector24 corner_positions(double side);

/// Stiffness of a cube of E = 1 by 3x3x3 Gauss points of B^T D B, Voigt order xx yy zz yz xz xy.
Matrix24 stiffness(double poisson, double side);

/// Consistent mass of a cube of density 1 by 3x3x3 Gauss points.
Matrix8 mass(double side);

/// [R] K [R]^T with R on all eight diagonal blocks.
Matrix24 rotated(const Matrix24& K, const Matrix3& R);

/// W (x) I_3.
Matrix24 expand(const Matrix8& W);

/// The proper rotation with the greatest tr(R^T F), by singular value decomposition.
Matrix3 best_rotation(const Matrix3& F);

/// The energy of section 5 of Dick, Georgii, Westermann 2011, by 3x3x3 Gauss points.
double rotation_energy(const Vector24& u, const Matrix3& R, double side);

/// Trilinear weights of the eight corners of [0, 1]^3 at a point of it.
Eigen::Matrix<double, 8, 1> trilinear_weights(const Vector3& at);

}  // namespace kerf::oracle
