// SPDX-License-Identifier: MIT
//
// Elimination in a dense symmetric matrix, and the inverse of what it eliminates, by tiles of rows
// and four columns. The columns of the factor are L over their own rows, and K over the rows below.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <type_traits>
#include <vector>

#include "cpu/pack.hpp"

namespace kerf::cpu {

/// Columns are eliminated in fours.
using FrontPack = Pack<double, 32>;
inline FrontPack four_at(const double* from) { return load_pack<double, 32>(from); }

/// A dense symmetric matrix by columns, of which the first `columns` are eliminated. Sizes are
/// multiples of four, and columns begin `stride` scalars apart. Above the diagonal it is zero.
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

  /// L^-1 and -K L^-1 in place of L and K, from the last columns on.
  void invert() const {
    std::vector<double> factors;  // of four columns, below them
    for (int j = columns_ - 4; j >= 0; j -= 4) {
      factors.clear();
      for (int k = j; k < columns_; ++k)
        for (int q = 0; q < 4; ++q) factors.push_back(column(j + q)[k]);
      for_tiles(j, columns_, [&](auto tile, int i) {
        typename decltype(tile)::Sums sum;
        for (int q = 0; q < 4; ++q) tile.set_unit(j + q - i, sum[q]);
        invert_tile(tile, i, j, factors.data(), sum);
      });
      for_tiles(columns_, height_, [&](auto tile, int i) {
        typename decltype(tile)::Sums sum;
        for (int q = 0; q < 4; ++q) tile.load_negative(column(j + q) + i, sum[q]);
        invert_tile(tile, i, j, factors.data(), sum);
      });
    }
  }

 private:
  /// Some packs of rows.
  template <class Q, int kPacks>
  struct Tile {
    static constexpr int kRows = Q::kLanes * kPacks;
    struct Rows {
      Q at[kPacks];
    };
    using Sums = Rows[4];  // in four columns

    static void load(const double* from, Rows& to) {
      for (int p = 0; p < kPacks; ++p)
        to.at[p] = load_pack<double, Q::kLanes* int{sizeof(double)}>(from + Q::kLanes * p);
    }
    static void load_negative(const double* from, Rows& to) {
      load(from, to);
      for (Q& pack : to.at) pack = -pack;
    }
    static void set_unit(int row, Rows& to) {
      for (Q& pack : to.at) pack = Q(0);
      if (row >= 0 && row < kRows) to.at[row / Q::kLanes].set(row % Q::kLanes, 1);
    }
    static void store(const Rows& from, double* to) {
      for (int p = 0; p < kPacks; ++p) store_pack(to + Q::kLanes * p, from.at[p]);
    }
    static void subtract(const Rows& x, double factor, Rows& sum) {
      const Q by(-factor);
      for (int p = 0; p < kPacks; ++p) sum.at[p] = fma(x.at[p], by, sum.at[p]);
    }
  };
  /// body(tile, first row), in tiles as large as fit.
  template <class Body>
  static void for_tiles(int i, int end, const Body& body) {
    const auto with = [&](auto tile) {
      constexpr int kRows = decltype(tile)::kRows;
      for (; i + kRows <= end; i += kRows) body(tile, i);
    };
    with(Tile<Pack<double>, 3>{});
    with(Tile<Pack<double>, 1>{});
    with(Tile<FrontPack, 1>{});
  }

  /// Rows of the inverse from i on, in four columns from j on.
  template <class T>
  void invert_tile(T tile, int i, int j, const double* factors, typename T::Sums& sum) const {
    typename T::Rows at;
    for (int k = j + 4; k < std::min(i + T::kRows, columns_); ++k) {
      tile.load(column(k) + i, at);
      for (int q = 0; q < 4; ++q) tile.subtract(at, factors[4 * (k - j) + q], sum[q]);
    }
    for (int q = 3; q >= 0; --q) {
      for (int k = 3; k > q; --k) tile.subtract(sum[k], factors[4 * k + q], sum[q]);
      const double inverse = 1 / factors[4 * q + q];
      for (auto& pack : sum[q].at) pack *= std::decay_t<decltype(pack)>(inverse);
      tile.store(sum[q], column(j + q) + i);
    }
  }

  /// Four columns from j on, less their part in the first `count` columns of L.
  void subtract(int j, int count) const {
    for_tiles(j, height_, [&](auto tile, int i) {
      typename decltype(tile)::Sums sum;
      typename decltype(tile)::Rows at;
      for (int q = 0; q < 4; ++q) tile.load(column(j + q) + i, sum[q]);
      for (int k = 0; k < count; ++k) {
        const double* const left = column(k);
        tile.load(left + i, at);
        for (int q = 0; q < 4; ++q) tile.subtract(at, left[j + q], sum[q]);
      }
      for (int q = 0; q < 4; ++q) tile.store(sum[q], column(j + q) + i);
    });
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

}  // namespace kerf::cpu
