// SPDX-License-Identifier: MIT
#include "core/fem/loads.hpp"

#include <cmath>
#include <functional>

#include "core/base/error.hpp"
#include "kernels/transfer.hpp"

namespace kerf {
namespace {

Vec3d cell_center(const Lattice& lattice, const Level& level, std::int32_t cell) {
  const double half = 0.5 * lattice.spacing * (1 << level.size_log2[cell]);
  return lattice.point(level.corner[cell]) + Vec3d{half, half, half};
}

// Forces on the corners reach the vertices that carry them.
void add_corner_forces(const Level& level, std::int32_t cell, const Vec3d (&corners)[8],
                       std::vector<double>& out) {
  Vec3d slots[8];
  kernels::fold_transpose(corners, level.fold[cell], slots);
  for (int i = 0; i < 8; ++i)
    for (int c = 0; c < 3; ++c)
      out[3 * static_cast<std::size_t>(level.slots[cell][i]) + c] += slots[i][c];
}

// A force spread evenly over a cell reaches its corners in equal shares.
void add_cell_force(const Level& level, std::int32_t cell, const Vec3d& force,
                    std::vector<double>& out) {
  Vec3d corners[8];
  for (Vec3d& corner : corners) corner = 0.125 * force;
  add_corner_forces(level, cell, corners, out);
}

// Finest cells of a leaf with their centre in a box, and their shares of its corners. Finest cells,
// so that a force does not jump when a cut refines the leaf.
struct Covered {
  double low[3] = {0, 0, 0}, high[3] = {0, 0, 0};  // along each axis, sums of 1 - t and of t

  Covered(const Lattice& lattice, const Level& level, std::int32_t cell, const Box3& box) {
    const int size = 1 << level.size_log2[cell];
    for (int i = 0; i < size; ++i) {
      Vec3i at = level.corner[cell];
      for (std::size_t d = 0; d < 3; ++d) at[d] += i;
      const Vec3d center = lattice.center(at);
      const double t = (i + 0.5) / size;
      for (int d = 0; d < 3; ++d) {
        if (center[d] < box.lo[d] || center[d] > box.hi[d]) continue;
        low[d] += 1 - t;
        high[d] += t;
      }
    }
  }
  double cells() const { return (low[0] + high[0]) * (low[1] + high[1]) * (low[2] + high[2]); }
  double corner(int i) const {
    return ((i & 1) != 0 ? high[0] : low[0]) * ((i & 2) != 0 ? high[1] : low[1]) *
           ((i & 4) != 0 ? high[2] : low[2]);
  }
};

void add_box_force(const Lattice& lattice, const Level& level, const BoxForce& load,
                   std::vector<double>& out) {
  double cells = 0;
  for (std::int32_t c = 0; c < level.cells(); ++c)
    cells += Covered(lattice, level, c, load.box).cells();
  expects(cells > 0, "the box of a force holds no centre of a finest cell; enlarge or move it");
  for (std::int32_t c = 0; c < level.cells(); ++c) {
    const Covered covered(lattice, level, c, load.box);
    if (covered.cells() == 0) continue;
    Vec3d corners[8];
    for (int i = 0; i < 8; ++i) corners[i] = (covered.corner(i) / cells) * load.force;
    add_corner_forces(level, c, corners, out);
  }
}

Vec3d away_from_axis(const RadialForce& load, const Vec3d& p) {
  const Vec3d axis = (1 / norm(load.axis)) * load.axis;
  const Vec3d d = p - load.point;
  const Vec3d radial = d - dot(d, axis) * axis;
  const double length = norm(radial);
  return length > 0 ? (1 / length) * radial : Vec3d{};
}

}  // namespace

std::vector<double> apply_supports(const Lattice& lattice, const std::vector<Support>& supports,
                                   Level& level) {
  std::vector<double> held(3 * level.point.size(), 0.0);
  for (std::int32_t v = 0; v < level.vertices(); ++v) {
    level.fixed[v] = 0;
    const Vec3d p = lattice.point(level.point[v]);
    for (const Support& support : supports) {
      if (!support.box.contains(p)) continue;
      for (int c = 0; c < 3; ++c)
        if (support.held[c]) {
          level.fixed[v] = static_cast<std::uint8_t>(level.fixed[v] | (1 << c));
          held[3 * static_cast<std::size_t>(v) + c] = support.displacement[c];
        }
    }
  }
  return held;
}

std::vector<double> external_force(const Lattice& lattice, const std::vector<Load>& loads,
                                   const Hierarchy& hierarchy) {
  const Level& level = hierarchy.levels[0];
  std::vector<double> out(3 * level.point.size(), 0.0);
  const auto for_cells = [&](const std::function<Vec3d(std::int32_t)>& force) {
    for (std::int32_t c = 0; c < level.cells(); ++c) add_cell_force(level, c, force(c), out);
  };
  for (const Load& load : loads) {
    if (const auto* gravity = std::get_if<Gravity>(&load)) {
      for_cells([&](std::int32_t c) { return hierarchy.values[c].mass * gravity->acceleration; });
    } else if (const auto* radial = std::get_if<RadialForce>(&load)) {
      for_cells([&](std::int32_t c) {
        return hierarchy.values[c].mass * radial->strength *
               away_from_axis(*radial, cell_center(lattice, level, c));
      });
    } else if (const auto* box = std::get_if<BoxForce>(&load)) {
      add_box_force(lattice, level, *box, out);
    }
  }
  return out;
}

}  // namespace kerf
