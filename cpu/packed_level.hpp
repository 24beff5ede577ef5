// SPDX-License-Identifier: MIT
//
// A level as the fast backend walks it: cells in groups of eight, one in each lane.
//
// Layout  Group g holds lanes 8 g .. 8 g + 7. A lane that is left over holds no cell: its vertices
//         are the one behind the last, which is zero and stays so.
//
//           slots     [group][slot][lane]     vertex
//           records   [group][slot][lane][4]  what a cell adds to the vertex at its slot
//           matrices  [group][entry][lane]    levels above 0: tiles of eight cells (layout.hpp)
//
//         All lanes of a group of level 0 share one material and one fold code. A group is one pack
//         of floats or two of doubles.
//         Vectors hold three scalars a vertex, those of the vertex behind the last, and one more.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/levels/hierarchy.hpp"
#include "cpu/pack.hpp"

namespace kerf::cpu {

inline constexpr int kGroup = 8;

/// What a fine vertex takes from coarse ones, or a coarse one from fine ones: rows of a sparse
/// matrix.
struct SparseWeights {
  std::vector<std::int32_t> begin;   // per row + 1
  std::vector<std::int32_t> vertex;  // of the other level
  std::vector<float> weight;         // multiples of 1/64: exact
};

/// w[i][m]: the value at slot i of a child from those at the slots m of its parent.
struct Weights {
  float w[8][8];
};

struct PackedLevel {
  const Level* level = nullptr;
  std::vector<std::int32_t> cell;       // per lane, -1: none
  std::vector<std::int32_t> lane;       // per cell
  std::vector<std::int32_t> slots;      // [group][8][8]
  std::vector<std::uint16_t> fold;      // per group, level 0 only
  std::vector<std::uint8_t> material;   // per group, level 0 only
  std::vector<std::int32_t> record;     // per incidence, in the order of level->incidence
  SparseWeights prolong;                // rows: vertices of this level; columns: of the next
  SparseWeights restrict_;              // rows: vertices of the next level; columns: of this one
  std::vector<std::int32_t> weights;    // per cell: which of the weights below, to its parent
  std::vector<Weights> from_slots;      // W of a stored matrix, which is over slots
  std::vector<Weights> from_corners;    // and of one over corners, level 0
  std::vector<std::uint8_t> has_fixed;  // per cell of level 0

  std::size_t groups() const { return cell.size() / kGroup; }
  std::size_t vertices() const { return level->point.size(); }
  std::size_t bytes() const;
};

/// `finer` is the level below, already packed; null for level 0.
PackedLevel pack_level(const Hierarchy& hierarchy, std::size_t index, const PackedLevel* finer);

}  // namespace kerf::cpu
