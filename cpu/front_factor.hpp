// SPDX-License-Identifier: MIT
//
// Numbers of a Cholesky factor in fronts. Eliminated in double; kept in the scalars of the cycle.
// The same bits for any number of threads.
//
// Of a front with the columns (L over its own rows, K over those below) what is kept is
// G = (L^-1, -K L^-1). Solving is then a product with G in each front, forward, and one with its
// transpose, backward: sums that do not wait for each other, where substitution is one long chain.
// What solves is M^T M, with M the product of these steps, so rounded numbers make an operator that
// is symmetric and positive definite as well. Its error, in the norm of the matrix A, is some
// eps sqrt(cond A), as with L.
#pragma once

#include <algorithm>
#include <atomic>
#include <memory>
#include <span>
#include <vector>

#include "cpu/dense_front.hpp"
#include "cpu/fronts.hpp"
#include "cpu/patch_draft.hpp"
#include "cpu/patch_sweep.hpp"
#include "kernels/unrolled.hpp"

namespace kerf::cpu {

template <class S>
class FrontFactor {
 public:
  using P = FrontPack;

  void analyse(const Level& level, const AssembledLevel& matrix) {
    fronts_ = Fronts(level, matrix);
    rest_.assign(fronts_.all.size(), {});
    local_.assign(fronts_.branches.size() + 1, {});
  }

  /// False if a pivot is not positive, or next to nothing beside its diagonal entry.
  bool factor(const AssembledLevel& matrix, int threads) {
    values_.resize(fronts_.entries);
    for (std::vector<double>& rest : rest_) rest = {};  // of one that failed
    std::atomic<bool> good = true;
    using Buffer = PointBuffer<double>;
    for (const std::vector<int>& fronts : fronts_.by_depth)
      for_parts(
          0, static_cast<std::int32_t>(fronts.size()), threads,
          [] { return std::make_unique<Buffer>(); },
          [&](std::int32_t n, Buffer& buffer) {
            if (good && !factor_front(matrix, fronts[n], buffer)) good = false;
          });
    return good;
  }

  /// In place. Each branch has a copy of its part of x, so that what they add to rows of the trunk
  /// meets in one order.
  void solve(std::span<double> x, int threads) {
    constexpr std::size_t kWorthEntries = 65536;  // below, waking the threads costs more
    if (fronts_.entries < kWorthEntries) threads = 1;
    const std::size_t vertices = x.size() / 3;
    for (Array<double>& local : local_) local.resize(4 * vertices);
    double* const whole = local_[0].data();
    for (std::size_t v = 0; v < vertices; ++v) {
      std::copy_n(x.data() + 3 * v, 3, whole + 4 * v);
      whole[4 * v + 3] = 0;
    }
    const auto each_branch = [&](const auto& body) {
      for_parts(0, static_cast<std::int32_t>(fronts_.branches.size()), threads,
                [&](std::int32_t b) {
                  body(fronts_.branches[b], local_[static_cast<std::size_t>(b) + 1].data());
                });
    };
    each_branch([&](const std::vector<int>& branch, double* local) {
      for (const int f : branch)
        for (const int v : fronts_.all[f].vertices)
          store_pack(local + 4 * v, four_at(whole + 4 * v));
      for_trunk([&](std::size_t i) { store_pack(local + i, P(0)); });
      for (const int f : branch) go_forward(fronts_.all[f], local);
    });
    for (std::size_t b = 1; b < local_.size(); ++b)
      for_trunk([&](std::size_t i) {
        store_pack(whole + i, four_at(whole + i) + four_at(local_[b].data() + i));
      });
    for (const int f : fronts_.trunk) go_forward(fronts_.all[f], whole);
    for (auto f = fronts_.trunk.rbegin(); f != fronts_.trunk.rend(); ++f)
      go_backward(fronts_.all[*f], whole);
    each_branch([&](const std::vector<int>& branch, double* local) {
      for_trunk([&](std::size_t i) { store_pack(local + i, four_at(whole + i)); });
      for (auto f = branch.rbegin(); f != branch.rend(); ++f) {
        go_backward(fronts_.all[*f], local);
        for (const int v : fronts_.all[*f].vertices) std::copy_n(local + 4 * v, 3, whole + 4 * v);
      }
    });
    for (std::size_t v = 0; v < vertices; ++v) std::copy_n(whole + 4 * v, 3, x.data() + 3 * v);
  }

  std::size_t bytes() const {
    std::size_t sum = bytes_of(values_);
    for (const Array<double>& local : local_) sum += bytes_of(local);
    return sum;
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
    for (const Front::Block& block : front.blocks)
      for (int c = 0; c < 3; ++c)
        for (int r = block.row == block.column ? c : 0; r < 3; ++r) {
          const int down = block.transposed ? c : r, across = block.transposed ? r : c;
          dense.column(block.column + across)[block.row + down] += matrix.value[block.at(r, c)];
        }
    for (const int child : front.below) add_rest(fronts_.all[child], rest_[child], dense);
    const auto accept = [&](int j, double pivot) {
      return j >= front.columns() || pivot > kSingular * diagonal(matrix, front, j);
    };
    if (!dense.eliminate(accept)) return false;
    keep_rest(front, dense, rest_[n]);
    dense.invert();
    keep(front, dense);
    return true;
  }

