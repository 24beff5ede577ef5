// SPDX-License-Identifier: MIT
#include "core/body/linked_octree.hpp"

#include <algorithm>
#include <limits>
#include <utility>

#include "core/base/error.hpp"

namespace kerf {
namespace {

constexpr int kMaxRefinement = 20;

Vec3i shifted(Vec3i c, int axis, std::int32_t by) {
  c[static_cast<std::size_t>(axis)] += by;
  return c;
}

/// Whether `key` is that of a link of `lattice`, rim included.
bool valid_key(const Lattice& lattice, LinkKey key) {
  const auto slots = (static_cast<LinkKey>(lattice.size[0]) + 1) *
                     (static_cast<LinkKey>(lattice.size[1]) + 1) *
                     (static_cast<LinkKey>(lattice.size[2]) + 1);
  return key < 3 * slots;
}

/// Each end keeps the nearer point; at equal distances the one that was there first.
void merge(LinkCut& into, const LinkCut& cut) {
  for (int e = 0; e < 2; ++e)
    if (cut.end[e].distance < into.end[e].distance) into.end[e] = cut.end[e];
}

/// Halfway between the centres, facing away from the end that is inside.
LinkCut midpoint_cut(double spacing, int axis, bool low_inside) {
  LinkEnd end;
  end.distance = static_cast<float>(0.5 * spacing);
  end.normal[axis] = low_inside ? 1.0f : -1.0f;
  return {{end, end}};
}

void check(const Voxels& voxels, int refinement) {
  const Lattice& lattice = voxels.lattice;
  expects(refinement >= 0 && refinement <= kMaxRefinement,
          text("refinement must lie between 0 and ", kMaxRefinement));
  expects(lattice.size[0] > 0 && lattice.size[1] > 0 && lattice.size[2] > 0 && lattice.spacing > 0,
          "the lattice needs at least one cell along each axis, and a positive spacing");
  expects(voxels.label.size() == lattice.cells(),
          "the labels must number one for each lattice cell");
  for (const auto& crossing : voxels.crossings)
    expects(valid_key(lattice, crossing.first), "a crossed link lies outside the lattice");
}

}  // namespace

/// For each node of a full octree over the lattice, whether it holds an inside cell and whether
/// it holds one that must be finest. Level k has one byte for each cube of 2^k cells a side.
class LinkedOctree::Pyramid {
 public:
  Pyramid(const Voxels& voxels, int levels) {
    level_.resize(static_cast<std::size_t>(levels) + 1);
    level_[0].size = voxels.lattice.size;
    flag_cells(voxels);
    for (std::size_t k = 1; k < level_.size(); ++k) gather(level_[k - 1], level_[k]);
  }

  /// Of the node of size 2^k with low corner `corner`, which may lie beyond the lattice.
  bool inside(const Vec3i& corner, int k) const { return (bits(corner, k) & kInside) != 0; }
  bool flagged(const Vec3i& corner, int k) const { return (bits(corner, k) & kFlagged) != 0; }
  const Vec3i& size(int k) const { return level_[static_cast<std::size_t>(k)].size; }

 private:
  static constexpr std::uint8_t kInside = 1;
  static constexpr std::uint8_t kFlagged = 2;
  struct Level {
    Vec3i size{};
    std::vector<std::uint8_t> bits;
    std::size_t index(const Vec3i& c) const {
      return static_cast<std::size_t>(c[0]) +
             static_cast<std::size_t>(size[0]) *
                 (static_cast<std::size_t>(c[1]) +
                  static_cast<std::size_t>(size[1]) * static_cast<std::size_t>(c[2]));
    }
  };

  std::uint8_t bits(const Vec3i& corner, int k) const {
    const Level& level = level_[static_cast<std::size_t>(k)];
    const Vec3i c{corner[0] >> k, corner[1] >> k, corner[2] >> k};
    for (std::size_t d = 0; d < 3; ++d)
      if (c[d] < 0 || c[d] >= level.size[d]) return 0;
    return level.bits[level.index(c)];
  }

