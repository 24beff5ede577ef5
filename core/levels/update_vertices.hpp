// SPDX-License-Identifier: MIT
//
// The parts of an update (update.hpp) that work on one level.
#pragma once

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <span>
#include <vector>

#include "core/levels/hierarchy.hpp"
#include "core/levels/update.hpp"

namespace kerf {

/// Writes down how cells were before they change for the first time.
class ChangeLog {
 public:
  ChangeLog(Level& level, LevelChange& change, UpdateScratch& scratch)
      : level_(level), change_(change), scratch_(scratch) {
    change_ = {};
    change_.cells_before = level.cells();
    change_.vertices_before = level.vertices();
    scratch_.listed.resize(level.corner.capacity(), 0);
    scratch_.visited.resize(level.corner.capacity(), 0);
  }

  /// To be called before an old cell changes; new cells are listed anyway.
  void touch(std::int32_t cell) {
    if (cell >= change_.cells_before || scratch_.listed[cell] != 0) return;
    change_.cells.push_back(cell);
    change_.before.push_back(
        {level_.corner[cell], level_.size_log2[cell], level_.fold[cell], level_.slots[cell]});
    scratch_.listed[cell] = static_cast<std::int32_t>(change_.cells.size());
  }
  void touch_vertex(std::int32_t vertex) {
    std::vector<std::int32_t>& all = change_.vertices;
    // Most are touched several times in a row, two by turns.
    const std::size_t n = all.size();
    if (n > 1 && (all[n - 1] == vertex || all[n - 2] == vertex)) return;
    all.push_back(vertex);
  }
  bool is_touched(std::int32_t old_cell) const { return scratch_.listed[old_cell] != 0; }
  /// An old cell as it was.
  CellBefore before(std::int32_t cell) const {
    const std::int32_t at = scratch_.listed[cell];
    if (at != 0) return change_.before[at - 1];
    return {level_.corner[cell], level_.size_log2[cell], level_.fold[cell], level_.slots[cell]};
  }
  /// A new cell, without links, children and vertices yet, that was a part of `origin`.
  std::int32_t append_cell(std::int32_t origin, const Vec3i& corner, std::uint8_t size_log2);
  /// Sorts the lists, and cleans up.
  void finish();

  const LevelChange& change() const { return change_; }
  bool is_new(std::int32_t cell) const { return cell >= change_.cells_before; }
  std::int32_t origin(std::int32_t cell) const {
    return is_new(cell) ? change_.origin[cell - change_.cells_before] : cell;
  }
  std::vector<std::uint8_t>& visited() { return scratch_.visited; }

 private:
  Level& level_;
  LevelChange& change_;
  UpdateScratch& scratch_;
};

/// Adds a link, unless it is among the last few.
inline void add_once(std::vector<std::int32_t>& row, std::int32_t item) {
  constexpr std::ptrdiff_t kFew = 12;
  const auto from = row.end() - std::min<std::ptrdiff_t>(kFew, std::ssize(row));
  if (std::find(from, row.end(), item) == row.end()) row.push_back(item);
}

/// Gives the rows of links of `cells` (ascending, all new ones among them) anew and tells which old
/// ones changed. new_row(cell, out) appends the links of a cell, some of them twice perhaps.
template <class NewRow>
void update_links(Level& level, std::span<const std::int32_t> cells, const ChangeLog& log,
                  const NewRow& new_row, std::vector<Touched::Faces>& relinked) {
  Rows rows(level.link_begin, level.linked, level.link_rows);
  std::vector<std::int32_t> row;
  for (const std::int32_t cell : cells) {
    row.clear();
    new_row(cell, row);
    std::sort(row.begin(), row.end());
    row.erase(std::unique(row.begin(), row.end()), row.end());
    if (log.is_new(cell)) {
      rows.append(row);
      continue;
    }
    const auto old = rows[cell];
    std::uint8_t faces = 0;
    const auto add = [&](std::int32_t item) {
      faces = static_cast<std::uint8_t>(faces | 1 << (item % 8));
    };
    std::size_t i = 0, j = 0;
    while (i < old.size() || j < row.size()) {
      if (j == row.size() || (i < old.size() && old[i] < row[j])) {
        add(old[i++]);
      } else if (i == old.size() || row[j] < old[i]) {
        add(row[j++]);
      } else {
        ++i;
        ++j;
      }
    }
    if (faces == 0) continue;
    rows.set(cell, row);
    relinked.push_back({cell, faces});
  }
  rows.pack_if_wasteful();
}

/// Slots, folds, vertices and incidences from cells and links.
void update_vertices(Level& level, const Touched& touched, ChangeLog& log);

}  // namespace kerf
