// SPDX-License-Identifier: MIT
#include <algorithm>
#include <bit>
#include <utility>

#include "core/base/error.hpp"
#include "core/levels/hierarchy.hpp"
#include "core/levels/union_find.hpp"

namespace kerf {
namespace {

// Calls visit(link) for every link once.
template <class Visit>
void for_each_link(const Level& level, const Visit& visit) {
  for (std::int32_t a = 0; a < level.cells(); ++a)
    for (const std::int32_t item : level.links_of(a))
      if ((item & 1) != 0)  // towards the high side
        visit(CellLink{a, item / 8, static_cast<std::uint8_t>(item % 8 / 2)});
}

// The places of one level at which cells can meet: the eight corners of every cell, and the 27
// grid points at half the side of those cells that are linked to smaller ones.
class Places {
 public:
  explicit Places(const Level& level) : level_(level), half_(level.corner.size(), -1) {
    const auto cells = level.cells();
    std::int32_t next = 8 * cells;
    for_each_link(level, [&](const CellLink& link) {
      if (level.size_log2[link.a] == level.size_log2[link.b]) return;
      const std::int32_t large =
          level.size_log2[link.a] > level.size_log2[link.b] ? link.a : link.b;
      if (half_[large] < 0) {
        half_[large] = next;
        next += 27;
        large_.push_back(large);
      }
    });
    count_ = static_cast<std::size_t>(next);
  }

  std::size_t count() const { return count_; }
  const std::vector<std::int32_t>& large_cells() const { return large_; }
  bool has_half(std::int32_t cell) const { return half_[cell] >= 0; }
  std::int32_t corner(std::int32_t cell, int corner) const { return 8 * cell + corner; }
  std::int32_t half(std::int32_t cell, int code) const { return half_[cell] + code; }

  // Place of grid point p on a larger cell.
  std::int32_t at(std::int32_t cell, const Vec3i& p) const {
    const int size = 1 << level_.size_log2[cell];
    int code = 0, corner = 0;
    bool is_corner = true;
    for (int d = 2; d >= 0; --d) {
      const int twice = 2 * (p[d] - level_.corner[cell][d]);
      ensures(twice >= 0 && twice <= 2 * size && twice % size == 0,
              "a linked cell is more than one level larger");
      const int third = twice / size;
      code = 3 * code + third;
      corner = 2 * corner + third / 2;
      is_corner = is_corner && third != 1;
    }
    return is_corner ? this->corner(cell, corner) : half(cell, code);
  }

