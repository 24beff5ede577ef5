// SPDX-License-Identifier: MIT
//
// Lists of integers, one a row, in one array, that change in place.
//
// Layout  Packed, as after a build: row r is items[begin[r]] .. items[begin[r + 1]] without its
//         last, and `count` is empty. Loose, after a change: row r starts at begin[r] and has
//         count[r] items; a row that grew out of its room lies at the end of `items`, where rooms
//         are multiples of eight, and its old room is lost until the next packing.
//         `begin` has one entry more than there are rows in both.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace kerf {

/// What to reserve for an array that cuts make longer: pages that are never touched cost nothing.
inline std::size_t with_room(std::size_t size) { return size + size / 4 + 16; }

/// Room for what cuts append is reserved when an array is moved anyway.
template <class T, class Allocator>
void resize_with_room(std::vector<T, Allocator>& array, std::size_t size, const T& value = {}) {
  if (size > array.capacity()) array.reserve(with_room(size));
  array.resize(size, value);
}

struct RowState {
  std::vector<std::int32_t> count;  ///< empty: packed
  std::int32_t packed_end = 0;      ///< rows that start before have no room to grow
};

/// Row r of the lists.
inline std::span<const std::int32_t> row_of(const std::vector<std::int32_t>& begin,
                                            const std::vector<std::int32_t>& items,
                                            const RowState& state, std::int32_t r) {
  const std::int32_t first = begin[r];
  const std::int32_t count = state.count.empty() ? begin[r + 1] - first : state.count[r];
  return {items.data() + first, static_cast<std::size_t>(count)};
}

/// Changes lists that others own.
class Rows {
 public:
  Rows(std::vector<std::int32_t>& begin, std::vector<std::int32_t>& items, RowState& state)
      : begin_(begin), items_(items), state_(state) {
    if (!state_.count.empty() || begin_.size() < 2) return;
    const std::size_t rows = begin_.size() - 1;
    state_.count.reserve(begin_.capacity());
    state_.count.resize(rows);
    for (std::size_t r = 0; r < rows; ++r) state_.count[r] = begin_[r + 1] - begin_[r];
    state_.packed_end = static_cast<std::int32_t>(items_.size());
  }

  std::span<const std::int32_t> operator[](std::int32_t r) const {
    return {items_.data() + begin_[r], static_cast<std::size_t>(state_.count[r])};
  }

  void append(std::span<const std::int32_t> row) {
    begin_.back() = room_at_end(row.size());
    state_.count.push_back(static_cast<std::int32_t>(row.size()));
    std::copy(row.begin(), row.end(), items_.begin() + begin_.back());
    begin_.push_back(static_cast<std::int32_t>(items_.size()));
  }

  /// `row` must not lie in these lists.
  void set(std::int32_t r, std::span<const std::int32_t> row) {
    if (row.size() > room(r)) begin_[r] = room_at_end(row.size());
    state_.count[r] = static_cast<std::int32_t>(row.size());
    std::copy(row.begin(), row.end(), items_.begin() + begin_[r]);
  }

  /// Into an ascending row.
  void insert(std::int32_t r, std::int32_t item) {
    const auto size = static_cast<std::size_t>(state_.count[r]);
    if (size + 1 > room(r)) {
      const std::int32_t to = room_at_end(size + 1);
      std::copy_n(items_.begin() + begin_[r], size, items_.begin() + to);
      begin_[r] = to;
    }
    const auto first = items_.begin() + begin_[r], last = first + static_cast<std::ptrdiff_t>(size);
    const auto place = std::upper_bound(first, last, item);
    std::copy_backward(place, last, last + 1);
    *place = item;
    ++state_.count[r];
  }

  /// From an ascending row. Returns whether it was there.
  bool remove(std::int32_t r, std::int32_t item) {
    const auto first = items_.begin() + begin_[r], last = first + state_.count[r];
    const auto place = std::lower_bound(first, last, item);
    if (place == last || *place != item) return false;
    std::copy(place + 1, last, place);
    --state_.count[r];
    return true;
  }

  /// Back to packed.
  void pack() {
    if (state_.count.empty()) return;
    std::size_t all = 0;
    for (const std::int32_t n : state_.count) all += static_cast<std::size_t>(n);
    std::vector<std::int32_t> items;
    items.reserve(with_room(all));
    for (std::size_t r = 0; r < state_.count.size(); ++r) {
      const auto first = items_.begin() + begin_[r];
      begin_[r] = static_cast<std::int32_t>(items.size());
      items.insert(items.end(), first, first + state_.count[r]);
    }
    begin_.back() = static_cast<std::int32_t>(items.size());
    items_ = std::move(items);
    state_ = {};
  }

  /// Packs if more room was taken at the end than there was at the last packing.
  void pack_if_wasteful() {
    if (items_.size() > 2 * static_cast<std::size_t>(state_.packed_end) + 64) pack();
  }

 private:
  std::size_t room(std::int32_t r) const {
    const auto size = static_cast<std::size_t>(state_.count[r]);
    return begin_[r] < state_.packed_end ? size : (size + 7) / 8 * 8;
  }
  std::int32_t room_at_end(std::size_t size) {
    const auto at = static_cast<std::int32_t>(items_.size());
    items_.resize(items_.size() + (size + 7) / 8 * 8);
    return at;
  }

  std::vector<std::int32_t>& begin_;
  std::vector<std::int32_t>& items_;
  RowState& state_;
};

}  // namespace kerf
