// SPDX-License-Identifier: MIT
#include "cpu/fronts.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/levels/union_find.hpp"

namespace kerf::cpu {
namespace {

constexpr std::size_t kLeaf = 8;  // vertices that are not divided

/// Whether a vertex takes no part: its row is that of the identity.
bool is_held(const Level& level, int vertex) { return level.fixed[vertex] == 7; }

class Dissection {
 public:
  Dissection(const Level& level, const AssembledLevel& matrix, std::vector<Front>& out)
      : level_(level), matrix_(matrix), out_(out), inside_(level.point.size(), 0) {
    least_.resize(inside_.size());
    place_.resize(inside_.size());
  }

  /// What a cut has parted may lie at the same places on both sides, which no plane parts. A few
  /// vertices are one front in any case.
  void divide(std::vector<int> vertices) {
    if (vertices.size() <= kLeaf) return add(std::move(vertices));
    std::vector<std::vector<int>> parts = separate(vertices);
    if (parts.empty()) return divide_connected(std::move(vertices));
    for (std::vector<int>& part : parts) divide_connected(std::move(part));
  }

 private:
  void divide_connected(std::vector<int> vertices) {
    std::vector<int> low, high, between;
    if (vertices.size() > kLeaf) split(vertices, low, high, between);
    if (low.empty() || high.empty()) return add(std::move(vertices));
    divide(std::move(low));
    divide(std::move(high));
    add(std::move(between));
  }

  /// body(v, w) for vertices of a list that touch, each pair once, and each with itself.
  template <class Body>
  void for_touching(const std::vector<int>& vertices, const Body& body) {
    for (const int v : vertices) inside_[v] = 1;
    for (const int v : vertices)
      for (int k = matrix_.column_begin[3 * v]; k < matrix_.column_begin[3 * v + 1]; k += 3) {
        const int w = matrix_.row[k] / 3;
        if (inside_[w] != 0) body(v, w);
      }
    for (const int v : vertices) inside_[v] = 0;
  }

  /// Parts that do not touch each other, each in the order of the list; none for one part alone.
  std::vector<std::vector<int>> separate(const std::vector<int>& vertices) {
    const auto count = static_cast<std::int32_t>(vertices.size());
    for (std::int32_t i = 0; i < count; ++i) place_[vertices[i]] = i;
    UnionFind sets(vertices.size());
    std::int32_t unions = 0;
    for_touching(vertices,
                 [&](int v, int w) { unions += sets.unite(place_[v], place_[w]) ? 1 : 0; });
    std::vector<std::vector<int>> parts;
    if (unions == count - 1) return parts;
    std::vector<int> part_of(vertices.size());  // of representatives, which come first
    for (std::int32_t i = 0; i < count; ++i) {
      const std::int32_t first = sets.find(i);
      if (first == i) {
        part_of[i] = static_cast<int>(parts.size());
        parts.emplace_back();
      }
      parts[part_of[first]].push_back(vertices[i]);
    }
    return parts;
  }

  int at(int vertex, std::size_t axis) const { return level_.point[vertex][axis]; }

  struct Plane {
    std::size_t axis = 0;
    int at = 0;
    double cost = HUGE_VAL;
  };

  /// Low ones lie before the plane. Of the others, those that touch low ones lie between.
  void split(const std::vector<int>& vertices, std::vector<int>& low, std::vector<int>& high,
             std::vector<int>& between) {
    find_least(vertices);
    Plane best;
    for (std::size_t axis = 0; axis < 3; ++axis) look_along(axis, vertices, best);
    if (best.cost == HUGE_VAL) return;
    for (const int v : vertices) {
      const bool touches = least_[v][best.axis] < best.at;
      (at(v, best.axis) < best.at ? low : touches ? between : high).push_back(v);
    }
  }

  /// Of each vertex, the least place along each axis of those that it touches.
  void find_least(const std::vector<int>& vertices) {
    for (const int v : vertices) least_[v] = level_.point[v];
    for_touching(vertices, [&](int v, int w) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        least_[v][axis] = std::min(least_[v][axis], at(w, axis));
        least_[w][axis] = std::min(least_[w][axis], at(v, axis));
      }
    });
  }

  /// The fewest between, to the power of 5 over the smaller part to the power of 4: measured,
  /// docs/decisions/0030-old-factors.md.
  void look_along(std::size_t axis, const std::vector<int>& vertices, Plane& best) {
    int first = INT32_MAX, last = INT32_MIN;
    for (const int v : vertices) {
      first = std::min(first, at(v, axis));
      last = std::max(last, at(v, axis));
    }
    const auto planes = static_cast<std::size_t>(last - first) + 2;
    std::vector<int> before(planes, 0), between(planes, 0);  // changes from plane to plane
    for (const int v : vertices) {
      ++before[at(v, axis) - first + std::size_t{1}];
      ++between[least_[v][axis] - first + std::size_t{1}];
      --between[at(v, axis) - first + std::size_t{1}];
    }
    int lower = 0, middle = 0;
    for (std::size_t p = 0; p + 1 < planes; ++p) {
      lower += before[p];
      middle += between[p];
      const int upper = static_cast<int>(vertices.size()) - lower - middle;
      if (lower == 0 || upper <= 0) continue;
      // One more, so that of planes with none between the one nearest to the middle wins. Only
      // products, which round the same everywhere: no std::pow.
      const double between_up = middle + 1.0, part = std::min(lower, upper);
      const double square = between_up * between_up, part2 = part * part;
      const double cost = square * square * between_up / (part2 * part2);
      if (cost < best.cost) best = {axis, first + static_cast<int>(p), cost};
    }
  }

