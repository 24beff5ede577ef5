// SPDX-License-Identifier: MIT
//
// What must hold of a linked octree after every call, by brute force over finest cells. Shares no
// look-up with the octree: the leaves are painted into a dense array.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <set>
#include <utility>
#include <vector>

#include "core/body/linked_octree.hpp"
#include "core/body/pieces.hpp"
#include "tests/support/bodies.hpp"

namespace kerf::test {

/// The leaf that covers each finest cell, as its place in body.leaves(); -1 for none.
struct PaintedLeaves {
  explicit PaintedLeaves(const LinkedOctree& body)
      : octree(body),
        leaves(body.leaves().begin(), body.leaves().end()),
        place(body.lattice().cells(), -1) {
    for (std::size_t i = 0; i < leaves.size(); ++i)
      for_each_cell(node(static_cast<std::int32_t>(i)), 0, [&](const Vec3i& c) {
        if (!octree.lattice().inside(c) || place[octree.lattice().index(c)] >= 0)
          overlapping = true;
        else
          place[octree.lattice().index(c)] = static_cast<std::int32_t>(i);
      });
  }

  const LinkedOctree::Node& node(std::int32_t leaf) const {
    return octree.nodes()[static_cast<std::size_t>(leaves[static_cast<std::size_t>(leaf)])];
  }
  std::int32_t at(const Vec3i& c) const {
    return octree.lattice().inside(c) ? place[octree.lattice().index(c)] : -1;
  }
  bool finest_or_none(const Vec3i& c) const { return at(c) < 0 || node(at(c)).size_log2 == 0; }
  /// Whether the link is disconnected, as its end `side` tells (0 lower, 1 upper).
  bool disconnected(const Vec3i& lower, int axis, int side) const {
    const std::int32_t leaf = at(plus(lower, axis, side));
    return (node(leaf).cut_mask >> (2 * axis + 1 - side) & 1) != 0;
  }
  /// Calls f for each finest cell of a node, and of a rim of `rim` cells around it.
  template <class F>
  static void for_each_cell(const LinkedOctree::Node& n, int rim, const F& f) {
    const int size = (1 << n.size_log2) + 2 * rim;
    for (int z = 0; z < size; ++z)
      for (int y = 0; y < size; ++y)
        for (int x = 0; x < size; ++x)
          f(Vec3i{n.corner[0] + x - rim, n.corner[1] + y - rim, n.corner[2] + z - rim});
  }
  /// Calls f(lower, axis) for each link with an end inside.
  template <class F>
  void for_each_link(const F& f) const {
    const Vec3i& size = octree.lattice().size;
    for (Vec3i c{0, 0, -1}; c[2] < size[2]; ++c[2])
      for (c[1] = -1; c[1] < size[1]; ++c[1])
        for (c[0] = -1; c[0] < size[0]; ++c[0])
          for (int axis = 0; axis < 3; ++axis)
            if (at(c) >= 0 || at(plus(c, axis, 1)) >= 0) f(c, axis);
  }

