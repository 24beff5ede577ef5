// SPDX-License-Identifier: MIT
//
// Blocks of vertices (vertex_blocks.hpp) in the memory of a device. The codes of incidences are
// found there, so that a cut sends the cells of the blocks that it touched and no more.
#pragma once

#include <vector>

#include "gpu/bodies/blocks.hpp"
#include "gpu/device_structure.hpp"
#include "gpu/vertex_blocks.hpp"

namespace kerf::gpu {

template <class Device>
class DeviceBlocks {
 public:
  explicit DeviceBlocks(Device& device)
      : device_(&device), order_(device), cells_(device), codes_(device) {}

  void load(const Level& level, const LevelView& view) {
    host_.build(level);
    order_.upload(host_.order());
    cells_.load(host_.begin(), host_.cells(), host_.rows());
    codes_.assign(level.incidence.size());
    write_codes(view, nullptr, count());
  }

  /// After the structure of the level was updated.
  void update(const Level& level, const LevelChange& change, const LevelView& view,
              Staging<Device>& staging) {
    const std::size_t before = order_.size();
    const std::vector<std::int32_t> blocks =
        host_.update(level, listed(change.vertices, change.vertices_before, level.vertices()));
    order_.resize(host_.order().size());
    order_.write(before, std::span<const std::int32_t>(host_.order()).subspan(before));
    cells_.update(host_.begin(), host_.cells(), host_.rows(), blocks, nullptr, nullptr, staging);
    codes_.resize(level.incidence.size());
    const bool all_moved = level.incidence_rows.count.empty();
    write_codes(view, all_moved ? nullptr : staging.put(blocks),
                all_moved ? count() : count_of(blocks));
  }

  /// Of a block.
  std::size_t most_cells() const { return host_.most_cells(); }
  std::int32_t count() const { return host_.count(); }
  BlockView view() const {
    return {order_.data(), cells_.begin(), cells_.count(), cells_.items(), codes_.data()};
  }

 private:
  void write_codes(const LevelView& level, const std::int32_t* some, std::int32_t blocks) {
    device_->launch(kBlockVertices * blocks, WriteCodes{level, view(), some, codes_.data()});
  }

  Device* device_;
  VertexBlocks host_;
  DeviceArray<Device, std::int32_t> order_;
  DeviceRows<Device> cells_;
  DeviceArray<Device, std::uint16_t> codes_;
};

}  // namespace kerf::gpu
