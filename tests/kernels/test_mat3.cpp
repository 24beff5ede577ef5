// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <cmath>

#include "kernels/relax.hpp"
#include "tests/kernels/kernel_values.hpp"

namespace kerf::test {
namespace {

using kernels::Mat3;
using kernels::Quat;
using kernels::Sym3;
using kernels::Vec3;
using oracle::Matrix3;
using oracle::Vector3;

// A few roundings, grown by the condition number (at most 1e4 in these blocks).
constexpr double kInverseTolerance = 1e-11;
constexpr double kRoundOff = 1e-14;

Sym3<double> to_sym3(const Matrix3& a) { return lower_triangle(to_mat3<double>(a)); }

TEST(Sym3, InverseOfDefiniteBlocksIsTheInverse) {
  Random random(1);
  for (int trial = 0; trial < 1000; ++trial) {
    const Matrix3 R = random.rotation();
    const Vector3 d(1.0, random.uniform(1e-4, 1), random.uniform(1e-4, 1));
    const Matrix3 A = std::pow(10.0, random.uniform(-12, 12)) * R * d.asDiagonal() * R.transpose();

    const Matrix3 G = to_eigen(inverse_semidefinite(to_sym3(A)).full());

    ASSERT_LT((A * G - Matrix3::Identity()).norm(), kInverseTolerance);
  }
}

TEST(Sym3, InactiveComponentsYieldZeroRows) {
  Random random(2);
  for (int inactive = 0; inactive < 8; ++inactive) {
    Vector3 keep;
    for (int a = 0; a < 3; ++a) keep[a] = (inactive >> a & 1) != 0 ? 0.0 : 1.0;
    const Matrix3 B = random.matrix3();
    const Matrix3 A = keep.asDiagonal() * (B * B.transpose()) * keep.asDiagonal();

    const Matrix3 G = to_eigen(inverse_semidefinite(to_sym3(A)).full());

    for (int a = 0; a < 3; ++a)
      if (keep[a] == 0.0) {
        EXPECT_EQ(G.row(a).norm(), 0.0);
        EXPECT_EQ(G.col(a).norm(), 0.0);
      }
    EXPECT_LE((A * G * A - A).norm(), kInverseTolerance * A.norm());
    EXPECT_LT((G - G.transpose()).norm(), kRoundOff * (1.0 + G.norm()));
  }
}

TEST(Sym3, RankDeficientBlocksYieldAGeneralisedInverse) {
  Random random(3);
  for (int rank = 0; rank <= 2; ++rank)
    for (int trial = 0; trial < 300; ++trial) {
      Matrix3 A = Matrix3::Zero();
      for (int k = 0; k < rank; ++k) {
        Vector3 v(random.normal(), random.normal(), random.normal());
        if (trial % 3 == 0) v[trial / 3 % 3] = 0.0;
        A += v * v.transpose();
      }

      const Matrix3 G = to_eigen(inverse_semidefinite(to_sym3(A)).full());

      ASSERT_TRUE(G.allFinite());
      ASSERT_LE((A * G * A - A).norm(), kInverseTolerance * A.norm()) << "rank " << rank;
    }
}

TEST(RelaxVertex, SolvesItsBlockAndHonoursOmega) {
  Random random(4);
  const Matrix3 B = random.matrix3();
  const Matrix3 A = B * B.transpose() + Matrix3::Identity();
  const Vector3 r(1.0, -2.0, 3.0), u(0.5, 0.25, -1.0);
  const Vector3 expected = u + 1.3 * A.ldlt().solve(r);

  const Vec3<double> by_matrix = relax_vertex(
      Vec3<double>{u[0], u[1], u[2]}, Vec3<double>{r[0], r[1], r[2]}, to_mat3<double>(A), 1.3);
  const Vec3<double> by_inverse =
      relax_vertex(Vec3<double>{u[0], u[1], u[2]}, Vec3<double>{r[0], r[1], r[2]},
                   inverse_semidefinite(to_sym3(A)), 1.3);

  for (int a = 0; a < 3; ++a) {
    EXPECT_NEAR(by_matrix[a], expected[a], kInverseTolerance);
    EXPECT_EQ(by_inverse[a], by_matrix[a]);
  }
}

TEST(Sym3, TurnsAsItsFullMatrixDoes) {
  Random random(6);
  for (int trial = 0; trial < 100; ++trial) {
    const Matrix3 B = random.matrix3(), A = B + B.transpose();
    const Matrix3 R = random.quaternion().toRotationMatrix();
    const Matrix3 found = to_eigen(turned(to_mat3<double>(R), to_sym3(A)).full());
    EXPECT_LT((found - R * A * R.transpose()).norm(), kRoundOff * A.norm());
  }
}

TEST(Quat, MatrixAndProductAgreeWithEigen) {
  Random random(5);
  for (int trial = 0; trial < 100; ++trial) {
    const Eigen::Quaterniond a = random.quaternion(), b = random.quaternion();
    const Quat<double> qa{a.w(), a.x(), a.y(), a.z()}, qb{b.w(), b.x(), b.y(), b.z()};

    EXPECT_LT((to_eigen(to_matrix(qa)) - a.toRotationMatrix()).norm(), kRoundOff);
    EXPECT_LT((to_eigen(to_matrix(qa * qb)) - (a * b).toRotationMatrix()).norm(), kRoundOff);
  }
}

TEST(Quat, NormalisedNeverYieldsNaN) {
  const double inf = HUGE_VAL, nan = std::nan("");
  const Quat<double> one{1, 0, 0, 0};
  EXPECT_EQ(normalised(Quat<double>{0, 0, 0, 0}), one);
  EXPECT_EQ(normalised(Quat<double>{nan, 0, 1, 0}), one);
  EXPECT_EQ(normalised(Quat<double>{inf, 0, 1, 0}), one);
  EXPECT_EQ(normalised(Quat<double>{0, 3, 0, 4}), (Quat<double>{0, 0.6000000000000001, 0, 0.8}));
}

}  // namespace
}  // namespace kerf::test
