// SPDX-License-Identifier: MIT
//
// Cutting: a blade disconnects the links that it crosses.
//
// Source  [DGW11] sections 4.1, 4.2 and 7.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/workers.hpp"
#include "core/body/linked_octree.hpp"
#include "core/geometry/triangle_mesh.hpp"
#include "kernels/blade_reach.hpp"

namespace kerf {

/// What one blade pass did.
struct CutEvent {
  std::int32_t cut_id = 0;
  std::size_t links_hit = 0;          ///< finest links between two inside cells the blade crosses
  std::vector<LinkKey> disconnected;  ///< those of them that were connected before, ascending
  std::vector<LinkKey> moved;         ///< those that were cut before, where it passed nearer to an
                                      ///< end than all cuts so far, ascending
  std::vector<std::int32_t> split;    ///< the number of each leaf that was split, in their order:
                                      ///< the i-th left its place to its first child and
                                      ///< appended cells_before + 7 i .. cells_before + 7 i + 6
  std::size_t cells_before = 0;       ///< leaves before and after
  std::size_t cells_after = 0;
  /// Whether the structure of cells and vertices changed; the surface may have moved all the same.
  bool changed() const { return !disconnected.empty() || cells_before != cells_after; }
};

/// Where the leaves near a blade lie.
struct DeformedLeaves {
  Box3 bounds;                        ///< of the whole body, m
  std::vector<std::int32_t> numbers;  ///< places in body.leaves(), ascending; all that the blade
                                      ///< may meet, and as many others as one likes
  std::vector<Vec3d> corners;         ///< eight for each of them, corner x + 2y + 4z, m
};

/// Where a blade may meet something, rounding included: a quick test that errs on the safe side.
class BladeReach {
 public:
  /// How far links that were cut before may reach beyond their leaf, in its extents; a little more,
  /// for rounding.
  static constexpr double kBeyond = 0.51;

  /// Positions that are tested count from `origin`.
  explicit BladeReach(const TriangleMesh& blade, const Vec3d& origin = {});

  const Box3& box() const { return box_; }
  std::span<const kernels::BladeSlab> slabs() const { return slabs_; }
  /// For a loop elsewhere, which may put the slabs where it reads them; valid as long as this.
  kernels::BladeNeighbourhood neighbourhood() const;
  /// Whether links of a leaf whose corners, or vertices, lie in `leaf` may be met.
  bool may_meet(const Box3& leaf, bool has_cut_links) const;

 private:
  Box3 box_;
  double margin_ = 0;
  std::vector<kernels::BladeSlab> slabs_;  // around triangles; none: too many to look at
};

/// Cuts `body` with `blade`.
///
/// `corners` holds the deformed positions of the corners of all leaves, eight per leaf (corner
/// x + 2y + 4z) in the order of body.leaves(), in m; empty for the reference state. A link is the
/// two half segments from the cell centres to the centre of the shared face, carried by the
/// trilinear map of the leaf they lie in; one that was cut before, from each centre to where it was
/// cut, since it may stand open. Links inside larger leaves are tested before any leaf is
/// split. The octree is refined at the hits before the links are disconnected.
///
/// Ties (a blade exactly through a centre, along a link) are decided as if the body were moved by
/// an infinitesimal (e, e^2, e^3), the same for every test, so that a blade through grid points
/// cuts one layer of links, without gaps.
///
/// @throws Error (bad_input) if a blade coordinate is not finite, or the blade is more than a
///         million times larger than the body. The body is unchanged after a throw.
CutEvent cut(LinkedOctree& body, std::span<const Vec3d> corners, const TriangleMesh& blade,
             std::int32_t cut_id);
/// The same, from the corners of the leaves near the blade alone. However many workers there are,
/// the body is cut alike.
CutEvent cut_near(LinkedOctree& body, const DeformedLeaves& leaves, const TriangleMesh& blade,
                  std::int32_t cut_id, const Workers& workers = {});

}  // namespace kerf