  void flag_cells(const Voxels& voxels) {
    const Lattice& lattice = voxels.lattice;
    std::vector<std::uint8_t>& bits = level_[0].bits;
    bits.assign(lattice.cells(), 0);
    const std::size_t step[3] = {
        1, static_cast<std::size_t>(lattice.size[0]),
        static_cast<std::size_t>(lattice.size[0]) * static_cast<std::size_t>(lattice.size[1])};
    std::size_t i = 0;
    for (Vec3i c{}; c[2] < lattice.size[2]; ++c[2])
      for (c[1] = 0; c[1] < lattice.size[1]; ++c[1])
        for (c[0] = 0; c[0] < lattice.size[0]; ++c[0], ++i) {
          const std::uint8_t label = voxels.label[i];
          if (label == 0) continue;
          bool flagged = false;  // another material or none beside it, or the rim
          for (std::size_t d = 0; d < 3; ++d)
            flagged = flagged || c[d] == 0 || c[d] + 1 == lattice.size[d] ||
                      voxels.label[i - step[d]] != label || voxels.label[i + step[d]] != label;
          bits[i] = flagged ? kInside | kFlagged : kInside;
        }
    for (const auto& crossing : voxels.crossings) {
      const Vec3i low = lattice.link_lower(crossing.first);
      for (const Vec3i& c : {low, shifted(low, Lattice::link_axis(crossing.first), 1)})
        if (lattice.inside(c) && bits[lattice.index(c)] != 0) bits[lattice.index(c)] |= kFlagged;
    }
  }

  static void gather(const Level& fine, Level& coarse) {
    for (std::size_t d = 0; d < 3; ++d) coarse.size[d] = (fine.size[d] + 1) / 2;
    coarse.bits.assign(static_cast<std::size_t>(coarse.size[0]) *
                           static_cast<std::size_t>(coarse.size[1]) *
                           static_cast<std::size_t>(coarse.size[2]),
                       0);
    std::size_t i = 0;
    for (std::int32_t z = 0; z < fine.size[2]; ++z)
      for (std::int32_t y = 0; y < fine.size[1]; ++y) {
        std::uint8_t* row = coarse.bits.data() + coarse.index({0, y / 2, z / 2});
        for (std::int32_t x = 0; x < fine.size[0]; ++x) row[x / 2] |= fine.bits[i++];
      }
  }

  std::vector<Level> level_;
};

LinkedOctree::LinkedOctree(const Voxels& voxels, int refinement)
    : lattice_(voxels.lattice), refinement_(refinement) {
  check(voxels, refinement);
  {
    const Pyramid pyramid(voxels, refinement);
    roots_ = pyramid.size(refinement);
    for (Vec3i r{}; r[2] < roots_[2]; ++r[2])
      for (r[1] = 0; r[1] < roots_[1]; ++r[1])
        for (r[0] = 0; r[0] < roots_[0]; ++r[0]) {
          const Vec3i corner{r[0] << refinement, r[1] << refinement, r[2] << refinement};
          const bool inside = pyramid.inside(corner, refinement);
          const std::int32_t root = inside ? append_node(corner, refinement) : -1;
          root_.push_back(root);
          if (inside) build(voxels, pyramid, root);
        }
  }
  expects(leaf_count_ > 0, "no cell centre lies inside the body: raise the resolution");

  std::vector<std::int32_t> split_nodes;
  for (std::size_t i = 0; i < nodes_.size(); ++i)
    if (!nodes_[i].is_leaf()) split_nodes.push_back(static_cast<std::int32_t>(i));
  balance(split_nodes);
  disconnect_surface(voxels);
  for (const auto& [key, cut] : voxels.crossings) {
    const Vec3i low = lattice_.link_lower(key);
    const int axis = Lattice::link_axis(key);
    if (leaf_at(low) >= 0 && leaf_at(shifted(low, axis, 1)) >= 0) disconnect(low, axis, cut);
  }
  number_leaves();
}

std::int32_t LinkedOctree::append_node(const Vec3i& corner, int size_log2) {
  if (nodes_.size() >= static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max()))
    throw Error(ErrorKind::unavailable,
                "the octree has more than 2^31 cells: lower the resolution");
  Node node;
  node.corner = corner;
  node.size_log2 = static_cast<std::uint8_t>(size_log2);
  node.present = 1;
  nodes_.push_back(node);
  return static_cast<std::int32_t>(nodes_.size() - 1);
}