  static int scalar(const Front& front, int j) { return 3 * front.vertices[j / 3] + j % 3; }
  static double diagonal(const AssembledLevel& matrix, const Front& front, int j) {
    return matrix.value[matrix.column_begin[scalar(front, j)]];
  }

  /// The columns of G, with what lies above their diagonal, which packs read.
  void keep(const Front& front, const DenseFront& dense) {
    S* to = values_.data() + front.at;
    for (int j = 0; j < front.padded_columns(); ++j, to += front.height()) {
      const double* const from = dense.column(j);
      std::fill_n(to, j, S(0));
      for (int i = j; i < front.height(); ++i) to[i] = static_cast<S>(from[i]);
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

  // Vectors here have four scalars a vertex, the last one any number, so that three of them go in
  // one piece, with what is behind them.

  /// body(first scalar) for the vertices that fronts of the trunk eliminate.
  template <class Body>
  void for_trunk(const Body& body) const {
    for (const int f : fronts_.trunk)
      for (const int v : fronts_.all[f].vertices) body(4 * static_cast<std::size_t>(v));
  }
  /// The vertices side by side, up to `end`.
  static void load(const std::vector<int>& vertices, const double* x, double* to, double* end) {
    for (const int v : vertices) {
      store_pack(to, four_at(x + 4 * v));
      to += 3;
    }
    std::fill(to, end, 0.0);
  }
  static void store(const std::vector<int>& vertices, const double* from, double* x) {
    for (const int v : vertices) {
      store_pack(x + 4 * v, four_at(from));
      from += 3;
    }
  }

  /// Room for the columns of a front, and for its columns and rows.
  struct Work {
    double *columns, *all, *rows, *end;

    explicit Work(const Front& front) {
      thread_local PointBuffer<double> buffer;
      constexpr int kAlign = kPackBytes / static_cast<int>(sizeof(double)), kBehind = 1;
      const int width = (front.padded_columns() + kBehind + kAlign - 1) / kAlign * kAlign;
      columns = buffer.reserve(static_cast<std::size_t>(width + front.height() + kBehind));
      all = columns + width;
      rows = all + front.padded_columns();
      end = all + front.height();
    }
  };
  void go_forward(const Front& front, double* x) const {
    const Work work(front);
    load(front.vertices, x, work.columns, work.columns + front.padded_columns());
    std::fill(work.all, work.rows, 0.0);
    load(front.rows, x, work.rows, work.end);
    forward(front, work.columns, work.all);
    store(front.vertices, work.all, x);
    store(front.rows, work.rows, x);
  }
  void go_backward(const Front& front, double* x) const {
    const Work work(front);
    load(front.vertices, x, work.all, work.rows);
    load(front.rows, x, work.rows, work.end);
    backward(front, work.all, work.columns);
    store(front.vertices, work.columns, x);
  }

  using Wide = Pack<double>;
  static constexpr int kWide = Wide::kLanes;
  /// The first rows of four columns from j on that are not all zero, by packs.
  static int first_row(int j) { return j / kWide * kWide; }
  const S* column(const Front& front, int j) const {
    return values_.data() + front.at +
           static_cast<std::size_t>(front.height()) * static_cast<std::size_t>(j);
  }

  /// y += G x
  void forward(const Front& front, const double* x, double* y) const {
    const int height = front.height();
    for (int j = 0; j < front.padded_columns(); j += 4) {
      const S* const G = column(front, j);
      const Wide factor[4] = {Wide(x[j]), Wide(x[j + 1]), Wide(x[j + 2]), Wide(x[j + 3])};
      for (int i = first_row(j); i < height; i += kWide) {
        Wide sum = load_pack(y + i);
        kernels::unrolled<4>(
            [&](auto q) { sum = fma(load_pack_as<double>(G + q * height + i), factor[q], sum); });
        store_pack(y + i, sum);
      }
    }
  }

  /// x = G^T y
  void backward(const Front& front, const double* y, double* x) const {
    const int height = front.height();
    for (int j = 0; j < front.padded_columns(); j += 4) {
      const S* const G = column(front, j);
      Wide sum[4] = {Wide(0), Wide(0), Wide(0), Wide(0)};
      for (int i = first_row(j); i < height; i += kWide) {
        const Wide at = load_pack(y + i);
        kernels::unrolled<4>(
            [&](auto q) { sum[q] = fma(load_pack_as<double>(G + q * height + i), at, sum[q]); });
      }
      for (int q = 0; q < 4; ++q) x[j + q] = sum_lanes(sum[q]);
    }
  }

  Fronts fronts_;
  Array<S> values_;                        // by front and column of G
  std::vector<Array<double>> local_;       // of solving: x, and one of each branch
  std::vector<std::vector<double>> rest_;  // per front, until the front above has it
};

}  // namespace kerf::cpu