 private:
  const Level& level_;
  std::vector<std::int32_t> half_;
  std::vector<std::int32_t> large_;
  std::size_t count_ = 0;
};

Vec3i corner_point(const Level& level, std::int32_t cell, int corner) {
  const int size = 1 << level.size_log2[cell];
  Vec3i p = level.corner[cell];
  for (int d = 0; d < 3; ++d) p[d] += ((corner >> d) & 1) * size;
  return p;
}

void unite_over_link(const Level& level, const Places& places, const CellLink& link,
                     UnionFind& sets) {
  const int u = (link.axis + 1) % 3, v = (link.axis + 2) % 3;
  const int high = 1 << link.axis;
  if (level.size_log2[link.a] == level.size_log2[link.b]) {
    for (int k = 0; k < 4; ++k) {
      const int rest = ((k & 1) << u) | ((k >> 1) << v);
      sets.unite(places.corner(link.a, rest | high), places.corner(link.b, rest));
    }
    // Points at half the side matter only where smaller cells meet both.
    if (!places.has_half(link.a) || !places.has_half(link.b)) return;
    constexpr int kStride[3] = {1, 3, 9};
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        if (i != 1 && j != 1) continue;
        const int rest = i * kStride[u] + j * kStride[v];
        sets.unite(places.half(link.a, rest + 2 * kStride[link.axis]), places.half(link.b, rest));
      }
    return;
  }
  const bool a_small = level.size_log2[link.a] < level.size_log2[link.b];
  const std::int32_t small = a_small ? link.a : link.b, large = a_small ? link.b : link.a;
  for (int k = 0; k < 4; ++k) {
    const int corner = ((k & 1) << u) | ((k >> 1) << v) | (a_small ? high : 0);
    sets.unite(places.corner(small, corner), places.at(large, corner_point(level, small, corner)));
  }
}

struct Component {
  std::int32_t vertex = -1;  // or
  std::int32_t master = -1;  // the larger cell that a hanging corner is interpolated from
};

// Numbers the vertices and returns the component of each place; hanging components keep a master.
std::vector<Component> number_vertices(Level& level, const Places& places, UnionFind& sets) {
  std::vector<Component> component(places.count());
  for (const std::int32_t large : places.large_cells())
    for (int code = 0; code < 27; ++code) {
      const int odd = (code % 3 == 1) + (code / 3 % 3 == 1) + (code / 9 == 1);
      if (odd == 0) continue;  // a corner: not used at half the side
      Component& c = component[sets.find(places.half(large, code))];
      if (c.master < 0) c.master = large;
    }

  // Keys of grid points ascend by (z, y, x); lattices stay below 2^21 cells along each axis.
  std::vector<std::pair<std::uint64_t, std::int32_t>> entries;
  const std::int32_t corners = 8 * level.cells();
  entries.reserve(static_cast<std::size_t>(level.cells()) * 5 / 4 + 64);
  for (std::int32_t place = 0; place < corners; ++place) {
    if (sets.find(place) != place || component[place].master >= 0) continue;
    const Vec3i p = corner_point(level, place / 8, place % 8);
    entries.emplace_back(static_cast<std::uint64_t>(p[2]) << 42 |
                             static_cast<std::uint64_t>(p[1]) << 21 |
                             static_cast<std::uint64_t>(p[0]),
                         place);
  }
  std::sort(entries.begin(), entries.end());
  level.point.reserve(with_room(entries.size()));
  level.point.resize(entries.size());
  for (std::size_t v = 0; v < entries.size(); ++v) {
    const std::int32_t place = entries[v].second;
    level.point[v] = corner_point(level, place / 8, place % 8);
    component[place].vertex = static_cast<std::int32_t>(v);
  }
  return component;
}

void fill_slots(Level& level, const Places& places, UnionFind& sets,
                const std::vector<Component>& component) {
  const std::int32_t cells = level.cells();
  level.fold.reserve(with_room(level.corner.size()));
  level.slots.reserve(with_room(level.corner.size()));
  level.fold.assign(cells, 0);
  level.slots.resize(cells);
  for (std::int32_t cell = 0; cell < cells; ++cell) {
    const int size = 1 << level.size_log2[cell];
    int octant = 0, hanging = 0;
    Vec3i parent_corner{};
    for (int d = 0; d < 3; ++d) {
      const int bit = (level.corner[cell][d] >> level.size_log2[cell]) & 1;
      octant |= bit << d;
      parent_corner[d] = level.corner[cell][d] - bit * size;
    }
    for (int i = 0; i < 8; ++i) {
      const Component& c = component[sets.find(places.corner(cell, i))];
      std::int32_t vertex = c.vertex;
      if (c.master >= 0) {
        hanging |= 1 << i;
        Vec3i q = parent_corner;
        for (int d = 0; d < 3; ++d) q[d] += ((i >> d) & 1) * 2 * size;
        const std::int32_t place = places.at(c.master, q);
        ensures(place < 8 * cells, "a hanging corner asks for a place that is no corner");
        vertex = component[sets.find(place)].vertex;
        ensures(std::popcount(static_cast<unsigned>(i ^ octant)) % 3 != 0,
                "a corner hangs that touches its parent's corner or centre");
      }
      ensures(vertex >= 0, "a hanging corner depends on another hanging corner");
      level.slots[cell][i] = vertex;
    }
    level.fold[cell] = static_cast<std::uint16_t>(hanging | (octant << 8));
  }
}

// The masters of a hanging corner must be slots of its cell; see rule 3 of LinkedOctree.
void check_masters(const Level& level, const Places& places, UnionFind& sets,
                   const std::vector<Component>& component) {
  for (std::int32_t cell = 0; cell < level.cells(); ++cell) {
    const int hanging = level.fold[cell] & 255, octant = level.fold[cell] >> 8;
    if (hanging == 0) continue;
    const int size = 1 << level.size_log2[cell];
    for (int i = 0; i < 8; ++i) {
      if (!((hanging >> i) & 1)) continue;
      const std::int32_t master = component[sets.find(places.corner(cell, i))].master;
      const int span = i ^ octant;
      for (int sub = span;; sub = (sub - 1) & span) {
        const int j = octant ^ sub;
        Vec3i q{};
        for (int d = 0; d < 3; ++d)
          q[d] = level.corner[cell][d] + (((j >> d) & 1) * 2 - ((octant >> d) & 1)) * size;
        const std::int32_t place = places.at(master, q);
        ensures(
            place < 8 * level.cells() && component[sets.find(place)].vertex == level.slots[cell][j],
            "a cell depends on more than eight vertices");
        if (sub == 0) break;
      }
    }
  }
}

void fill_incidences(Level& level) {
  level.incidence_rows = {};
  level.incidence_begin.reserve(with_room(level.point.size()));
  level.incidence_begin.assign(level.point.size() + 1, 0);
  for (const auto& slots : level.slots)
    for (const std::int32_t v : slots) ++level.incidence_begin[v + 1];
  for (std::size_t v = 0; v < level.point.size(); ++v)
    level.incidence_begin[v + 1] += level.incidence_begin[v];
  level.incidence.reserve(with_room(8 * level.slots.size()));
  level.incidence.resize(8 * level.slots.size());
  std::vector<std::int32_t> next(level.incidence_begin.begin(), level.incidence_begin.end() - 1);
  for (std::int32_t cell = 0; cell < level.cells(); ++cell)
    for (int i = 0; i < 8; ++i) level.incidence[next[level.slots[cell][i]]++] = 8 * cell + i;
}

}  // namespace

void build_vertices(Level& level) {
  const Places places(level);
  expects(places.count() < (std::size_t{1} << 31),
          "the body has too many cells for 32-bit indices; lower the resolution");
  UnionFind sets(places.count());
  for_each_link(level, [&](const CellLink& link) { unite_over_link(level, places, link, sets); });
  const std::vector<Component> component = number_vertices(level, places, sets);
  fill_slots(level, places, sets, component);
  check_masters(level, places, sets, component);
  level.fixed.reserve(with_room(level.point.size()));
  level.fixed.assign(level.point.size(), 0);
  fill_incidences(level);
}

}  // namespace kerf
