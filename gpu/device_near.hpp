// SPDX-License-Identifier: MIT
//
// The search for what a blade may meet, on a device: a bit a cell comes back, and the bounds.
#pragma once

#include <bit>
#include <cmath>
#include <vector>

#include "core/body/cut.hpp"
#include "core/levels/corners.hpp"
#include "gpu/device_backend.hpp"

namespace kerf::gpu {

/// Where vertices lie at rest, sent when a blade first asks, and what cuts append when the next
/// does.
template <class Device, class S>
VertexPlaces DeviceBackend<Device, S>::vertex_places(int displacement) const {
  const std::vector<LatticePoint>& points = hierarchy_->levels[0].point;
  const std::size_t before = keys_.size();
  if (before < points.size()) {
    std::vector<std::uint64_t> keys;
    keys.reserve(points.size() - before);
    for (std::size_t v = before; v < points.size(); ++v) keys.push_back(points[v].key());
    keys_.resize(points.size());
    keys_.write(before, keys);
  }
  return {keys_.data(), hierarchy_->spacing, exact_vector(displacement)};
}

/// Of all vertices.
template <class Device, class S>
void DeviceBackend<Device, S>::find_bounds(const VertexPlaces& places, NearCells& out) const {
  constexpr std::int32_t kLanes = 4096, kFewer = 128;
  constexpr std::size_t kValues = BoundVertices::kValues;
  const std::int32_t vertices = levels_[0].vertices();
  values_.assign(kValues * (kLanes + kFewer));
  double* const folded = values_.data() + kValues * kLanes;
  run(kLanes, BoundVertices{places, vertices, kLanes, values_.data()});
  run(kFewer, FoldBounds{kLanes, kFewer, values_.data(), folded});
  std::vector<double> parts(kValues * kFewer);
  values_.read(kValues * kLanes, parts);
  double sum = 0;
  for (std::size_t lane = 0; lane < kFewer; ++lane) {
    const auto value = [&](std::size_t n) { return parts[n * kFewer + lane]; };
    out.bounds.add(Box3{{value(0), value(1), value(2)}, {value(3), value(4), value(5)}});
    sum += value(6);
  }
  out.finite = std::isfinite(sum);
}

template <class Device, class S>
NearCells DeviceBackend<Device, S>::find_near(int displacement, const BladeReach& reach,
                                              std::span<const std::int32_t> opened) const {
  NearCells out;
  const VertexPlaces places = vertex_places(displacement);
  find_bounds(places, out);

  kernels::BladeNeighbourhood blade = reach.neighbourhood();
  blade.slab = staging_.put(reach.slabs());
  const std::int32_t cells = levels_[0].cells(), words = (cells + 31) / 32;
  marks_.assign(std::max(at(cells), opened.size()));
  words_.assign(at(words));
  run(cells, MarkNear{levels_[0].view(), places, blade, 0, nullptr, marks_.data()});
  run(words, PackMarks{cells, marks_.data(), words_.data()});
  std::vector<std::uint32_t> bits(at(words));
  words_.read(0, bits);
  for (std::int32_t w = 0; w < words; ++w)
    for (std::uint32_t left = bits[at(w)]; left != 0; left &= left - 1)
      out.cells.push_back(32 * w + std::countr_zero(left));

  std::vector<std::int32_t> met;
  if (!opened.empty()) {
    run(count_of(opened), MarkNear{levels_[0].view(), places, blade, BladeReach::kBeyond,
                                   other_staging_.put(opened), marks_.data()});
    std::vector<std::uint8_t> marks(opened.size());
    marks_.read(0, marks);
    for (std::size_t i = 0; i < opened.size(); ++i)
      if (marks[i] != 0) met.push_back(opened[i]);
  }
  add_opened(met, out);
  return out;
}

}  // namespace kerf::gpu
