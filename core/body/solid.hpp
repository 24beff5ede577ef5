// SPDX-License-Identifier: MIT
//
// Solids that can be sampled on a lattice: which cell centres are inside, which links are crossed.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/body/lattice.hpp"
#include "core/geometry/triangle_mesh.hpp"

namespace kerf {

/// What a solid looks like on a lattice.
struct SolidSamples {
  std::vector<std::uint8_t> inside;  ///< one per lattice cell, 1 if its centre is inside
  /// Links that the solid's surface crosses, ascending by key; also links with both ends inside
  /// (touching limbs, thin gaps). Each end keeps the crossing nearest to it; cut_id 0.
  std::vector<std::pair<LinkKey, LinkCut>> crossings;
  std::vector<std::string> warnings;  ///< what was wrong with the input and what was done about it
};

class Solid {
 public:
  virtual ~Solid() = default;
  virtual Box3 bounds() const = 0;
  /// Every link between an inside and an outside centre is among the crossings; cells outside the
  /// lattice count as outside.
  virtual SolidSamples sample(const Lattice& lattice) const = 0;
};

/// The box between two corners; a centre on a face is inside.
std::unique_ptr<Solid> make_box(const Box3& box);
/// The ball of `radius`, stretched along the axes if the three radii differ.
std::unique_ptr<Solid> make_ellipsoid(const Vec3d& center, const Vec3d& radii);
/// The wall of a tube along y: outer radii rx and rz, from box.lo.y to box.hi.y, `thickness` thick.
std::unique_ptr<Solid> make_cylinder_shell(const Box3& box, double thickness);
/// The inside of a mesh. Watertight, oriented meshes are sampled exactly; others by the generalised
/// winding number, with a warning that says what was found.
/// @throws Error (bad_input) for an empty mesh, a coordinate that is not finite, or no volume.
std::unique_ptr<Solid> make_mesh_solid(TriangleMesh mesh, std::string name);

}  // namespace kerf