/// Eight children of `node`, all present, with its material.
std::int32_t LinkedOctree::append_children(std::int32_t node) {
  const Node parent = nodes_[static_cast<std::size_t>(node)];
  const int k = parent.size_log2 - 1;
  const auto first = static_cast<std::int32_t>(nodes_.size());
  for (int i = 0; i < 8; ++i) {
    append_node({parent.corner[0] + ((i & 1) << k), parent.corner[1] + ((i >> 1 & 1) << k),
                 parent.corner[2] + ((i >> 2) << k)},
                k);
    nodes_.back().material = parent.material;
  }
  nodes_[static_cast<std::size_t>(node)].link = first;
  return first;
}

void LinkedOctree::build(const Voxels& voxels, const Pyramid& pyramid, std::int32_t node) {
  const Vec3i corner = nodes_[static_cast<std::size_t>(node)].corner;
  const int k = nodes_[static_cast<std::size_t>(node)].size_log2;
  if (k == 0 || !pyramid.flagged(corner, k)) {
    // No flag: no cell inside has a neighbour outside or of another material, so all are alike.
    nodes_[static_cast<std::size_t>(node)].material =
        static_cast<std::uint8_t>(voxels.label[lattice_.index(corner)] - 1);
    ++leaf_count_;
    return;
  }
  const std::int32_t first = append_children(node);
  for (std::int32_t child = first; child < first + 8; ++child) {
    if (pyramid.inside(nodes_[static_cast<std::size_t>(child)].corner, k - 1))
      build(voxels, pyramid, child);
    else
      nodes_[static_cast<std::size_t>(child)].present = 0;
  }
}

/// Marks and records every link from an inside cell to the outside.
void LinkedOctree::disconnect_surface(const Voxels& voxels) {
  const auto inside = [&](const Vec3i& c) {
    return lattice_.inside(c) && voxels.label[lattice_.index(c)] != 0;
  };
  for (const auto& [key, cut] : voxels.crossings) {
    const Vec3i low = lattice_.link_lower(key);
    if (inside(low) == inside(shifted(low, Lattice::link_axis(key), 1))) continue;
    const auto [place, is_new] = records_.try_emplace(key, cut);
    if (!is_new) merge(place->second, cut);
  }
  for (Node& node : nodes_) {
    if (node.size_log2 != 0 || node.present == 0) continue;
    for (int axis = 0; axis < 3; ++axis)
      for (int side = 0; side < 2; ++side) {
        if (inside(shifted(node.corner, axis, 2 * side - 1))) continue;
        node.cut_mask = static_cast<std::uint8_t>(node.cut_mask | 1 << (2 * axis + side));
        const Vec3i low = shifted(node.corner, axis, side - 1);
        records_.try_emplace(lattice_.link_key(low, axis),
                             midpoint_cut(lattice_.spacing, axis, side == 1));
      }
  }
}

void LinkedOctree::number_leaves() {
  std::vector<std::pair<std::uint64_t, std::int32_t>> order;
  order.reserve(leaf_count_);
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    const Node& node = nodes_[i];
    if (node.present == 0 || !node.is_leaf()) continue;
    // The index of the corner grows with (z, y, x); lattices stay far below 2^58 cells.
    order.emplace_back(
        static_cast<std::uint64_t>(node.size_log2) << 58 | lattice_.index(node.corner),
        static_cast<std::int32_t>(i));
  }
  if (!std::is_sorted(order.begin(), order.end())) std::sort(order.begin(), order.end());

  leaves_.reserve(order.size() + order.size() / 4);  // cuts append
  for (const auto& entry : order) {
    nodes_[static_cast<std::size_t>(entry.second)].set_number(
        static_cast<std::int32_t>(leaves_.size()));
    leaves_.push_back(entry.second);
  }
}

