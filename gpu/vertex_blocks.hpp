// SPDX-License-Identifier: MIT
//
// The vertices of level 0 in blocks of such as lie together, and the cells around each block; on
// the host. Vertices are dealt out along a curve that fills space, so that few cells lie between
// blocks: 1.6 times as many as there are, in a uniform body, where rows of vertices would meet 2.5
// times to 4 times as many. Vertices that cuts append come behind, and blocks that a cut touched
// find their cells anew.
//
// Source  Morton 1966 [M66]: the curve.
#pragma once

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "core/levels/hierarchy.hpp"
#include "core/levels/rows.hpp"
#include "gpu/level_view.hpp"

namespace kerf::gpu {

class VertexBlocks {
 public:
  void build(const Level& level) {
    deal_out(level);
    begin_.assign(1, 0);
    cells_.clear();
    rows_ = {};
    most_cells_ = 0;
    std::vector<std::int32_t> last_block(static_cast<std::size_t>(level.cells()), -1);
    std::vector<std::int32_t> found;
    for (std::int32_t b = 0; b < count(); ++b) {
      found.clear();
      each_cell(level, b, [&](std::int32_t cell) {
        if (std::exchange(last_block[static_cast<std::size_t>(cell)], b) != b)
          found.push_back(cell);
      });
      std::sort(found.begin(), found.end());
      note(found);
      cells_.insert(cells_.end(), found.begin(), found.end());
      begin_.push_back(static_cast<std::int32_t>(cells_.size()));
    }
  }

  /// @returns the blocks whose cells or vertices may have changed, ascending. `changed`: vertices
  /// whose incidences did, and all that are new.
  std::vector<std::int32_t> update(const Level& level, std::span<const std::int32_t> changed) {
    for (std::int32_t v = static_cast<std::int32_t>(order_.size()); v < level.vertices(); ++v) {
      place_.push_back(v);
      order_.push_back(v);
    }
    std::vector<std::int32_t> blocks;
    for (const std::int32_t v : changed)
      blocks.push_back(place_[static_cast<std::size_t>(v)] / kBlockVertices);
    make_distinct(blocks);
    Rows rows(begin_, cells_, rows_);
    std::vector<std::int32_t> found;
    for (const std::int32_t b : blocks) {
      found.clear();
      each_cell(level, b, [&](std::int32_t cell) { found.push_back(cell); });
      make_distinct(found);
      note(found);
      if (b + 1 < static_cast<std::int32_t>(begin_.size()))
        rows.set(b, found);
      else
        rows.append(found);
    }
    rows.pack_if_wasteful();
    return blocks;
  }

  std::int32_t count() const {
    return static_cast<std::int32_t>((order_.size() + kBlockVertices - 1) / kBlockVertices);
  }
  const std::vector<std::int32_t>& order() const { return order_; }
  /// The cells of block b: a row of lists (core/levels/rows.hpp).
  const std::vector<std::int32_t>& begin() const { return begin_; }
  const std::vector<std::int32_t>& cells() const { return cells_; }
  const RowState& rows() const { return rows_; }
  /// Of a block, so far.
  std::size_t most_cells() const { return most_cells_; }

 private:
  // The bits of x, three places apart; below 2^21.
  static std::uint64_t spread(std::int32_t x) {
    auto bits = static_cast<std::uint64_t>(x);
    bits = (bits | bits << 32) & 0x1f00000000ffff;
    bits = (bits | bits << 16) & 0x1f0000ff0000ff;
    bits = (bits | bits << 8) & 0x100f00f00f00f00f;
    bits = (bits | bits << 4) & 0x10c30c30c30c30c3;
    return (bits | bits << 2) & 0x1249249249249249;
  }

  void deal_out(const Level& level) {
    std::vector<std::pair<std::uint64_t, std::int32_t>> keys;
    keys.reserve(level.point.size());
    for (const auto& p : level.point)
      keys.emplace_back(spread(p[0]) | spread(p[1]) << 1 | spread(p[2]) << 2,
                        static_cast<std::int32_t>(keys.size()));
    std::sort(keys.begin(), keys.end());
    order_.resize(keys.size());
    place_.resize(keys.size());
    for (std::size_t i = 0; i < keys.size(); ++i) {
      order_[i] = keys[i].second;
      place_[static_cast<std::size_t>(keys[i].second)] = static_cast<std::int32_t>(i);
    }
  }

  template <class Visit>
  void each_cell(const Level& level, std::int32_t block, const Visit& visit) const {
    const std::size_t first = static_cast<std::size_t>(block) * kBlockVertices;
    const std::size_t end = std::min(order_.size(), first + kBlockVertices);
    for (std::size_t i = first; i < end; ++i)
      for (const std::int32_t incidence :
           row_of(level.incidence_begin, level.incidence, level.incidence_rows, order_[i]))
        visit(incidence / kCorners);
  }

  static void make_distinct(std::vector<std::int32_t>& list) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
  }
  void note(const std::vector<std::int32_t>& found) {
    most_cells_ = std::max(most_cells_, found.size());
  }

  std::vector<std::int32_t> order_, place_;  // vertices by place, and back
  std::vector<std::int32_t> begin_, cells_;
  RowState rows_;
  std::size_t most_cells_ = 0;
};

}  // namespace kerf::gpu
