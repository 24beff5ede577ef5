// SPDX-License-Identifier: MIT
#include "core/snapshot.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <map>

#include "core/levels/corners.hpp"
#include "kernels/transfer.hpp"

namespace kerf {
namespace {

using Masters = std::array<std::int32_t, 4>;

// The vertices that a hanging corner is the mean of, ascending, then -1.
Masters masters_of(const Level& level, std::int32_t cell, int corner) {
  const int octant = level.fold[cell] >> 8, span = corner ^ octant;
  Masters out{-1, -1, -1, -1};
  int count = 0;
  for (int sub = span;; sub = (sub - 1) & span) {
    out[count++] = level.slots[cell][octant ^ sub];
    if (sub == 0) break;
  }
  std::sort(out.begin(), out.begin() + count);
  return out;
}

// Calls visit(cell, corner, masters) for every hanging corner.
template <class Visit>
void for_hanging(const Level& level, const Visit& visit) {
  for (std::int32_t cell = 0; cell < level.cells(); ++cell) {
    const int hanging = level.fold[cell] & 255;
    if (hanging == 0) continue;
    for (int i = 0; i < 8; ++i)
      if ((hanging >> i) & 1) visit(cell, i, masters_of(level, cell, i));
  }
}

Vec3d at(std::span<const double> x, std::int32_t vertex) {
  const std::size_t i = 3 * static_cast<std::size_t>(vertex);
  return {x[i], x[i + 1], x[i + 2]};
}

// Where the corners of a cell lie that moved by u.
void place_corners(const Lattice& lattice, const Level& level, std::int32_t cell,
                   const Vec3d (&u)[8], Vec3d* out) {
  const int size = 1 << level.size_log2[cell];
  for (int i = 0; i < 8; ++i) {
    Vec3i p = level.corner[cell];
    for (int d = 0; d < 3; ++d) p[d] += ((i >> d) & 1) * size;
    out[i] = lattice.point(p) + u[i];
  }
}

void add_boundary(const LinkedOctree& body, Snapshot& out) {
  const NodeList& leaves = body.leaves();
  for (std::size_t c = 0; c < leaves.size(); ++c) {
    const LinkedOctree::Node& leaf = body.nodes()[leaves[c]];
    if (leaf.size_log2 != 0) continue;  // larger leaves are linked on all sides
    for (int face = 0; face < 6; ++face) {
      if (!((leaf.cut_mask >> face) & 1)) continue;
      const int axis = face / 2, side = face % 2;
      Vec3i lower = leaf.corner;
      lower[axis] -= 1 - side;
      const LinkCut* record = body.record(lower, axis);
      // This cell is the lower end of the link on its high side.
      const std::int32_t id = record == nullptr ? 0 : record->end[1 - side].cut_id;
      out.boundary.push_back({static_cast<std::int32_t>(c), face, id});
    }
  }
}

}  // namespace

std::vector<Vec3d> cell_corners(const Lattice& lattice, const Level& level,
                                std::span<const double> displacement) {
  std::vector<Vec3d> out(8 * level.corner.size());
  for (std::int32_t cell = 0; cell < level.cells(); ++cell) {
    Vec3d u[8];
    corner_values(level, cell, displacement, u);
    place_corners(lattice, level, cell, u, &out[8 * static_cast<std::size_t>(cell)]);
  }
  return out;
}

std::vector<Vec3d> corners_of_cells(const Lattice& lattice, const Level& level,
                                    std::span<const std::int32_t> cells,
                                    std::span<const double> of_slots) {
  std::vector<Vec3d> out(8 * cells.size());
  for (std::size_t k = 0; k < cells.size(); ++k) {
    Vec3d slots[8], u[8];
    for (std::size_t i = 0; i < 8; ++i) {
      const double* at = &of_slots[24 * k + 3 * i];
      slots[i] = {at[0], at[1], at[2]};
    }
    kernels::unfold(slots, level.fold[cells[k]], u);
    place_corners(lattice, level, cells[k], u, &out[8 * k]);
  }
  return out;
}

std::size_t count_hanging(const Level& level) {
  std::vector<Masters> all;
  for_hanging(level, [&](std::int32_t, int, const Masters& masters) { all.push_back(masters); });
  std::sort(all.begin(), all.end());
  return static_cast<std::size_t>(std::unique(all.begin(), all.end()) - all.begin());
}

Snapshot make_snapshot(const LinkedOctree& body, const Hierarchy& hierarchy,
                       std::span<const double> displacement, std::span<const double> velocity,
                       std::span<const double> external) {
  const Level& level = hierarchy.levels[0];
  Snapshot out;
  for (std::int32_t v = 0; v < level.vertices(); ++v) {
    out.points.push_back(body.lattice().point(level.point[v]));
    out.displacement.push_back(at(displacement, v));
    out.velocity.push_back(at(velocity, v));
    out.external_force.push_back(at(external, v));
    out.masters.push_back({-1, -1, -1, -1});
  }
  out.fixed = level.fixed;
  out.cells = level.slots;
  out.size_log2 = level.size_log2;
  std::map<Masters, std::int32_t> number;
  for_hanging(level, [&](std::int32_t cell, int corner, const Masters& masters) {
    const auto [entry, added] =
        number.try_emplace(masters, static_cast<std::int32_t>(out.points.size()));
    out.cells[cell][corner] = entry->second;
    if (!added) return;
    Vec3d u{}, v{};
    int count = 0;
    for (const std::int32_t m : masters) {
      if (m < 0) break;
      u += at(displacement, m);
      v += at(velocity, m);
      ++count;
    }
    Vec3i p = level.corner[cell];
    for (int d = 0; d < 3; ++d) p[d] += ((corner >> d) & 1) << level.size_log2[cell];
    out.points.push_back(body.lattice().point(p));
    out.displacement.push_back((1.0 / count) * u);
    out.velocity.push_back((1.0 / count) * v);
    out.external_force.push_back({});
    out.masters.push_back(masters);
    out.fixed.push_back(0);
  });
  add_boundary(body, out);
  return out;
}

}  // namespace kerf
