// SPDX-License-Identifier: MIT
//
// A scene made ready: octree, hierarchy, load, and a bent state in which rotations are no identity.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/backend.hpp"
#include "core/body/linked_octree.hpp"
#include "core/levels/hierarchy.hpp"
#include "core/setup.hpp"
#include "core/structure.hpp"

namespace kerf::bench {

class Body {
 public:
  explicit Body(SimulationSetup setup);

  const SimulationSetup& setup() const { return setup_; }
  const LinkedOctree& octree() const { return octree_; }
  std::size_t cells() const { return octree_.leaf_count(); }

  /// All levels over the leaves of `octree`, held as a simulation in static mode holds them.
  Hierarchy build_levels(const LinkedOctree& octree) const;
  /// Fills what follows; apart from the constructor, so that memory can be checked first.
  void build();

  const Hierarchy& hierarchy() const { return hierarchy_; }
  const Level& finest() const { return hierarchy_.levels[0]; }
  /// The load of the scene on the vertices, N.
  const std::vector<double>& load() const { return load_; }
  /// Displacement of a column bent by half a radian about z, `part` of it, m.
  std::vector<double> bent(double part) const;
  /// Corners of all leaves in the bent state, as cut() wants them.
  const std::vector<Vec3d>& bent_corners() const { return bent_corners_; }
  /// A square through the middle of the bent body that touches about 1 % of its cells.
  const TriangleMesh& blade() const { return blade_; }

 private:
  void place_blade();

  SimulationSetup setup_;
  LinkedOctree octree_;
  Hierarchy hierarchy_;
  std::vector<double> load_;
  std::vector<Vec3d> bent_corners_;
  TriangleMesh blade_;
};

/// Of the voxels of a set-up, its regions included, before any blade.
LinkedOctree uncut_octree(const SimulationSetup& setup);
/// Lets a backend follow a blade that `structure` has followed; `in_place`: what it returned.
void follow(Backend& backend, Structure& structure, bool in_place);

/// Of the bits of all values, in their order.
std::uint64_t hash_of(const std::vector<double>& values);
/// Of cells, slots, links, supports and transfer of all levels.
std::uint64_t hash_of(const Hierarchy& hierarchy);

}  // namespace kerf::bench
