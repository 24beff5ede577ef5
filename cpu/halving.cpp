// SPDX-License-Identifier: MIT
#include "cpu/halving.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

namespace kerf::cpu {
namespace {

class Halving {
 public:
  Halving(const Level& level, const std::vector<std::int32_t>& cells) {
    items_.reserve(cells.size());
    for (const std::int32_t c : cells) items_.push_back({level.corner[c], c});
  }

  std::vector<std::vector<std::int32_t>> into(std::size_t parts) {
    parts_.reserve(parts);
    divide(items_.begin(), items_.end(), parts);
    return std::move(parts_);
  }

 private:
  struct Item {
    Vec3i corner;
    std::int32_t cell;
  };
  using At = std::vector<Item>::iterator;

  void divide(At begin, At end, std::size_t parts) {
    if (parts <= 1) {
      std::vector<std::int32_t>& part = parts_.emplace_back();
      part.reserve(static_cast<std::size_t>(end - begin));
      std::transform(begin, end, std::back_inserter(part),
                     [](const Item& item) { return item.cell; });
      std::sort(part.begin(), part.end());  // libraries part a range in orders of their own
      return;
    }
    const std::size_t first = (parts + 1) / 2, count = static_cast<std::size_t>(end - begin);
    const At middle = begin + static_cast<std::ptrdiff_t>(count * first / parts);
    const int axis = widest(begin, end), second = axis == 2 ? 1 : 2, third = axis == 0 ? 1 : 0;
    std::nth_element(begin, middle, end, [=](const Item& a, const Item& b) {
      for (const int d : {axis, second, third})
        if (a.corner[d] != b.corner[d]) return a.corner[d] < b.corner[d];
      return a.cell < b.cell;
    });
    divide(begin, middle, first);
    divide(middle, end, parts - first);
  }

  static int widest(At begin, At end) {
    constexpr int kRow = 2;  // what a length along x counts less: measured
    if (begin == end) return 0;
    Vec3i low = begin->corner, high = low;
    for (At at = begin; at != end; ++at)
      for (int d = 0; d < 3; ++d) {
        low[d] = std::min(low[d], at->corner[d]);
        high[d] = std::max(high[d], at->corner[d]);
      }
    const int x = (high[0] - low[0]) / kRow, y = high[1] - low[1], z = high[2] - low[2];
    return z >= y && z >= x ? 2 : y >= x ? 1 : 0;
  }

  std::vector<Item> items_;
  std::vector<std::vector<std::int32_t>> parts_;
};

}  // namespace

std::vector<std::vector<std::int32_t>> halved(const Level& level,
                                              const std::vector<std::int32_t>& cells,
                                              std::size_t parts) {
  return Halving(level, cells).into(parts);
}

}  // namespace kerf::cpu
