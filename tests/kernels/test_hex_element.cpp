// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include "kernels/corotate.hpp"
#include "kernels/modes.hpp"
#include "tests/kernels/kernel_values.hpp"
#include "tests/oracle/system_oracle.hpp"

namespace kerf::test {
namespace {

using kernels::HexMass;
using kernels::HexStiffness;
using kernels::MassModel;
using kernels::Vec3;
using oracle::Matrix24;
using oracle::Matrix3;
using oracle::Vector24;
using oracle::Vector3;

constexpr double kPoisson[] = {-0.5, 0.0, 0.3, 0.49};
// Two ways of summing the same few products.
constexpr double kSameSum = 1e-14;
// A few dozen products of rotation entries, each off by half a rounding.
constexpr double kRotated = 1e-13;
constexpr double kSingle = 1e-5;
constexpr double kPi = 3.14159265358979323846;

template <class T>
Matrix24 dense(const HexStiffness<T>& K) {
  return Matrix24::NullaryExpr([&](int i, int j) { return static_cast<double>(K.k[i][j]); });
}

template <class T>
oracle::Matrix8 dense(const HexMass<T>& M) {
  return oracle::Matrix8::NullaryExpr([&](int i, int j) { return static_cast<double>(M.m[i][j]); });
}

TEST(HexStiffness, EqualsTheQuadratureOfTheOracle) {
  for (const double nu : kPoisson) {
    const Matrix24 expected = oracle::stiffness(nu, 1.0);
    const Matrix24 K = dense(kernels::unit_hex_stiffness(nu));
    EXPECT_LT((K - expected).cwiseAbs().maxCoeff(), kSameSum * expected.cwiseAbs().maxCoeff());
    EXPECT_EQ(K, K.transpose());
  }
}

TEST(HexStiffness, ScalesWithTheSide) {
  const Matrix24 expected = oracle::stiffness(0.3, 0.25);
  const Matrix24 K = 0.25 * dense(kernels::unit_hex_stiffness(0.3));
  EXPECT_LT((K - expected).cwiseAbs().maxCoeff(), kSameSum * expected.cwiseAbs().maxCoeff());
}

TEST(HexStiffness, HasSixZeroModesAndNoNegativeOne) {
  for (const double nu : kPoisson) {
    const Matrix24 K = dense(kernels::unit_hex_stiffness(nu));
    const Vector24 values = oracle::eigenvalues(K);
    const double greatest = values[23];
    for (int i = 0; i < 6; ++i) EXPECT_LT(std::abs(values[i]), kSameSum * greatest);
    EXPECT_GT(values[6], 1e-3 * greatest);
  }
}

TEST(HexStiffness, StretchAndShearHaveTheEnergyOfTheMaterial) {
  // u = x - centre: strain I, energy density 3 / (2 (1 - 2 nu)) for E = 1.
  // u = (y - 1/2, x - 1/2, 0): engineering shear 2, energy density 2 mu = 1 / (1 + nu).
  const Vector24 x = oracle::corner_positions(1.0);
  for (const double nu : kPoisson) {
    const Matrix24 K = dense(kernels::unit_hex_stiffness(nu));
    Vector24 stretch = x, shear = Vector24::Zero();
    for (int i = 0; i < 8; ++i) {
      stretch.segment<3>(3 * i) -= Vector3::Constant(0.5);
      shear[3 * i] = x[3 * i + 1] - 0.5;
      shear[3 * i + 1] = x[3 * i] - 0.5;
    }
    EXPECT_NEAR(0.5 * stretch.dot(K * stretch), 1.5 / (1.0 - 2.0 * nu), 1e-13 / (1.0 - 2.0 * nu));
    EXPECT_NEAR(0.5 * shear.dot(K * shear), 1.0 / (1.0 + nu), 1e-13);
  }
}

TEST(HexStiffness, ConstantStrainLoadsCornersAsASurfaceTractionWould) {
  // Corner i of a unit cube gathers sigma n / 4 from its three faces.
  Random random(10);
  const double nu = 0.3, lambda = nu / ((1 + nu) * (1 - 2 * nu)), mu = 0.5 / (1 + nu);
  const Matrix3 G = random.matrix3();
  const Matrix3 strain = 0.5 * (G + G.transpose());
  const Matrix3 stress = lambda * strain.trace() * Matrix3::Identity() + 2 * mu * strain;
  const Vector24 x = oracle::corner_positions(1.0);
  CellVector<double> u, f;
  for (int i = 0; i < 8; ++i) {
    const Vector3 ui = G * x.segment<3>(3 * i);
    u.at[i] = {ui[0], ui[1], ui[2]};
  }

  apply_cell(u.at, kernels::Mat3<double>::identity(), 1.0, 0.0,
             kernels::mode_constants(nu, MassModel::consistent), f.at);

  for (int i = 0; i < 8; ++i) {
    const Vector3 outward = 2.0 * x.segment<3>(3 * i) - Vector3::Ones();
    const Vector3 expected = 0.25 * stress * outward;
    for (int a = 0; a < 3; ++a) EXPECT_NEAR(f.at[i][a], expected[a], kRotated);
  }
}

TEST(HexMass, EqualsTheQuadratureOfTheOracle) {
  const auto M = dense(kernels::unit_hex_mass<double>());
  EXPECT_LT((M - oracle::mass(1.0)).cwiseAbs().maxCoeff(), 1e-15);
  EXPECT_EQ(dense(kernels::unit_hex_mass_lumped<double>()), oracle::Matrix8::Identity() / 8.0);
}

TEST(Modes, TransformIsItsOwnInverseUpToEight) {
  Random random(11);
  const Vector24 u = random.vector24();
  CellVector<double> v = to_cell<double>(u);
  double m[3][8];
  to_modes(v.at, m);
  for (int s = 0; s < 8; ++s)
    for (int a = 0; a < 3; ++a) {
      double expected = 0.0;
      for (int i = 0; i < 8; ++i) {
        int lows = 0;
        for (int bit = 1; bit < 8; bit *= 2) lows += (s & bit) != 0 && (i & bit) == 0 ? 1 : 0;
        expected += (lows % 2 != 0 ? -1.0 : 1.0) * u[3 * i + a];
      }
      EXPECT_NEAR(m[a][s], expected, kSameSum);
    }
  to_corners(m, v.at);
  EXPECT_LT((to_eigen(v.at) - 8.0 * u).norm(), kRotated);
}

TEST(Modes, OperatorEqualsTheQuadratureColumnByColumn) {
  const auto unrotated = kernels::Mat3<double>::identity();
  for (const double nu : kPoisson) {
    const Matrix24 K = oracle::stiffness(nu, 1.0);
    const auto constants = kernels::mode_constants(nu, MassModel::consistent);
    for (int col = 0; col < 24; ++col) {
      CellVector<double> u = to_cell<double>(Vector24::Unit(col)), f;
      apply_cell(u.at, unrotated, 1.0, 0.0, constants, f.at);
      EXPECT_LT((to_eigen(f.at) - K.col(col)).cwiseAbs().maxCoeff(),
                kSameSum * K.cwiseAbs().maxCoeff());
    }
  }
}

template <class T>
double rotated_apply_error(MassModel model, double stiffness, double mass) {
  Random random(12);
  double worst = 0.0;
  for (int trial = 0; trial < 100; ++trial) {
    const double nu = kPoisson[trial % 4];
    const Matrix3 R = random.rotation();
    const Vector24 u = random.vector24();
    const oracle::Matrix8 M = model == MassModel::consistent
                                  ? oracle::mass(1.0)
                                  : oracle::Matrix8(oracle::Matrix8::Identity() / 8.0);
    const Matrix24 A =
        stiffness * oracle::rotated(oracle::stiffness(nu, 1.0), R) + mass * oracle::expand(M);
    CellVector<T> v = to_cell<T>(u);
    apply_cell(v.at, to_mat3<T>(R), static_cast<T>(stiffness), static_cast<T>(mass),
               kernels::mode_constants(static_cast<T>(nu), model), v.at);  // f may be u
    worst = std::max(worst, (to_eigen(v.at) - A * u).norm() / (A.norm() * u.norm()));
  }
  return worst;
}

TEST(ApplyCell, EqualsTheDenseRotatedMatrix) {
  EXPECT_LT(rotated_apply_error<double>(MassModel::consistent, 3.0e4, 7.0e3), kSameSum);
  EXPECT_LT(rotated_apply_error<double>(MassModel::lumped, 3.0e4, 7.0e3), kSameSum);
  EXPECT_LT(rotated_apply_error<float>(MassModel::consistent, 3.0e4, 7.0e3), kSingle);
}

template <class T>
double cell_matrix_error() {
  Random random(13);
  double worst = 0.0;
  for (const double nu : kPoisson) {
    const Matrix3 R = random.rotation();
    const Matrix24 A = 2.5 * oracle::rotated(oracle::stiffness(nu, 1.0), R) +
                       1.5 * oracle::expand(oracle::mass(1.0));
    const auto K = kernels::unit_hex_stiffness(static_cast<T>(nu));
    const auto M = kernels::unit_hex_mass<T>();
    std::vector<T> packed(kernels::kEntries);
    cell_matrix(K, M, to_mat3<T>(R), T(2.5), T(1.5), packed.data());
    worst = std::max(worst, (from_packed(packed) - A).norm() / A.norm());
    for (int i = 0; i < 8; ++i) {
      const auto block = cell_diagonal(K, M, to_mat3<T>(R), T(2.5), T(1.5), i).full();
      worst = std::max(worst, (to_eigen(block) - A.block<3, 3>(3 * i, 3 * i)).norm() / A.norm());
    }
  }
  return worst;
}

TEST(CellMatrix, EqualsTheDenseRotatedMatrix) {
  EXPECT_LT(cell_matrix_error<double>(), kSameSum);
  EXPECT_LT(cell_matrix_error<float>(), kSingle);
}

TEST(ElasticForce, IsZeroForAnyRigidMotion) {
  Random random(14);
  const double side = 0.01, stiffness = 5.0e4 * side;
  const Vector24 x = oracle::corner_positions(side);
  for (int degrees = 0; degrees <= 360; degrees += 15) {
    const Vector3 axis = Vector3(random.normal(), random.normal(), random.normal()).normalized();
    const Matrix3 R = Eigen::AngleAxisd(degrees * kPi / 180.0, axis).toRotationMatrix();
    const Vector3 shift = side * Vector3(random.normal(), random.normal(), random.normal());
    CellVector<double> u, f;
    for (int i = 0; i < 8; ++i) {
      const Vector3 ui = R * x.segment<3>(3 * i) + shift - x.segment<3>(3 * i);
      u.at[i] = {ui[0], ui[1], ui[2]};
    }

    elastic_force(u.at, to_quat<double>(Eigen::Quaterniond(R)), side, stiffness,
                  kernels::mode_stiffness(0.4), f.at);

    EXPECT_LT(to_eigen(f.at).norm(), kRotated * stiffness * side) << degrees << " degrees";
  }
}

template <class T>
double elastic_force_error() {
  Random random(15);
  const double side = 0.5, stiffness = 10.0;
  const Vector24 x = oracle::corner_positions(side);
  double worst = 0.0;
  for (int trial = 0; trial < 50; ++trial) {
    const Matrix3 R = random.rotation();
    const Vector24 u = random.vector24();
    Vector24 local;
    for (int i = 0; i < 8; ++i)
      local.segment<3>(3 * i) = R.transpose() * (x + u).segment<3>(3 * i) - x.segment<3>(3 * i);
    const Vector24 force = stiffness * (oracle::stiffness(0.3, 1.0) * local);
    Vector24 expected;
    for (int i = 0; i < 8; ++i) expected.segment<3>(3 * i) = R * force.segment<3>(3 * i);
    CellVector<T> v = to_cell<T>(u);
    elastic_force(v.at, to_quat<T>(Eigen::Quaterniond(R)), static_cast<T>(side),
                  static_cast<T>(stiffness), kernels::mode_stiffness(T(0.3)), v.at);  // f may be u
    worst = std::max(worst, (to_eigen(v.at) - expected).norm() / expected.norm());
  }
  return worst;
}

TEST(ElasticForce, EqualsTheDenseCorotationalForce) {
  EXPECT_LT(elastic_force_error<double>(), kRotated);
  EXPECT_LT(elastic_force_error<float>(), kSingle);
}

// Steel under its own weight strains by 1e-8 and less, and equilibria are asked for to 1e-8.
TEST(ElasticForce, KeepsItsDigitsWhereTheStrainIsTiny) {
  Random random(16);
  for (const double size : {1e-6, 1e-9, 1e-12}) {
    const Vector24 u = size * random.vector24();
    // So small an angle that R u = u but for the angle's square.
    const kernels::Quat<double> q =
        normalised(kernels::Quat<double>{1, size * random.normal(), size * random.normal(), 0});
    const Vector3 turned(2 * q.x, 2 * q.y, 0);
    const Vector24 x = oracle::corner_positions(1);
    Vector24 strained = u;  // R^T (x + u) - x to first order
    for (int i = 0; i < 8; ++i) strained.segment<3>(3 * i) -= turned.cross(x.segment<3>(3 * i));
    const Vector24 expected = oracle::stiffness(0.3, 1.0) * strained;
    CellVector<double> f = to_cell<double>(u);

    elastic_force(f.at, q, 1.0, 1.0, kernels::mode_stiffness(0.3), f.at);

    const double second_order = 100 * size;
    EXPECT_LT((to_eigen(f.at) - expected).norm(), (second_order + kRotated) * expected.norm())
        << size;
  }
}

}  // namespace
}  // namespace kerf::test
