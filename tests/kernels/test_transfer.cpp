// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <vector>

#include "kernels/transfer.hpp"
#include "tests/kernels/kernel_values.hpp"

namespace kerf::test {
namespace {

using kernels::FoldCode;
using oracle::Matrix8;
using oracle::Vector24;
using oracle::Vector3;

// Weights are sums of powers of two: exact, but for the values they multiply.
constexpr double kRoundOff = 1e-14;

Vector3 corner(int i) { return {double(i % 2), double(i / 2 % 2), double(i / 4)}; }

/// Every code that can occur: nothing else is asked of the functions.
std::vector<FoldCode> valid_codes() {
  std::vector<FoldCode> codes;
  for (int o = 0; o < 8; ++o)
    for (int mask = 0; mask < 256; ++mask)
      if (kernels::fold_is_valid(kernels::fold_code(mask, o)))
        codes.push_back(kernels::fold_code(mask, o));
  return codes;
}

/// Corner by slot, from trilinear weights in the geometric parent.
Matrix8 dense_fold(FoldCode code) {
  const int o = code >> 8;
  Matrix8 W = Matrix8::Identity();
  for (int i = 0; i < 8; ++i)
    if ((code >> i & 1) != 0)
      W.row(i) = oracle::trilinear_weights(0.5 * (corner(o) + corner(i))).transpose();
  return W;
}

/// Where slot i of a cell is: at its corner, or at that of its parent.
Vector3 slot_position(FoldCode code, const Vector3& origin, double side, int i) {
  const int o = code >> 8;
  if ((code >> i & 1) == 0) return origin + side * corner(i);
  return origin - side * corner(o) + 2.0 * side * corner(i);
}

Matrix8 to_eigen8(const double (&w)[8][8]) {
  return Matrix8::NullaryExpr([&](int i, int j) { return w[i][j]; });
}

TEST(Fold, ValidCodesAreThoseOfThreeFacesAndThreeEdges) {
  // Faces at corner o that may hang: 3 of them, and of the edges between them those not already
  // hanging with a face. No face: 8 sets of edges; one face (2 edges hang): 3 * 2; two or three
  // faces (all edges hang): 3 + 1. So 18 an octant.
  EXPECT_EQ(valid_codes().size(), 18U * 8U);
}

TEST(Fold, InvalidCodesAreRefused) {
  EXPECT_FALSE(kernels::fold_is_valid(kernels::fold_code(0b00000001, 0)));  // the shared corner
  EXPECT_FALSE(kernels::fold_is_valid(kernels::fold_code(0b11111110, 0)));  // the parent's middle
  EXPECT_FALSE(kernels::fold_is_valid(kernels::fold_code(0b00001000, 0)));  // a face, no edges
}

TEST(Fold, WeightsEqualTheTrilinearOnesOfTheParent) {
  for (const FoldCode code : valid_codes()) {
    double w[8][8];
    kernels::fold_weights(code, w);
    ASSERT_EQ(to_eigen8(w), dense_fold(code)) << code;
  }
}

TEST(Fold, UnfoldAndItsAdjointEqualTheWeights) {
  Random random(40);
  for (const FoldCode code : valid_codes()) {
    const Vector24 slots = random.vector24(), forces = random.vector24();
    const auto W = oracle::expand(dense_fold(code));
    CellVector<double> u = to_cell<double>(slots), f = to_cell<double>(forces), corners, folded;

    unfold(u.at, code, corners.at);
    fold_transpose(f.at, code, folded.at);

    const Vector24 value = to_eigen(corners.at), force = to_eigen(folded.at);
    ASSERT_LT((value - W * slots).norm(), kRoundOff);
    ASSERT_LT((force - W.transpose() * forces).norm(), kRoundOff);
    ASSERT_NEAR(value.dot(forces), slots.dot(force), kRoundOff * slots.norm() * forces.norm());
  }
}

TEST(Fold, UnfoldReproducesLinearFunctions) {
  const Vector3 slope(0.3, -0.7, 1.1);
  for (const FoldCode code : valid_codes()) {
    const Vector3 origin(2, 4, 6);
    double slots[8];
    for (int i = 0; i < 8; ++i) slots[i] = slope.dot(slot_position(code, origin, 1.0, i));
    for (int i = 0; i < 8; ++i)
      ASSERT_NEAR(kernels::fold_corner<double>(slots, code, i), slope.dot(origin + corner(i)),
                  kRoundOff * 10);
  }
}

TEST(TransferWeights, ReproduceLinearFunctionsForEveryChildAndParent) {
  const Vector3 slope(0.3, -0.7, 1.1), parent_origin(4, 8, 12);
  for (const FoldCode child : valid_codes())
    for (const FoldCode parent : valid_codes()) {
      const int place = kernels::fold_octant(child);
      const Vector3 child_origin = parent_origin + corner(place);
      Eigen::Matrix<double, 8, 1> coarse, fine;
      for (int i = 0; i < 8; ++i) {
        coarse[i] = slope.dot(slot_position(parent, parent_origin, 2.0, i));
        fine[i] = slope.dot(slot_position(child, child_origin, 1.0, i));
      }
      double w[8][8];
      kernels::transfer_weights(child, place, parent, w);
      ASSERT_LT((to_eigen8(w) * coarse - fine).cwiseAbs().maxCoeff(), kRoundOff * 100);
    }
}

TEST(TransferWeights, EqualTrilinearInterpolationOfTheUnfoldedParent) {
  for (const FoldCode child : valid_codes())
    for (const FoldCode parent : valid_codes()) {
      const int place = kernels::fold_octant(child);
      Matrix8 P;
      for (int i = 0; i < 8; ++i) {
        const Vector3 at = (child >> i & 1) != 0 ? corner(i) : 0.5 * (corner(place) + corner(i));
        P.row(i) = oracle::trilinear_weights(at).transpose();
      }
      double w[8][8];
      kernels::transfer_weights(child, place, parent, w);
      ASSERT_EQ(to_eigen8(w), P * dense_fold(parent));
    }
}

TEST(TransferWeights, OfAPassedCellAreTheIdentity) {
  for (const FoldCode code : valid_codes()) {
    double w[8][8];
    kernels::transfer_weights(code, kernels::kPassed, code, w);
    ASSERT_EQ(to_eigen8(w), Matrix8::Identity());
  }
}

TEST(TransferWeights, HoldInSinglePrecision) {
  for (const FoldCode code : valid_codes()) {
    float single[8][8];
    double exact[8][8];
    kernels::transfer_weights(code, kernels::fold_octant(code), code, single);
    kernels::transfer_weights(code, kernels::fold_octant(code), code, exact);
    for (int i = 0; i < 8; ++i)
      for (int j = 0; j < 8; ++j) ASSERT_EQ(static_cast<double>(single[i][j]), exact[i][j]);
  }
}

}  // namespace
}  // namespace kerf::test
