// SPDX-License-Identifier: MIT
//
// A bounding-volume tree over boxes whose order already follows space.
//
// The leaves keep the caller's order; the tree is implicit and is built in linear time, so that it
// can be built anew for every blade pass over a deformed body.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "core/geometry/vec.hpp"

namespace kerf {

class Bvh {
 public:
  /// Boxes that lie near each other in the array should lie near each other in space.
  explicit Bvh(std::vector<Box3> boxes);

  /// Calls visit(i) for each box i that overlaps `query`, in ascending order of i.
  void query(const Box3& query, const std::function<void(std::int32_t)>& visit) const;

  const Box3& bounds() const;
  std::size_t size() const { return count_; }

 private:
  std::size_t count_ = 0;
  std::vector<std::size_t> level_begin_;  // first box of each tree level, leaves first
  std::vector<Box3> boxes_;
};

}  // namespace kerf
