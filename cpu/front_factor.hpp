// SPDX-License-Identifier: MIT
//
// Numbers of a Cholesky factor in fronts. Eliminated in double; kept in the scalars of the cycle,
// which leaves a factor of a matrix as near to A as those that single precision makes elsewhere,
// and positive definite as before. The same bits for any number of threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <span>
#include <vector>

#include "cpu/fronts.hpp"
#include "cpu/patch_draft.hpp"
#include "cpu/patch_sweep.hpp"

namespace kerf::cpu {

/// Fronts are padded to four rows, so packs are no wider where a register is.
using FrontPack = Pack<double, 32>;
inline FrontPack four_at(const double* from) { return load_pack<double, 32>(from); }

/// A dense symmetric matrix by columns, of which the first `columns` are eliminated. Sizes are
/// multiples of four, and columns begin `stride` scalars apart.
class DenseFront {
 public:
  using P = FrontPack;

  DenseFront(double* values, int height, int columns, std::size_t stride)
      : values_(values), height_(height), columns_(columns), stride_(stride) {}

  double* column(int j) const { return values_ + stride_ * static_cast<std::size_t>(j); }

  /// Columns of L, and in the others what is left of the matrix. accept(j, pivot) says whether to
  /// go on; returns whether it always did.
  template <class Accept>
  bool eliminate(const Accept& accept) const {
    for (int j = 0; j < height_; j += 4) {
      subtract(j, std::min(j, columns_));
      if (j < columns_ && !(factor_block(j, accept))) return false;
    }
    return true;
  }

 private:
  /// Four columns from j on, less their part in the first `count` columns of L.
  void subtract(int j, int count) const {
    int i = j;
    for (; i + 12 <= height_; i += 12) subtract_tile<3>(i, j, count);
    for (; i < height_; i += 4) subtract_tile<1>(i, j, count);
  }

  template <int kPacks>
  void subtract_tile(int i, int j, int count) const {
    P sum[kPacks][4];
    for (int q = 0; q < 4; ++q)
      for (int p = 0; p < kPacks; ++p) sum[p][q] = four_at(column(j + q) + i + 4 * p);
    for (int k = 0; k < count; ++k) {
      const double* const left = column(k);
      P at[kPacks];
      for (int p = 0; p < kPacks; ++p) at[p] = four_at(left + i + 4 * p);
      for (int q = 0; q < 4; ++q) {
        const P factor = P(-left[j + q]);
        for (int p = 0; p < kPacks; ++p) sum[p][q] = fma(at[p], factor, sum[p][q]);
      }
    }
    for (int q = 0; q < 4; ++q)
      for (int p = 0; p < kPacks; ++p) store_pack(column(j + q) + i + 4 * p, sum[p][q]);
  }

  template <class Accept>
  bool factor_block(int j, const Accept& accept) const {
    double inverse[4];
    for (int q = 0; q < 4; ++q) {
      double* const at = column(j + q) + j;
      for (int k = 0; k < q; ++k)
        for (int i = q; i < 4; ++i) at[i] -= column(j + k)[j + i] * column(j + k)[j + q];
      if (!accept(j + q, at[q])) return false;
      at[q] = std::sqrt(at[q]);
      inverse[q] = 1 / at[q];
      for (int i = 0; i < q; ++i) at[i] = 0;
      for (int i = q + 1; i < 4; ++i) at[i] *= inverse[q];
    }
    for (int i = j + 4; i < height_; i += 4) {
      P x[4];
      for (int q = 0; q < 4; ++q) {
        x[q] = four_at(column(j + q) + i);
        for (int k = 0; k < q; ++k) x[q] = fma(x[k], P(-column(j + k)[j + q]), x[q]);
        x[q] *= P(inverse[q]);
        store_pack(column(j + q) + i, x[q]);
      }
    }
    return true;
  }

  double* values_;
  int height_, columns_;
  std::size_t stride_;
};

template <class S>
class FrontFactor {
 public:
  using P = FrontPack;

  void analyse(const Level& level, const AssembledLevel& matrix) {
    fronts_ = Fronts(level, matrix);
    rest_.assign(fronts_.all.size(), {});
  }

  /// False if a pivot is not positive, or next to nothing beside its diagonal entry.
  bool factor(const AssembledLevel& matrix, int threads) {
    values_.resize(fronts_.entries);
    inverse_.resize(fronts_.pivots);
    for (std::vector<double>& rest : rest_) rest = {};  // of one that failed
    std::atomic<bool> good = true;
    using Buffer = PointBuffer<double>;
    for (const std::vector<int>& fronts : fronts_.by_depth)
      for_patches(
          0, static_cast<std::int32_t>(fronts.size()), threads,
          [] { return std::make_unique<Buffer>(); },
          [&](std::int32_t n, Buffer& buffer) {
            if (good && !factor_front(matrix, fronts[n], buffer)) good = false;
          });
    return good;
  }

