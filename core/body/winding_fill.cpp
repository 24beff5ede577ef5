// SPDX-License-Identifier: MIT
#include "core/body/winding_fill.hpp"

#include <algorithm>
#include <cmath>

namespace kerf {
namespace {

constexpr std::int8_t kUnknown = -128;
constexpr double kMost = 100;
constexpr std::int32_t kSmall = 4;  // boxes of at most this side are mostly boundary

class Filler {
 public:
  Filler(const WindingTree& tree, const Lattice& lattice)
      : tree_(tree), lattice_(lattice), value_(lattice.cells(), kUnknown) {}

  // Cells lo ... hi, both included.
  void fill(const Vec3i& lo, const Vec3i& hi) {
    const std::int32_t side = std::max({hi[0] - lo[0], hi[1] - lo[1], hi[2] - lo[2]}) + 1;
    if (side > kSmall) {
      if (!tree_.touches({lattice_.center(lo), lattice_.center(hi)}) && uniform_boundary(lo, hi))
        each(lo, hi, [&](std::size_t i, const Vec3i&) { value_[i] = value_[lattice_.index(lo)]; });
      else
        split(lo, hi);
      return;
    }
    each(lo, hi, [&](std::size_t, const Vec3i& c) { at(c); });
  }

  std::vector<std::int8_t> take() { return std::move(value_); }

 private:
  template <class Visit>
  void each(const Vec3i& lo, const Vec3i& hi, const Visit& visit) {
    for (std::int32_t z = lo[2]; z <= hi[2]; ++z)
      for (std::int32_t y = lo[1]; y <= hi[1]; ++y)
        for (std::int32_t x = lo[0]; x <= hi[0]; ++x) visit(lattice_.index({x, y, z}), {x, y, z});
  }

  void split(const Vec3i& lo, const Vec3i& hi) {
    for (unsigned part = 0; part < 8; ++part) {
      Vec3i a = lo, b = hi;
      bool empty = false;
      for (unsigned d = 0; d < 3; ++d) {
        const std::int32_t middle = lo[d] + (hi[d] - lo[d]) / 2;
        if ((part >> d & 1) != 0)
          a[d] = middle + 1;
        else
          b[d] = middle;
        empty = empty || a[d] > b[d];
      }
      if (!empty) fill(a, b);
    }
  }

  std::int8_t at(const Vec3i& c) {
    std::int8_t& value = value_[lattice_.index(c)];
    if (value == kUnknown) {
      const double w = std::nearbyint(tree_(lattice_.center(c)));
      value = static_cast<std::int8_t>(std::clamp(w, -kMost, kMost));
    }
    return value;
  }

  bool uniform_boundary(const Vec3i& lo, const Vec3i& hi) {
    const std::int8_t first = at(lo);
    for (std::int32_t z = lo[2]; z <= hi[2]; ++z)
      for (std::int32_t y = lo[1]; y <= hi[1]; ++y) {
        const bool face = z == lo[2] || z == hi[2] || y == lo[1] || y == hi[1];
        const std::int32_t step = face ? 1 : std::max(hi[0] - lo[0], 1);
        for (std::int32_t x = lo[0]; x <= hi[0]; x += step)
          if (at({x, y, z}) != first) return false;
      }
    return true;
  }

  const WindingTree& tree_;
  const Lattice& lattice_;
  std::vector<std::int8_t> value_;
};

}  // namespace

std::vector<std::int8_t> rounded_winding(const WindingTree& tree, const Lattice& lattice) {
  Filler filler(tree, lattice);
  filler.fill({0, 0, 0}, {lattice.size[0] - 1, lattice.size[1] - 1, lattice.size[2] - 1});
  return filler.take();
}

}  // namespace kerf
