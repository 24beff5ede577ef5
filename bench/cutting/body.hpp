// SPDX-License-Identifier: MIT
//
// A body with cuts in it, as different methods see it: always one finite element level, so that
// supports, loads, solver and measures are the same for all.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "core/geometry/triangle_mesh.hpp"
#include "core/levels/hierarchy.hpp"

namespace kerf::cutting {

enum class Method {
  uniform,        ///< all cells are finest; a blade disconnects links
  octree,         ///< the same, with an interior of larger cells that a blade refines
  deletion,       ///< all cells are finest; those that a blade meets are removed
  virtual_nodes,  ///< all cells are finest; a cell that falls apart is there once for each part,
                  ///< with the stiffness of the whole cell
};

struct MethodInfo {
  Method method;
  const char* name;
  const char* what;
};
const std::vector<MethodInfo>& methods();
const char* name_of(Method method);

struct Elastic {
  double young = 1;    ///< Pa
  double poisson = 0;  ///< in (-1, 0.5)
  double density = 1;  ///< kg/m^3
};
/// Of all scenes whose answer says nothing about the material.
inline constexpr Elastic kMaterial{1000, 0.3, 1};

/// A box of whole cells, the blades that pass through it in their order, in the reference state.
struct Shape {
  Box3 box;
  int cells = 1;  ///< along the longest side
  Elastic material;
  std::vector<TriangleMesh> blades;
};

/// Level 0 of `hierarchy` with its values; supports and coarser levels are still to be set.
struct CutBody {
  Lattice lattice;
  Hierarchy hierarchy;
  double octree_seconds = 0;  ///< lattice, voxels and octree
  double cut_seconds = 0;     ///< the blades
  double level_seconds = 0;   ///< cells and vertices of level 0
  std::size_t octree_bytes = 0;
  double removed = 0;  ///< part of the volume

  const Level& level() const { return hierarchy.levels[0]; }
};

/// Source  Octree and links: [DGW11] section 4. Deletion: [WWD15] section 2.2.2. Virtual nodes:
///         Molino, Bao, Fedkiw 2004 [MBF04], there on tetrahedra.
CutBody make_body(const Shape& shape, Method method);

/// Whether a triangle meets the inside of a box.
bool meets(const Vec3d (&triangle)[3], const Box3& box);

}  // namespace kerf::cutting