void LinkedOctree::add_leaves_between(const Vec3i& low, const Vec3i& high,
                                      std::vector<std::int32_t>& numbers) const {
  Vec3i first, last;
  for (std::size_t d = 0; d < 3; ++d) {
    first[d] = std::max(low[d], 0) >> refinement_;
    last[d] = std::min(high[d], lattice_.size[d] - 1) >> refinement_;
  }
  std::vector<std::int32_t> stack;
  for (Vec3i r = first; r[2] <= last[2]; ++r[2])
    for (r[1] = first[1]; r[1] <= last[1]; ++r[1])
      for (r[0] = first[0]; r[0] <= last[0]; ++r[0]) {
        const std::int32_t root = root_[root_index(r)];
        if (root >= 0) stack.push_back(root);
        while (!stack.empty()) {
          const std::int32_t i = stack.back();
          stack.pop_back();
          const Node& node = nodes_[static_cast<std::size_t>(i)];
          bool touches = node.present != 0;
          for (std::size_t d = 0; d < 3; ++d)
            touches = touches && node.corner[d] <= high[d] &&
                      node.corner[d] + (1 << node.size_log2) > low[d];
          if (!touches) continue;
          if (node.is_leaf()) numbers.push_back(leaf_number(i));
          for (int k = 7; !node.is_leaf() && k >= 0; --k) stack.push_back(node.first_child() + k);
        }
      }
}

std::int32_t LinkedOctree::child_at(std::int32_t node, const Vec3i& c) const {
  const Node& n = nodes_[static_cast<std::size_t>(node)];
  const int k = n.size_log2 - 1;
  return n.first_child() + ((c[0] >> k & 1) | (c[1] >> k & 1) << 1 | (c[2] >> k & 1) << 2);
}

std::int32_t LinkedOctree::leaf_at(const Vec3i& c) const {
  if (!lattice_.inside(c)) return -1;
  std::int32_t n =
      root_[root_index({c[0] >> refinement_, c[1] >> refinement_, c[2] >> refinement_})];
  if (n < 0) return -1;
  while (!nodes_[static_cast<std::size_t>(n)].is_leaf()) n = child_at(n, c);
  return nodes_[static_cast<std::size_t>(n)].present != 0 ? n : -1;
}

bool LinkedOctree::connected(const Vec3i& c, int axis) const {
  const std::int32_t a = leaf_at(c), b = leaf_at(shifted(c, axis, 1));
  if (a < 0 || b < 0) return false;
  return (nodes_[static_cast<std::size_t>(a)].cut_mask >> (2 * axis + 1) & 1) == 0;
}

const LinkCut* LinkedOctree::record(const Vec3i& c, int axis) const {
  for (std::size_t d = 0; d < 3; ++d)
    if (c[d] < -1 || c[d] >= lattice_.size[d]) return nullptr;
  const auto found = records_.find(lattice_.link_key(c, axis));
  return found == records_.end() ? nullptr : &found->second;
}

/// A leaf larger than a finest cell is wholly inside (rule 1), so that all children are present.
void LinkedOctree::split(std::int32_t leaf) {
  const std::int32_t number = leaf_number(leaf);
  const std::int32_t first = append_children(leaf);
  leaf_count_ += 7;
  if (leaves_.empty()) return;
  splits_.push_back(number);
  leaves_.set(static_cast<std::size_t>(number), first);
  nodes_[static_cast<std::size_t>(first)].set_number(number);
  for (std::int32_t child = first + 1; child < first + 8; ++child) {
    nodes_[static_cast<std::size_t>(child)].set_number(static_cast<std::int32_t>(leaves_.size()));
    leaves_.push_back(child);
  }
}

