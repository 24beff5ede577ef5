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

// A force spread evenly over a cell reaches its corners in equal shares.
void add_cell_force(const Level& level, std::int32_t cell, const Vec3d& force,
                    std::vector<double>& out) {
  Vec3d corners[8], slots[8];
  for (Vec3d& corner : corners) corner = 0.125 * force;
  kernels::fold_transpose(corners, level.fold[cell], slots);
  for (int i = 0; i < 8; ++i)
    for (int c = 0; c < 3; ++c)
      out[3 * static_cast<std::size_t>(level.slots[cell][i]) + c] += slots[i][c];
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
      double volume = 0;
      const auto share = [&](std::int32_t c) {
        const double side = 1 << level.size_log2[c];
        return box->box.contains(cell_center(lattice, level, c)) ? side * side * side : 0.0;
      };
      for (std::int32_t c = 0; c < level.cells(); ++c) volume += share(c);
      expects(volume > 0, "the box of a force holds no cell centre; enlarge or move it");
      for_cells([&](std::int32_t c) { return (share(c) / volume) * box->force; });
    }
  }
  return out;
}

}  // namespace kerf