  /// In place. Each branch has a copy of x, so that what they add to rows of the trunk meets in
  /// one order.
  void solve(std::span<double> x, int threads) const {
    constexpr std::size_t kWorthEntries = 65536;  // below, waking the threads costs more
    if (fronts_.entries < kWorthEntries) threads = 1;
    const std::size_t count = fronts_.branches.size();
    std::vector<std::vector<double>> local(count, std::vector<double>(x.begin(), x.end()));
    std::vector<double> work;
    const auto each_branch = [&](const auto& body) {
      for_patches(
          0, static_cast<std::int32_t>(count), threads,
          [] { return std::make_unique<std::vector<double>>(); },
          [&](std::int32_t b, std::vector<double>& own) { body(std::size_t(b), own); });
    };
    each_branch([&](std::size_t b, std::vector<double>& own) {
      for (const int f : fronts_.trunk) clear(fronts_.all[f], local[b]);
      for (const int f : fronts_.branches[b]) go_forward(fronts_.all[f], local[b], own);
    });
    for (const std::vector<double>& from : local)
      for (const int f : fronts_.trunk) add(fronts_.all[f], from, x);
    for (const int f : fronts_.trunk) go_forward(fronts_.all[f], x, work);
    for (auto f = fronts_.trunk.rbegin(); f != fronts_.trunk.rend(); ++f)
      go_backward(fronts_.all[*f], x, work);
    each_branch([&](std::size_t b, std::vector<double>& own) {
      for (const int f : fronts_.trunk) take(fronts_.all[f], x, local[b]);
      const std::vector<int>& branch = fronts_.branches[b];
      for (auto f = branch.rbegin(); f != branch.rend(); ++f) {
        go_backward(fronts_.all[*f], local[b], own);
        take(fronts_.all[*f], local[b], x);
      }
    });
  }

  std::size_t bytes() const {
    return values_.capacity() * sizeof(S) + inverse_.capacity() * sizeof(double);
  }

 private:
  // A pivot is what is left of a diagonal entry when the unknowns before it are eliminated: as in
  // core/solve/sparse_cholesky.cpp.
  static constexpr double kSingular = 1e-13;

  /// Columns that are a multiple of 512 bytes apart would fall onto the same lines of the cache.
  static std::size_t stride_of(int height) {
    return static_cast<std::size_t>(height % 64 == 0 ? height + 4 : height);
  }

  bool factor_front(const AssembledLevel& matrix, int n, PointBuffer<double>& buffer) {
    const Front& front = fronts_.all[n];
    const int height = front.height(), padded = front.padded_columns();
    const std::size_t stride = stride_of(height), size = stride * static_cast<std::size_t>(height);
    const DenseFront dense(buffer.reserve(size), height, padded, stride);
    std::fill_n(dense.column(0), size, 0.0);
    for (int j = front.columns(); j < padded; ++j) dense.column(j)[j] = 1;
    for (const Front::Entry& entry : front.entries)
      dense.column(entry.column)[entry.row] += matrix.value[entry.value];
    for (const int child : front.below) add_rest(fronts_.all[child], rest_[child], dense);
    const auto accept = [&](int j, double pivot) {
      return j >= front.columns() || pivot > kSingular * diagonal(matrix, front, j);
    };
    if (!dense.eliminate(accept)) return false;
    keep(front, dense);
    keep_rest(front, dense, rest_[n]);
    return true;
  }

  static int scalar(const Front& front, int j) { return 3 * front.vertices[j / 3] + j % 3; }
  static double diagonal(const AssembledLevel& matrix, const Front& front, int j) {
    return matrix.value[matrix.column_begin[scalar(front, j)]];
  }

  /// Columns below their diagonal block of four, and that block below its diagonal.
  void keep(const Front& front, const DenseFront& dense) {
    S* to = values_.data() + front.at;
    for (int j = 0; j < front.padded_columns(); ++j, to += front.height()) {
      const double* const from = dense.column(j);
      inverse_[front.pivots_at + static_cast<std::size_t>(j)] = 1 / from[j];
      for (int i = j + 1; i < front.height(); ++i) to[i] = static_cast<S>(from[i]);
    }
  }

  /// What a front leaves to the one above: the lower triangle over its rows, by columns.
  static void keep_rest(const Front& front, const DenseFront& dense, std::vector<double>& rest) {
    const int begin = front.padded_columns(), end = begin + 3 * static_cast<int>(front.rows.size());
    rest.clear();
    for (int j = begin; j < end; ++j)
      rest.insert(rest.end(), dense.column(j) + j, dense.column(j) + end);
  }
  static void add_rest(const Front& child, std::vector<double>& rest, const DenseFront& dense) {
    const double* from = rest.data();
    const std::size_t rows = child.rows.size();
    for (std::size_t n = 0; n < rows; ++n)
      for (int b = 0; b < 3; ++b) {
        double* const to = dense.column(child.row_place[n] + b);
        for (int a = b; a < 3; ++a) to[child.row_place[n] + a] += *from++;
        for (std::size_t m = n + 1; m < rows; ++m)
          for (int a = 0; a < 3; ++a) to[child.row_place[m] + a] += *from++;
      }
    rest = {};
  }

