// SPDX-License-Identifier: MIT
//
// The linked octree: cells that hold material, and which of them are joined.
//
// Links exist on the finest level only. Three rules hold after every call:
//   1. A leaf larger than a finest cell lies wholly inside, and all finest links that start in it
//      are connected. So disconnected links are stored at finest leaves alone.
//   2. Balance: where a node is split, no leaf that touches it (face, edge or corner) is larger
//      than the node. Children that were deleted count, so that the rule equals that of a full
//      octree, and every multigrid level inherits it.
//   3. All leaves that touch one of the four grid points of the shared face of a disconnected link
//      between two cells are finest. So a corner that hangs is never beside a cut, and the corners
//      it is interpolated from belong to every cell around it.
// A uniform grid is the octree with refinement 0.
//
// Source  [DGW11] sections 4.1 and 4.2.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <unordered_map>
#include <vector>

#include "core/body/lattice.hpp"
#include "core/body/lattice_point.hpp"
#include "core/body/node_list.hpp"
#include "core/body/voxelise.hpp"

namespace kerf {

class LinkedOctree {
 public:
  struct Node {
    LatticePoint corner{};       ///< low corner on the finest lattice
    std::int32_t link = kNone;   ///< the first child, or from the leaf's number, or neither
    std::uint8_t size_log2 = 0;  ///< side in finest cells: 1 << size_log2
    std::uint8_t present = 0;    ///< 0: holds no material (deleted), never a leaf of the body
    std::uint8_t material = 0;   ///< index of the material, of a present leaf
    std::uint8_t cut_mask = 0;   ///< finest leaves: bit 2 a + s is set if the link along axis a
                                 ///< to side s (0 low, 1 high) is disconnected

    bool is_leaf() const { return link < 0; }
    /// Eight consecutive nodes; -1 for a leaf.
    std::int32_t first_child() const { return std::max(link, -1); }
    /// Place in leaves() of a present leaf; -1 for others.
    std::int32_t number() const { return link < 0 && link != kNone ? -1 - link : -1; }
    void set_number(std::int32_t number) { link = -1 - number; }

   private:
    static constexpr std::int32_t kNone = std::numeric_limits<std::int32_t>::min();
  };
  static_assert(sizeof(Node) == 16);

  /// Coarse to fine: a node is split while it holds an end of a finest link that the surface
  /// crosses, or of a link between two materials; nodes without an inside centre are deleted.
  LinkedOctree(const Voxels& voxels, int refinement);

  const Lattice& lattice() const { return lattice_; }
  int refinement() const { return refinement_; }
  const std::vector<Node>& nodes() const { return nodes_; }

  /// The nodes that are present leaves. Ascending by (size, z, y, x) of their corner at first; a
  /// leaf that is split leaves its place to its first child, and the other seven are appended. So a
  /// place in this list, the number of the leaf, stays that of the cells at one corner for ever.
  const NodeList& leaves() const { return leaves_; }
  std::size_t leaf_count() const { return leaf_count_; }
  /// The place in leaves() of a node that is a present leaf; -1 for others.
  std::int32_t leaf_number(std::int32_t node) const {
    return nodes_[static_cast<std::size_t>(node)].number();
  }
  /// Appends the number of every present leaf that touches the box of finest cells [low, high].
  void add_leaves_between(const Vec3i& low, const Vec3i& high,
                          std::vector<std::int32_t>& numbers) const;

  /// The present leaf that covers finest cell `c`, or -1 (outside the lattice, or no material).
  std::int32_t leaf_at(const Vec3i& c) const;

  /// Whether the finest cells `c` and `c + 1 along axis` both hold material and are joined.
  bool connected(const Vec3i& c, int axis) const;

  /// The record of the disconnected link from `c` to its neighbour at +1 along `axis`; null if
  /// the link is connected or has no end inside.
  const LinkCut* record(const Vec3i& c, int axis) const;
  const std::unordered_map<LinkKey, LinkCut>& records() const { return records_; }

  /// Splits leaves until the leaf that covers `c`, if there is one, is finest. Keeps rule 2.
  void refine_to_finest(const Vec3i& c);

  /// Disconnects the link from `c` to `c + 1 along axis`, both inside, after the refinement that
  /// rules 1 and 3 ask for; a link that is disconnected already keeps, at each end, the nearer
  /// point. Returns whether the link was connected before.
  bool disconnect(const Vec3i& c, int axis, const LinkCut& cut);

  /// The number of each leaf that was split since construction, in their order.
  const std::vector<std::int32_t>& splits() const { return splits_; }

  std::size_t bytes() const;

 private:
  class Pyramid;

  std::int32_t append_node(const Vec3i& corner, int size_log2);
  std::int32_t append_children(std::int32_t node);
  void build(const Voxels& voxels, const Pyramid& pyramid, std::int32_t node);
  void disconnect_surface(const Voxels& voxels);
  void number_leaves();
  void split(std::int32_t leaf);
  std::int32_t child_at(std::int32_t node, const Vec3i& c) const;
  std::size_t root_index(const Vec3i& r) const {
    return static_cast<std::size_t>(r[0]) +
           static_cast<std::size_t>(roots_[0]) *
               (static_cast<std::size_t>(r[1]) +
                static_cast<std::size_t>(roots_[1]) * static_cast<std::size_t>(r[2]));
  }
  void balance(std::vector<std::int32_t>& split_nodes);
  void mark(const Vec3i& c, int axis);

  Lattice lattice_;
  int refinement_ = 0;
  Vec3i roots_{};
  NodeList root_;  // dense grid of root nodes, -1: none
  std::vector<Node> nodes_;
  std::unordered_map<LinkKey, LinkCut> records_;
  NodeList leaves_;  // empty during construction
  std::size_t leaf_count_ = 0;
  std::vector<std::int32_t> splits_;
};

/// Appends the numbers of the two leaves at the ends of a link, if both hold material.
void add_ends(const LinkedOctree& body, LinkKey link, std::vector<std::int32_t>& numbers);
/// The leaves at the ends of disconnected links between two leaves, in no order.
std::vector<std::int32_t> opened_cells(const LinkedOctree& body);

}  // namespace kerf
