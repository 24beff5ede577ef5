// SPDX-License-Identifier: MIT
#include "tests/oracle/element_oracle.hpp"

#include <array>
#include <cmath>

namespace kerf::oracle {
namespace {

struct GaussPoint {
  Vector3 at;     // in [0, 1]^3
  double weight;  // sums to 1
};

std::array<GaussPoint, 27> gauss_points() {
  const double offset = 0.5 * std::sqrt(0.6);
  const std::array<double, 3> at{0.5 - offset, 0.5, 0.5 + offset};
  const std::array<double, 3> weight{5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0};
  std::array<GaussPoint, 27> points;
  std::size_t n = 0;
  for (std::size_t z = 0; z < 3; ++z)
    for (std::size_t y = 0; y < 3; ++y)
      for (std::size_t x = 0; x < 3; ++x)
        points[n++] = {{at[x], at[y], at[z]}, weight[x] * weight[y] * weight[z]};
  return points;
}

Vector3 corner(int i) { return {double(i % 2), double(i / 2 % 2), double(i / 4)}; }

/// Gradients of the shape functions with respect to the unit coordinates.
Eigen::Matrix<double, 3, 8> gradients(const Vector3& at) {
  Eigen::Matrix<double, 3, 8> g;
  for (int i = 0; i < 8; ++i) {
    const Vector3 sign = 2.0 * corner(i) - Vector3::Ones();
    const Vector3 value = 0.5 * (Vector3::Ones() - sign) + sign.cwiseProduct(at);
    g.col(i) << sign.x() * value.y() * value.z(), value.x() * sign.y() * value.z(),
        value.x() * value.y() * sign.z();
  }
  return g;
}

}  // namespace

Vector24 corner_positions(double side) {
  Vector24 x;
  for (int i = 0; i < 8; ++i) x.segment<3>(3 * i) = side * corner(i);
  return x;
}

Eigen::Matrix<double, 8, 1> trilinear_weights(const Vector3& at) {
  Eigen::Matrix<double, 8, 1> w;
  for (int i = 0; i < 8; ++i) {
    w[i] = 1.0;
    for (int a = 0; a < 3; ++a) w[i] *= corner(i)[a] > 0.5 ? at[a] : 1.0 - at[a];
  }
  return w;
}

Matrix24 stiffness(double poisson, double side) {
  Eigen::Matrix<double, 6, 6> D = Eigen::Matrix<double, 6, 6>::Zero();
  D.topLeftCorner<3, 3>().setConstant(poisson);
  D.diagonal().head<3>().setConstant(1.0 - poisson);
  D.diagonal().tail<3>().setConstant(0.5 - poisson);
  D /= (1.0 + poisson) * (1.0 - 2.0 * poisson);

  Matrix24 K = Matrix24::Zero();
  for (const GaussPoint& point : gauss_points()) {
    const auto g = (gradients(point.at) / side).eval();
    Eigen::Matrix<double, 6, 24> B = Eigen::Matrix<double, 6, 24>::Zero();
    for (int i = 0; i < 8; ++i) {
      const double x = g(0, i), y = g(1, i), z = g(2, i);
      B.block<6, 3>(0, 3 * i) << x, 0, 0, 0, y, 0, 0, 0, z, 0, z, y, z, 0, x, y, x, 0;
    }
    K += point.weight * side * side * side * B.transpose() * D * B;
  }
  return K;
}

Matrix8 mass(double side) {
  Matrix8 M = Matrix8::Zero();
  for (const GaussPoint& point : gauss_points()) {
    const auto N = trilinear_weights(point.at);
    M += point.weight * side * side * side * N * N.transpose();
  }
  return M;
}

Matrix24 rotated(const Matrix24& K, const Matrix3& R) {
  Matrix24 big = Matrix24::Zero();
  for (int i = 0; i < 8; ++i) big.block<3, 3>(3 * i, 3 * i) = R;
  return big * K * big.transpose();
}

Matrix24 expand(const Matrix8& W) {
  Matrix24 big = Matrix24::Zero();
  for (int i = 0; i < 8; ++i)
    for (int j = 0; j < 8; ++j) big.block<3, 3>(3 * i, 3 * j) = W(i, j) * Matrix3::Identity();
  return big;
}

Matrix3 best_rotation(const Matrix3& F) {
  const Eigen::JacobiSVD<Matrix3> svd(F, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0 ? -1.0 : 1.0;
  return svd.matrixU() * Vector3(1.0, 1.0, sign).asDiagonal() * svd.matrixV().transpose();
}

double rotation_energy(const Vector24& u, const Matrix3& R, double side) {
  const Vector24 x = corner_positions(side);
  Eigen::Matrix<double, 3, 8> rest, deformed;
  for (int i = 0; i < 8; ++i) {
    rest.col(i) = x.segment<3>(3 * i);
    deformed.col(i) = x.segment<3>(3 * i) + u.segment<3>(3 * i);
  }
  Vector3 c0 = Vector3::Zero(), c = Vector3::Zero();
  for (const GaussPoint& point : gauss_points()) {
    c0 += point.weight * rest * trilinear_weights(point.at);
    c += point.weight * deformed * trilinear_weights(point.at);
  }
  double energy = 0.0;
  for (const GaussPoint& point : gauss_points()) {
    const auto N = trilinear_weights(point.at);
    const Vector3 d = R.transpose() * (deformed * N - c) - (rest * N - c0);
    energy += point.weight * side * side * side * d.squaredNorm();
  }
  return energy;
}

}  // namespace kerf::oracle
