// SPDX-License-Identifier: MIT
//
// Names for the vector types of core/, and an axis-aligned box.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>

#include "kernels/mat3.hpp"

namespace kerf {

using Vec3d = kernels::Vec3<double>;
using Vec3f = kernels::Vec3<float>;
using Mat3d = kernels::Mat3<double>;
using Vec3i = std::array<std::int32_t, 3>;

using kernels::cross;
using kernels::dot;
using kernels::norm;

/// A closed axis-aligned box; empty until something is added.
struct Box3 {
  Vec3d lo{std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity(),
           std::numeric_limits<double>::infinity()};
  Vec3d hi{-std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity(),
           -std::numeric_limits<double>::infinity()};

  void add(const Vec3d& p) {
    for (int d = 0; d < 3; ++d) {
      lo[d] = std::min(lo[d], p[d]);
      hi[d] = std::max(hi[d], p[d]);
    }
  }
  void add(const Box3& b) {
    for (int d = 0; d < 3; ++d) {
      lo[d] = std::min(lo[d], b.lo[d]);
      hi[d] = std::max(hi[d], b.hi[d]);
    }
  }
  bool empty() const { return !(lo.x <= hi.x && lo.y <= hi.y && lo.z <= hi.z); }
  bool overlaps(const Box3& b) const {
    for (int d = 0; d < 3; ++d)
      if (!(lo[d] <= b.hi[d] && b.lo[d] <= hi[d])) return false;
    return true;
  }
  bool contains(const Vec3d& p) const {
    for (int d = 0; d < 3; ++d)
      if (!(lo[d] <= p[d] && p[d] <= hi[d])) return false;
    return true;
  }
  Vec3d extent() const { return hi - lo; }
};

}  // namespace kerf
