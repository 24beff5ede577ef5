// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <vector>

#include "kernels/coarsen.hpp"
#include "kernels/corner_coarsen.hpp"
#include "kernels/transfer.hpp"
#include "tests/kernels/kernel_values.hpp"

namespace kerf::test {
namespace {

using kernels::FoldCode;
using kernels::kEntries;
using oracle::Matrix24;
using oracle::Matrix8;
using oracle::Vector24;

// Sums of some 64 products.
constexpr double kRoundOff = 1e-13;
constexpr double kSingle = 1e-5;

template <class T>
Matrix8 to_eigen8(const T (&w)[8][8]) {
  return Matrix8::NullaryExpr([&](int i, int j) { return static_cast<double>(w[i][j]); });
}

TEST(ApplyPacked, EqualsTheDenseProductInEveryTile) {
  Random random(50);
  const Matrix24 A = random.symmetric24();
  const Vector24 u = random.vector24();
  const auto packed = to_packed<double>(A);
  const CellVector<double> v = to_cell<double>(u);
  for (const int log2 : {0, 4, 5}) {
    std::vector<double> tiles(kernels::tiled_size(40, kEntries, log2));
    const auto cell = kernels::cell_entries(tiles.data(), 39, kEntries, log2);
    for (int e = 0; e < kEntries; ++e) cell[e] = packed[static_cast<std::size_t>(e)];

    CellVector<double> y;
    apply_packed(cell, v.at, y.at);

    EXPECT_LT((to_eigen(y.at) - A * u).norm(), kRoundOff * A.norm() * u.norm());
    for (int i = 0; i < 8; ++i) {
      EXPECT_EQ(apply_packed_row(cell, i, v.at), y.at[i]);  // same order, same bits
      EXPECT_EQ(to_eigen(kernels::packed_diagonal<double>(cell, i).full()),
                (A.block<3, 3>(3 * i, 3 * i)));
    }
  }
}

TEST(ApplyPacked, HoldsInSinglePrecision) {
  Random random(51);
  const Matrix24 A = random.symmetric24();
  const Vector24 u = random.vector24();
  const auto packed = to_packed<float>(A);
  CellVector<float> v = to_cell<float>(u);
  apply_packed(packed.data(), v.at, v.at);  // y may be u
  EXPECT_LT((to_eigen(v.at) - A * u).norm(), kSingle * A.norm() * u.norm());
}

template <class T>
double coarsen_error(FoldCode child, FoldCode parent, Random& random) {
  const Matrix24 A = random.symmetric24(), before = random.symmetric24();
  T w[8][8];
  kernels::transfer_weights(child, kernels::fold_octant(child), parent, w);
  const auto packed = to_packed<T>(A);
  auto coarse = to_packed<T>(before);

  kernels::coarsen_cell(packed.data(), w, coarse.data());

  const Matrix24 W = oracle::expand(to_eigen8(w));
  const Matrix24 expected = before + W.transpose() * A * W;
  return (from_packed(coarse) - expected).norm() / expected.norm();
}

TEST(CoarsenCell, EqualsTheDenseTripleProduct) {
  Random random(52);
  for (int o = 0; o < 8; ++o)
    for (int mask = 0; mask < 256; ++mask) {
      const FoldCode child = kernels::fold_code(mask, o);
      if (!kernels::fold_is_valid(child)) continue;
      for (const FoldCode parent : {kernels::fold_code(0, 0), kernels::fold_code(0b1110, 0),
                                    kernels::fold_code(0b01101100, 7)}) {
        ASSERT_TRUE(kernels::fold_is_valid(parent));
        ASSERT_LT(coarsen_error<double>(child, parent, random), kRoundOff);
      }
      ASSERT_LT(coarsen_error<float>(child, kernels::fold_code(0, 0), random), kSingle);
    }
}

TEST(CoarsenCell, EightCubesMakeOneCubeOfTwiceTheSide) {
  // Trilinear functions of the parent are trilinear in each child, so the Galerkin matrix is the
  // exact one: 2 K for the stiffness, 8 M for the consistent mass.
  const Matrix24 K = oracle::stiffness(0.3, 1.0), M = oracle::expand(oracle::mass(1.0));
  const auto packed = to_packed<double>(K + M);
  std::vector<double> coarse(kEntries);
  for (int o = 0; o < 8; ++o) {
    double w[8][8];
    kernels::transfer_weights(kernels::fold_code(0, o), o, kernels::fold_code(0, 0), w);
    kernels::coarsen_cell(packed.data(), w, coarse.data());
  }
  const Matrix24 expected = oracle::stiffness(0.3, 2.0) + oracle::expand(oracle::mass(2.0));
  EXPECT_LT((from_packed(coarse) - expected).norm(), kRoundOff * expected.norm());
}

TEST(CoarsenCell, FoldsACornerMatrixToSlots) {
  Random random(53);
  const FoldCode code = kernels::fold_code(0b1110, 0);
  const Matrix24 A = random.symmetric24();
  const Vector24 slots = random.vector24();
  double w[8][8];
  kernels::fold_weights(code, w);
  const auto packed = to_packed<double>(A);
  std::vector<double> folded(kEntries);
  kernels::coarsen_cell(packed.data(), w, folded.data());

  CellVector<double> u = to_cell<double>(slots), corners, f, expected, y;
  unfold(u.at, code, corners.at);
  apply_packed(packed.data(), corners.at, f.at);
  fold_transpose(f.at, code, expected.at);
  apply_packed(folded.data(), u.at, y.at);

  EXPECT_LT((to_eigen(y.at) - to_eigen(expected.at)).norm(), kRoundOff * A.norm() * slots.norm());
}

TEST(CoarsenCell, APassedCellIsCopied) {
  Random random(54);
  const auto packed = to_packed<double>(random.symmetric24());
  std::vector<double> coarse(kEntries);
  double w[8][8];
  kernels::transfer_weights(0, kernels::kPassed, 0, w);
  kernels::coarsen_cell(packed.data(), w, coarse.data());
  EXPECT_EQ(coarse, packed);
}

TEST(CoarsenCorners, IsTheSumOfWhatChildrenGiveOneByOne) {
  Random random(57);
  for (const unsigned present : {0xFFU, 0x01U, 0x80U, 0x0FU, 0xF0U, 0x55U, 0xAAU, 0x33U, 0x6DU}) {
    std::array<std::vector<double>, 8> children;
    std::vector<double> expected(kEntries), out(kEntries, 1e30);
    std::vector<int> asked;
    for (int o = 0; o < 8; ++o) {
      children[static_cast<std::size_t>(o)] = to_packed<double>(random.symmetric24());
      if (((present >> o) & 1U) == 0) continue;
      double w[8][8];
      kernels::transfer_weights(kernels::fold_code(0, o), o, kernels::fold_code(0, 0), w);
      kernels::coarsen_cell(children[static_cast<std::size_t>(o)].data(), w, expected.data());
    }

    kernels::coarsen_corners<double>(
        [&](int o, double(&entries)[kEntries]) {
          asked.push_back(o);
          const auto& from = children[static_cast<std::size_t>(o)];
          std::copy(from.begin(), from.end(), entries);
        },
        present, out.data());

    const Matrix24 A = from_packed(out), B = from_packed(expected);
    EXPECT_LT((A - B).norm(), kRoundOff * B.norm()) << present;
    std::vector<int> rising;
    for (int o = 0; o < 8; ++o)
      if (((present >> o) & 1U) != 0) rising.push_back(o);
    EXPECT_EQ(asked, rising) << present;
  }
}

}  // namespace
}  // namespace kerf::test
