// SPDX-License-Identifier: MIT
//
// Transfers of one patch: between its vertices and copies of those of the next level that they
// take from, which lie in the cache.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <optional>
#include <type_traits>

#include "cpu/patch_sweep.hpp"
#include "kernels/unrolled.hpp"

namespace kerf::cpu {

/// Of a thread at most one at a time that has loaded: another one takes its buffer. Its loops are
/// functions of their own where sweeps call them: among all that a sweep holds, GCC 12 keeps their
/// counters in vectors.
template <class S>
class TransferPoints {
 public:
  using R = typename Record<S>::Vector;

  TransferPoints(const PatchedLevel& level, std::size_t patch)
      : level_(level),
        transfer_(level.transfer),
        part_(level.transfer.parts[patch]),
        own_(level.patches[patch].own) {
    thread_local PointBuffer<S> buffer;
    x_ = buffer.reserve(4 * static_cast<std::size_t>(part_.points.size) + 4);
  }

  /// The points, from a vector of the next level.
  [[gnu::noinline]] void load(const PatchedLevel& next, const S* u) {
    S* to = x_;
    for (std::int32_t k = part_.points.first; k < part_.points.end(); ++k, to += 4) {
      const S* from = u + scalar_of(next.packed[transfer_.point[k]]);
      to[0] = from[0];
      to[1] = from[kGroup];
      to[2] = from[2 * kGroup];
      to[3] = 0;
    }
  }

  /// What the loaded points give to own vertices. Of a tile, the first lanes are asked for first.
  kernels::Vec3<Pack<S>> taken(std::size_t tile, int first) {
    if (first == 0) take(transfer_.tiles[tile], transfer_.others.data() + kGroup * tile);
    return gathered(static_cast<const S*>(rows_ + 4 * first));
  }

  /// Adds it to the shared vertices of the part, where they are not held.
  void add_to_leads(S* u) {
    for_lead_blocks([&](const TransferBlock& block, std::int32_t first, int count) {
      take(block, transfer_.lead_others.data() + first);
      for (int k = 0; k < count; ++k) {
        const std::int32_t v = transfer_.lead[first + k];
        S* to = u + scalar_of(v);
        for (std::size_t c = 0; c < 3; ++c)
          if (((level_.fixed[v] >> c) & 1) == 0)
            to[kGroup * c] += rows_[4 * static_cast<std::size_t>(k) + c];
      }
    });
  }

  // The other way: what vertices give to the points, by point, in `out`: first of all clear, own
  // vertices next, leads last.

  void clear(S* out) const {
    std::fill_n(given_to(out), 4 * static_cast<std::size_t>(part_.points.size), S(0));
  }
  /// r: of the own vertices of a tile, of the lanes from `first` on; of a tile in their order.
  void give_tile(std::size_t tile, int first, const kernels::Vec3<Pack<S>>& r, S* out) {
    for_records(r, [&](int lane, const R& record) {
      __builtin_memcpy(rows_ + 4 * (first + lane), &record, sizeof record);
    });
    if (first + Pack<S>::kLanes == kGroup)
      give(transfer_.tiles[tile], transfer_.others.data() + kGroup * tile, given_to(out));
  }
  void give_own(const S* r, S* out) {
    for (std::int32_t t = own_.first / kGroup; t < own_.end() / kGroup; ++t) {
      const auto tile = static_cast<std::size_t>(t);
      for_packs<S>([&](int first) { give_tile(tile, first, load_tile(r, tile, first), out); });
    }
  }
  /// place(packed vertex): where it lies in r.
  template <class Place>
  void give_leads(const S* r, const Place& place, S* out) {
    for_lead_blocks([&](const TransferBlock& block, std::int32_t first, int count) {
      S* row = rows_;
      for (int k = 0; k < count; ++k, row += 4) {
        const S* from = r + place(transfer_.lead[first + k]);
        row[0] = from[0], row[1] = from[kGroup], row[2] = from[2 * kGroup], row[3] = 0;
      }
      give(block, transfer_.lead_others.data() + first, given_to(out));
    });
  }

