// SPDX-License-Identifier: MIT
#include "core/near_leaves.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/base/error.hpp"
#include "core/levels/corners.hpp"
#include "core/snapshot.hpp"

namespace kerf {

DeformedLeaves leaves_near(const Backend& backend, const Structure& structure,
                           const Lattice& lattice, int displacement, const TriangleMesh& blade) {
  const BladeReach reach(blade, lattice.origin);
  const Hierarchy& hierarchy = structure.hierarchy();
  const Level& level = hierarchy.levels[0];
  NearCells near;
  std::vector<double> all;
  if (backend.can_update()) {
    near = backend.find_near(displacement, reach, structure.opened());
  } else {
    all.resize(3 * level.point.size());
    backend.read(0, displacement, all);
    near = near_cells(hierarchy, all, reach, structure.opened());
  }
  expects(near.finite && std::isfinite(norm(near.bounds.extent())),
          "the deformed positions of the body are not finite: the simulation has diverged");
  std::vector<Vec3d> corners(8 * near.cells.size());
  backend.workers().share(near.cells.size(), [&](std::size_t, std::size_t begin, std::size_t end) {
    const std::span<const std::int32_t> cells(near.cells.data() + begin, end - begin);
    std::vector<std::int32_t> vertices;
    vertices.reserve(8 * cells.size());
    for (const std::int32_t cell : cells)
      vertices.insert(vertices.end(), level.slots[cell].begin(), level.slots[cell].end());
    std::vector<double> of_slots;
    if (backend.can_update()) {
      of_slots.resize(3 * vertices.size());
      backend.read_some(0, displacement, vertices, of_slots);
    } else {
      of_slots = values_at(all, vertices);
    }
    const std::vector<Vec3d> some = corners_of_cells(lattice, level, cells, of_slots);
    std::copy(some.begin(), some.end(), corners.begin() + static_cast<std::ptrdiff_t>(8 * begin));
  });
  return {{near.bounds.lo + lattice.origin, near.bounds.hi + lattice.origin},
          std::move(near.cells),
          std::move(corners)};
}

}  // namespace kerf
