// SPDX-License-Identifier: MIT
#include "cpu/packed_level.hpp"

#include <algorithm>
#include <map>
#include <numeric>
#include <tuple>

#include "kernels/transfer.hpp"

namespace kerf::cpu {
namespace {

template <class T>
std::size_t bytes_of(const std::vector<T>& array) {
  return array.capacity() * sizeof(T);
}

/// What the cells of a group have in common: fold code and material on level 0, the weights of
/// their children in their order above.
std::vector<std::vector<std::int32_t>> group_keys(const Hierarchy& hierarchy,
                                                  const PackedLevel* finer, const Level& level) {
  std::vector<std::vector<std::int32_t>> keys(level.corner.size());
  for (std::int32_t c = 0; c < level.cells(); ++c) {
    if (finer == nullptr) {
      keys[c] = {level.fold[c], hierarchy.values[c].material};
      continue;
    }
    for (std::int32_t k = level.child_begin[c]; k < level.child_begin[c + 1]; ++k)
      keys[c].push_back(finer->weights[level.children[k]]);
  }
  return keys;
}

/// Cells in the order of their lanes. On level 0 a group begins anew where the key changes.
void assign_lanes(const Hierarchy& hierarchy, const PackedLevel* finer, PackedLevel& out) {
  const Level& level = *out.level;
  const bool finest = finer == nullptr;
  const auto keys = group_keys(hierarchy, finer, level);
  std::vector<std::int32_t> order(level.corner.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::int32_t a, std::int32_t b) { return keys[a] < keys[b]; });
  out.lane.resize(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    const std::int32_t c = order[i];
    if (finest && i > 0 && keys[order[i - 1]] != keys[c])
      while (out.cell.size() % kGroup != 0) out.cell.push_back(-1);
    out.lane[c] = static_cast<std::int32_t>(out.cell.size());
    out.cell.push_back(c);
  }
  while (out.cell.size() % kGroup != 0) out.cell.push_back(-1);
  if (!finest) return;
  for (std::size_t g = 0; g < out.groups(); ++g) {
    const std::int32_t c = out.cell[kGroup * g];
    out.fold.push_back(level.fold[c]);
    out.material.push_back(hierarchy.values[c].material);
  }
  for (std::int32_t c = 0; c < level.cells(); ++c) {
    std::uint8_t any = 0;
    for (const std::int32_t v : level.slots[c]) any = any | level.fixed[v];
    out.has_fixed.push_back(any);
  }
}

void place_slots(PackedLevel& out) {
  const Level& level = *out.level;
  out.slots.assign(8 * out.cell.size(), level.vertices());
  for (std::size_t lane = 0; lane < out.cell.size(); ++lane) {
    if (out.cell[lane] < 0) continue;
    for (std::size_t i = 0; i < 8; ++i)
      out.slots[8 * kGroup * (lane / kGroup) + kGroup * i + lane % kGroup] =
          level.slots[out.cell[lane]][i];
  }
  out.record.resize(level.incidence.size());
  for (std::size_t k = 0; k < level.incidence.size(); ++k) {
    const std::int32_t lane = out.lane[level.incidence[k] / 8], slot = level.incidence[k] % 8;
    out.record[k] = 8 * kGroup * (lane / kGroup) + kGroup * slot + lane % kGroup;
  }
}

/// Rows of the interpolation from the next level, by the first cell that meets each vertex.
void fill_transfer(const Level& coarse, PackedLevel& out) {
  const Level& fine = *out.level;
  SparseWeights& rows = out.prolong;
  rows.begin.push_back(0);
  std::vector<std::int32_t> count(coarse.point.size() + 1, 0);
  for (std::int32_t v = 0; v < fine.vertices(); ++v) {
    const std::int32_t first = fine.incidence[fine.incidence_begin[v]];
    const std::int32_t child = first / 8, parent = fine.parent[child];
    float w[8][8];
    kernels::transfer_weights(fine.fold[child], fine.place[child], coarse.fold[parent], w);
    for (int m = 0; m < 8; ++m) {
      if (w[first % 8][m] == 0) continue;
      rows.vertex.push_back(coarse.slots[parent][m]);
      rows.weight.push_back(w[first % 8][m]);
      ++count[coarse.slots[parent][m] + 1];
    }
    rows.begin.push_back(static_cast<std::int32_t>(rows.vertex.size()));
  }
  std::partial_sum(count.begin(), count.end(), count.begin());
  SparseWeights& columns = out.restrict_;
  columns.begin = count;
  columns.vertex.resize(rows.vertex.size());
  columns.weight.resize(rows.weight.size());
  for (std::int32_t v = 0; v < fine.vertices(); ++v)
    for (std::int32_t k = rows.begin[v]; k < rows.begin[v + 1]; ++k) {
      const std::int32_t at = count[rows.vertex[k]]++;
      columns.vertex[at] = v;
      columns.weight[at] = rows.weight[k];
    }
}

/// The weights of each cell in its parent; there are few different ones.
void fill_weights(const Level& coarse, PackedLevel& out) {
  const Level& fine = *out.level;
  std::map<std::tuple<std::uint16_t, std::uint8_t, std::uint16_t>, std::int32_t> known;
  out.weights.resize(fine.corner.size());
  for (std::int32_t c = 0; c < fine.cells(); ++c) {
    const auto key = std::tuple(fine.fold[c], fine.place[c], coarse.fold[fine.parent[c]]);
    const auto [entry, added] =
        known.try_emplace(key, static_cast<std::int32_t>(out.from_slots.size()));
    out.weights[c] = entry->second;
    if (!added) continue;
    Weights slots, corners{};
    float fold[8][8];
    kernels::transfer_weights(std::get<0>(key), std::get<1>(key), std::get<2>(key), slots.w);
    kernels::fold_weights(std::get<0>(key), fold);
    for (int i = 0; i < 8; ++i)
      for (int m = 0; m < 8; ++m)
        for (int j = 0; j < 8; ++j) corners.w[i][m] += fold[i][j] * slots.w[j][m];
    out.from_slots.push_back(slots);
    out.from_corners.push_back(corners);
  }
}

}  // namespace

std::size_t PackedLevel::bytes() const {
  return bytes_of(cell) + bytes_of(lane) + bytes_of(slots) + bytes_of(fold) + bytes_of(material) +
         bytes_of(record) + bytes_of(prolong.begin) + bytes_of(prolong.vertex) +
         bytes_of(prolong.weight) + bytes_of(restrict_.begin) + bytes_of(restrict_.vertex) +
         bytes_of(restrict_.weight) + bytes_of(weights) + bytes_of(from_slots) +
         bytes_of(from_corners) + bytes_of(has_fixed);
}

PackedLevel pack_level(const Hierarchy& hierarchy, std::size_t index, const PackedLevel* finer) {
  PackedLevel out;
  out.level = &hierarchy.levels[index];
  assign_lanes(hierarchy, finer, out);
  place_slots(out);
  if (index + 1 < hierarchy.levels.size()) {
    fill_transfer(hierarchy.levels[index + 1], out);
    fill_weights(hierarchy.levels[index + 1], out);
  }
  return out;
}

}  // namespace kerf::cpu
