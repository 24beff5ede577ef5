// SPDX-License-Identifier: MIT
#include "bench/body.hpp"

#include <cmath>

#include "core/base/error.hpp"
#include "core/base/hash.hpp"
#include "core/body/cut.hpp"
#include "core/body/pieces.hpp"
#include "core/fem/held.hpp"
#include "core/fem/loads.hpp"
#include "core/snapshot.hpp"

namespace kerf::bench {
namespace {

LinkedOctree cut_octree(const SimulationSetup& setup) {
  LinkedOctree out = uncut_octree(setup);
  std::int32_t id = 0;
  for (const CutSetup& blade : setup.cuts)
    cut(out, {}, blade.lines.empty() ? blade.mesh : sweep(blade.lines), ++id);
  return out;
}

}  // namespace

Body::Body(SimulationSetup setup) : setup_(std::move(setup)), octree_(cut_octree(setup_)) {}

Hierarchy Body::build_levels(const LinkedOctree& octree) const {
  Hierarchy out;
  out.levels.push_back(finest_level(octree));
  Level& level = out.levels[0];
  out.spacing = octree.lattice().spacing;
  out.poisson = {setup_.material.poisson};
  for (const std::uint8_t log2 : level.size_log2) {
    const double side = out.spacing * (1 << log2);
    out.values.push_back(
        {setup_.material.young * side, setup_.material.density * side * side * side, 0});
  }
  std::vector<HeldComponent> held;
  apply_supports(octree.lattice(), setup_.supports, level, 0, held);
  std::size_t pieces = 0;
  const std::vector<std::int32_t> piece = label_pieces(octree, &pieces);
  hold_crumbs(octree.lattice(), piece, pieces, level);
  for (const auto& [key, record] : octree.records())
    out.cut = out.cut || record.end[0].cut_id > 0 || record.end[1].cut_id > 0;
  build_coarse_levels(out, {setup_.solver.coarsest_vertices, setup_.solver.max_levels,
                            setup_.solver.duplicate_cells});
  return out;
}

void Body::build() {
  hierarchy_ = build_levels(octree_);
  load_ = ExternalForce(octree_.lattice(), setup_.loads, finest()).on_all(hierarchy_);
  bent_corners_ = cell_corners(octree_.lattice(), finest(), bent(1));
  place_blade();
}

// A plane section at height y of a column moves to the arc of a circle and turns with it.
std::vector<double> Body::bent(double part) const {
  constexpr double kAngle = 0.5;  // between the ends, rad
  const Box3 box = setup_.body.solid->bounds();
  const double bend = part * kAngle / box.extent().y, middle = 0.5 * (box.lo.x + box.hi.x);
  std::vector<double> out(3 * finest().point.size(), 0.0);
  for (std::int32_t v = 0; v < finest().vertices(); ++v) {
    const Vec3d p = octree_.lattice().point(finest().point[v]);
    const double turn = bend * (p.y - box.lo.y), across = p.x - middle;
    const double s = std::sin(turn), c = std::cos(turn);
    const std::size_t k = 3 * static_cast<std::size_t>(v);
    out[k] = (1 - c) / bend + c * across - across;
    out[k + 1] = s / bend - s * across - (p.y - box.lo.y);
  }
  return out;
}

// Each link that is cut touches two cells.
void Body::place_blade() {
  constexpr double kPart = 0.01;
  Vec3d middle{};
  double weight = 0;
  for (std::int32_t c = 0; c < finest().cells(); ++c) {
    const double volume = std::pow(8.0, finest().size_log2[c]);
    for (std::size_t i = 0; i < 8; ++i)
      middle += 0.125 * volume * bent_corners_[8 * static_cast<std::size_t>(c) + i];
    weight += volume;
  }
  middle = (1 / weight) * middle;
  const double side = std::sqrt(0.5 * kPart * static_cast<double>(cells()));  // finest cells
  const double half = 0.5 * hierarchy_.spacing * std::max(2.0, side);
  const Vec3d u = (half / std::sqrt(1.04)) * Vec3d{0.2, 1, 0}, v{0, 0, half};  // off the grid
  blade_ = {{middle - u - v, middle + u - v, middle + u + v, middle - u + v},
            {{0, 1, 2}, {0, 2, 3}}};
}

LinkedOctree uncut_octree(const SimulationSetup& setup) {
  const Lattice lattice =
      make_lattice(setup.body.solid->bounds(), setup.body.resolution, setup.body.refinement);
  std::vector<std::shared_ptr<const Solid>> regions;
  for (const Region& region : setup.regions) regions.push_back(region.solid);
  return LinkedOctree(voxelise(*setup.body.solid, lattice, regions), setup.body.refinement);
}

void follow(Backend& backend, Structure& structure, bool in_place) {
  if (backend.can_update() && in_place) {
    backend.update(structure.hierarchy(), structure.change());
  } else {
    structure.pack();
    backend.load(structure.hierarchy());
  }
}

std::uint64_t hash_of(const std::vector<double>& values) {
  Hash hash;
  hash.add(values);
  return hash.value();
}

std::uint64_t hash_of(const Hierarchy& hierarchy) {
  Hash hash;
  for (const Level& level : hierarchy.levels) {
    hash.add(std::vector<Vec3i>(level.corner.begin(), level.corner.end()));
    hash.add(level.size_log2);
    hash.add(level.parent);
    hash.add(level.place);
    hash.add(level.fold);
    hash.add(level.slots);
    hash.add(level.fixed);
    hash.add(level.incidence);
  }
  return hash.value();
}

}  // namespace kerf::bench
