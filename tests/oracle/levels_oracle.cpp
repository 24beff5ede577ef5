// SPDX-License-Identifier: MIT
#include "tests/oracle/levels_oracle.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

namespace kerf::oracle {
namespace {

constexpr double kSameWeight = 1e-14;  // sums of a few products of halves: exact but for order

[[noreturn]] void wrong(const std::string& what, int level, int cell) {
  std::ostringstream out;
  out << what << ", level " << level << ", cell or vertex " << cell;
  throw std::runtime_error(out.str());
}

Vec3i stepped(Vec3i c, int axis, int by) {
  c[static_cast<std::size_t>(axis)] += by;
  return c;
}

Vec3i corner_of(const Cell& cell, int corner) {
  Vec3i p = cell.corner;
  for (int d = 0; d < 3; ++d)
    if ((corner >> d) & 1) p[static_cast<std::size_t>(d)] += cell.size;
  return p;
}

/// The corner of the cell at p, or -1.
int corner_at(const Cell& cell, const Vec3i& p) {
  for (int i = 0; i < 8; ++i)
    if (corner_of(cell, i) == p) return i;
  return -1;
}

std::vector<Cell> leaf_cells(const LinkedOctree& body) {
  std::vector<Cell> cells;
  for (const std::int32_t leaf : body.leaves()) {
    const auto& node = body.nodes()[leaf];
    cells.push_back({node.corner, 1 << node.size_log2, {static_cast<std::int32_t>(cells.size())}});
  }
  return cells;
}

/// The leaf over each finest cell; -1 for none.
class Paint {
 public:
  explicit Paint(const LinkedOctree& body) : lattice_(body.lattice()), at_(lattice_.cells(), -1) {
    const std::vector<Cell> cells = leaf_cells(body);
    for (std::size_t i = 0; i < cells.size(); ++i)
      for (int k = 0; k < cells[i].size * cells[i].size * cells[i].size; ++k) {
        Vec3i c = cells[i].corner;
        c[0] += k % cells[i].size;
        c[1] += k / cells[i].size % cells[i].size;
        c[2] += k / cells[i].size / cells[i].size;
        at_[lattice_.index(c)] = static_cast<int>(i);
      }
  }
  int operator()(const Vec3i& c) const { return lattice_.inside(c) ? at_[lattice_.index(c)] : -1; }

