// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "kernels/rotation.hpp"
#include "tests/kernels/kernel_values.hpp"
#include "tests/oracle/system_oracle.hpp"

namespace kerf::test {
namespace {

using kernels::Mat3;
using kernels::Quat;
using oracle::Matrix3;
using oracle::Vector24;
using oracle::Vector3;

// Rounding of a 3x3 product chain; the rotation itself is only as sharp as the gap (see gap_of).
constexpr double kTrace = 2e-14;
constexpr double kProper = 1e-14;
constexpr double kTraceSingle = 1e-5;
constexpr double kPi = 3.14159265358979323846;

double trace_of(const Matrix3& R, const Matrix3& F) { return (R.transpose() * F).trace(); }

/// How sharply the best rotation is defined: least eigenvalue of tr(S) I - S over |F|.
double gap_of(const Matrix3& F) {
  const Matrix3 S = oracle::best_rotation(F).transpose() * F;
  const Matrix3 H = S.trace() * Matrix3::Identity() - 0.5 * (S + S.transpose());
  return oracle::eigenvalues(H)[0] / F.norm();
}

/// Asserts that R is proper and as good as the oracle's, and equal to it where that is defined.
template <class T>
void expect_best(const Matrix3& F, const Quat<T>& start, double tolerance) {
  const Matrix3 R = to_eigen(to_matrix(extract_rotation(to_mat3<T>(F), start)));
  const Matrix3 expected = oracle::best_rotation(F);
  ASSERT_TRUE(R.allFinite()) << F;
  ASSERT_LT((R.transpose() * R - Matrix3::Identity()).norm(), tolerance) << F;
  ASSERT_GT(R.determinant(), 0.5) << F;
  ASSERT_LT(std::abs(trace_of(R, F) - trace_of(expected, F)), tolerance * F.norm()) << F;
  const double gap = gap_of(F);
  ASSERT_LT((R - expected).norm() * gap, tolerance) << F << "\ngap " << gap;
}

TEST(MeanGradient, IsExactForLinearFields) {
  Random random(20);
  for (const double side : {0.01, 1.0, 3.0}) {
    const Matrix3 G = random.matrix3();
    const Vector24 x = oracle::corner_positions(side);
    CellVector<double> u;
    for (int i = 0; i < 8; ++i) {
      const Vector3 ui = G * x.segment<3>(3 * i) + Vector3(1, 2, 3);
      u.at[i] = {ui[0], ui[1], ui[2]};
    }
    const Matrix3 F = to_eigen(mean_gradient(u.at, side));
    EXPECT_LT((F - Matrix3::Identity() - G).norm(), 1e-12);  // 1 / side grows the rounding of u
  }
}

TEST(MeanGradient, ItsPolarFactorHasTheLeastEnergyOfAnyRotation) {
  Random random(21);
  const double side = 0.7;
  for (int trial = 0; trial < 50; ++trial) {
    const Vector24 u = random.uniform(0.05, 2.0) * random.vector24();
    CellVector<double> v = to_cell<double>(u);
    const Quat<double> q =
        extract_rotation(mean_gradient(v.at, side), to_quat<double>(random.quaternion()));
    const double least = oracle::rotation_energy(u, to_eigen(to_matrix(q)), side);
    for (int other = 0; other < 50; ++other) {
      const Vector3 axis = Vector3(random.normal(), random.normal(), random.normal()).normalized();
      const double angle = std::pow(10.0, random.uniform(-3, 0.5));
      const Matrix3 R = to_eigen(to_matrix(q)) * Eigen::AngleAxisd(angle, axis).toRotationMatrix();
      ASSERT_LE(least, oracle::rotation_energy(u, R, side) * (1.0 + kTrace));
    }
  }
}

TEST(RotationNewton, ConvergesQuadraticallyFromTenDegrees) {
  // performance.md 2.7: 1.5e-3 after one step, 2e-7 after two, at stretches of 30 %.
  Random random(22);
  double worst[3] = {};
  for (int trial = 0; trial < 1000; ++trial) {
    const Eigen::Quaterniond q = random.quaternion();
    const Matrix3 V = random.rotation();
    const Vector3 stretch(random.uniform(0.7, 1.3), random.uniform(0.7, 1.3),
                          random.uniform(0.7, 1.3));
    const Matrix3 F = q.toRotationMatrix() * V * stretch.asDiagonal() * V.transpose();
    const Vector3 axis = Vector3(random.normal(), random.normal(), random.normal()).normalized();
    const Eigen::Quaterniond start = q * Eigen::AngleAxisd(kPi / 18.0, axis);
    for (int steps = 1; steps <= 3; ++steps) {
      const Matrix3 R =
          to_eigen(to_matrix(rotation_newton(to_mat3<double>(F), to_quat<double>(start), steps)));
      worst[steps - 1] = std::max(worst[steps - 1], (R - q.toRotationMatrix()).norm());
    }
  }
  EXPECT_LT(worst[0], 2e-2);
  EXPECT_LT(worst[1], 1e-5);
  EXPECT_LT(worst[2], 1e-11);
}

// From quaternions of any length: both grow with its square.
TEST(RotationStep, TellsTheMatrixThatItSolvedWith) {
  Random random(31);
  int ascents = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const Eigen::Quaterniond q = random.quaternion();
    const double length = random.uniform(0.5, 2);
    const Matrix3 F = q.toRotationMatrix() * (Matrix3::Identity() + 0.2 * random.matrix3());
    const Eigen::Quaterniond near =
        q * Eigen::AngleAxisd(
                0.3, Vector3(random.normal(), random.normal(), random.normal()).normalized());
    const auto scaled = to_quat<double>(near);
    kernels::RotationStep<double> step;
    kernels::rotation_step(
        to_mat3<double>(F),
        {length * scaled.w, length * scaled.x, length * scaled.y, length * scaled.z}, step);
    const Matrix3 A = near.toRotationMatrix().transpose() * F;
    const Matrix3 H = A.trace() * Matrix3::Identity() - 0.5 * (A + A.transpose());
    const Matrix3 apart = H - H.trace() / 3 * Matrix3::Identity();
    const double square = length * length;
    ASSERT_NEAR(step.trace, square * H.trace(), 1e-13 * square);
    ASSERT_NEAR(step.spread2, square * square * apart.squaredNorm(), 1e-12 * square * square);
    if (!step.ascent) continue;
    ++ascents;
    const Matrix3 half = to_eigen(step.half_inverse.full());
    ASSERT_LT((2 * square * half * H - Matrix3::Identity()).norm(), 1e-12 * H.inverse().norm());
  }
  EXPECT_GT(ascents, 1000);
}

// Without R, and small where the rotation is nearly the best: no digits are lost to what cancels.
TEST(HornAxial, IsTheAxialVectorOfTheTurnedGradient) {
  Random random(32);
  for (int trial = 0; trial < 2000; ++trial) {
    const Matrix3 F = random.matrix3();
    const Eigen::Quaterniond q = random.quaternion();
    const double length = random.uniform(0.5, 2);
    const auto scaled = to_quat<double>(q);
    const Matrix3 A = length * length * q.toRotationMatrix().transpose() * F;
    const auto axial = kernels::horn_axial<double>(
        to_mat3<double>(F),
        {length * scaled.w, length * scaled.x, length * scaled.y, length * scaled.z});
    const Vector3 expected(A(2, 1) - A(1, 2), A(0, 2) - A(2, 0), A(1, 0) - A(0, 1));
    ASSERT_LT((Vector3(axial.x, axial.y, axial.z) - expected).norm(), 2e-14 * F.norm());
  }
}

TEST(ExtractRotation, AtRestStaysTheIdentityToTheBit) {
  const Quat<double> one{};
  EXPECT_EQ(extract_rotation(Mat3<double>::identity(), one), one);
}

TEST(ExtractRotation, EqualsTheOracleForRandomGradientsAndStarts) {
  Random random(23);
  for (int trial = 0; trial < 50000; ++trial) {
    const Matrix3 F = std::pow(10.0, random.uniform(-6, 6)) * random.matrix3();
    expect_best<double>(F, to_quat<double>(random.quaternion()), kTrace);
    if (HasFatalFailure()) return;
  }
}

TEST(ExtractRotation, HoldsInSinglePrecision) {
  Random random(24);
  for (int trial = 0; trial < 20000; ++trial) {
    const Matrix3 F = random.matrix3().cast<float>().cast<double>();
    expect_best<float>(F, to_quat<float>(random.quaternion()), kTraceSingle);
    if (HasFatalFailure()) return;
  }
}

TEST(ExtractRotation, HoldsHalfATurnOff) {
  Random random(25);
  for (int trial = 0; trial < 5000; ++trial) {
    const Matrix3 F = random.matrix3();
    const Eigen::Quaterniond best(oracle::best_rotation(F));
    const Vector3 axis = Vector3(random.normal(), random.normal(), random.normal()).normalized();
    expect_best<double>(F, to_quat<double>(best * Eigen::AngleAxisd(kPi, axis)), kTrace);
    expect_best<double>(F, to_quat<double>(best * Eigen::Quaterniond(0, 1, 0, 0)), kTrace);
    if (HasFatalFailure()) return;
  }
}

// The Hessian then has a determinant and a trace a rounding below zero, and a first minor above.
TEST(ExtractRotation, HoldsHalfATurnOffAnAxisWithRoundingInTheStretch) {
  for (const double rounding : {0.0, 4.7e-15, -4.7e-15, 1e-12}) {
    Matrix3 F = Matrix3::Identity();
    F(0, 0) = F(1, 1) = rounding - 1;
    expect_best(F, Quat<double>{}, kTrace);
  }
}

TEST(ExtractRotation, HoldsForFlatInvertedAndCollapsedCells) {
  Random random(26);
  const Vector3 stretches[] = {
      {1, 1, 1},       {1, 1, 0},          {1, 0, 0},  {1, 1, -1},     {1, 1, -.5},
      {1, -1, 1},      {-1, -1, -1},       {2, 1, -1}, {1, .5, 0},     {1, 1e-9, -1e-9},
      {1, 1e-9, 1e-9}, {1, 1, -1 + 1e-12}, {0, 0, 0},  {1e-3, 1, 1e3}, {1e-160, 1e-160, 0}};
  for (const Vector3& stretch : stretches)
    for (int trial = 0; trial < 200; ++trial) {
      Matrix3 F = stretch.asDiagonal();
      if (trial != 0) F = random.rotation() * F * random.rotation();
      const Matrix3 R = to_eigen(
          to_matrix(extract_rotation(to_mat3<double>(F), to_quat<double>(random.quaternion()))));
      const double size = F.cwiseAbs().maxCoeff();
      const Matrix3 unit = size > 0.0 ? Matrix3(F / size) : F;
      const double greatest = trace_of(oracle::best_rotation(unit), unit);
      ASSERT_LT((R.transpose() * R - Matrix3::Identity()).norm(), kProper) << F;
      ASSERT_GT(R.determinant(), 0.5) << F;
      ASSERT_GT(trace_of(R, unit), greatest - kTrace) << F;
    }
}

TEST(ExtractRotation, KeepsTheStartWhereEveryRotationIsAsGood) {
  Random random(27);
  const Quat<double> start = normalised(to_quat<double>(random.quaternion()));
  const double nan = std::nan(""), inf = HUGE_VAL;
  for (const double bad : {0.0, nan, inf, -inf}) {
    Mat3<double> F;
    F[1][2] = bad;
    const Matrix3 R = to_eigen(to_matrix(extract_rotation(F, start)));
    EXPECT_LT((R - to_eigen(to_matrix(start))).norm(), kProper) << bad;
  }
}

TEST(ExtractRotation, StaysNearTheStartWhereSeveralAreAsGood) {
  // A cell collapsed onto a line may spin about it: any spin is as good, so none is added.
  Random random(28);
  for (int trial = 0; trial < 200; ++trial) {
    const Matrix3 Q = random.rotation();
    const Matrix3 F = Q * Vector3(1, 0, 0).asDiagonal();
    const Matrix3 start = Q * Eigen::AngleAxisd(random.uniform(-3, 3), Vector3::UnitX());
    const Matrix3 R = to_eigen(to_matrix(
        extract_rotation(to_mat3<double>(F), to_quat<double>(Eigen::Quaterniond(start)))));
    ASSERT_LT((R - start).norm(), 1e-12);
  }
}

TEST(ExtractRotation, AcceptsAStartThatIsNoRotation) {
  Random random(29);
  const Matrix3 F = random.matrix3();
  const double nan = std::nan("");
  expect_best<double>(F, {0, 0, 0, 0}, kTrace);
  expect_best<double>(F, {nan, 1, 0, 0}, kTrace);
  expect_best<double>(F, {0, 1e8, 0, 3e8}, kTrace);
}

TEST(ExtractRotation, HoldsForTheGreatestAndTheLeastNumbers) {
  Random random(30);
  for (const double scale : {1e-300, 1e-160, 1e150, 1e300}) {
    const Matrix3 A = random.matrix3();
    const Quat<double> q =
        extract_rotation(to_mat3<double>(scale * A), to_quat<double>(random.quaternion()));
    EXPECT_LT((to_eigen(to_matrix(q)) - oracle::best_rotation(A)).norm() * gap_of(A), kTrace);
  }
}

// Near and far starts, strains up to inversion, cells of no volume, numbers at the ends of both
// ranges: the same rotation, or that of the way in double to the bit.
TEST(ExtractRotationMixed, IsThatOfTheWayInDouble) {
  Random random(32);
  int alike = 0, near = 0;
  for (int trial = 0; trial < 20000; ++trial) {
    const double strain = std::pow(10.0, random.uniform(-6, 0.5));
    const double size = trial % 4 == 0 ? std::pow(10.0, random.uniform(-60, 60)) : 1;
    Matrix3 F = size * (random.rotation() * (Matrix3::Identity() + strain * random.matrix3()));
    if (trial % 50 == 0) F.col(1).setZero();
    Quat<double> start = to_quat<double>(random.quaternion());
    if (trial % 3 != 0)
      start = to_quat<double>(Eigen::Quaterniond(oracle::best_rotation(F)) *
                              Eigen::Quaterniond(1, 0.1 * random.normal(), 0.1, 0).normalized());
    const Quat<double> a = extract_rotation(to_mat3<double>(F), start);
    const Quat<double> b = extract_rotation_mixed(to_mat3<double>(F), start);
    if (std::memcmp(&a, &b, sizeof a) == 0) {
      ++alike;
      continue;
    }
    ++near;
    const Matrix3 A = to_eigen(to_matrix(a)), B = to_eigen(to_matrix(b));
    ASSERT_LT((A - B).norm() * gap_of(F), 2e-12) << F;
    ASSERT_LT((B.transpose() * B - Matrix3::Identity()).norm(), kProper) << F;
  }
  EXPECT_GT(alike, 1000);
  EXPECT_GT(near, 10000);
  const double nan = std::nan("");
  for (const double bad : {0.0, nan, HUGE_VAL}) {
    const Quat<double> start = normalised(to_quat<double>(random.quaternion()));
    Mat3<double> F;
    F[1][2] = bad;
    EXPECT_EQ(extract_rotation_mixed(F, start), extract_rotation(F, start));
  }
  EXPECT_EQ(extract_rotation_mixed(Mat3<double>::identity(), {}), Quat<double>{});
}

TEST(ExtractRotation, GivesTheSameBitsTwice) {
  Random random(31);
  for (int trial = 0; trial < 100; ++trial) {
    const Mat3<double> F = to_mat3<double>(random.matrix3());
    const Quat<double> start = to_quat<double>(random.quaternion());
    const Quat<double> a = extract_rotation(F, start), b = extract_rotation(F, start);
    EXPECT_EQ(std::memcmp(&a, &b, sizeof a), 0);
  }
}

}  // namespace
}  // namespace kerf::test
