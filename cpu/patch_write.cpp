// SPDX-License-Identifier: MIT
#include <algorithm>
#include <utility>

#include "core/base/error.hpp"
#include "cpu/patcher.hpp"
#include "kernels/transfer.hpp"

namespace kerf::cpu {
namespace {

/// What a range held, to where it is now; `width` items each.
template <class T>
void move_items(const Range& before, const Range& now, std::ptrdiff_t width,
                std::vector<T>& array) {
  if (before.first == now.first) return;
  std::copy_n(array.begin() + width * before.first, width * before.size,
              array.begin() + width * now.first);
}

}  // namespace

void PatchedLevel::forget_rows() {
  ensures(corners_at.empty(), "a level forgets its rows again");
  constexpr std::size_t kBlock = 8 * kGroup;
  const auto in_rows = [](std::uint8_t as) { return run_of(static_cast<RowKind>(as)) > 1; };
  const auto others =
      groups() - static_cast<std::size_t>(std::count_if(row.begin(), row.end(), in_rows));
  Array<std::uint16_t> kept;
  kept.reserve(kBlock * others);
  corners_at.assign(groups(), -1);
  for (std::size_t g = 0; g < groups(); ++g) {
    if (in_rows(row[g])) continue;
    corners_at[g] = static_cast<std::int32_t>(kept.size() / kBlock);
    kept.insert(kept.end(), corners.data() + kBlock * g, corners.data() + kBlock * (g + 1));
  }
  corners = std::move(kept);
  if (children.empty()) vertex = {};  // others find by it what levels give to the next
}

void PatchWriter::write() {
  if (!draft_.anew) move_ranges();
  if (!draft_.anew) remove_cells();
  add_groups();
  close_gaps();
  change_cells();
  add_points();
  if (!draft_.anew) drop_hanging();
  std::sort(touched_.begin(), touched_.end());
  touched_.erase(std::unique(touched_.begin(), touched_.end()), touched_.end());
  for (const std::int32_t g : touched_) set_row(g);
}

void PatchWriter::set_row(std::int32_t g) {
  const auto group = static_cast<std::size_t>(g);
  out_.row[g] = row_kind(out_.corners.data() + 8 * kGroup * group);
  out_.set_heads(group);
}

void PatchWriter::move_ranges() {
  const Patch& before = draft_.before;
  constexpr std::ptrdiff_t kBlock = 8 * kGroup;
  move_items(before.copies, patch_.copies, 1, out_.copy_point);
  move_items(before.copies, patch_.copies, 1, out_.copy_vertex);
  move_items(before.hanging, patch_.hanging, 1, out_.hanging_point);
  move_items(before.hanging, patch_.hanging, 1, out_.hanging_masters);
  move_items(before.folded, patch_.folded, kBlock, out_.slots);
  if (const std::int32_t by = patch_.folded.first - before.folded.first; by != 0)
    for (std::int32_t g = before.groups.first; g < before.groups.end(); ++g)
      if (out_.slots_at[g] >= 0) out_.slots_at[g] += by;
  if (before.groups.first == patch_.groups.first) return;
  for (std::int32_t n = 0; n < before.groups.size; ++n)
    move_group(before.groups.first + n, patch_.groups.first + n);
}

/// All that the arrays of a level say of a group.
void PatchWriter::move_group(std::int32_t from, std::int32_t to) {
  constexpr std::ptrdiff_t kBlock = 8 * kGroup;
  std::copy_n(out_.cell.begin() + kGroup * from, kGroup, out_.cell.begin() + kGroup * to);
  std::copy_n(out_.corners.begin() + kBlock * from, kBlock, out_.corners.begin() + kBlock * to);
  if (!out_.children.empty())
    std::copy_n(out_.children.begin() + kBlock * from, kBlock, out_.children.begin() + kBlock * to);
  out_.kind[to] = out_.kind[from];
  out_.row[to] = out_.row[from];
  out_.set_heads(static_cast<std::size_t>(to));
  out_.slots_at[to] = out_.slots_at[from];
  out_.patch_of[to] = draft_.patch;
  for (std::int32_t lane = kGroup * to; lane < kGroup * (to + 1); ++lane)
    if (out_.cell[lane] >= 0) out_.lane[out_.cell[lane]] = lane;
  out_.empty_group(from);
}

/// Cells that are to be grouped again, from where they are.
void PatchWriter::remove_cells() {
  for (const std::int32_t c : draft_.cells) {
    if (c < 0 || out_.lane[c] < 0) continue;
    const std::int32_t lane = std::exchange(out_.lane[c], -1), group = lane / kGroup;
    out_.cell[lane] = -1;
    for (std::int32_t i = 0; i < 8; ++i) {
      out_.corners[8 * kGroup * std::size_t(group) + std::size_t(kGroup * i + lane % kGroup)] =
          kNothing;
      if (!out_.children.empty())
        out_.children[8 * kGroup * std::size_t(group) + std::size_t(kGroup * i + lane % kGroup)] =
            -1;
      if (out_.folded(static_cast<std::size_t>(group)))
        out_.slots[8 * kGroup * std::size_t(out_.slots_at[group]) +
                   std::size_t(kGroup * i + lane % kGroup)] = kNothing;
    }
    touched_.push_back(group);
    const auto cells = out_.cell.begin() + kGroup * group;
    if (std::all_of(cells, cells + kGroup, [](std::int32_t at) { return at < 0; }))
      empty_.push_back(group);
  }
  std::sort(empty_.begin(), empty_.end());
}

/// New groups, first where others became empty. What is written is freed, since drafts together are
/// as large as the level.
void PatchWriter::add_groups() {
  std::int32_t end = patch_.groups.first + draft_.before.groups.size;
  next_block_ = patch_.folded.first + draft_.before.folded.size;
  std::size_t used = 0, block = 0;
  for (std::size_t n = 0; n < draft_.kind.size(); ++n) {
    const std::int32_t g = used < empty_.size() ? empty_[used++] : end++;
    const auto copy = [&](const auto& from, std::size_t at, std::ptrdiff_t width, std::int32_t to,
                          auto& array) {
      const auto first = from.begin() + width * static_cast<std::ptrdiff_t>(at);
      std::copy(first, first + width, array.begin() + width * to);
    };
    copy(draft_.cells, n, kGroup, g, out_.cell);
    copy(draft_.corners, n, 8 * kGroup, g, out_.corners);
    out_.kind[g] = draft_.kind[n];
    set_row(g);
    out_.patch_of[g] = draft_.patch;
    out_.slots_at[g] = -1;
    if (draft_.folded[n] != 0) {
      copy(draft_.slots, block++, 8 * kGroup, next_block_, out_.slots);
      out_.slots_at[g] = next_block_++;
    }
    for (std::int32_t lane = kGroup * g; lane < kGroup * (g + 1); ++lane)
      if (out_.cell[lane] >= 0) out_.lane[out_.cell[lane]] = lane;
  }
  empty_.erase(empty_.begin(), empty_.begin() + static_cast<std::ptrdiff_t>(used));
  patch_.groups.size = end - patch_.groups.first;
  draft_.corners = {};
  draft_.slots = {};
}

/// The last groups go where groups are empty.
void PatchWriter::close_gaps() {
  while (!empty_.empty()) {
    const std::int32_t last = patch_.groups.end() - 1, gap = empty_.front();
    if (empty_.back() == last) {
      empty_.pop_back();
      out_.empty_group(last);
    } else {
      move_group(last, gap);
      touched_.push_back(gap);
      empty_.erase(empty_.begin());
    }
    --patch_.groups.size;
    std::erase(touched_, last);
  }
}

/// Other corners of cells that stay where they are.
void PatchWriter::change_cells() {
  for (std::size_t n = 0; n < draft_.changed.size(); ++n) {
    const std::int32_t c = draft_.changed[n], lane = out_.lane[c], group = lane / kGroup;
    const auto put = [&](const Draft::Corners& from, std::int32_t block, auto& array) {
      for (std::size_t i = 0; i < 8; ++i)
        array[8 * kGroup * std::size_t(block) + kGroup * i + std::size_t(lane % kGroup)] = from[i];
    };
    if (kernels::has_hanging(level_.fold[c]) && !out_.folded(static_cast<std::size_t>(group)))
      fold_group(group);
    put(draft_.changed_corners[n], group, out_.corners);
    if (out_.folded(static_cast<std::size_t>(group)))
      put(draft_.changed_slots[n], out_.slots_at[group], out_.slots);
    touched_.push_back(group);
  }
}

/// Slots of a group that had none of its own, since no corner hung: they are its corners.
void PatchWriter::fold_group(std::int32_t group) {
  const std::int32_t block = next_block_++;
  std::copy_n(out_.corners.begin() + 8 * kGroup * std::ptrdiff_t{group}, 8 * kGroup,
              out_.slots.begin() + 8 * kGroup * std::ptrdiff_t{block});
  out_.slots_at[group] = block;
}

void PatchWriter::add_points() {
  if (draft_.anew)
    std::fill_n(out_.own_point.begin() + patch_.own.first, patch_.own.size, kNothing);
  std::vector<std::pair<std::int32_t, std::uint16_t>> copies;  // packed vertex, point
  for (std::size_t n = 0; n < draft_.vertices.size(); ++n) {
    const std::int32_t packed = out_.packed[draft_.vertices[n]];
    if (out_.home[packed / kGroup] == draft_.patch)
      out_.own_point[packed] = draft_.vertex_point[n];
    else
      copies.emplace_back(packed, draft_.vertex_point[n]);
  }
  std::sort(copies.begin(), copies.end());  // as they are numbered
  std::int32_t k = patch_.copies.first + draft_.before.copies.size;
  for (const auto& [packed, point] : copies) {
    out_.copy_point[k] = point;
    out_.copy_vertex[k++] = packed;
  }
  const std::ptrdiff_t hanging = patch_.hanging.first + draft_.before.hanging.size;
  std::copy(draft_.hanging_point.begin(), draft_.hanging_point.end(),
            out_.hanging_point.begin() + hanging);
  std::copy(draft_.masters.begin(), draft_.masters.end(), out_.hanging_masters.begin() + hanging);
}

/// Takes off the list what no cell has any more: some of its masters may not be points any more.
void PatchWriter::drop_hanging() {
  if (patch_.hanging.size == 0) return;
  std::vector<bool> used(static_cast<std::size_t>(patch_.points));
  for (std::int32_t g = patch_.groups.first; g < patch_.groups.end(); ++g)
    if (out_.folded(static_cast<std::size_t>(g)))
      for (std::size_t n = 0; n < 8 * kGroup; ++n)
        used[out_.corners[8 * kGroup * std::size_t(g) + n]] = true;
  std::int32_t to = patch_.hanging.first;
  for (std::int32_t h = to; h < patch_.hanging.end(); ++h)
    if (used[out_.hanging_point[h]]) {
      out_.hanging_point[to] = out_.hanging_point[h];
      out_.hanging_masters[to++] = out_.hanging_masters[h];
    }
  patch_.hanging.size = to - patch_.hanging.first;
}

}  // namespace kerf::cpu