 private:
  S* given_to(S* out) const { return out + 4 * static_cast<std::size_t>(part_.points.first); }
  static void read(const S* x, std::size_t n, R& out) {
    __builtin_memcpy(&out, x + 4 * n, sizeof out);
  }
  static void write(S* x, std::size_t n, const R& r) { __builtin_memcpy(x + 4 * n, &r, sizeof r); }
  static void add(S* x, std::size_t n, const R& r) {
    R sum;
    read(x, n, sum);
    write(x, n, sum + r);
  }

  /// body(block, its first lead, how many)
  template <class Body>
  void for_lead_blocks(const Body& body) const {
    std::int32_t first = part_.leads.first;
    for (std::int32_t b = part_.lead_blocks.first; b < part_.lead_blocks.end();
         ++b, first += kGroup)
      body(transfer_.lead_blocks[b], first, std::min(kGroup, part_.leads.end() - first));
  }

  /// body(rows as a type, run)
  template <class Body>
  void for_runs(const TransferBlock& block, const Body& body) const {
    const TransferRun* run = transfer_.runs.data() + block.first_run;
    for (int n = 0; n < block.runs; ++n, ++run) switch (run->rows) {
        case 1:
          body(std::integral_constant<int, 1>{}, *run);
          break;
        case 2:
          body(std::integral_constant<int, 2>{}, *run);
          break;
        case 4:
          body(std::integral_constant<int, 4>{}, *run);
          break;
        default:
          body(std::integral_constant<int, TransferRun::kIdentity>{}, *run);
      }
  }

  // Functions of their own where sweeps call them: see above.
  [[gnu::noinline]] void take(const TransferBlock& block, const TransferVertex* others) {
    if (block.gaps) std::fill(std::begin(rows_), std::end(rows_), S(0));
    for_runs(block, [&](auto rows, const TransferRun& run) { take_run<rows()>(run); });
    take_others(block, others);
  }
  [[gnu::noinline]] void give(const TransferBlock& block, const TransferVertex* others,
                              S* to) const {
    for_runs(block, [&](auto rows, const TransferRun& run) { give_run<rows()>(run, to); });
    give_others(block, others, to);
  }

  /// The mean of the k-th points of the rows.
  template <int rows>
  void mean(const TransferRun& run, std::size_t k, R& out) const {
    read(x_, run.point[0] + k, out);
    if constexpr (rows >= 2) {
      R second;
      read(x_, run.point[1] + k, second);
      out += second;
    }
    if constexpr (rows == 4) {
      R third, fourth;
      read(x_, run.point[2] + k, third);
      read(x_, run.point[3] + k, fourth);
      out += third + fourth;
    }
    if constexpr (rows > 1) out *= S(1) / S(rows);
  }
  template <int rows>
  void take_run(const TransferRun& run) {
    S* const to = rows_ + 4 * run.first;
    const std::size_t size = run.size;
    R left, right;
    if constexpr (rows == TransferRun::kIdentity) {
      for (std::size_t n = 0; n < size; ++n) {
        read(x_, run.point[0] + n, left);
        write(to, n, left);
      }
    } else {
      mean<rows>(run, 0, left);
      std::size_t n = 0;
      if (run.between == 0) write(to, n++, left);
      for (std::size_t k = 1; n < size; ++k) {
        mean<rows>(run, k, right);
        write(to, n++, S(0.5) * (left + right));
        if (n < size) write(to, n++, right);
        left = right;
      }
    }
  }
  /// The mean of some points, in pairs.
  template <int n>
  void mean_of(const std::uint16_t* point, R& out) const {
    R of[n];
    for (int i = 0; i < n; ++i) read(x_, point[i], of[i]);
    for (int half = n / 2; half > 0; half /= 2)
      for (int i = 0; i < half; ++i) of[i] += of[i + half];
    out = S(1) / S(n) * of[0];
  }
  /// mean(terms as a type, place, points) of the vertices that are means, then weighted(terms,
  /// place, points, weights).
  template <class Mean, class Weighted>
  void for_others(const TransferBlock& block, const TransferVertex* other, const Mean& mean,
                  const Weighted& weighted) const {
    const std::uint16_t* point = transfer_.term_point.data() + block.first_term;
    kernels::unrolled<TransferBlock::kMeans>([&](auto n) {
      constexpr int terms = 1 << decltype(n)::value;
      for (int k = block.means[n]; k > 0; --k, ++other, point += terms)
        mean(kernels::Constant<terms>{}, static_cast<std::size_t>(other->place()), point);
    });
    const std::uint8_t* weight =
        transfer_.term_weight.data() + (point - transfer_.term_point.data());
    for (int k = block.weighted; k > 0; --k, ++other) {
      const int terms = other->terms();
      weighted(terms, static_cast<std::size_t>(other->place()), point, weight);
      point += terms;
      weight += terms;
    }
  }
  void take_others(const TransferBlock& block, const TransferVertex* others) {
    for_others(
        block, others,
        [&](auto terms, std::size_t place, const std::uint16_t* point) {
          R sum;
          mean_of<decltype(terms)::value>(point, sum);
          write(rows_, place, sum);
        },
        [&](int terms, std::size_t place, const std::uint16_t* point, const std::uint8_t* weight) {
          R sum{}, one;
          for (int n = 0; n < terms; ++n) {
            read(x_, point[n], one);
            sum += weights_[weight[n]] * one;
          }
          write(rows_, place, sum);
        });
  }

