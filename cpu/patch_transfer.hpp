// SPDX-License-Identifier: MIT
//
// The structure of transfers between the vertices of a level and of the next.
#pragma once

#include <array>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "cpu/patch_draft.hpp"

namespace kerf::cpu {

/// Rows of one part, before they have a place in the arrays.
struct TransferDraft {
  std::vector<std::int32_t> points;  // vertices of the next level
  std::vector<std::uint16_t> term_point;
  std::vector<std::uint8_t> term_weight;
  std::vector<std::int32_t> first_term;  // per tile of own vertices
  std::vector<std::uint8_t> terms;       // per own vertex
  std::vector<std::int32_t> lead;
  std::vector<std::uint8_t> lead_terms;
  std::int32_t first_lead_term = 0;
  std::vector<std::uint16_t> point_terms;
  std::vector<std::uint16_t> given_row;
  std::vector<std::uint8_t> given_weight;
};

/// Of each vertex of a level its first cell, as in Level::incidences_of, which may be gone.
class FirstCells {
 public:
  explicit FirstCells(const Level& level);
  /// 8 cell + slot.
  std::int32_t operator[](std::int32_t vertex) const {
    return first_.empty() ? level_.incidences_of(vertex)[0] : first_[vertex];
  }

 private:
  const Level& level_;
  std::vector<std::int32_t> first_;
};

/// The rows of one patch after the other. A row is that of the first cell of the vertex; those of
/// its other cells agree.
class TransferRows {
 public:
  TransferRows(const PatchedLevel& level, const Level& next, const FirstCells& first);
  TransferDraft operator()(std::int32_t patch);

 private:
  /// What a vertex takes: slots of a parent, and weights.
  struct RowTerms {
    std::uint8_t count = 0, slot[8] = {}, weight[8] = {};
  };
  using SlotTerms = std::array<RowTerms, 8>;  // per slot of a child

  static SlotTerms terms_of(std::uint16_t child, int place, std::uint16_t parent);
  const SlotTerms& terms(std::uint16_t child, int place, std::uint16_t parent);
  std::uint8_t add_row(std::int32_t vertex, TransferDraft& out);

  const PatchedLevel& level_;
  const Level& next_;
  const FirstCells& first_;
  Marks local_;                        // per vertex of the next level: its point, from 1
  std::vector<std::uint16_t> points_;  // of the terms of a patch, and room for more
  std::vector<std::uint8_t> weights_;
  std::size_t count_ = 0;  // terms
  std::array<SlotTerms, 9> regular_;
  std::unordered_map<std::uint64_t, SlotTerms> others_;
};

/// Makes the parts of some patches, in ascending order, and all that they need.
void place_transfers(const std::vector<std::int32_t>& patches, const Level& next, int threads,
                     PatchedLevel& level);

}  // namespace kerf::cpu
