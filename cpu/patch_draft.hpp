// SPDX-License-Identifier: MIT
//
// A patch by itself: its cells in groups and its points in order, before they have a place in the
// arrays of the level.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <exception>
#include <memory>
#include <new>
#include <unordered_map>
#include <utility>
#include <vector>

#include "cpu/patched_level.hpp"

namespace kerf::cpu {

struct Draft {
  std::int32_t patch = 0;
  std::vector<std::int32_t> cells;          // to be grouped; then per lane, -1: none
  std::vector<std::uint16_t> kind_of;       // of the cells to be grouped
  std::vector<std::uint16_t> corners;       // [group][8][8]
  std::vector<std::uint16_t> slots;         // the same, of the groups that are folded
  std::vector<std::uint8_t> folded;         // per group
  std::vector<std::uint8_t> row;            // per group
  std::vector<std::uint16_t> kind;          // per group
  std::vector<std::int32_t> vertices;       // of the level, in the order of their points
  std::vector<std::uint16_t> vertex_point;  // rising
  std::vector<std::uint16_t> hanging_point;
  std::vector<std::array<std::uint16_t, 4>> masters;

  std::int32_t points() const {
    return static_cast<std::int32_t>(vertices.size() + masters.size()) + 1;
  }
  std::uint16_t nothing() const { return static_cast<std::uint16_t>(points() - 1); }
};

/// Zeros, one for each of many numbers; of large bodies, those never touched cost nothing.
class Marks {
 public:
  explicit Marks(std::size_t size)
      : marks_(static_cast<std::int32_t*>(std::calloc(size + 1, sizeof(std::int32_t)))) {
    if (!marks_) throw std::bad_alloc();
  }
  std::int32_t& operator[](std::int32_t n) { return marks_.get()[n]; }

 private:
  struct Free {
    void operator()(std::int32_t* p) const { std::free(p); }
  };
  std::unique_ptr<std::int32_t[], Free> marks_;
};

/// Runs body(i, local) for i from begin to end on some threads, each with a `local` of its own that
/// make() gives. What they throw, one of them at least, is thrown here.
template <class Make, class Body>
void for_patches(std::int32_t begin, std::int32_t end, int threads, const Make& make,
                 const Body& body) {
  std::exception_ptr error;
  std::atomic<bool> failed = false;
  const auto guarded = [&](const auto& part) {
    try {
      part();
    } catch (...) {
      if (!failed.exchange(true)) error = std::current_exception();
    }
  };
  if (begin >= end) return;
#pragma omp parallel num_threads(std::min(threads, end - begin)) if (end - begin > 1)
  {
    decltype(make()) local{};
    guarded([&] { local = make(); });
#pragma omp for schedule(dynamic, 1)
    for (std::int32_t i = begin; i < end; ++i)
      guarded([&] {
        if (local) body(i, *local);
      });
  }
  if (error) std::rethrow_exception(error);
}

/// The points of one patch after the other.
class Numbering {
 public:
  using Corners = std::array<std::uint16_t, 8>;

  explicit Numbering(const Level& level) : level_(level), first_(level.point.size()) {}

  /// Corners and slots of the draft's cells, as points.
  void number(Draft& draft, std::vector<Corners>& corners, std::vector<Corners>& slots);

 private:
  std::uint16_t vertex(std::int32_t v, Draft& draft);
  Corners corners_of(Draft& draft, std::size_t n, const Corners& slots);
  void sort(Draft& draft, std::size_t vertices);

  const Level& level_;
  Marks first_;                        // per vertex of the level: its place in the draft, from 1
  std::vector<std::uint64_t> places_;  // of points as they were met: vertices, then hanging ones
  std::vector<std::pair<std::uint64_t, std::uint64_t>> order_;
  std::vector<std::uint16_t> rank_;
  std::unordered_map<std::uint64_t, std::int32_t> hanging_;
};

/// Groups and numbers the cells of a draft.
void make_draft(const Level& level, Draft& draft, Numbering& numbering);

/// A number along a curve that stays within cubes.
std::uint64_t morton(const Vec3i& point);

}  // namespace kerf::cpu
