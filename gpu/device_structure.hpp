// SPDX-License-Identifier: MIT
//
// The structure of one level in the memory of a device. A load copies it whole; an update after a
// cut sends what changed as lists of records, one copy each, which a launch puts in place.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/levels/hierarchy.hpp"
#include "core/levels/update.hpp"
#include "gpu/bodies/updates.hpp"
#include "gpu/device_array.hpp"

namespace kerf::gpu {

/// A place on the device for what the next launch reads. What is asked for runs in its order, so
/// that the place may be used again at once.
template <class Device>
class Staging {
 public:
  explicit Staging(Device& device) : bytes_(device) {}

  template <class T>
  const T* put(std::span<const T> values) {
    bytes_.assign(values.size_bytes());
    bytes_.write(0, std::as_bytes(values));
    return reinterpret_cast<const T*>(bytes_.data());
  }
  template <class T>
  const T* put(const std::vector<T>& values) {
    return put(std::span<const T>(values));
  }

 private:
  DeviceArray<Device, std::byte> bytes_;
};

template <class T>
std::int32_t count_of(const T& list) {
  return static_cast<std::int32_t>(list.size());
}

/// Old ones of an ascending list, and all that are new.
inline std::vector<std::int32_t> listed(const std::vector<std::int32_t>& changed,
                                        std::int32_t before, std::int32_t now) {
  std::vector<std::int32_t> out;
  for (const std::int32_t c : changed)
    if (c < before) out.push_back(c);
  for (std::int32_t c = before; c < now; ++c) out.push_back(c);
  return out;
}

/// Lists of integers as core/levels/rows.hpp has them, with a count a row.
template <class Device>
class DeviceRows {
 public:
  explicit DeviceRows(Device& device)
      : device_(&device), begin_(device), count_(device), items_(device) {}

  void load(const std::vector<std::int32_t>& begin, const std::vector<std::int32_t>& items,
            const RowState& state) {
    const std::size_t rows = begin.empty() ? 0 : begin.size() - 1;
    std::vector<std::int32_t> count(state.count);
    if (count.empty())
      for (std::size_t r = 0; r < rows; ++r) count.push_back(begin[r + 1] - begin[r]);
    begin_.upload({begin.data(), rows});
    count_.upload(count);
    items_.upload(items);
  }

  /// The rows that are named. `held`: of each row, also to be written; or null.
  void update(const std::vector<std::int32_t>& begin, const std::vector<std::int32_t>& items,
              const RowState& state, std::span<const std::int32_t> changed,
              const std::vector<std::uint8_t>* held, std::uint8_t* fixed,
              Staging<Device>& staging) {
    const bool packed = state.count.empty();  // in this update: all rows have moved
    if (packed) load(begin, items, state);
    std::vector<RowRecord> rows;
    std::vector<PlacedItem<std::int32_t>> placed;
    for (const std::int32_t r : changed) {
      const auto row = row_of(begin, items, state, r);
      rows.push_back({r, begin[r], count_of(row),
                      held != nullptr ? (*held)[static_cast<std::size_t>(r)] : std::uint8_t{0}});
      if (packed) continue;
      for (std::size_t k = 0; k < row.size(); ++k)
        placed.push_back({begin[r] + static_cast<std::int32_t>(k), row[k]});
    }
    if (!packed) {
      begin_.resize(state.count.size());
      count_.resize(state.count.size());
      items_.resize(items.size());
    }
    device_->launch(count_of(rows),
                    WriteRow{staging.put(rows), begin_.data(), count_.data(), fixed});
    device_->launch(count_of(placed), WriteItem<std::int32_t>{staging.put(placed), items_.data()});
  }

  const std::int32_t* begin() const { return begin_.data(); }
  const std::int32_t* count() const { return count_.data(); }
  const std::int32_t* items() const { return items_.data(); }

 private:
  Device* device_;
  DeviceArray<Device, std::int32_t> begin_, count_, items_;
};

template <class Device>
class DeviceStructure {
 public:
  explicit DeviceStructure(Device& device)
      : device_(&device),
        slots_(device),
        parent_(device),
        fold_(device),
        place_(device),
        size_log2_(device),
        fixed_(device),
        incidences_(device),
        children_(device) {}

  void load(const Level& level) {
    slots_.upload({level.slots.empty() ? nullptr : level.slots[0].data(), 8 * level.slots.size()});
    parent_.upload(level.parent);
    fold_.upload(level.fold);
    place_.upload(level.place);
    size_log2_.upload(level.size_log2);
    fixed_.upload(level.fixed);
    incidences_.load(level.incidence_begin, level.incidence, level.incidence_rows);
    children_.load(level.child_begin, level.children, level.child_rows);
    cells_ = level.cells();
    vertices_ = level.vertices();
  }

  void update(const Level& level, const LevelChange& change, Staging<Device>& staging) {
    cells_ = level.cells();
    vertices_ = level.vertices();
    slots_.resize(8 * level.slots.size());
    parent_.resize(level.parent.size());
    fold_.resize(level.fold.size());
    place_.resize(level.place.size());
    size_log2_.resize(level.size_log2.size());
    fixed_.resize(level.fixed.size());
    const std::vector<std::int32_t> cells = listed(change.cells, change.cells_before, cells_);
    std::vector<CellRecord> records;
    records.reserve(cells.size());
    for (const std::int32_t c : cells) records.push_back(record_of(level, c));
    device_->launch(count_of(records),
                    WriteCell{staging.put(records), slots_.data(), data_or_null(parent_),
                              data_or_null(place_), fold_.data(), size_log2_.data()});
    if (!level.child_begin.empty())
      children_.update(level.child_begin, level.children, level.child_rows, cells, nullptr, nullptr,
                       staging);
    incidences_.update(level.incidence_begin, level.incidence, level.incidence_rows,
                       listed(change.vertices, change.vertices_before, vertices_), &level.fixed,
                       fixed_.data(), staging);
  }

  LevelView view() const {
    return {cells_,
            vertices_,
            slots_.data(),
            fold_.data(),
            data_or_null(parent_),
            data_or_null(place_),
            fixed_.data(),
            incidences_.begin(),
            incidences_.count(),
            incidences_.items(),
            children_.begin(),
            children_.count(),
            children_.items()};
  }
  const std::uint8_t* size_log2() const { return size_log2_.data(); }
  std::int32_t cells() const { return cells_; }
  std::int32_t vertices() const { return vertices_; }

 private:
  template <class T>
  static T* data_or_null(const DeviceArray<Device, T>& array) {
    return array.size() > 0 ? array.data() : nullptr;
  }
  static CellRecord record_of(const Level& level, std::int32_t cell) {
    const auto c = static_cast<std::size_t>(cell);
    CellRecord out{};
    out.cell = cell;
    for (std::size_t k = 0; k < 8; ++k) out.slots[k] = level.slots[c][k];
    if (!level.parent.empty()) out.parent = level.parent[c];
    if (!level.place.empty()) out.place = level.place[c];
    out.fold = level.fold[c];
    out.size_log2 = level.size_log2[c];
    return out;
  }

  Device* device_;
  std::int32_t cells_ = 0, vertices_ = 0;
  DeviceArray<Device, std::int32_t> slots_, parent_;
  DeviceArray<Device, std::uint16_t> fold_;
  DeviceArray<Device, std::uint8_t> place_, size_log2_, fixed_;
  DeviceRows<Device> incidences_, children_;
};

}  // namespace kerf::gpu
