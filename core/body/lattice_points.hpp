// SPDX-License-Identifier: MIT
//
// Points of the finest lattice, eight bytes each: a cell and a vertex each have one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <vector>

#include "core/geometry/vec.hpp"

namespace kerf {

/// A point as one number. Its coordinates are from 0 on; lattices have less than 2^20 cells along
/// an axis.
class LatticePoint {
 public:
  LatticePoint() = default;
  LatticePoint(const Vec3i& p)  // NOLINT: they are one thing
      : key_(static_cast<std::uint64_t>(p[0]) | static_cast<std::uint64_t>(p[1]) << kBits |
             static_cast<std::uint64_t>(p[2]) << (2 * kBits)) {}
  operator Vec3i() const {  // NOLINT
    constexpr std::uint64_t kMask = (std::uint64_t{1} << kBits) - 1;
    return {static_cast<std::int32_t>(key_ & kMask),
            static_cast<std::int32_t>(key_ >> kBits & kMask),
            static_cast<std::int32_t>(key_ >> (2 * kBits))};
  }
  friend bool operator==(const LatticePoint&, const LatticePoint&) = default;

 private:
  static constexpr int kBits = 21;
  std::uint64_t key_ = 0;
};

class LatticePoints {
 public:
  class Iterator {
   public:
    using iterator_category = std::random_access_iterator_tag;
    using value_type = Vec3i;
    using difference_type = std::ptrdiff_t;
    using pointer = const Vec3i*;
    using reference = Vec3i;

    Iterator() = default;
    explicit Iterator(const LatticePoint* at) : at_(at) {}
    Vec3i operator*() const { return *at_; }
    Vec3i operator[](difference_type n) const { return at_[n]; }
    Iterator& operator++() { return ++at_, *this; }
    Iterator operator++(int) { return Iterator(at_++); }
    Iterator& operator--() { return --at_, *this; }
    Iterator& operator+=(difference_type n) { return at_ += n, *this; }
    friend Iterator operator+(Iterator a, difference_type n) { return a += n; }
    friend difference_type operator-(const Iterator& a, const Iterator& b) { return a.at_ - b.at_; }
    friend bool operator==(const Iterator&, const Iterator&) = default;

   private:
    const LatticePoint* at_ = nullptr;
  };

  Vec3i operator[](std::size_t i) const { return points_[i]; }
  void set(std::size_t i, const Vec3i& point) { points_[i] = point; }
  void push_back(const Vec3i& point) { points_.emplace_back(point); }
  /// New ones are at the origin.
  void resize(std::size_t size) { points_.resize(size); }
  void reserve(std::size_t size) { points_.reserve(size); }
  void clear() { points_.clear(); }
  std::size_t size() const { return points_.size(); }
  std::size_t capacity() const { return points_.capacity(); }
  bool empty() const { return points_.empty(); }
  const LatticePoint* data() const { return points_.data(); }
  Iterator begin() const { return Iterator(points_.data()); }
  Iterator end() const { return Iterator(points_.data() + points_.size()); }
  std::size_t bytes() const { return points_.size() * sizeof(LatticePoint); }

  friend bool operator==(const LatticePoints&, const LatticePoints&) = default;

 private:
  std::vector<LatticePoint> points_;
};

}  // namespace kerf