  void add(std::vector<int> vertices) {
    if (vertices.empty()) return;
    Front front;
    front.vertices = std::move(vertices);
    out_.push_back(std::move(front));
  }

  const Level& level_;
  const AssembledLevel& matrix_;
  std::vector<Front>& out_;
  std::vector<char> inside_;
  std::vector<Vec3i> least_;
  std::vector<int> place_;
};

/// Rows of all fronts, and where they are in the front above.
class Linking {
 public:
  Linking(const AssembledLevel& matrix, Fronts& out)
      : matrix_(matrix), out_(out), front_of_(matrix.unknowns() / 3, -1), order_(front_of_.size()) {
    int next = 0;
    for (std::size_t f = 0; f < out.all.size(); ++f)
      for (const int v : out.all[f].vertices) {
        front_of_[v] = static_cast<int>(f);
        order_[v] = next++;
      }
    place_.resize(front_of_.size());
    list_blocks();
    for (int f = 0; f < static_cast<int>(out.all.size()); ++f) link(f);
  }

 private:
  /// Each block of the matrix goes to the front that is eliminated first.
  void list_blocks() {
    for (int v = 0; 3 * v < matrix_.unknowns(); ++v) {
      const int begin = matrix_.column_begin[3 * v], end = matrix_.column_begin[3 * v + 1];
      for (int k = begin; k < end; k += 3) {
        int first = v, last = matrix_.row[k] / 3;
        if (front_of_[first] < 0 || front_of_[last] < 0) continue;
        const bool transposed = order_[last] < order_[first];
        if (transposed) std::swap(first, last);
        Front& front = out_.all[front_of_[first]];
        front.blocks.push_back({k, end - begin, last, first, transposed});  // vertices, for now
        if (front_of_[last] != front_of_[first]) front.rows.push_back(last);
      }
    }
  }

  void link(int f) {
    Front& front = out_.all[f];
    for (const int child : front.below) {
      for (const int v : out_.all[child].rows)
        if (front_of_[v] != f) front.rows.push_back(v);
      front.depth = std::max(front.depth, out_.all[child].depth + 1);
    }
    std::sort(front.rows.begin(), front.rows.end(),
              [&](int v, int w) { return order_[v] < order_[w]; });
    front.rows.erase(std::unique(front.rows.begin(), front.rows.end()), front.rows.end());

    int next = 0;
    for (const int v : front.vertices) place_[v] = next, next += 3;
    next = front.padded_columns();
    for (const int v : front.rows) place_[v] = next, next += 3;
    for (Front::Block& block : front.blocks) {
      block.row = place_[block.row];
      block.column = place_[block.column];
    }
    for (const int child : front.below)
      for (const int v : out_.all[child].rows) out_.all[child].row_place.push_back(place_[v]);
    front.at = out_.entries;
    out_.entries += front.entries_of_factor();
    if (!front.rows.empty()) out_.all[front_of_[front.rows[0]]].below.push_back(f);
    if (out_.by_depth.size() <= static_cast<std::size_t>(front.depth))
      out_.by_depth.resize(front.depth + std::size_t{1});
    out_.by_depth[front.depth].push_back(f);
  }

  const AssembledLevel& matrix_;
  Fronts& out_;
  std::vector<int> front_of_, order_, place_;  // per vertex
};

}  // namespace

Fronts::Fronts(const Level& level, const AssembledLevel& matrix) {
  std::vector<int> vertices;
  for (int v = 0; v < level.vertices(); ++v)
    if (!is_held(level, v)) vertices.push_back(v);
  Dissection(level, matrix, all).divide(std::move(vertices));
  Linking(matrix, *this);
  part();
}

void Fronts::part() {
  std::vector<std::size_t> size(all.size());
  std::vector<int> roots;
  for (std::size_t f = 0; f < all.size(); ++f) {
    size[f] = all[f].entries_of_factor();
    for (const int child : all[f].below) size[f] += size[child];
    if (all[f].rows.empty()) roots.push_back(static_cast<int>(f));
  }
  const auto smaller = [&](int a, int b) { return size[a] < size[b]; };
  for (;;) {
    const auto largest = std::max_element(roots.begin(), roots.end(), smaller);
    if (largest == roots.end() || 2 * size[*largest] <= entries || all[*largest].below.empty())
      break;
    const int root = *largest;
    roots.erase(largest);
    trunk.push_back(root);
    roots.insert(roots.end(), all[root].below.begin(), all[root].below.end());
  }
  std::sort(trunk.begin(), trunk.end());
  // Small ones together: each branch has a copy of what is solved for.
  constexpr std::size_t kMost = 16;
  std::sort(roots.begin(), roots.end());
  std::size_t in_branch = entries;
  for (const int root : roots) {
    if (kMost * in_branch >= entries) {
      branches.emplace_back();
      in_branch = 0;
    }
    std::vector<int>& branch = branches.back();
    in_branch += size[root];
    std::size_t n = branch.size();
    for (branch.push_back(root); n < branch.size(); ++n) {
      const std::vector<int>& below = all[branch[n]].below;
      branch.insert(branch.end(), below.begin(), below.end());
    }
  }
  for (std::vector<int>& branch : branches) std::sort(branch.begin(), branch.end());
}

}  // namespace kerf::cpu
