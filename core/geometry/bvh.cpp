// SPDX-License-Identifier: MIT
#include "core/geometry/bvh.hpp"

#include <array>
#include <utility>

namespace kerf {
namespace {

constexpr std::size_t kFan = 4;  // boxes joined by one box of the next level

}  // namespace

Bvh::Bvh(std::vector<Box3> boxes) : count_(boxes.size()), boxes_(std::move(boxes)) {
  if (boxes_.empty()) boxes_.emplace_back();
  level_begin_.push_back(0);
  while (boxes_.size() - level_begin_.back() > 1) {
    const std::size_t begin = level_begin_.back(), end = boxes_.size();
    level_begin_.push_back(end);
    for (std::size_t first = begin; first < end; first += kFan) {
      Box3 joined;
      for (std::size_t i = first; i < std::min(first + kFan, end); ++i) joined.add(boxes_[i]);
      boxes_.push_back(joined);
    }
  }
}

const Box3& Bvh::bounds() const { return boxes_.back(); }

void Bvh::query(const Box3& query, const std::function<void(std::int32_t)>& visit) const {
  if (count_ == 0) return;
  // Entries (level, index in level); children are pushed last first, so leaves come out in order.
  struct Entry {
    std::size_t level, index;
  };
  constexpr std::size_t kDepth = 24 * (kFan - 1) + 1;  // a tree over 2^48 boxes; no allocation
  std::array<Entry, kDepth> stack;
  std::size_t height = 0;
  stack[height++] = {level_begin_.size() - 1, 0};
  while (height > 0) {
    const auto [level, index] = stack[--height];
    if (!boxes_[level_begin_[level] + index].overlaps(query)) continue;
    if (level == 0) {
      visit(static_cast<std::int32_t>(index));
      continue;
    }
    const std::size_t below = level_begin_[level] - level_begin_[level - 1];
    for (std::size_t i = std::min(kFan * (index + 1), below); i-- > kFan * index;)
      stack[height++] = {level - 1, i};
  }
}

}  // namespace kerf