  void go_forward(const Front& front, std::span<double> x, std::vector<double>& work) const {
    load(front, x, work);
    forward(front, work.data());
    store(front, work, front.rows.size(), x);
  }
  void go_backward(const Front& front, std::span<double> x, std::vector<double>& work) const {
    load(front, x, work);
    backward(front, work.data());
    store(front, work, 0, x);
  }

  /// body(scalar) for those that a front eliminates.
  template <class Body>
  static void for_scalars(const Front& front, const Body& body) {
    for (const int v : front.vertices)
      for (std::size_t c = 0; c < 3; ++c) body(3 * static_cast<std::size_t>(v) + c);
  }
  static void clear(const Front& front, std::span<double> x) {
    for_scalars(front, [&](std::size_t i) { x[i] = 0; });
  }
  static void add(const Front& front, std::span<const double> from, std::span<double> x) {
    for_scalars(front, [&](std::size_t i) { x[i] += from[i]; });
  }
  static void take(const Front& front, std::span<const double> from, std::span<double> x) {
    for_scalars(front, [&](std::size_t i) { x[i] = from[i]; });
  }

  static void load(const Front& front, std::span<const double> x, std::vector<double>& work) {
    work.assign(static_cast<std::size_t>(front.height()), 0.0);
    const auto put = [&](const std::vector<int>& vertices, std::size_t at) {
      for (const int v : vertices)
        for (std::size_t c = 0; c < 3; ++c) work[at++] = x[3 * static_cast<std::size_t>(v) + c];
    };
    put(front.vertices, 0);
    put(front.rows, static_cast<std::size_t>(front.padded_columns()));
  }
  static void store(const Front& front, const std::vector<double>& work, std::size_t rows,
                    std::span<double> x) {
    const auto take = [&](const std::vector<int>& vertices, std::size_t count, std::size_t at) {
      for (std::size_t n = 0; n < count; ++n)
        for (std::size_t c = 0; c < 3; ++c)
          x[3 * static_cast<std::size_t>(vertices[n]) + c] = work[at++];
    };
    take(front.vertices, front.vertices.size(), 0);
    take(front.rows, rows, static_cast<std::size_t>(front.padded_columns()));
  }

  static void load_four(const S* from, P& out) {
    typedef S Four __attribute__((vector_size(4 * sizeof(S))));
    Four four;
    __builtin_memcpy(&four, from, sizeof four);
    out.v = __builtin_convertvector(four, P::Vector);
  }

  /// Four columns of a front.
  struct Columns {
    const S* at[4];
    const double* inverse;  // of their pivots
  };
  Columns columns_at(const Front& front, int j) const {
    const auto height = static_cast<std::size_t>(front.height());
    const S* const first = values_.data() + front.at + height * static_cast<std::size_t>(j);
    return {{first, first + height, first + 2 * height, first + 3 * height},
            inverse_.data() + front.pivots_at + j};
  }

  void forward(const Front& front, double* x) const {
    for (int j = 0; j < front.padded_columns(); j += 4) {
      const Columns columns = columns_at(front, j);
      P factor[4];
      for (int q = 0; q < 4; ++q) {
        for (int k = 0; k < q; ++k)
          x[j + q] -= static_cast<double>(columns.at[k][j + q]) * x[j + k];
        x[j + q] *= columns.inverse[q];
        factor[q] = P(-x[j + q]);
      }
      for (int i = j + 4; i < front.height(); i += 4) {
        P sum = four_at(x + i), entries;
        for (int q = 0; q < 4; ++q) {
          load_four(columns.at[q] + i, entries);
          sum = fma(entries, factor[q], sum);
        }
        store_pack(x + i, sum);
      }
    }
  }

  void backward(const Front& front, double* x) const {
    for (int j = front.padded_columns() - 4; j >= 0; j -= 4) {
      const Columns columns = columns_at(front, j);
      P sum[4] = {P(0), P(0), P(0), P(0)};
      for (int i = j + 4; i < front.height(); i += 4) {
        const P at = four_at(x + i);
        P entries;
        for (int q = 0; q < 4; ++q) {
          load_four(columns.at[q] + i, entries);
          sum[q] = fma(entries, at, sum[q]);
        }
      }
      for (int q = 3; q >= 0; --q) {
        double rest = x[j + q] - sum_lanes(sum[q]);
        for (int k = q + 1; k < 4; ++k)
          rest -= static_cast<double>(columns.at[q][j + k]) * x[j + k];
        x[j + q] = rest * columns.inverse[q];
      }
    }
  }

  Fronts fronts_;
  std::vector<S> values_;                  // by front and column
  std::vector<double> inverse_;            // of pivots
  std::vector<std::vector<double>> rest_;  // per front, until the front above has it
};

}  // namespace kerf::cpu
