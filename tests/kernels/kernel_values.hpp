// SPDX-License-Identifier: MIT
//
// Between the values of kernels/ and those of the oracle, and random ones from a fixed seed.
#pragma once

#include <random>
#include <vector>

#include "kernels/layout.hpp"
#include "kernels/mat3.hpp"
#include "tests/oracle/element_oracle.hpp"

namespace kerf::test {

template <class T>
struct CellVector {
  kernels::Vec3<T> at[kernels::kCorners];
};

template <class T>
CellVector<T> to_cell(const oracle::Vector24& v) {
  CellVector<T> out;
  for (int i = 0; i < 24; ++i) out.at[i / 3][i % 3] = static_cast<T>(v[i]);
  return out;
}

template <class T>
oracle::Vector24 to_eigen(const kernels::Vec3<T> (&v)[kernels::kCorners]) {
  oracle::Vector24 out;
  for (int i = 0; i < 24; ++i) out[i] = static_cast<double>(v[i / 3][i % 3]);
  return out;
}

template <class T>
kernels::Quat<T> to_quat(const Eigen::Quaterniond& q) {
  return {static_cast<T>(q.w()), static_cast<T>(q.x()), static_cast<T>(q.y()),
          static_cast<T>(q.z())};
}

template <class T>
kernels::Mat3<T> to_mat3(const oracle::Matrix3& a) {
  kernels::Mat3<T> out;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) out[i][j] = static_cast<T>(a(i, j));
  return out;
}

template <class T>
oracle::Matrix3 to_eigen(const kernels::Mat3<T>& a) {
  oracle::Matrix3 out;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) out(i, j) = static_cast<double>(a[i][j]);
  return out;
}

template <class T>
std::vector<T> to_packed(const oracle::Matrix24& a) {
  std::vector<T> out(kernels::kEntries);
  for (int row = 0, e = 0; row < 24; ++row)
    for (int col = 0; col <= row; ++col, ++e)
      out[static_cast<std::size_t>(e)] = static_cast<T>(a(row, col));
  return out;
}

template <class T>
oracle::Matrix24 from_packed(const std::vector<T>& packed) {
  oracle::Matrix24 out;
  for (int row = 0, e = 0; row < 24; ++row)
    for (int col = 0; col <= row; ++col, ++e)
      out(row, col) = out(col, row) = static_cast<double>(packed[static_cast<std::size_t>(e)]);
  return out;
}

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}

  double normal() { return normal_(engine_); }
  double uniform(double low, double high) {
    return low + (high - low) * std::generate_canonical<double, 53>(engine_);
  }
  oracle::Vector24 vector24() {
    return oracle::Vector24::NullaryExpr([this] { return normal(); });
  }
  oracle::Matrix3 matrix3() {
    return oracle::Matrix3::NullaryExpr([this] { return normal(); });
  }
  oracle::Matrix24 symmetric24() {
    const oracle::Matrix24 a = oracle::Matrix24::NullaryExpr([this] { return normal(); });
    return a + a.transpose();
  }
  Eigen::Quaterniond quaternion() {
    const double w = normal(), x = normal(), y = normal(), z = normal();
    return Eigen::Quaterniond(w, x, y, z).normalized();
  }
  oracle::Matrix3 rotation() { return quaternion().toRotationMatrix(); }

 private:
  std::mt19937_64 engine_;
  std::normal_distribution<double> normal_;
};

}  // namespace kerf::test
