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

/// At most one of a thread at a time: they share its buffers.
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
  void load(const PatchedLevel& next, const S* u) {
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
    alignas(32) S sums[4 * Pack<S>::kLanes];
    const std::uint8_t* terms = transfer_.terms.data() + kGroup * tile;
    std::size_t term = static_cast<std::size_t>(transfer_.first_term[tile]);
    for (int k = 0; k < first; ++k) term += terms[k];
    for (int k = 0; k < Pack<S>::kLanes; ++k) {
      R sum;
      take(term, terms[first + k], sum);
      term += terms[first + k];
      __builtin_memcpy(sums + 4 * k, &sum, sizeof sum);
    }
    return gathered(static_cast<const S*>(sums));
  }

  /// Adds it to the shared vertices of the part, where they are not held.
  void add_to_leads(S* u) const {
    std::size_t term = static_cast<std::size_t>(part_.first_lead_term);
    for (std::int32_t n = part_.leads.first; n < part_.leads.end(); ++n) {
      const std::int32_t v = transfer_.lead[n];
      R sum;
      take(term, transfer_.lead_terms[n], sum);
      term += transfer_.lead_terms[n];
      S* to = u + scalar_of(v);
      for (std::size_t c = 0; c < 3; ++c)
        if (((level_.fixed[v] >> c) & 1) == 0) to[kGroup * c] += sum[c];
    }
  }

  /// The other way: what the vertices give to the points, from a vector, by point.
  void give(const S* r, S* out) {
    const S* const rows = rows_of(r);
    std::size_t term = static_cast<std::size_t>(part_.terms.first);
    for (std::int32_t k = part_.points.first; k < part_.points.end(); ++k) {
      // In turn to two sums, so that the second need not wait for the first.
      R even{}, odd{};
      const std::size_t end = term + transfer_.point_terms[k];
      for (; term + 1 < end; term += 2) {
        add_given(rows, term, even);
        add_given(rows, term + 1, odd);
      }
      if (term < end) add_given(rows, term++, even);
      even += odd;
      __builtin_memcpy(out + 4 * static_cast<std::size_t>(k), &even, sizeof even);
    }
  }

 private:
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

  void take(std::size_t term, std::uint8_t count, R& sum) const {
    sum = R{};
    for (const std::size_t end = term + count; term < end; ++term) {
      R one, weight;
      __builtin_memcpy(&one, x_ + 4 * std::size_t(transfer_.term_point[term]), sizeof one);
      __builtin_memcpy(&weight, weights_ + 4 * std::size_t(transfer_.term_weight[term]),
                       sizeof weight);
      sum += weight * one;
    }
  }

  void add_given(const S* rows, std::size_t term, R& sum) const {
    R one, weight;
    __builtin_memcpy(&one, rows + 4 * std::size_t(transfer_.given_row[term]), sizeof one);
    __builtin_memcpy(&weight, weights_ + 4 * std::size_t(transfer_.given_weight[term]),
                     sizeof weight);
    sum += weight * one;
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
