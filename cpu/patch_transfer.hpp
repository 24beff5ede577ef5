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

/// Runs and terms of some blocks, counted from their own.
struct BlockDraft {
  std::vector<TransferBlock> blocks;
  std::vector<TransferRun> runs;
  std::vector<std::uint16_t> term_point;
  std::vector<std::uint8_t> term_weight;
  std::vector<TransferVertex> others;  // as many as vertices
};

/// A part before it has a place in the arrays: all of it, or where it stays what is made again.
struct TransferDraft {
  bool whole = true;
  std::vector<std::int32_t> points;  // vertices of the next level, behind those that it has
  std::vector<std::int32_t> tiles;   // where not all are made
  std::vector<std::int32_t> lead;
  BlockDraft own, leads;
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

/// The parts of one patch after the other. What a vertex takes is its row: that of its first cell;
/// those of its other cells agree. Of a part that is there, only the tiles of `moves` are made
/// again, as long as there is room for them; and all leads.
class TransferRows {
 public:
  TransferRows(const PatchedLevel& level, const Level& next, const FirstCells& first,
               const PatchMoves& moves);
  TransferDraft operator()(std::int32_t patch);

 private:
  /// What a vertex takes: slots of a parent, and weights.
  struct RowTerms {
    std::uint8_t count = 0, slot[8] = {}, weight[8] = {};
  };
  using SlotTerms = std::array<RowTerms, 8>;  // per slot of a child

  /// The terms of a vertex, in points of the part.
  struct Row {
    const std::uint16_t* point;
    const std::uint8_t* weight;
    int count;

    bool has_weights(int of_all) const;
  };

  static SlotTerms terms_of(std::uint16_t child, int place, std::uint16_t parent);
  const SlotTerms& terms(std::uint16_t child, int place, std::uint16_t parent);
  TransferDraft make(std::int32_t patch);
  bool make_some(std::int32_t patch, TransferDraft& out);
  std::vector<std::int32_t> tiles_to_make(const Patch& patch, const TransferPart& part) const;
  void start_rows(std::int32_t most_rows);
  void add_row(std::int32_t vertex, TransferDraft& out);
  void add_tile(std::int32_t tile, TransferDraft& out);
  void add_leads(std::int32_t patch, TransferDraft& out);
  void sort_points(TransferDraft& out);
  void add_lead_blocks(std::size_t first, TransferDraft& out);
  void add_block(std::size_t first, std::size_t count, BlockDraft& out);
  int class_of(const Row& row) const;
  TransferRun longest_run(std::size_t row, std::size_t end) const;
  TransferRun run_of_kind(std::size_t row, std::size_t end, int rows, bool between) const;
  Row row(std::size_t n) const {
    const std::uint32_t begin = row_begin_[n];
    return {points_.data() + begin, weights_.data() + begin,
            static_cast<int>(row_begin_[n + 1] - begin)};
  }

  const PatchedLevel& level_;
  const Level& next_;
  const FirstCells& first_;
  const PatchMoves& moves_;
  std::int32_t points_before_ = 0;  // of the part
  Marks local_;                     // per vertex of the next level: its point, from 1
  // Rows of the tiles of a patch that are made, then of its leads, and room for more.
  std::vector<std::uint16_t> points_;
  std::vector<std::uint8_t> weights_;
  std::vector<std::uint32_t> row_begin_;
  std::vector<std::int32_t> met_;     // points as they were met
  std::vector<std::uint64_t> order_;  // of them: place, then number
  std::vector<std::uint16_t> rank_;
  std::array<std::vector<std::size_t>, TransferBlock::kMeans + 1> classes_;  // rows of a block
  std::array<SlotTerms, 9> regular_;
  std::unordered_map<std::uint64_t, SlotTerms> others_;
};

/// Makes the parts of some patches, in ascending order, and all that they need.
void place_transfers(const std::vector<std::int32_t>& patches, const PatchMoves& moves,
                     const Level& next, int threads, PatchedLevel& level);

}  // namespace kerf::cpu