/// Splits what rule 2 asks for around nodes that were split.
void LinkedOctree::balance(std::vector<std::int32_t>& split_nodes) {
  while (!split_nodes.empty()) {
    const Node node = nodes_[static_cast<std::size_t>(split_nodes.back())];
    split_nodes.pop_back();
    const std::int32_t size = 1 << node.size_log2;
    for (int i = 0; i < 27; ++i) {
      const Vec3i c{node.corner[0] + (i % 3 - 1) * size, node.corner[1] + (i / 3 % 3 - 1) * size,
                    node.corner[2] + (i / 9 - 1) * size};
      std::int32_t leaf = leaf_at(c);
      while (leaf >= 0 && nodes_[static_cast<std::size_t>(leaf)].size_log2 > node.size_log2) {
        split(leaf);
        split_nodes.push_back(leaf);
        leaf = child_at(leaf, c);
      }
    }
  }
}

void LinkedOctree::refine_to_finest(const Vec3i& c) {
  std::int32_t leaf = leaf_at(c);
  if (leaf < 0 || nodes_[static_cast<std::size_t>(leaf)].size_log2 == 0) return;
  std::vector<std::int32_t> split_nodes;
  while (nodes_[static_cast<std::size_t>(leaf)].size_log2 > 0) {
    split(leaf);
    split_nodes.push_back(leaf);
    leaf = child_at(leaf, c);
  }
  balance(split_nodes);
}

/// Sets the bits of a link between two finest leaves at both ends.
void LinkedOctree::mark(const Vec3i& c, int axis) {
  for (int side = 0; side < 2; ++side) {
    Node& node = nodes_[static_cast<std::size_t>(leaf_at(shifted(c, axis, 1 - side)))];
    node.cut_mask = static_cast<std::uint8_t>(node.cut_mask | 1 << (2 * axis + side));
  }
}

bool LinkedOctree::disconnect(const Vec3i& c, int axis, const LinkCut& cut) {
  expects(axis >= 0 && axis < 3 && leaf_at(c) >= 0 && leaf_at(shifted(c, axis, 1)) >= 0,
          "only a link between two cells that hold material can be disconnected");
  // Rules 1 and 3: the 3 x 3 cells around each end, in the plane of the shared face.
  const int u = (axis + 1) % 3, v = (axis + 2) % 3;
  for (int side = 0; side < 2 && refinement_ > 0; ++side)
    for (int i = -1; i <= 1; ++i)
      for (int j = -1; j <= 1; ++j)
        refine_to_finest(shifted(shifted(shifted(c, axis, side), u, i), v, j));

  const auto [place, is_new] = records_.try_emplace(lattice_.link_key(c, axis), cut);
  if (!is_new) merge(place->second, cut);
  mark(c, axis);
  return is_new;
}

std::size_t LinkedOctree::bytes() const {
  // A hash map spends a node with a next pointer on each record, and a pointer on each bucket.
  const std::size_t record = sizeof(std::pair<const LinkKey, LinkCut>) + sizeof(void*);
  // Room at the end of an array that was never written takes no memory.
  return nodes_.size() * sizeof(Node) + leaves_.bytes() + root_.bytes() + bytes_of(splits_) +
         records_.size() * record + records_.bucket_count() * sizeof(void*);
}

void add_ends(const LinkedOctree& body, LinkKey link, std::vector<std::int32_t>& numbers) {
  const Vec3i low = body.lattice().link_lower(link);
  const std::int32_t a = body.leaf_at(low);
  const std::int32_t b = body.leaf_at(shifted(low, Lattice::link_axis(link), 1));
  if (a < 0 || b < 0) return;
  numbers.push_back(body.leaf_number(a));
  numbers.push_back(body.leaf_number(b));
}

std::vector<std::int32_t> opened_cells(const LinkedOctree& body) {
  std::vector<std::int32_t> numbers;
  for (const auto& [key, record] : body.records()) add_ends(body, key, numbers);
  return numbers;
}

}  // namespace kerf
