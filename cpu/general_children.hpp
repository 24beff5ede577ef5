// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <span>

#include "cpu/patched_level.hpp"
#include "kernels/transfer.hpp"

namespace kerf::cpu {

/// How the matrix of a child comes to its parent.
enum class ChildWay {
  octant,  ///< over the corners of an octant
  whole,   ///< a child that is passed on, over its corners
  slots    ///< held by slots of which some lie elsewhere
};

/// Children of some coarse cells: those of level 0 that no held component concerns, one an octant,
/// and all others.
class GeneralChildren {
 public:
  GeneralChildren(const PatchedLevel& from, const PatchedLevel& to, const std::int32_t* cells,
                  int lanes)
      : from_(from), to_(to), cells_(cells), lanes_(lanes) {
    std::fill(std::begin(plain_), std::end(plain_), -1);
    if (from.kinds.empty()) return;  // not of level 0
    for (int k = 0; k < lanes; ++k)
      for (const std::int32_t child : of(k)) {
        if (from.held[child] != kFree || from.level->place[child] == Level::kPassed) continue;
        if (std::int32_t& lane = plain_[plain_place(child, k)]; lane < 0) lane = from.lane[child];
        any_plain_ = true;
      }
  }

  bool any_plain() const { return any_plain_; }
  /// [octant][kGroup]: their lanes, -1: none.
  const std::int32_t* plain() const { return plain_; }
  /// The n-th of the others that each lane has of an octant and a way, -1: none. False where no
  /// lane has one. Those that are passed on are of octant 0.
  bool others(int octant, int n, ChildWay way, std::int32_t* out) const {
    bool any = false;
    for (int k = 0; k < lanes_; ++k) {
      out[k] = -1;
      int left = n;
      for (const std::int32_t child : of(k)) {
        if (from_.level->place[child] % 8 != octant || from_.held[child] == kWhollyHeld ||
            plain_[plain_place(child, k)] == from_.lane[child] || way_of(child) != way ||
            left-- > 0)
          continue;
        out[k] = child;
        any = true;
        break;
      }
    }
    return any;
  }

 private:
  std::span<const std::int32_t> of(int k) const {
    if (cells_[k] < 0) return {};
    return to_.level->children_of(cells_[k]);
  }
  ChildWay way_of(std::int32_t child) const {
    if (!from_.kinds.empty() && from_.held[child] == kPartlyHeld &&
        kernels::has_hanging(from_.level->fold[child]))
      return ChildWay::slots;
    return from_.level->place[child] == Level::kPassed ? ChildWay::whole : ChildWay::octant;
  }
  int plain_place(std::int32_t child, int k) const {
    return kGroup * (from_.level->place[child] % 8) + k;
  }

  const PatchedLevel &from_, &to_;
  const std::int32_t* cells_;
  int lanes_;
  std::int32_t plain_[8 * kGroup];
  bool any_plain_ = false;
};

}  // namespace kerf::cpu