  /// The sum of what vertices give to the k-th points of the rows goes to each of them.
  template <int rows>
  void give_run(const TransferRun& run, S* to) const {
    const S* const from = rows_ + 4 * run.first;
    const std::size_t size = run.size;
    const auto put = [&](std::size_t k, R sum) {
      if constexpr (rows > 1) sum *= S(1) / S(rows);
      for (int r = 0; r < std::max(rows, 1); ++r) add(to, run.point[r] + k, sum);
    };
    R at{}, half, next;
    if constexpr (rows == TransferRun::kIdentity) {
      for (std::size_t n = 0; n < size; ++n) {
        read(from, n, at);
        put(n, at);
      }
    } else {
      std::size_t n = 0, k = 0;
      if (run.between == 0) read(from, n++, at);
      while (n < size) {
        read(from, n++, half);
        half *= S(0.5);
        put(k++, at + half);
        at = half;
        if (n == size) break;
        read(from, n++, next);
        at += next;
      }
      put(k, at);
    }
  }
  void give_others(const TransferBlock& block, const TransferVertex* others, S* to) const {
    for_others(
        block, others,
        [&](auto terms, std::size_t place, const std::uint16_t* point) {
          R share;
          read(rows_, place, share);
          share *= S(1) / S(terms);
          for (int n = 0; n < terms; ++n) add(to, point[n], share);
        },
        [&](int terms, std::size_t place, const std::uint16_t* point, const std::uint8_t* weight) {
          R from;
          read(rows_, place, from);
          for (int n = 0; n < terms; ++n) add(to, point[n], weights_[weight[n]] * from);
        });
  }

  /// Weights by their code.
  static const S* weights() {
    struct Table {
      S w[65];
      Table() {
        for (int code = 0; code <= 64; ++code) w[code] = static_cast<S>(code) / S(64);
      }
    };
    static const Table table;
    return table.w;
  }

  const PatchedLevel& level_;
  const Transfer& transfer_;
  const TransferPart& part_;
  Range own_;
  const S* weights_ = weights();
  S* x_;
  alignas(kPackBytes) S rows_[4 * kGroup] = {};  // of the vertices of a block: records
};

/// The transfer of the patch at which a thread is, if there is one to do.
template <class S>
std::optional<TransferPoints<S>>& transfer_here() {
  thread_local std::optional<TransferPoints<S>> points;
  return points;
}

}  // namespace kerf::cpu