 private:
  Lattice lattice_;
  std::vector<int> at_;
};

Joins leaf_joins(const LinkedOctree& body, const Paint& paint) {
  Joins joins;
  for (std::size_t i = 0; i < body.lattice().cells(); ++i)
    for (int axis = 0; axis < 3; ++axis) {
      const Vec3i c = body.lattice().cell(i);
      const int a = paint(c), b = paint(stepped(c, axis, 1));
      if (a >= 0 && b >= 0 && a != b && body.connected(c, axis)) joins.insert({a, b, axis});
    }
  return joins;
}

/// Groups the members of `list`: beside(i, j) tells whether two of them are joined.
template <class Beside>
std::vector<std::vector<int>> components(const std::vector<int>& list, const Beside& beside) {
  std::vector<std::vector<int>> out;
  std::vector<bool> seen(list.size(), false);
  for (std::size_t i = 0; i < list.size(); ++i) {
    if (seen[i]) continue;
    std::vector<std::size_t> stack{i};
    seen[i] = true;
    out.emplace_back();
    while (!stack.empty()) {
      const std::size_t k = stack.back();
      stack.pop_back();
      out.back().push_back(list[k]);
      for (std::size_t j = 0; j < list.size(); ++j)
        if (!seen[j] && beside(list[k], list[j])) {
          seen[j] = true;
          stack.push_back(j);
        }
    }
    std::sort(out.back().begin(), out.back().end());
  }
  return out;
}

std::vector<std::set<int>> neighbours(std::size_t cells, const Joins& joins) {
  std::vector<std::set<int>> out(cells);
  for (const auto& join : joins) {
    out[join[0]].insert(join[1]);
    out[join[1]].insert(join[0]);
  }
  return out;
}

struct Structure {
  std::vector<Cell> cells;
  Joins joins;
};

/// One level up: cells of side `size` merge by block and component, or by block alone.
Structure merged(const Structure& fine, int size, bool duplicate) {
  const auto beside = neighbours(fine.cells.size(), fine.joins);
  std::map<Vec3i, std::vector<int>> blocks;
  Structure coarse;
  std::vector<int> parent(fine.cells.size(), -1);
  for (std::size_t c = 0; c < fine.cells.size(); ++c) {
    if (fine.cells[c].size == size) {
      Vec3i block = fine.cells[c].corner;
      for (auto& x : block) x = x / (2 * size) * (2 * size);
      blocks[block].push_back(static_cast<int>(c));
    } else {
      parent[c] = static_cast<int>(coarse.cells.size());
      coarse.cells.push_back(fine.cells[c]);
    }
  }
  for (const auto& [corner, members] : blocks) {
    const auto groups =
        components(members, [&](int a, int b) { return !duplicate || beside[a].count(b) > 0; });
    for (const auto& group : groups) {
      Cell cell{corner, 2 * size, {}};
      for (const int c : group) {
        parent[c] = static_cast<int>(coarse.cells.size());
        cell.leaves.insert(cell.leaves.end(), fine.cells[c].leaves.begin(),
                           fine.cells[c].leaves.end());
      }
      std::sort(cell.leaves.begin(), cell.leaves.end());
      coarse.cells.push_back(cell);
    }
  }
  for (const auto& join : fine.joins)
    if (parent[join[0]] != parent[join[1]])
      coarse.joins.insert({parent[join[0]], parent[join[1]], join[2]});
  if (duplicate) return coarse;
  for (std::size_t a = 0; a < coarse.cells.size(); ++a)
    for (std::size_t b = 0; b < coarse.cells.size(); ++b)
      for (int axis = 0; axis < 3; ++axis)
        if (coarse.cells[a].size == 2 * size && coarse.cells[b].size == 2 * size &&
            stepped(coarse.cells[a].corner, axis, 2 * size) == coarse.cells[b].corner)
          coarse.joins.insert({static_cast<int>(a), static_cast<int>(b), axis});
  return coarse;
}

/// Puts the cells in the order of a level whose cells hold the given leaves.
Structure reordered(const Structure& from, const Level& level,
                    const std::vector<std::vector<std::int32_t>>& leaves, int number) {
  if (from.cells.size() != leaves.size()) wrong("number of cells", number, level.cells());
  std::map<std::vector<std::int32_t>, int> index;
  for (std::size_t c = 0; c < leaves.size(); ++c) index[leaves[c]] = static_cast<int>(c);
  Structure to;
  to.cells.resize(from.cells.size());
  std::vector<int> at(from.cells.size());
  for (std::size_t c = 0; c < from.cells.size(); ++c) {
    const auto found = index.find(from.cells[c].leaves);
    if (found == index.end())
      wrong("no such component among the cells", number, static_cast<int>(c));
    at[c] = found->second;
    to.cells[at[c]] = from.cells[c];
    if (level.corner[at[c]] != from.cells[c].corner ||
        1 << level.size_log2[at[c]] != from.cells[c].size)
      wrong("place or size", number, at[c]);
  }
  for (const auto& join : from.joins) to.joins.insert({at[join[0]], at[join[1]], join[2]});
  Joins have;
  const std::vector<CellLink> links = links_of(level);
  for (const CellLink& link : links) have.insert({link.a, link.b, link.axis});
  if (have != to.joins || have.size() != links.size()) wrong("links", number, 0);
  return to;
}

Weights trilinear(const Cell& cell, const Vec3i& p, const std::array<Weights, 8>& corners) {
  Weights out;
  for (int i = 0; i < 8; ++i) {
    double w = 1;
    for (int d = 0; d < 3; ++d) {
      const auto k = static_cast<std::size_t>(d);
      const double t = static_cast<double>(p[k] - cell.corner[k]) / cell.size;
      w *= (i >> d) & 1 ? t : 1 - t;
    }
    if (w == 0) continue;
    for (const auto& [v, x] : corners[static_cast<std::size_t>(i)]) out[v] += w * x;
  }
  return out;
}

bool same(const Weights& a, const Weights& b) {
  if (a.size() != b.size()) return false;
  for (const auto& [v, w] : a) {
    const auto other = b.find(v);
    if (other == b.end() || std::abs(other->second - w) > kSameWeight) return false;
  }
  return true;
}

/// Cells around each grid point that is some cell's corner, in components of joined cells.
class Meetings {
 public:
  explicit Meetings(const Structure& s) {
    std::map<Vec3i, std::vector<int>> around;
    for (const Cell& cell : s.cells)
      for (int i = 0; i < 8; ++i) around[corner_of(cell, i)];
    for (std::size_t c = 0; c < s.cells.size(); ++c) {
      const Cell& cell = s.cells[c];
      const int n = cell.size + 1;
      for (int k = 0; k < n * n * n; ++k) {
        const auto at = around.find(
            {cell.corner[0] + k % n, cell.corner[1] + k / n % n, cell.corner[2] + k / n / n});
        if (at != around.end()) at->second.push_back(static_cast<int>(c));
      }
    }
    const auto beside = neighbours(s.cells.size(), s.joins);
    for (const auto& [p, list] : around)
      for (auto& group : components(list, [&](int a, int b) { return beside[a].count(b) > 0; })) {
        for (const int c : group) group_of_[{p, c}] = static_cast<int>(groups.size());
        groups.push_back({p, std::move(group)});
      }
  }
  int at(const Vec3i& p, int cell) const { return group_of_.at({p, cell}); }

