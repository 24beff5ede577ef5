// SPDX-License-Identifier: MIT
#include "core/body/pieces.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

namespace kerf {
namespace {

using Node = LinkedOctree::Node;

/// Calls visit(a, b, axis) for each linked pair of leaves, given as nodes, a on the low side.
/// The smaller leaf of a pair finds the larger; of two that are equal, the low one the high one.
template <class Visit>
void for_each_linked_pair(const LinkedOctree& body, const NodeList& leaves, const Visit& visit) {
  const std::vector<Node>& nodes = body.nodes();
  for (const std::int32_t i : leaves) {
    const Node& leaf = nodes[static_cast<std::size_t>(i)];
    for (std::size_t axis = 0; axis < 3; ++axis)
      for (int side = 0; side < 2; ++side) {
        if ((leaf.cut_mask >> (2 * axis + static_cast<std::size_t>(side)) & 1) != 0) continue;
        Vec3i c = leaf.corner;
        c[axis] += side == 1 ? 1 << leaf.size_log2 : -1;
        const std::int32_t j = body.leaf_at(c);
        if (j < 0) continue;
        const int other = nodes[static_cast<std::size_t>(j)].size_log2;
        if (side == 1 && other >= leaf.size_log2) visit(i, j, static_cast<std::uint8_t>(axis));
        if (side == 0 && other > leaf.size_log2) visit(j, i, static_cast<std::uint8_t>(axis));
      }
  }
}

std::int32_t find_root(std::vector<std::int32_t>& parent, std::int32_t i) {
  while (parent[static_cast<std::size_t>(i)] != i) {
    std::int32_t& up = parent[static_cast<std::size_t>(i)];
    up = parent[static_cast<std::size_t>(up)];  // halves the path, so that finds stay short
    i = up;
  }
  return i;
}

}  // namespace

std::vector<LeafLink> leaf_links(const LinkedOctree& body) {
  const NodeList& leaves = body.leaves();
  std::vector<LeafLink> found;
  found.reserve(3 * leaves.size());
  std::vector<std::size_t> begin(leaves.size() + 1, 0);
  for_each_linked_pair(body, leaves, [&](std::int32_t a, std::int32_t b, std::uint8_t axis) {
    found.push_back({body.leaf_number(a), body.leaf_number(b), axis});
    ++begin[static_cast<std::size_t>(found.back().a) + 1];
  });

  // Counting sort by a; the few links of one leaf are then sorted by b.
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<LeafLink> links(found.size());
  std::vector<std::size_t> next(begin.begin(), begin.end() - 1);
  for (const LeafLink& link : found) links[next[static_cast<std::size_t>(link.a)]++] = link;
  for (std::size_t a = 0; a < leaves.size(); ++a)
    std::sort(links.begin() + static_cast<std::ptrdiff_t>(begin[a]),
              links.begin() + static_cast<std::ptrdiff_t>(begin[a + 1]),
              [](const LeafLink& p, const LeafLink& q) { return p.b < q.b; });
  return links;
}

std::vector<std::int32_t> label_pieces(const LinkedOctree& body, std::size_t* count) {
  const NodeList& leaves = body.leaves();
  std::vector<std::int32_t> parent(leaves.size());
  std::iota(parent.begin(), parent.end(), 0);
  for_each_linked_pair(body, leaves, [&](std::int32_t a, std::int32_t b, std::uint8_t) {
    const std::int32_t p = find_root(parent, body.leaf_number(a));
    const std::int32_t q = find_root(parent, body.leaf_number(b));
    parent[static_cast<std::size_t>(std::max(p, q))] = std::min(p, q);  // roots are first leaves
  });

  std::vector<std::int32_t> piece(leaves.size(), -1);
  std::int32_t pieces = 0;
  for (std::size_t i = 0; i < leaves.size(); ++i) {
    const auto root = static_cast<std::size_t>(find_root(parent, static_cast<std::int32_t>(i)));
    if (root == i) piece[i] = pieces++;
    piece[i] = piece[root];
  }
  if (count != nullptr) *count = static_cast<std::size_t>(pieces);
  return piece;
}

}  // namespace kerf