  const LinkedOctree& octree;
  std::vector<std::int32_t> leaves;
  std::vector<std::int32_t> place;
  bool overlapping = false;
};

inline ::testing::AssertionResult broken(const char* what, const Vec3i& c) {
  return ::testing::AssertionFailure()
         << what << " at cell (" << c[0] << ", " << c[1] << ", " << c[2] << ")";
}

/// The tree itself: parents and children, order and count of the leaves, volume (A5, A7).
inline ::testing::AssertionResult tree_holds(const PaintedLeaves& p,
                                             const std::vector<std::uint8_t>& label) {
  const auto& nodes = p.octree.nodes();
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const auto& n = nodes[i];
    if (n.size_log2 > p.octree.refinement()) return broken("size", n.corner);
    if (n.is_leaf()) continue;
    if (n.present == 0) return broken("deleted node with children", n.corner);
    for (int k = 0; k < 8; ++k) {
      const auto& child = nodes[static_cast<std::size_t>(n.first_child() + k)];
      const int half = 1 << child.size_log2;
      const Vec3i corner{n.corner[0] + (k & 1) * half, n.corner[1] + (k >> 1 & 1) * half,
                         n.corner[2] + (k >> 2) * half};
      if (child.size_log2 + 1 != n.size_log2 || child.corner != corner)
        return broken("child and parent disagree", n.corner);
    }
  }
  if (p.overlapping) return broken("leaves overlap or leave the lattice", {});
  if (p.leaves.size() != p.octree.leaf_count()) return broken("leaf_count", {});
  std::size_t volume = 0, inside = 0;
  for (std::size_t i = 0; i < p.leaves.size(); ++i) {
    const auto& n = p.node(static_cast<std::int32_t>(i));
    volume += std::size_t{1} << (3 * n.size_log2);
    if (p.octree.leaf_number(p.leaves[i]) != static_cast<std::int32_t>(i))
      return broken("leaf_number()", n.corner);
    if (i == 0 || !p.octree.splits().empty()) continue;
    const auto& m = p.node(static_cast<std::int32_t>(i) - 1);
    const auto key = [](const LinkedOctree::Node& a) {
      return std::array{static_cast<int>(a.size_log2), a.corner[2], a.corner[1], a.corner[0]};
    };
    if (!(key(m) < key(n))) return broken("leaves() is not sorted", n.corner);
  }
  for (std::size_t i = 0; i < label.size(); ++i) {
    const Vec3i c = p.octree.lattice().cell(i);
    inside += label[i] != 0 ? 1 : 0;
    if ((p.place[i] >= 0) != (label[i] != 0)) return broken("cell lost or invented", c);
    if (label[i] != 0 && p.node(p.place[i]).material + 1 != label[i]) return broken("material", c);
    const std::int32_t at = p.octree.leaf_at(c);
    if (at != (p.place[i] < 0 ? -1 : p.leaves[static_cast<std::size_t>(p.place[i])]))
      return broken("leaf_at", c);
  }
  if (volume != inside) return broken("volume is not that of the inside cells", {});
  return ::testing::AssertionSuccess();
}

/// Rules 1 to 3 of linked_octree.hpp (A6).
inline ::testing::AssertionResult rules_hold(const PaintedLeaves& p) {
  for (std::size_t i = 0; i < p.leaves.size(); ++i) {
    const auto& n = p.node(static_cast<std::int32_t>(i));
    if (n.size_log2 == 0) continue;
    if (n.cut_mask != 0) return broken("rule 1, mask", n.corner);
    bool open = false;
    PaintedLeaves::for_each_cell(n, 0, [&](const Vec3i& c) {
      for (int axis = 0; axis < 3; ++axis)
        open = open || p.at(plus(c, axis, -1)) < 0 || p.at(plus(c, axis, 1)) < 0;
    });
    if (open) return broken("rule 1, a large leaf at the surface", n.corner);
  }
  for (const auto& n : p.octree.nodes()) {
    if (n.is_leaf()) continue;
    bool balanced = true;
    PaintedLeaves::for_each_cell(n, 1, [&](const Vec3i& c) {
      balanced = balanced && (p.at(c) < 0 || p.node(p.at(c)).size_log2 <= n.size_log2);
    });
    if (!balanced) return broken("rule 2", n.corner);
  }
  for (const auto& entry : p.octree.records()) {
    const Vec3i low = p.octree.lattice().link_lower(entry.first);
    const int axis = Lattice::link_axis(entry.first);
    if (p.at(low) < 0 || p.at(plus(low, axis, 1)) < 0) continue;
    for (int k = 0; k < 18; ++k)
      if (!p.finest_or_none(plus(plus(plus(low, axis, k / 9), (axis + 1) % 3, k / 3 % 3 - 1),
                                 (axis + 2) % 3, k % 3 - 1)))
        return broken("rule 3", low);
  }
  return ::testing::AssertionSuccess();
}