  struct Group {
    Vec3i point;
    std::vector<int> cells;
  };
  std::vector<Group> groups;

 private:
  std::map<std::pair<Vec3i, int>, int> group_of_;
};

class Builder {
 public:
  explicit Builder(Structure s) : meetings_(s), value_(meetings_.groups.size()) {
    grid.cells = std::move(s.cells);
    grid.joins = std::move(s.joins);
    grid.corner.resize(grid.cells.size());
    grid.hangs.resize(grid.cells.size());
    for (std::size_t g = 0; g < value_.size(); ++g) {
      if (hanging(static_cast<int>(g))) continue;
      value_[g] = {{static_cast<int>(grid.point.size()), 1.0}};
      grid.point.push_back(meetings_.groups[g].point);
    }
    for (std::size_t c = 0; c < grid.cells.size(); ++c)
      for (int i = 0; i < 8; ++i) {
        const int g = meetings_.at(corner_of(grid.cells[c], i), static_cast<int>(c));
        grid.corner[c][static_cast<std::size_t>(i)] = value(g);
        grid.hangs[c][static_cast<std::size_t>(i)] = hanging(g);
      }
  }
  Grid grid;

 private:
  bool hanging(int g) const {
    const auto& group = meetings_.groups[g];
    return std::any_of(group.cells.begin(), group.cells.end(),
                       [&](int c) { return corner_at(grid.cells[c], group.point) < 0; });
  }
  /// Every larger cell of the group must give the same value: the field is continuous over links.
  const Weights& value(int g) {
    if (!value_[g].empty()) return value_[g];
    const auto& group = meetings_.groups[g];
    Weights found;
    for (const int c : group.cells) {
      if (corner_at(grid.cells[c], group.point) >= 0) continue;
      std::array<Weights, 8> corners;
      for (int i = 0; i < 8; ++i)
        corners[static_cast<std::size_t>(i)] = value(meetings_.at(corner_of(grid.cells[c], i), c));
      const Weights here = trilinear(grid.cells[c], group.point, corners);
      if (found.empty()) found = here;
      if (!same(found, here)) wrong("two larger cells disagree on a hanging corner", -1, c);
    }
    return value_[g] = found;
  }

