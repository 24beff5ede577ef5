// SPDX-License-Identifier: MIT
//
// A point of the finest lattice in eight bytes: every cell and every vertex has one.
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/geometry/vec.hpp"
#include "kernels/layout.hpp"

namespace kerf {

/// Coordinates are from 0 on, and below 2^21: lattices have less than 2^20 cells along an axis.
class LatticePoint {
 public:
  LatticePoint() = default;
  LatticePoint(const Vec3i& p)  // NOLINT: they are one thing
      : key_(static_cast<std::uint64_t>(p[0]) | static_cast<std::uint64_t>(p[1]) << kBits |
             static_cast<std::uint64_t>(p[2]) << (2 * kBits)) {}
  operator Vec3i() const { return {(*this)[0], (*this)[1], (*this)[2]}; }  // NOLINT
  std::int32_t operator[](std::size_t axis) const {
    return kernels::lattice_coordinate(key_, static_cast<int>(axis));
  }
  /// The coordinates, 21 bits each, x lowest.
  std::uint64_t key() const { return key_; }
  friend bool operator==(const LatticePoint&, const LatticePoint&) = default;

 private:
  static constexpr int kBits = kernels::kLatticeBits;
  std::uint64_t key_ = 0;
};

}  // namespace kerf
