// SPDX-License-Identifier: MIT
//
// Which cells make a patch.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/levels/hierarchy.hpp"

namespace kerf::cpu {

/// Cells in parts that share few vertices; their sizes differ by one at the most, and each is in
/// ascending order. The cells are halved again and again, across where they reach farthest; rows
/// along x, which packs go along, are cut last.
///
/// Needs   parts > 0.
/// Source  Berger and Bokhari 1987, "A partitioning strategy for nonuniform problems on
///         multiprocessors", IEEE Transactions on Computers 36(5).
std::vector<std::vector<std::int32_t>> halved(const Level& level,
                                              const std::vector<std::int32_t>& cells,
                                              std::size_t parts);

}  // namespace kerf::cpu
