// SPDX-License-Identifier: MIT
//
// Rotations of the fast backend, which takes its steps in single precision, against singular value
// decompositions.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "tests/oracle/element_oracle.hpp"
#include "tests/support/solves.hpp"

namespace kerf {
namespace {

using oracle::Matrix3;
using oracle::Vector;
using test::Problem;
using test::ProblemOptions;

Problem uniform_body(const Vec3i& size) {
  ProblemOptions options;
  options.holds = test::Holds::none;
  options.with_oracle = false;
  return {LinkedOctree(test::box_body(size), 0), options};
}

/// I + the mean gradient of u over a cell.
Matrix3 gradient_of(const Problem& p, std::int32_t cell, const Vector& u) {
  const Level& finest = p.hierarchy.levels[0];
  Matrix3 F = Matrix3::Identity();
  for (int i = 0; i < 8; ++i) {
    const auto at = u.segment<3>(3 * finest.slots[cell][static_cast<std::size_t>(i)]);
    for (int a = 0; a < 3; ++a)
      F.col(a) += (((i >> a) & 1) != 0 ? 1 : -1) / (4 * p.physics.spacing) * at;
  }
  return F;
}

Matrix3 matrix_of(const std::vector<double>& q, std::int32_t cell) {
  const double* const of = q.data() + 4 * static_cast<std::ptrdiff_t>(cell);
  return Eigen::Quaterniond(of[0], of[1], of[2], of[3]).toRotationMatrix();
}

/// What kinds of cells a test met.
struct Met {
  int inverted = 0, far_turned = 0;
};

/// `rounding`: of a component of a quaternion.
void expect_best(const Matrix3& F, const Matrix3& R, double rounding, Met& met) {
  constexpr double kRotation = 1e-12;
  const Matrix3 best = oracle::best_rotation(F);
  const Matrix3 S = best.transpose() * F;
  const Matrix3 H = S.trace() * Matrix3::Identity() - 0.5 * (S + S.transpose());
  const double gap = oracle::eigenvalues(H)[0] / F.norm();
  ASSERT_LT((R.transpose() * R - Matrix3::Identity()).norm(), 16 * rounding);
  ASSERT_GT(R.determinant(), 0.5);
  ASSERT_LT(std::abs((R.transpose() * F).trace() - S.trace()), 16 * rounding * F.norm()) << F;
  ASSERT_LT((R - best).norm() * gap, kRotation) << F << "\ngap " << gap;
  met.inverted += F.determinant() < 0 ? 1 : 0;
  met.far_turned += best.trace() < 0 ? 1 : 0;
}

// From the identity, and then from what another displacement left; groups that fill their batch and
// groups that do not.
TEST(FastRotations, AreTheBestForAnyDisplacement) {
  Met met;
  for (const Vec3i& size : {Vec3i{19, 7, 5}, Vec3i{16, 8, 2}, Vec3i{2, 1, 1}})
    for (const std::string machine : {"fast", "mixed"}) {
      const double rounding = machine == "fast" ? 0x1p-52 : 0x1p-49;
      const Problem p = uniform_body(size);
      const auto backend = test::make_backend(machine);
      const int u = backend->add_vector();
      backend->load(p.hierarchy);
      std::vector<double> q(4 * p.hierarchy.values.size());
      for (const double noise : {0.02, 0.5, 2.0, 0.1}) {
        SCOPED_TRACE(::testing::Message() << machine << ", " << size[0] << ", noise " << noise);
        const Vector x =
            p.deformation() + noise * p.physics.spacing * test::random_vector(p.unknowns(0), 3);
        test::write(*backend, 0, u, x);
        backend->rotate_cells(u);
        backend->read_rotations(q);
        for (std::int32_t c = 0; c < p.hierarchy.levels[0].cells(); ++c)
          ASSERT_NO_FATAL_FAILURE(
              expect_best(gradient_of(p, c, x), matrix_of(q, c), rounding, met));
      }
    }
  EXPECT_GT(met.inverted, 100);
  EXPECT_GT(met.far_turned, 100);
}

// From rotations a little off, by less and by more than what one step, or two, can mend: the last
// step takes the matrix of the step before, which must not have been too far away for the strain.
TEST(FastRotations, AreTheBestFromWhereverTheyWere) {
  // Many more quaternions than elsewhere: of some all four components are rounded by half a unit.
  constexpr double kTwoParts = 0x1p-48;
  const Problem p = uniform_body({16, 6, 5});
  std::vector<double> q(4 * p.hierarchy.values.size());
  Met met;
  for (const std::string machine : {"fast", "mixed"})
    for (const double strain : {0.0, 1e-6, 0.003, 0.03, 0.3}) {
      const auto backend = test::make_backend(machine);
      const int u = backend->add_vector();
      backend->load(p.hierarchy);
      Vector x =
          p.deformation() + strain * p.physics.spacing * test::random_vector(p.unknowns(0), 5);
      unsigned seed = 6;
      for (double size = 1e-7; size < 0.5; size *= 3) {
        SCOPED_TRACE(::testing::Message() << machine << ", strain " << strain << ", size " << size);
        x += size * p.physics.spacing * test::random_vector(p.unknowns(0), seed++);
        test::write(*backend, 0, u, x);
        backend->rotate_cells(u);
        backend->read_rotations(q);
        for (std::int32_t c = 0; c < p.hierarchy.levels[0].cells(); ++c)
          ASSERT_NO_FATAL_FAILURE(expect_best(gradient_of(p, c, x), matrix_of(q, c),
                                              machine == "fast" ? 0x1p-52 : kTwoParts, met));
      }
    }
}

// Stationary, at the start, to the bit, and no maximum; with a matrix of the step whose trace is so
// small beside it that rounding in single precision makes it look positive definite.
TEST(FastRotations, LeaveAPointThatIsNoMaximum) {
  const double gradients[][9] = {
      {-0.045780829640731838, -0.20880465651931854, 0.05562992722615949, -0.20880465651931854,
       -0.91884171643836277, 0.24529614032724112, 0.05562992722615949, 0.24529614032724112,
       0.96621024775362918},
      {-0.97984103165945247, -0.13754640964085815, 8.2879260410593118e-05, -0.13754640964085815,
       -0.018423375070398321, -3.0877349998371813e-05, 8.2879260410593118e-05,
       -3.0877349998371813e-05, 0.99913220793147706}};
  const Problem p = uniform_body({2, 1, 1});
  const Level& finest = p.hierarchy.levels[0];
  for (const std::string machine : {"cpu", "fast", "mixed"})
    for (const auto& of : gradients) {
      const Matrix3 F = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(of);
      const auto backend = test::make_backend(machine);
      const int u = backend->add_vector();
      backend->load(p.hierarchy);
      Vector x(p.unknowns(0));
      for (std::int32_t v = 0; v < finest.vertices(); ++v) {
        const auto& at = finest.point[v];
        x.segment<3>(3 * v) =
            p.physics.spacing * (F - Matrix3::Identity()) * oracle::Vector3(at[0], at[1], at[2]);
      }
      test::write(*backend, 0, u, x);
      backend->rotate_cells(u);
      std::vector<double> q(4 * p.hierarchy.values.size());
      backend->read_rotations(q);
      Met met;
      for (std::int32_t c = 0; c < finest.cells(); ++c)
        ASSERT_NO_FATAL_FAILURE(expect_best(gradient_of(p, c, x), matrix_of(q, c), 0x1p-49, met))
            << machine;
    }
}

// A cell among fine ones that takes more steps, or none, or the reference's way; with gradients
// that single precision, or no number at all, can hold.
TEST(FastRotations, DependOnNoOtherCell) {
  const Problem p = uniform_body({19, 7, 5});
  const Level& finest = p.hierarchy.levels[0];
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const Vector small = 0.02 * p.physics.spacing * test::random_vector(p.unknowns(0), 3);
  const auto rotations_of = [&](const std::string& machine, const Vector& x) {
    const auto backend = test::make_backend(machine);
    const int u = backend->add_vector();
    backend->load(p.hierarchy);
    test::write(*backend, 0, u, x);
    backend->rotate_cells(u);
    std::vector<double> q(4 * p.hierarchy.values.size());
    backend->read_rotations(q);
    return q;
  };
  const auto expect_one = [&](const std::string& machine, const Vector& x, std::int32_t v,
                              const std::vector<double>& usual, double far) {
    SCOPED_TRACE(::testing::Message() << machine << ", vertex " << v << ", " << far);
    const double rounding = machine == "fast" ? 0x1p-52 : 0x1p-49;
    Vector moved = x;
    moved[3 * v] += far * p.physics.spacing;
    const std::vector<double> q = rotations_of(machine, moved);
    Met met;
    for (std::int32_t c = 0; c < finest.cells(); ++c) {
      const auto& slots = finest.slots[c];
      const bool other = std::find(slots.begin(), slots.end(), v) == slots.end();
      for (std::size_t k = 0; k < 4; ++k) {
        const double found = q[4 * static_cast<std::size_t>(c) + k];
        if (other) {
          ASSERT_EQ(found, usual[4 * static_cast<std::size_t>(c) + k]) << "cell " << c;
        } else if (!std::isfinite(far)) {
          ASSERT_EQ(found, k == 0 ? 1 : 0) << "where it was";
        }
      }
      const Matrix3 R = matrix_of(q, c);
      ASSERT_LT((R.transpose() * R - Matrix3::Identity()).norm(), 16 * rounding);
      if (!other && std::abs(far) < 100) {
        ASSERT_NO_FATAL_FAILURE(expect_best(gradient_of(p, c, moved), R, rounding, met));
      }
    }
  };
  for (const std::string machine : {"fast", "mixed"})
    for (const Vector& x : {small, p.deformation()}) {
      const std::vector<double> usual = rotations_of(machine, x);
      for (const std::int32_t cell : {40, 111, 300, 500})
        for (const double far : {-3.0, 0.9, 2.0, 10.0, 1e15, 1e22, kInfinity, std::nan("")})
          ASSERT_NO_FATAL_FAILURE(expect_one(machine, x, finest.slots[cell][7], usual, far));
    }
}

// What is stored in two numbers of single precision has the relative precision of both.
TEST(FastRotations, OfTinyAnglesAreRightForTheirSize) {
  const Problem p = uniform_body({9, 5, 3});
  for (const char* machine : {"fast", "mixed"})
    for (const double size : {1e-7, 1e-12}) {
      const auto backend = test::make_backend(machine);
      const int u = backend->add_vector();
      backend->load(p.hierarchy);
      const Vector x = size * p.physics.spacing * test::random_vector(p.unknowns(0), 9);
      test::write(*backend, 0, u, x);
      backend->rotate_cells(u);
      std::vector<double> q(4 * p.hierarchy.values.size());
      backend->read_rotations(q);
      for (std::int32_t c = 0; c < p.hierarchy.levels[0].cells(); ++c) {
        // To first order the axial vector of the gradient of u; to second, less than its square.
        const Matrix3 G = gradient_of(p, c, x / size) - Matrix3::Identity();
        const double axial[] = {G(2, 1) - G(1, 2), G(0, 2) - G(2, 0), G(1, 0) - G(0, 1)};
        for (std::size_t a = 0; a < 3; ++a)
          ASSERT_NEAR(q[4 * static_cast<std::size_t>(c) + a + 1], 0.25 * size * axial[a],
                      (1e-14 + 2 * size) * size)
              << machine << ", size " << size;
      }
    }
}

// As after the change of a backend in mid-run: what is read, written and read is the same.
TEST(FastRotations, ComeBackAsTheyWereRead) {
  const Problem p = uniform_body({9, 5, 3});
  for (const char* machine : {"fast", "mixed"}) {
    const auto first = test::make_backend(machine), second = test::make_backend(machine);
    const int u = first->add_vector(), force = first->add_vector();
    second->add_vector();
    second->add_vector();
    for (Backend* backend : {first.get(), second.get()}) backend->load(p.hierarchy);
    const Vector x = p.deformation();
    std::vector<double> q(4 * p.hierarchy.values.size()), again(q.size());
    test::write(*first, 0, u, x);
    first->rotate_cells(u);
    first->read_rotations(q);

    second->write_rotations(q);

    second->read_rotations(again);
    EXPECT_EQ(again, q) << machine;
    test::write(*second, 0, u, x);
    for (Backend* backend : {first.get(), second.get()}) backend->elastic_force(u, force);
    EXPECT_EQ(p.read(*second, 0, force), p.read(*first, 0, force)) << machine;
  }
}

}  // namespace
}  // namespace kerf