/// Links are symmetric; masks, records and connected() agree (A2).
inline ::testing::AssertionResult links_hold(const PaintedLeaves& p) {
  constexpr float kUnit = 1e-5f;  // a normal was rounded to single precision
  ::testing::AssertionResult result = ::testing::AssertionSuccess();
  std::size_t records = 0;
  p.for_each_link([&](const Vec3i& c, int axis) {
    bool is_cut = true;
    for (int side = 0; side < 2; ++side)
      if (p.at(plus(c, axis, side)) >= 0) is_cut = p.disconnected(c, axis, side);
    for (int side = 0; side < 2; ++side)
      if (p.at(plus(c, axis, side)) >= 0 && p.disconnected(c, axis, side) != is_cut)
        result = broken("link differs from its other end", c);
    const bool joins = p.at(c) >= 0 && p.at(plus(c, axis, 1)) >= 0;
    if (!joins && !is_cut) result = broken("link to the outside is connected", c);
    if (p.octree.connected(c, axis) != (joins && !is_cut)) result = broken("connected()", c);
    const LinkCut* record = p.octree.record(c, axis);
    if ((record != nullptr) != is_cut) result = broken("record without mask, or the reverse", c);
    if (record == nullptr) return;
    ++records;
    for (const LinkEnd& end : record->end)
      if (!(end.distance >= 0 && end.distance <= static_cast<float>(p.octree.lattice().spacing) &&
            std::abs(norm(end.normal) - 1) < kUnit))
        result = broken("record out of range", c);
  });
  if (result && records != p.octree.records().size()) result = broken("records of no link", {});
  return result;
}

/// leaf_links() is what the finest links say, and label_pieces() what a flood fill says.
inline ::testing::AssertionResult pieces_hold(const PaintedLeaves& p) {
  std::set<std::array<std::int32_t, 3>> expected, found;
  p.for_each_link([&](const Vec3i& c, int axis) {
    const std::int32_t a = p.at(c), b = p.at(plus(c, axis, 1));
    if (a >= 0 && b >= 0 && a != b && !p.disconnected(c, axis, 0)) expected.insert({a, b, axis});
  });
  const std::vector<LeafLink> links = leaf_links(p.octree);
  for (std::size_t i = 0; i < links.size(); ++i) {
    found.insert({links[i].a, links[i].b, links[i].axis});
    if (i > 0 && std::pair(links[i - 1].a, links[i - 1].b) >= std::pair(links[i].a, links[i].b))
      return broken("leaf_links() is not sorted", {});
  }
  if (found != expected) return broken("leaf_links()", {});

  std::vector<std::vector<std::int32_t>> beside(p.leaves.size());
  for (const auto& link : expected) {
    beside[static_cast<std::size_t>(link[0])].push_back(link[1]);
    beside[static_cast<std::size_t>(link[1])].push_back(link[0]);
  }
  std::vector<std::int32_t> piece(p.leaves.size(), -1), stack;
  std::int32_t count = 0;
  for (std::size_t i = 0; i < piece.size(); ++i) {
    if (piece[i] >= 0) continue;
    stack.assign(1, static_cast<std::int32_t>(i));
    while (!stack.empty()) {
      const auto k = static_cast<std::size_t>(stack.back());
      stack.pop_back();
      if (piece[k] >= 0) continue;
      piece[k] = count;
      stack.insert(stack.end(), beside[k].begin(), beside[k].end());
    }
    ++count;
  }
  std::size_t pieces = 0;
  if (label_pieces(p.octree, &pieces) != piece || pieces != static_cast<std::size_t>(count))
    return broken("label_pieces()", {});
  return ::testing::AssertionSuccess();
}

/// All of the above; `label` as in Voxels.
inline ::testing::AssertionResult invariants_hold(const LinkedOctree& body,
                                                  const std::vector<std::uint8_t>& label) {
  const PaintedLeaves p(body);
  for (const auto& result : {tree_holds(p, label), rules_hold(p), links_hold(p), pieces_hold(p)})
    if (!result) return result;
  return ::testing::AssertionSuccess();
}

}  // namespace kerf::test