  Meetings meetings_;
  std::vector<Weights> value_;
};

/// Numbers the vertices as `level` does, by the corners that are vertices.
void renumber(Grid& grid, const Level& level, int number) {
  if (static_cast<int>(grid.point.size()) != level.vertices())
    wrong("number of vertices", number, level.vertices());
  std::vector<int> theirs(grid.point.size(), -1);
  std::set<int> used;
  for (std::size_t c = 0; c < grid.cells.size(); ++c)
    for (std::size_t i = 0; i < 8; ++i) {
      if (grid.hangs[c][i] != (((level.fold[c] >> i) & 1) != 0))
        wrong("a corner hangs, or does not", number, static_cast<int>(c));
      if (grid.hangs[c][i]) continue;
      int& v = theirs[grid.corner[c][i].begin()->first];
      if (v < 0) {
        v = level.slots[c][i];
        if (!used.insert(v).second) wrong("two vertices were made one", number, v);
      }
      if (v != level.slots[c][i]) wrong("one vertex was made two", number, v);
    }
  std::vector<Vec3i> points(grid.point.size());
  for (std::size_t v = 0; v < theirs.size(); ++v) {
    if (theirs[v] < 0) wrong("a vertex that no cell has", number, static_cast<int>(v));
    points[theirs[v]] = grid.point[v];
  }
  if (!std::equal(points.begin(), points.end(), level.point.begin(), level.point.end()))
    wrong("place of a vertex", number, 0);
  grid.point = points;
  for (auto& corners : grid.corner)
    for (Weights& weights : corners) {
      Weights to;
      for (const auto& [v, w] : weights) to[theirs[v]] = w;
      weights = to;
    }
}

}  // namespace

Sharing share_by_octants(const LinkedOctree& body) {
  const Paint paint(body);
  const std::vector<Cell> cells = leaf_cells(body);
  Sharing out;
  out.group.assign(cells.size(), {});
  out.hangs.assign(cells.size(), {});
  int next = 0;
  const Vec3i& n = body.lattice().size;
  for (Vec3i p{0, 0, 0}; p[2] <= n[2]; ++p[2])
    for (p[1] = 0; p[1] <= n[1]; ++p[1])
      for (p[0] = 0; p[0] <= n[0]; ++p[0]) {
        const auto octant = [&](int o) {
          return Vec3i{p[0] - 1 + (o & 1), p[1] - 1 + (o >> 1 & 1), p[2] - 1 + (o >> 2)};
        };
        std::vector<int> present;
        for (int o = 0; o < 8; ++o)
          if (paint(octant(o)) >= 0) present.push_back(o);
        const auto joined = [&](int a, int b) {
          if (paint(octant(a)) == paint(octant(b))) return true;
          const int low = std::min(a, b), difference = a ^ b;
          if (difference != 1 && difference != 2 && difference != 4) return false;
          return body.connected(octant(low), difference / 2);
        };
        for (const auto& group : components(present, joined)) {
          bool hangs = false;
          for (const int o : group) hangs = hangs || corner_at(cells[paint(octant(o))], p) < 0;
          for (const int o : group) {
            const int leaf = paint(octant(o)), corner = corner_at(cells[leaf], p);
            if (corner < 0) continue;
            out.group[leaf][static_cast<std::size_t>(corner)] = next;
            out.hangs[leaf][static_cast<std::size_t>(corner)] = hangs;
          }
          ++next;
        }
      }
  return out;
}

std::vector<Grid> grids_like(const LinkedOctree& body, const Hierarchy& hierarchy,
                             bool duplicate_cells) {
  std::vector<Grid> grids;
  Structure s{leaf_cells(body), leaf_joins(body, Paint(body))};
  std::vector<std::vector<std::int32_t>> leaves(s.cells.size());
  for (std::size_t c = 0; c < leaves.size(); ++c) leaves[c] = s.cells[c].leaves;
  for (std::size_t l = 0; l < hierarchy.levels.size(); ++l) {
    const int number = static_cast<int>(l);
    const Level& level = hierarchy.levels[l];
    s = reordered(s, level, leaves, number);
    grids.push_back(Builder(s).grid);
    renumber(grids.back(), level, number);
    if (l + 1 == hierarchy.levels.size()) break;
    std::vector<std::vector<std::int32_t>> above(hierarchy.levels[l + 1].corner.size());
    for (std::size_t c = 0; c < leaves.size(); ++c)
      above.at(level.parent.at(c))
          .insert(above[level.parent[c]].end(), leaves[c].begin(), leaves[c].end());
    for (auto& list : above) std::sort(list.begin(), list.end());
    leaves = above;
    s = merged(s, 1 << number, duplicate_cells);
  }
  return grids;
}

std::vector<int> parents(const Grid& fine, const Grid& coarse) {
  std::map<std::int32_t, int> holder;
  for (std::size_t c = 0; c < coarse.cells.size(); ++c)
    for (const std::int32_t leaf : coarse.cells[c].leaves) holder[leaf] = static_cast<int>(c);
  std::vector<int> out;
  for (const Cell& cell : fine.cells) out.push_back(holder.at(cell.leaves.front()));
  return out;
}

std::vector<Weights> prolongation(const Grid& fine, const Grid& coarse) {
  const std::vector<int> parent = parents(fine, coarse);
  std::vector<Weights> out(fine.point.size());
  for (std::size_t c = 0; c < fine.cells.size(); ++c)
    for (std::size_t i = 0; i < 8; ++i) {
      if (fine.hangs[c][i]) continue;
      const int v = fine.corner[c][i].begin()->first;
      const Weights here =
          trilinear(coarse.cells[parent[c]], corner_of(fine.cells[c], static_cast<int>(i)),
                    coarse.corner[parent[c]]);
      if (out[v].empty()) out[v] = here;
      if (!same(out[v], here)) wrong("two parents disagree on a vertex", -1, v);
    }
  return out;
}

}  // namespace kerf::oracle
