// SPDX-License-Identifier: MIT
//
// Nodes of an octree by a number: of its leaves, or of its roots. As long as each is that number
// itself, which it is in a uniform body and in a full lattice, nothing is stored.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <numeric>
#include <vector>

#include "core/base/array.hpp"

namespace kerf {

class NodeList {
 public:
  class Iterator {
   public:
    using iterator_category = std::input_iterator_tag;
    using value_type = std::int32_t;
    using difference_type = std::ptrdiff_t;
    using pointer = const std::int32_t*;
    using reference = std::int32_t;

    Iterator(const NodeList* of, std::size_t at) : of_(of), at_(at) {}
    std::int32_t operator*() const { return (*of_)[at_]; }
    Iterator& operator++() { return ++at_, *this; }
    Iterator operator++(int) { return {of_, at_++}; }
    friend bool operator==(const Iterator&, const Iterator&) = default;

   private:
    const NodeList* of_;
    std::size_t at_;
  };

  std::int32_t operator[](std::size_t number) const {
    return is_stored_ ? nodes_[number] : static_cast<std::int32_t>(number);
  }
  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  Iterator begin() const { return {this, 0}; }
  Iterator end() const { return {this, size_}; }
  std::size_t bytes() const { return bytes_of(nodes_); }

  /// For when they are stored.
  void reserve(std::size_t size) { room_ = size; }
  void push_back(std::int32_t node) {
    if (!is_stored_ && node != static_cast<std::int32_t>(size_)) store();
    if (is_stored_) nodes_.push_back(node);
    ++size_;
  }
  void set(std::size_t number, std::int32_t node) {
    if (!is_stored_ && node != static_cast<std::int32_t>(number)) store();
    if (is_stored_) nodes_[number] = node;
  }

 private:
  void store() {
    is_stored_ = true;
    nodes_.reserve(std::max(room_, size_ + size_ / 4 + 1));
    nodes_.resize(size_);
    std::iota(nodes_.begin(), nodes_.end(), 0);
  }

  std::vector<std::int32_t> nodes_;
  std::size_t size_ = 0, room_ = 0;
  bool is_stored_ = false;
};

}  // namespace kerf
