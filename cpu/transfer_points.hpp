// SPDX-License-Identifier: MIT
//
// Transfers of one patch: between its vertices and copies of those of the next level that they
// take from, which lie in the cache.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "cpu/patch_sweep.hpp"

namespace kerf::cpu {

/// At most one of a thread at a time: they share its buffers. Its loops are functions of their own
/// where sweeps call them: among all that a sweep holds, GCC 12 keeps their counters in vectors.
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

  /// What the points give to own vertices.
  kernels::Vec3<Pack<S>> taken(std::size_t tile, int first) const {
    alignas(kPackBytes) S sums[4 * Pack<S>::kLanes];
    take(tile, first, sums);
    return gathered(static_cast<const S*>(sums));
  }

  /// Adds it to the shared vertices of the part, where they are not held.
  void add_to_leads(S* u) const {
    Terms from = takes(static_cast<std::size_t>(part_.first_lead_term));
    for (std::int32_t n = part_.leads.first; n < part_.leads.end(); ++n) {
      const std::int32_t v = transfer_.lead[n];
      R sum;
      from.take(transfer_.lead_terms[n], sum);
      S* to = u + scalar_of(v);
      for (std::size_t c = 0; c < 3; ++c)
        if (((level_.fixed[v] >> c) & 1) == 0) to[kGroup * c] += sum[c];
    }
  }

  /// The other way: what the vertices give to the points, from a vector, by point.
  void give(const S* r, S* out) {
    const auto first = static_cast<std::size_t>(part_.terms.first);
    Terms from{rows_of(r), weights_, transfer_.given_row.data() + first,
               transfer_.given_weight.data() + first};
    for (std::int32_t k = part_.points.first; k < part_.points.end(); ++k) {
      // In turn to two sums, so that the second need not wait for the first.
      R even{}, odd{};
      const int count = transfer_.point_terms[k];
      for (int n = 0; n + 1 < count; n += 2) {
        from.add(even);
        from.add(odd);
      }
      if (count % 2 != 0) from.add(even);
      even += odd;
      __builtin_memcpy(out + 4 * static_cast<std::size_t>(k), &even, sizeof even);
    }
  }

 private:
  /// Records and their weights, one after the other. Holds what it reads by itself, so that a loop
  /// need not ask for it again behind each store.
  struct Terms {
    const S *records, *weights;
    const std::uint16_t* which;
    const std::uint8_t* code;

    void skip(int count) {
      which += count;
      code += count;
    }
    void add(R& sum) {
      R one, weight;
      __builtin_memcpy(&one, records + 4 * std::size_t(*which++), sizeof one);
      __builtin_memcpy(&weight, weights + 4 * std::size_t(*code++), sizeof weight);
      sum += weight * one;
    }
    void take(int count, R& sum) {
      sum = R{};
      for (int n = 0; n < count; ++n) add(sum);
    }
  };
  [[gnu::noinline]] void take(std::size_t tile, int first, S* sums) const {
    const std::uint8_t* terms = transfer_.terms.data() + kGroup * tile;
    Terms from = takes(static_cast<std::size_t>(transfer_.first_term[tile]));
    for (int k = 0; k < first; ++k) from.skip(terms[k]);
    for (int k = 0; k < Pack<S>::kLanes; ++k, sums += 4) {
      R sum;
      from.take(terms[first + k], sum);
      __builtin_memcpy(sums, &sum, sizeof sum);
    }
  }
  Terms takes(std::size_t term) const {
    return {x_, weights_, transfer_.term_point.data() + term, transfer_.term_weight.data() + term};
  }

  /// Weights in all components, by their code.
  static const S* weights() {
    struct Table {
      alignas(32) S w[65][4];
      Table() {
        for (int code = 0; code <= 64; ++code)
          std::fill_n(w[code], 4, static_cast<S>(code) / S(64));
      }
    };
    static const Table table;
    return table.w[0];
  }

  /// The vertices of the part, own ones first, as records.
  const S* rows_of(const S* r) const {
    thread_local PointBuffer<S> buffer;
    S* const rows = buffer.reserve(4 * static_cast<std::size_t>(own_.size + part_.leads.size));
    S* to = rows;
    for (std::int32_t v = own_.first; v < own_.end(); v += kGroup)
      for_packs<S>([&](int first) {
        for_records(load_tile(r, static_cast<std::size_t>(v / kGroup), first),
                    [&](int, const R& record) {
                      __builtin_memcpy(to, &record, sizeof record);
                      to += 4;
                    });
      });
    for (std::int32_t n = part_.leads.first; n < part_.leads.end(); ++n, to += 4) {
      const S* from = r + scalar_of(transfer_.lead[n]);
      to[0] = from[0], to[1] = from[kGroup], to[2] = from[2 * kGroup], to[3] = 0;
    }
    return rows;
  }

  const PatchedLevel& level_;
  const Transfer& transfer_;
  const TransferPart& part_;
  Range own_;
  const S* weights_ = weights();
  S* x_;
};

/// The transfer of the patch at which a thread is, if there is one to do.
template <class S>
std::optional<TransferPoints<S>>& transfer_here() {
  thread_local std::optional<TransferPoints<S>> points;
  return points;
}

}  // namespace kerf::cpu
