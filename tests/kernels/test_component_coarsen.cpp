// SPDX-License-Identifier: MIT
//
// Galerkin products by pairs of components against those of whole matrices (coarsen.hpp).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "kernels/coarsen.hpp"
#include "kernels/component_coarsen.hpp"
#include "kernels/corotate.hpp"
#include "tests/kernels/kernel_values.hpp"

namespace kerf::test {
namespace {

using kernels::ComponentPair;
using kernels::FoldCode;
using kernels::kComponentPairs;
using kernels::kCorners;
using kernels::kEntries;
using kernels::MassModel;

constexpr double kRoundOff = 1e-13;  // relative to the greatest entry
constexpr double kSingle = 1e-6;

template <class T>
constexpr double kTolerance = sizeof(T) == sizeof(double) ? kRoundOff : kSingle;

double relative_error(const std::vector<double>& a, const std::vector<double>& b) {
  double error = 0, greatest = 0;
  for (std::size_t e = 0; e < b.size(); ++e) {
    error = std::max(error, std::abs(a.at(e) - b[e]));
    greatest = std::max(greatest, std::abs(b[e]));
  }
  return error / greatest;
}

/// The whole matrix, pair by pair. EXPECTs that what is stored twice agrees.
template <class T, class Make>
std::vector<double> by_pairs(const Make& make) {
  std::vector<double> out(kEntries, std::nan(""));
  for (int number = 0; number < kComponentPairs; ++number) {
    const ComponentPair pair = kernels::component_pair(number);
    T A[kCorners][kCorners] = {};
    make(pair, A);
    for (int p = 0; p < kCorners; ++p)
      for (int q = 0; q < kCorners; ++q) {
        double& entry = out[static_cast<std::size_t>(kernels::pair_entry(p, q, pair))];
        if (!std::isnan(entry)) {
          EXPECT_NEAR(entry, A[p][q], 100 * kTolerance<T>);
        }
        entry = A[p][q];
      }
  }
  return out;
}

template <class T>
void read_pair(const std::vector<double>& packed, ComponentPair pair, T (&A)[kCorners][kCorners]) {
  for (int p = 0; p < kCorners; ++p)
    for (int q = 0; q < kCorners; ++q)
      A[p][q] = static_cast<T>(packed[static_cast<std::size_t>(kernels::pair_entry(p, q, pair))]);
}

struct Child {
  kernels::Quat<double> rotation;
  double stiffness, mass, poisson;
};

struct Family {
  Child child[8];
  unsigned present;
  MassModel model;
};

std::vector<double> matrix_of(const Child& c, MassModel model) {
  std::vector<double> out(kEntries);
  const auto M = model == MassModel::lumped ? kernels::unit_hex_mass_lumped<double>()
                                            : kernels::unit_hex_mass<double>();
  kernels::cell_matrix(kernels::unit_hex_stiffness(c.poisson), M, kernels::to_matrix(c.rotation),
                       c.stiffness, c.mass, out.data());
  return out;
}

std::vector<Family> families() {
  Random random(71);
  std::vector<Family> out;
  for (const MassModel model : {MassModel::consistent, MassModel::lumped})
    for (const unsigned present : {0xffu, 0x01u, 0x80u, 0x5au, 0x37u}) {
      Family f{{}, present, model};
      for (Child& c : f.child)
        c = {to_quat<double>(random.quaternion()), random.uniform(0.5, 2), random.uniform(0, 0.5),
             random.uniform(-0.2, 0.45)};
      out.push_back(f);
    }
  return out;
}

TEST(ComponentPairs, NameEachEntryOfTheTriangle) {
  std::vector<int> times(kEntries, 0);
  for (int number = 0; number < kComponentPairs; ++number) {
    const ComponentPair pair = kernels::component_pair(number);
    ASSERT_GE(pair.i, pair.k);
    for (int p = 0; p < kCorners; ++p)
      for (int q = 0; q < kCorners; ++q) {
        if (pair.i == pair.k && q > p) continue;
        ++times[static_cast<std::size_t>(kernels::pair_entry(p, q, pair))];
      }
  }
  EXPECT_TRUE(std::all_of(times.begin(), times.end(), [](int n) { return n == 1; }));
}

template <class T>
class ComponentCoarsen : public ::testing::Test {};
using Scalars = ::testing::Types<double, float>;
TYPED_TEST_SUITE(ComponentCoarsen, Scalars);

TYPED_TEST(ComponentCoarsen, MatrixOfAFinestCell) {
  using T = TypeParam;
  for (const Family& f : families()) {
    const Child& c = f.child[3];
    const auto unit = kernels::mode_constants<T>(static_cast<T>(c.poisson), f.model);
    const std::vector<double> found =
        by_pairs<T>([&](ComponentPair pair, T(&A)[kCorners][kCorners]) {
          T forces[10];
          const auto R = to_mat3<T>(to_eigen(kernels::to_matrix(c.rotation)));
          kernels::component_forces(R, static_cast<T>(c.stiffness), static_cast<T>(c.mass),
                                    unit.stiffness, pair, forces);
          kernels::component_matrix(forces, unit.mass, A);
        });
    EXPECT_LE(relative_error(found, matrix_of(c, f.model)), kTolerance<T>);
  }
}

TYPED_TEST(ComponentCoarsen, ParentOfFinestChildren) {
  using T = TypeParam;
  for (const Family& f : families()) {
    std::vector<double> expected(kEntries, 0.0);
    for (int o = 0; o < 8; ++o) {
      if (((f.present >> o) & 1) == 0) continue;
      double weights[kCorners][kCorners];
      kernels::transfer_weights(FoldCode{0}, o, FoldCode{0}, weights);
      const std::vector<double> A = matrix_of(f.child[o], f.model);
      kernels::coarsen_cell(A.data(), weights, expected.data());
    }
    const auto unit = kernels::mode_constants<T>(T(0), f.model);
    const std::vector<double> found =
        by_pairs<T>([&](ComponentPair pair, T(&A)[kCorners][kCorners]) {
          T sums[10][kCorners] = {};
          for (int o = 0; o < 8; ++o) {
            if (((f.present >> o) & 1) == 0) continue;
            const Child& c = f.child[o];
            const auto of = kernels::mode_constants<T>(static_cast<T>(c.poisson), f.model);
            T forces[10];
            kernels::component_forces(to_mat3<T>(to_eigen(kernels::to_matrix(c.rotation))),
                                      static_cast<T>(c.stiffness), static_cast<T>(c.mass),
                                      of.stiffness, pair, forces);
            for (int q = 0; q < 10; ++q) sums[q][o] = forces[q];
          }
          kernels::component_sums(sums);
          kernels::component_parent(sums, unit.mass, A);
        });
    EXPECT_LE(relative_error(found, expected), kTolerance<T>) << f.present;
  }
}

TYPED_TEST(ComponentCoarsen, ParentOfAStoredChild) {
  using T = TypeParam;
  Random random(72);
  for (int place = 0; place < 8; ++place) {
    const std::vector<double> A = to_packed<double>(random.symmetric24());
    std::vector<double> expected(kEntries, 0.0);
    double weights[kCorners][kCorners];
    kernels::transfer_weights(FoldCode{0}, place, FoldCode{0}, weights);
    kernels::coarsen_cell(A.data(), weights, expected.data());
    const std::vector<double> found =
        by_pairs<T>([&](ComponentPair pair, T(&out)[kCorners][kCorners]) {
          read_pair(A, pair, out);
          kernels::restrict_component(place, out);
        });
    EXPECT_LE(relative_error(found, expected), kTolerance<T>) << place;
  }
}

// Hanging corners of child and parent, held components, places and passed cells.
TYPED_TEST(ComponentCoarsen, AnyChildByItsWeights) {
  using T = TypeParam;
  Random random(73);
  int checked = 0;
  for (const FoldCode parent : {FoldCode{0}, kernels::fold_code(0b00001110, 0)})
    for (int octant = 0; octant < 8; ++octant)
      for (int hanging = 0; hanging < 256; ++hanging) {
        const FoldCode child = kernels::fold_code(hanging, octant);
        if (!kernels::fold_is_valid(child)) continue;
        ASSERT_TRUE(kernels::fold_is_valid(parent));
        const Child c{to_quat<double>(random.quaternion()), 1.3, 0.4, 0.3};
        const unsigned held[3] = {0x11u, 0u, 0x42u};
        // Whole matrices: to slots, held rows and columns zero, then to the parent.
        const std::vector<double> A = matrix_of(c, MassModel::consistent);
        double fold[kCorners][kCorners], transfer[kCorners][kCorners];
        kernels::fold_weights(child, fold);
        kernels::transfer_weights(child, octant, parent, transfer);
        std::vector<double> slots(kEntries, 0.0), expected(kEntries, 0.0);
        kernels::coarsen_cell(A.data(), fold, slots.data());
        for (int row = 0; row < 24; ++row)
          for (int col = 0; col <= row; ++col)
            if (((held[row % 3] >> (row / 3)) & 1) != 0 || ((held[col % 3] >> (col / 3)) & 1) != 0)
              slots[static_cast<std::size_t>(kernels::packed_index(row, col))] = 0;
        kernels::coarsen_cell(slots.data(), transfer, expected.data());

        const std::vector<double> found =
            by_pairs<T>([&](ComponentPair pair, T(&out)[kCorners][kCorners]) {
              T corners[kCorners][kCorners], left[kCorners][kCorners], right[kCorners][kCorners];
              read_pair(A, pair, corners);
              kernels::corner_weights(child, octant, parent, held[pair.i], left);
              kernels::corner_weights(child, octant, parent, held[pair.k], right);
              kernels::add_weighted(corners, left, right, out);
            });
        EXPECT_LE(relative_error(found, expected), kTolerance<T>);
        ++checked;
      }
  EXPECT_EQ(checked, 2 * 8 * 18);
}

}  // namespace
}  // namespace kerf::test
