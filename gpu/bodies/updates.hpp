// SPDX-License-Identifier: MIT
//
// After a cut: what changed comes as a list of records, in one copy, and goes where it belongs.
#pragma once

#include "gpu/level_view.hpp"

namespace kerf::gpu {

struct CellRecord {
  std::int32_t cell;
  std::int32_t slots[kCorners];
  std::int32_t parent;
  std::uint16_t fold;
  std::uint8_t place, size_log2;
};

struct WriteCell {
  const CellRecord* records;
  std::int32_t* slots;
  std::int32_t* parent;  ///< null on the coarsest level, as is place
  std::uint8_t* place;
  std::uint16_t* fold;
  std::uint8_t* size_log2;

  KERF_HD void operator()(std::int32_t i) const {
    const CellRecord& r = records[i];
    const auto first = kCorners * static_cast<std::size_t>(r.cell);
    for (std::size_t k = 0; k < kCorners; ++k) slots[first + k] = r.slots[k];
    if (parent != nullptr) parent[r.cell] = r.parent;
    if (place != nullptr) place[r.cell] = r.place;
    fold[r.cell] = r.fold;
    size_log2[r.cell] = r.size_log2;
  }
};

/// Where the list of a cell or vertex lies, and for vertices what of it is held.
struct RowRecord {
  std::int32_t row, begin, count;
  std::uint8_t fixed;
};

struct WriteRow {
  const RowRecord* records;
  std::int32_t *begin, *count;
  std::uint8_t* fixed;  ///< or null

  KERF_HD void operator()(std::int32_t i) const {
    const RowRecord& r = records[i];
    begin[r.row] = r.begin;
    count[r.row] = r.count;
    if (fixed != nullptr) fixed[r.row] = r.fixed;
  }
};

/// One item of some arrays: a place and what is there now.
template <class T>
struct PlacedItem {
  std::int32_t at;
  T value;
};

template <class T>
struct WriteItem {
  const PlacedItem<T>* items;
  T* to;

  KERF_HD void operator()(std::int32_t i) const { to[items[i].at] = items[i].value; }
};

}  // namespace kerf::gpu
