// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "cpu/pack.hpp"
#include "kernels/coarsen.hpp"
#include "kernels/corotate.hpp"
#include "kernels/mode_coarsen.hpp"
#include "kernels/slot_diagonal.hpp"
#include "kernels/transfer.hpp"
#include "tests/kernels/kernel_values.hpp"

namespace kerf::test {
namespace {

using kernels::FinestChild;
using kernels::kEntries;
using kernels::kModeEntries;
using kernels::MassModel;
using kernels::ModeConstants;
using kernels::Quat;
using kernels::Sym3;
using kernels::Vec3;
using oracle::Matrix24;
using Packed = std::vector<double>;

constexpr double kPoisson = 0.3;
constexpr double kRoundOff = 1e-12;  // relative to the greatest entry
constexpr double kSingle = 1e-5;
constexpr MassModel kMassModels[] = {MassModel::consistent, MassModel::lumped};

double greatest(const Packed& a) {
  double out = 0;
  for (const double x : a) out = std::max(out, std::abs(x));
  return out;
}

/// The greatest difference, relative to the greatest entry of b.
double relative_error(const Packed& a, const Packed& b) {
  Packed difference(b.size());
  for (std::size_t e = 0; e < b.size(); ++e) difference[e] = a.at(e) - b[e];
  const double error = greatest(difference);
  return error == 0 ? 0 : error / greatest(b);
}

Packed first(const Packed& a, int entries) { return {a.begin(), a.begin() + entries}; }

/// The eight children of a cell, all finest: those of `present`, the others without stiffness.
struct Family {
  FinestChild<double> child[8]{};
  unsigned present = 0;
};

Family random_family(Random& random, unsigned present, bool with_mass) {
  Family out;
  out.present = present;
  for (int o = 0; o < 8; ++o) {
    out.child[o].rotation = to_quat<double>(random.quaternion());
    if (((present >> o) & 1U) == 0) continue;
    out.child[o].stiffness = random.uniform(0.5, 2);
    if (with_mass) out.child[o].mass = random.uniform(0.5, 2);
  }
  return out;
}

unsigned random_subset(Random& random) { return static_cast<unsigned>(random.uniform(0, 256)); }

// ---- the same by corners, with the functions of other headers ----

Packed corner_matrix(const FinestChild<double>& cell, MassModel model) {
  const auto K = kernels::unit_hex_stiffness(kPoisson);
  const auto M = model == MassModel::lumped ? kernels::unit_hex_mass_lumped<double>()
                                            : kernels::unit_hex_mass<double>();
  Packed out(kEntries);
  kernels::cell_matrix(K, M, to_matrix(cell.rotation), cell.stiffness, cell.mass, out.data());
  return out;
}

void add_to_parent(const Packed& child, int octant, Packed& parent) {
  double w[8][8];
  kernels::transfer_weights(kernels::fold_code(0, 0), octant, kernels::fold_code(0, 0), w);
  kernels::coarsen_cell(child.data(), w, parent.data());
}

Packed corner_parent(const Family& family, MassModel model) {
  Packed out(kEntries);
  for (int o = 0; o < 8; ++o)
    if (((family.present >> o) & 1U) != 0)
      add_to_parent(corner_matrix(family.child[o], model), o, out);
  return out;
}

Packed to_modes_of(const Packed& corners) {
  Packed out(kEntries);
  kernels::modes_from_corners<double>(corners.data(), out.data());
  return out;
}

Packed to_corners_of(const Packed& modes) {
  Packed out(kEntries);
  kernels::corners_from_modes<double>(modes.data(), out.data());
  return out;
}

Packed finest_parent(const Family& family, MassModel model) {
  Packed out(kEntries);
  kernels::coarsen_finest<true>(family.child, kernels::mode_constants(kPoisson, model), out.data());
  return out;
}

Packed finest_modes(const FinestChild<double>& cell, MassModel model) {
  Packed out(kEntries);
  kernels::finest_mode_matrix(to_matrix(cell.rotation), cell.stiffness, cell.mass,
                              kernels::mode_constants(kPoisson, model), out.data());
  return out;
}

bool translations_are_zero(const Packed& S) {
  return std::all_of(S.begin() + kModeEntries, S.end(), [](double x) { return x == 0; });
}

// ---- a basis and one cell ----

TEST(ModeMatrix, IsTheCornerMatrixInTheBasisOfModes) {
  Random random(70);
  Matrix24 H;  // modes, the translations last, from corners
  for (int s = 0; s < 8; ++s)
    for (int i = 0; i < 8; ++i) {
      const int low = s & ~i;
      const double chi = kernels::mode_axes(low) % 2 == 0 ? 1 : -1;
      H.block<3, 3>(3 * (7 - s), 3 * i) = chi * oracle::Matrix3::Identity();
    }
  const Matrix24 S = random.symmetric24();
  const Packed packed = to_packed<double>(S);

  const Packed corners = to_corners_of(packed);

  EXPECT_LT((from_packed(corners) - H.transpose() * S * H).norm(), kRoundOff * S.norm());
  EXPECT_LT(relative_error(to_modes_of(corners), packed), kRoundOff);
}

TEST(FinestModeMatrix, IsTheCornerMatrixOfTheCell) {
  Random random(71);
  for (const MassModel model : kMassModels)
    for (int i = 0; i < 20; ++i) {
      const Family family = random_family(random, 255, i % 2 == 0);
      const Packed corners = corner_matrix(family.child[0], model);
      const Packed S = finest_modes(family.child[0], model);
      EXPECT_LT(relative_error(S, to_modes_of(corners)), kRoundOff);
      EXPECT_LT(relative_error(to_corners_of(S), corners), kRoundOff);
      EXPECT_EQ(translations_are_zero(S), family.child[0].mass == 0);
    }
}

TEST(FinestModeMatrix, HasThirteenBlocks) {
  Random random(72);
  const Packed S = finest_modes(random_family(random, 255, false).child[0], MassModel::consistent);
  int blocks = 0;
  for (int s = 0; s < 8; ++s)
    for (int t = s; t < 8; ++t) {
      bool any = false;
      for (int i = 0; i < 3; ++i)
        for (int k = 0; k < 3; ++k)
          any = any || S[static_cast<std::size_t>(kernels::mode_entry(s, i, t, k))] != 0;
      blocks += any ? 1 : 0;
    }
  EXPECT_EQ(blocks, 13);
}

// ---- the products ----

TEST(CoarsenFinest, EqualsTheProductByCorners) {
  Random random(73);
  for (const MassModel model : kMassModels)
    for (int i = 0; i < 40; ++i) {
      const unsigned present = i < 8 ? 1U << i : (i == 8 ? 255U : random_subset(random));
      const Family family = random_family(random, present, i % 2 == 0);
      const Packed expected = to_modes_of(corner_parent(family, model));
      EXPECT_LT(relative_error(finest_parent(family, model), expected), kRoundOff) << present;
    }
}

TEST(CoarsenFinest, WithoutMassLeavesTheTranslationsAlone) {
  Random random(74);
  const Family family = random_family(random, 0b10110111, false);
  Packed out(kEntries, 7.0);
  kernels::coarsen_finest<false>(
      family.child, kernels::mode_constants(kPoisson, MassModel::consistent), out.data());
  const Packed with_mass = finest_parent(family, MassModel::consistent);
  EXPECT_EQ(first(out, kModeEntries), first(with_mass, kModeEntries));
  EXPECT_EQ(Packed(out.begin() + kModeEntries, out.end()), Packed(kEntries - kModeEntries, 7.0));
  EXPECT_TRUE(translations_are_zero(with_mass));
}

TEST(CoarsenFinest, EightCubesMakeOneCubeOfTwiceTheSide) {
  Random random(75);
  const Eigen::Quaterniond q = random.quaternion();
  Family family;
  for (auto& child : family.child) child = {to_quat<double>(q), 1.0, 1.0};
  const Matrix24 expected = oracle::rotated(oracle::stiffness(kPoisson, 2), q.toRotationMatrix()) +
                            oracle::expand(oracle::mass(2));
  const Packed out = to_corners_of(finest_parent(family, MassModel::consistent));
  EXPECT_LT((from_packed(out) - expected).norm(), kRoundOff * expected.norm());
}

/// A cell of two levels: the matrices of its eight children, and its own, by corners and by modes.
struct TwoLevels {
  Packed corner_parent = Packed(kEntries);
  Packed children[8];
};

TwoLevels random_levels(Random& random, unsigned present, bool with_mass, MassModel model) {
  TwoLevels out;
  for (int o = 0; o < 8; ++o) {
    const unsigned finest = ((present >> o) & 1U) == 0 ? 0U : std::max(1U, random_subset(random));
    const Family family = random_family(random, finest, with_mass);
    out.children[o] = finest_parent(family, model);
    add_to_parent(corner_parent(family, model), o, out.corner_parent);
  }
  return out;
}

/// Children come as if computed when asked for, into memory for the two along x.
template <bool with_translations>
Packed coarsen(const Packed (&children)[8], unsigned present) {
  Packed out(kernels::kStoredEntries<with_translations>), pair[2];
  unsigned asked = 0;
  const auto child = [&](int o) {
    EXPECT_EQ(asked >> o, 0U);  // once, rising
    asked |= 1U << o;
    pair[o % 2] = first(children[o], kernels::kStoredEntries<with_translations>);
    return pair[o % 2].data();
  };
  kernels::coarsen_modes<with_translations, double>(child, present, out.data());
  EXPECT_EQ(asked, present);
  return out;
}

TEST(CoarsenModes, EqualsTheProductByCornersOnTwoLevels) {
  Random random(76);
  for (const MassModel model : kMassModels)
    for (int i = 0; i < 40; ++i) {
      const unsigned present = i < 8 ? 1U << i : (i == 8 ? 255U : random_subset(random));
      const bool with_mass = i % 2 == 0;
      const TwoLevels cell = random_levels(random, present, with_mass, model);
      const Packed expected = to_modes_of(cell.corner_parent);

      const Packed out = coarsen<true>(cell.children, present);

      EXPECT_LT(relative_error(out, expected), kRoundOff) << present;
      if (with_mass) continue;
      EXPECT_TRUE(translations_are_zero(out));
      EXPECT_EQ(coarsen<false>(cell.children, present), first(out, kModeEntries));
    }
}

TEST(CoarsenModes, EqualsTheProductOfAnyMatrices) {
  Random random(77);
  Packed children[8], expected(kEntries);
  for (int o = 0; o < 8; ++o) {
    const Packed corners = to_packed<double>(random.symmetric24());
    children[o] = to_modes_of(corners);
    add_to_parent(corners, o, expected);
  }
  EXPECT_LT(relative_error(coarsen<true>(children, 255), to_modes_of(expected)), kRoundOff);
}

TEST(CoarsenModes, AnAbsentChildIsAMatrixOfZeros) {
  Random random(78);
  for (unsigned present = 0; present < 256; ++present) {
    const TwoLevels cell = random_levels(random, present, true, MassModel::consistent);
    const Packed out = coarsen<true>(cell.children, present);
    EXPECT_EQ(out, coarsen<true>(cell.children, 255)) << present;
  }
}

/// Whether A + shift I has a Cholesky factor, so that no eigenvalue of A is below -shift.
bool is_positive_with(const Packed& A, double shift) {
  Packed L = A;
  const auto at = [&](int row, int col) -> double& {
    return L[static_cast<std::size_t>(kernels::packed_index(row, col))];
  };
  for (int row = 0; row < 24; ++row)
    for (int col = 0; col <= row; ++col) {
      double sum = at(row, col) + (row == col ? shift : 0);
      for (int k = 0; k < col; ++k) sum -= at(row, k) * at(col, k);
      if (row == col && !(sum > 0)) return false;
      at(row, col) = row == col ? std::sqrt(sum) : sum / at(col, col);
    }
  return true;
}

TEST(CoarsenModes, IsSemidefinite) {
  Random random(79);
  for (int i = 0; i < 20; ++i) {
    const unsigned present = 1U | random_subset(random);
    const TwoLevels cell = random_levels(random, present, i % 2 == 0, MassModel::consistent);
    const Packed out = coarsen<true>(cell.children, present);
    EXPECT_TRUE(is_positive_with(out, kRoundOff * greatest(out)));
    Packed negative = out;
    for (double& entry : negative) entry = -entry;
    EXPECT_FALSE(is_positive_with(negative, kRoundOff * greatest(out)));
  }
}

// ---- packs ----

template <class T>
T pack_of(const double (&lanes)[T::kLanes]) {
  T out(0.0);
  for (int l = 0; l < T::kLanes; ++l) out.set(l, static_cast<typename T::Scalar>(lanes[l]));
  return out;
}

/// Families, one in each lane.
template <class T>
void to_lanes(const Family (&families)[T::kLanes], FinestChild<T> (&out)[8]) {
  for (int o = 0; o < 8; ++o) {
    const auto gathered = [&](auto member) {
      double lanes[T::kLanes];
      for (int l = 0; l < T::kLanes; ++l) lanes[l] = member(families[l].child[o]);
      return pack_of<T>(lanes);
    };
    using Child = FinestChild<double>;
    out[o].rotation = {gathered([](const Child& c) { return c.rotation.w; }),
                       gathered([](const Child& c) { return c.rotation.x; }),
                       gathered([](const Child& c) { return c.rotation.y; }),
                       gathered([](const Child& c) { return c.rotation.z; })};
    out[o].stiffness = gathered([](const Child& c) { return c.stiffness; });
    out[o].mass = gathered([](const Child& c) { return c.mass; });
  }
}

template <class T>
Packed lane_of(const std::vector<T>& packs, int lane) {
  Packed out;
  for (const T& pack : packs) out.push_back(static_cast<double>(pack[lane]));
  return out;
}

template <class T>
class ModePacks : public testing::Test {};
using Packs = testing::Types<cpu::Pack<double>, cpu::Pack<float>>;
TYPED_TEST_SUITE(ModePacks, Packs);

TYPED_TEST(ModePacks, EveryLaneIsItsOwnParent) {
  using T = TypeParam;
  constexpr int lanes = T::kLanes;
  const double tolerance = sizeof(typename T::Scalar) == 8 ? kRoundOff : kSingle;
  Random random(80);
  const auto constants = kernels::mode_constants(T(kPoisson), MassModel::consistent);
  std::vector<T> children[8], out(kEntries, T(0));
  Packed expected[lanes];
  for (auto& e : expected) e.resize(kEntries);
  for (int o = 0; o < 7; ++o) {  // the last is absent in every lane
    Family families[lanes];
    for (auto& f : families) f = random_family(random, random_subset(random), true);
    FinestChild<T> packed[8];
    to_lanes<T>(families, packed);
    children[o].assign(kEntries, T(0));
    kernels::coarsen_finest<true>(packed, constants, children[o].data());
    for (int l = 0; l < lanes; ++l) {
      const Packed parent = corner_parent(families[l], MassModel::consistent);
      EXPECT_LT(relative_error(lane_of(children[o], l), to_modes_of(parent)), tolerance);
      add_to_parent(parent, o, expected[l]);
    }
  }

  kernels::coarsen_modes<true, T>([&](int o) { return children[o].data(); }, 127U, out.data());

  Vec3<T> u[8];
  for (auto& v : u) v = {T(random.normal()), T(random.normal()), T(random.normal())};
  Sym3<T> D[8];
  kernels::mode_diagonal_blocks<true>(out.data(), D);
  apply_mode_matrix<true>(out.data(), u, u);
  for (int l = 0; l < lanes; ++l) {
    EXPECT_LT(relative_error(lane_of(out, l), to_modes_of(expected[l])), tolerance);
    for (int i = 0; i < 8; ++i) {
      const auto block = kernels::packed_diagonal<double>(expected[l].data(), i);
      EXPECT_NEAR(double(D[i].xz[l]), block.xz, tolerance * greatest(expected[l]));
    }
  }
}

// ---- use ----

template <bool with_translations>
double apply_error(const Packed& corners, Random& random) {
  const CellVector<double> u = to_cell<double>(random.vector24());
  CellVector<double> f = u, expected;
  apply_packed(corners.data(), u.at, expected.at);
  const Packed S = first(to_modes_of(corners), kernels::kStoredEntries<with_translations>);
  apply_mode_matrix<with_translations>(S.data(), f.at, f.at);  // f may be u
  return (to_eigen(f.at) - to_eigen(expected.at)).norm() /
         (greatest(corners) * to_eigen(u.at).norm());
}

TEST(ApplyModeMatrix, EqualsTheProductByCorners) {
  Random random(81);
  for (int i = 0; i < 20; ++i) {
    EXPECT_LT(apply_error<true>(to_packed<double>(random.symmetric24()), random), kRoundOff);
    const Family family = random_family(random, 1U | random_subset(random), false);
    EXPECT_LT(apply_error<false>(corner_parent(family, MassModel::consistent), random), kRoundOff);
  }
}

// With rows and columns of each corner turned, and so of each mode.
TEST(TurnModeMatrix, TurnsEveryCorner) {
  Random random(87);
  for (int i = 0; i < 20; ++i) {
    const Matrix24 A = random.symmetric24();
    const Eigen::Quaterniond q = random.quaternion();
    Matrix24 turn = Matrix24::Zero();
    for (int n = 0; n < 24; n += 3) turn.block<3, 3>(n, n) = q.toRotationMatrix();
    Packed found = to_modes_of(to_packed<double>(A));
    kernels::turn_mode_matrix(to_matrix(to_quat<double>(q)), found);
    const Packed expected = to_modes_of(to_packed<double>(Matrix24(turn * A * turn.transpose())));
    EXPECT_LT(relative_error(found, expected), kRoundOff);
  }
}

double block_error(const Sym3<double> (&D)[8], const Packed& corners) {
  double out = 0;
  for (int i = 0; i < 8; ++i)
    out = std::max(out, (to_eigen(D[i].full()) -
                         to_eigen(kernels::packed_diagonal<double>(corners.data(), i).full()))
                            .cwiseAbs()
                            .maxCoeff());
  return out / greatest(corners);
}

TEST(DiagonalBlocks, AreThoseOfTheCornerMatrix) {
  Random random(82);
  Sym3<double> D[8];
  for (int i = 0; i < 20; ++i) {
    const Packed any = to_packed<double>(random.symmetric24());
    kernels::mode_diagonal_blocks<true>(to_modes_of(any).data(), D);
    EXPECT_LT(block_error(D, any), kRoundOff);

    const Family family = random_family(random, 1U | random_subset(random), false);
    const Packed elastic = corner_parent(family, MassModel::consistent);
    kernels::mode_diagonal_blocks<false>(first(to_modes_of(elastic), kModeEntries).data(), D);
    EXPECT_LT(block_error(D, elastic), kRoundOff);
  }
}

TEST(DiagonalBlocks, OfAFinestCellNeedNoMatrix) {
  Random random(83);
  Sym3<double> D[8];
  for (const MassModel model : kMassModels)
    for (int i = 0; i < 20; ++i) {
      const FinestChild<double> cell = random_family(random, 255, i % 2 == 0).child[0];
      kernels::finest_diagonal_blocks(to_matrix(cell.rotation), cell.stiffness, cell.mass,
                                      kernels::mode_constants(kPoisson, model), D);
      EXPECT_LT(block_error(D, corner_matrix(cell, model)), kRoundOff);
    }
}

/// Of the matrix over slots.
Packed folded(const Packed& corners, kernels::FoldCode code) {
  double w[8][8];
  kernels::fold_weights(code, w);
  Packed slots(kEntries, 0);
  kernels::coarsen_cell(corners.data(), w, slots.data());
  return slots;
}

TEST(DiagonalBlocks, AtSlotsNeedOnlyTheModesOfWhatASlotMoves) {
  Random random(84);
  for (int octant = 0; octant < 8; ++octant)
    for (int hanging = 0; hanging < 256; ++hanging) {
      const kernels::FoldCode code = kernels::fold_code(hanging, octant);
      if (!kernels::fold_is_valid(code)) continue;
      const MassModel model = kMassModels[hanging % 2];
      const FinestChild<double> cell = random_family(random, 255, hanging % 3 != 0).child[0];
      const ModeConstants<double> constants = kernels::mode_constants(kPoisson, model);
      const Packed corners = corner_matrix(cell, model), slots = folded(corners, code);
      Sym3<double> finest[8], stored[8], regular[8];
      kernels::finest_diagonal_blocks(to_matrix(cell.rotation), cell.stiffness, cell.mass,
                                      constants, regular);
      for (int slot = 0; slot < 8; ++slot) {
        double m[8];
        kernels::slot_modes(code, slot, m);
        kernels::stored_slot_block<true>(to_modes_of(corners).data(), m, stored[slot]);
        kernels::finest_slot_block(to_matrix(cell.rotation), cell.stiffness, cell.mass, constants,
                                   kernels::slot_gram(m, constants.mass), finest[slot]);
        if (!kernels::is_folded_slot(code, slot)) stored[slot] = regular[slot];
      }
      EXPECT_LT(block_error(finest, slots), kRoundOff) << code;
      EXPECT_LT(block_error(stored, slots), kRoundOff) << code;
    }
}

}  // namespace
}  // namespace kerf::test
