// SPDX-License-Identifier: MIT
//
// The factor of the coarsest level in fronts: against a sparse factor, products with the matrix,
// and what rounding may do.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "core/solve/sparse_cholesky.hpp"
#include "cpu/front_factor.hpp"
#include "kernels/layout.hpp"
#include "kernels/noise.hpp"
#include "tests/support/cut_octree.hpp"
#include "tests/support/problem.hpp"
#include "tests/support/scenes.hpp"

namespace kerf {
namespace {

using test::cut_octree;
using test::Problem;
using test::ProblemOptions;

// L^-1 and -K L^-1 from a matrix, against products with L and K.
TEST(DenseFronts, InvertWhatTheyEliminate) {
  const std::pair<int, int> sizes[] = {{8, 4}, {24, 12}, {56, 24}, {64, 28}, {72, 64}, {16, 16}};
  for (const auto& [height, columns] : sizes) {
    SCOPED_TRACE(::testing::Message() << height << " rows, " << columns << " columns");
    const auto stride = static_cast<std::size_t>(height + 4);
    std::vector<double> values(stride * static_cast<std::size_t>(height));
    const cpu::DenseFront dense(values.data(), height, columns, stride);
    for (int j = 0; j < height; ++j)
      for (int i = j; i < height; ++i)
        dense.column(j)[i] =
            i == j ? height : kernels::noise(static_cast<std::uint64_t>(height * i + j));
    ASSERT_TRUE(dense.eliminate([](int, double pivot) { return pivot > 0; }));
    const std::vector<double> L = values;
    const auto of_L = [&](int i, int j) {
      return i < j ? 0 : L[stride * std::size_t(j) + std::size_t(i)];
    };

    dense.invert();

    for (int j = 0; j < columns; ++j)
      for (int i = 0; i < height; ++i) {
        double sum = 0;  // of G L: the identity, and -K
        for (int k = 0; k < columns; ++k) sum += dense.column(k)[i] * of_L(k, j);
        const double expected = i >= columns ? -of_L(i, j) : i == j ? 1 : 0;
        EXPECT_NEAR(sum, expected, 1e-14 * height) << i << ", " << j;
        if (i < j) {
          EXPECT_EQ(dense.column(j)[i], 0) << i << ", " << j;
        }
      }
  }
}

bool is_held(const Level& level, std::int32_t cell, int i) {
  const std::int32_t v = level.slots[cell][static_cast<std::size_t>(i / 3)];
  return ((level.fixed[v] >> (i % 3)) & 1) != 0;
}

/// A level with cell matrices of noise, and `diagonal` on their diagonal; zero where held.
AssembledLevel noisy(const Level& level, double diagonal) {
  AssembledLevel out(level);
  std::uint64_t count = 0;
  out.assemble(level, [&](std::int32_t cell, std::span<double> packed) {
    const auto held = [&](int i) { return is_held(level, cell, i); };
    for (int i = 0; i < 24; ++i)
      for (int j = 0; j <= i; ++j)
        packed[static_cast<std::size_t>(kernels::packed_index(i, j))] =
            held(i) || held(j) ? 0
            : i == j           ? diagonal
                               : kernels::noise(count++);
  });
  return out;
}

template <class S>
std::vector<double> solved_by_fronts(const Level& level, const AssembledLevel& matrix, int threads,
                                     std::vector<double> x) {
  cpu::FrontFactor<S> factor;
  factor.analyse(level, matrix);
  EXPECT_TRUE(factor.factor(matrix, threads));
  factor.solve(x, threads);
  return x;
}

double dot(const std::vector<double>& a, const std::vector<double>& b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

std::vector<double> product(const AssembledLevel& matrix, const std::vector<double>& x) {
  std::vector<double> out(x.size());
  for (int column = 0; column < matrix.unknowns(); ++column)
    for (int k = matrix.column_begin[column]; k < matrix.column_begin[column + 1]; ++k) {
      const int row = matrix.row[k];
      out[row] += matrix.value[k] * x[column];
      if (row != column) out[column] += matrix.value[k] * x[row];
    }
  return out;
}

double difference(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0, size = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    sum += (a[i] - b[i]) * (a[i] - b[i]);
    size += b[i] * b[i];
  }
  return std::sqrt(sum / size);
}

TEST(Fronts, SolveAsASparseFactorDoes) {
  const Problem p = cut_octree(true);
  for (const std::size_t l : {1, 2}) {
    const Level& level = p.hierarchy.levels[l];
    const AssembledLevel matrix = noisy(level, 20);
    std::vector<double> right(static_cast<std::size_t>(matrix.unknowns())), expected(right);
    for (std::size_t i = 0; i < right.size(); ++i)
      right[i] = (level.fixed[i / 3] >> (i % 3) & 1) != 0 ? 0 : kernels::noise(i);
    SparseCholesky sparse(CholeskyEngine::simplicial);
    sparse.analyse(matrix);
    ASSERT_TRUE(sparse.factor(matrix));
    sparse.solve(right, expected);
    const std::vector<double> one = solved_by_fronts<double>(level, matrix, 1, right);
    EXPECT_LT(difference(one, expected), 1e-12);
    EXPECT_EQ(one, solved_by_fronts<double>(level, matrix, 3, right));
    EXPECT_LT(difference(solved_by_fronts<float>(level, matrix, 2, right), expected), 1e-6);
  }
}

/// A cube, as wide as `cells`, in cubes of its own.
Problem diced(int cells, int width) {
  LinkedOctree body(test::box_body({cells, cells, cells}), 0);
  for (int z = 0; z < cells; ++z)
    for (int y = 0; y < cells; ++y)
      for (int x = 0; x < cells; ++x)
        for (int axis = 0; axis < 3; ++axis)
          if (const Vec3i at{x, y, z}; at[axis] % width == width - 1 && at[axis] < cells - 1)
            test::disconnect(body, at, axis);
  ProblemOptions options;
  options.max_levels = 1;
  options.with_oracle = false;
  return Problem(std::move(body), options);
}

// Vertices of several pieces lie at one place, so that no plane parts them.
TEST(Fronts, HaveOnePieceEach) {
  for (const auto& [cells, width] : {std::pair{8, 1}, {8, 2}, {12, 3}}) {
    SCOPED_TRACE(::testing::Message() << cells << " cells, pieces of " << width);
    const Problem p = diced(cells, width);
    const Level& level = p.hierarchy.levels[0];
    const cpu::Fronts fronts(level, AssembledLevel(level));
    std::vector<int> piece(level.point.size());
    for (std::int32_t c = 0; c < level.cells(); ++c)
      for (const std::int32_t v : level.slots[c]) {
        piece[v] = 0;
        for (std::size_t axis = 0; axis < 3; ++axis)
          piece[v] = cells * piece[v] + level.corner[c][axis] / width;
      }
    std::size_t most = 0;
    for (const cpu::Front& front : fronts.all) {
      most = std::max(most, front.vertices.size() + front.rows.size());
      for (const int v : front.vertices) EXPECT_EQ(piece[v], piece[front.vertices[0]]);
      for (const int v : front.rows) EXPECT_EQ(piece[v], piece[front.vertices[0]]);
    }
    EXPECT_LE(most, std::pow(width + 1, 3));
  }
}

TEST(Fronts, SolveSeparatePieces) {
  const Problem p = diced(16, 4);  // 64 pieces
  const Level& level = p.hierarchy.levels[0];
  const AssembledLevel matrix = noisy(level, 20);
  const cpu::Fronts fronts(level, matrix);
  EXPECT_GT(fronts.branches.size(), 4u);
  EXPECT_LE(fronts.branches.size(), 17u);
  std::vector<int> all = fronts.trunk;
  for (const std::vector<int>& branch : fronts.branches)
    all.insert(all.end(), branch.begin(), branch.end());
  std::sort(all.begin(), all.end());
  std::vector<int> expected(fronts.all.size());
  std::iota(expected.begin(), expected.end(), 0);
  EXPECT_EQ(all, expected);

  std::vector<double> x(static_cast<std::size_t>(matrix.unknowns()));
  for (std::size_t i = 0; i < x.size(); ++i)
    x[i] = (level.fixed[i / 3] >> (i % 3) & 1) != 0 ? 0 : kernels::noise(i);
  const std::vector<double> right = product(matrix, x);
  EXPECT_LT(difference(solved_by_fronts<double>(level, matrix, 2, right), x), 1e-12);
  EXPECT_LT(difference(solved_by_fronts<float>(level, matrix, 2, right), x), 1e-6);
}

// Cells that resist differences between their corners alone, and `diagonal`: smooth vectors have
// next to no energy. The error of numbers in single precision, in the norm of the matrix, may grow
// with the root of the condition; that the operator is symmetric does not depend on it.
TEST(Fronts, SolveNearlySingularMatrices) {
  const Problem p = cut_octree(true);
  const Level& level = p.hierarchy.levels[1];
  for (const double diagonal : {1e-4, 1e-8}) {
    AssembledLevel matrix(level);
    matrix.assemble(level, [&](std::int32_t cell, std::span<double> packed) {
      const auto entry = [&](int i, int j) {
        if (is_held(level, cell, i) || is_held(level, cell, j)) return 0.0;
        return i == j ? 7 + diagonal : (i - j) % 3 == 0 ? -1.0 : 0.0;
      };
      for (int i = 0; i < 24; ++i)
        for (int j = 0; j <= i; ++j)
          packed[static_cast<std::size_t>(kernels::packed_index(i, j))] = entry(i, j);
    });
    cpu::FrontFactor<float> factor;
    factor.analyse(level, matrix);
    ASSERT_TRUE(factor.factor(matrix, 2));
    std::vector<double> x(static_cast<std::size_t>(matrix.unknowns())), z(x);
    for (std::size_t i = 0; i < x.size(); ++i) {
      const bool held = (level.fixed[i / 3] >> (i % 3) & 1) != 0;
      x[i] = held ? 0 : 1 + 0.1 * kernels::noise(i);
      z[i] = held ? 0 : kernels::noise(i + 7);
    }
    const std::vector<double> right = product(matrix, x);
    std::vector<double> found = right, other = z;
    factor.solve(found, 2);
    factor.solve(other, 2);
    EXPECT_NEAR(dot(z, found), dot(right, other), 1e-9 * std::abs(dot(z, found)));
    std::vector<double> error(x);
    for (std::size_t i = 0; i < x.size(); ++i) error[i] -= found[i];
    const double relative =
        std::sqrt(dot(error, product(matrix, error)) / dot(x, product(matrix, x)));
    constexpr double kMost = 64;   // no eigenvalue is larger: eight cells of 8 at a vertex
    constexpr double kEps = 6e-8;  // half a unit in the last place
    EXPECT_LT(relative, 10 * kEps * std::sqrt(kMost / diagonal)) << diagonal;
  }
}

TEST(Fronts, SayThatAMatrixIsNotDefinite) {
  const Problem p = cut_octree(true);
  const Level& level = p.hierarchy.levels[1];
  const AssembledLevel matrix = noisy(level, 0.1);
  cpu::FrontFactor<double> factor;
  factor.analyse(level, matrix);
  EXPECT_FALSE(factor.factor(matrix, 2));
}

}  // namespace
}  // namespace kerf
