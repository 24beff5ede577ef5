// SPDX-License-Identifier: MIT
//
// Which leaves are joined, and the pieces that the body has come apart into.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/body/linked_octree.hpp"

namespace kerf {

/// Two face-adjacent leaves that at least one connected finest link joins.
struct LeafLink {
  std::int32_t a = 0;  ///< the leaf on the low side, in the order of LinkedOctree::leaves()
  std::int32_t b = 0;  ///< the leaf on the high side
  std::uint8_t axis = 0;
};

/// Every such pair once, ascending by (a, b).
std::vector<LeafLink> leaf_links(const LinkedOctree& body);

/// The piece of each leaf, in the order of body.leaves(). Pieces are numbered from 0 by their first
/// leaf; their number goes to `count` unless that is null.
std::vector<std::int32_t> label_pieces(const LinkedOctree& body, std::size_t* count);

}  // namespace kerf
