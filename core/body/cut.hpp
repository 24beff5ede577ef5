// SPDX-License-Identifier: MIT
//
// Cutting: a blade disconnects the links that it crosses.
//
// Source  [DGW11] sections 4.1, 4.2 and 7.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/body/linked_octree.hpp"
#include "core/geometry/triangle_mesh.hpp"

namespace kerf {

/// What one blade pass did.
struct CutEvent {
  std::int32_t cut_id = 0;
  std::size_t links_hit = 0;          ///< finest links between two inside cells the blade crosses
  std::vector<LinkKey> disconnected;  ///< those of them that were connected before, ascending
  std::vector<LinkKey> moved;         ///< those that were cut before, where it passed nearer to an
                                      ///< end than all cuts so far, ascending
  std::size_t cells_before = 0;       ///< leaves before and after
  std::size_t cells_after = 0;
  /// Whether the structure of cells and vertices changed; the surface may have moved all the same.
  bool changed() const { return !disconnected.empty() || cells_before != cells_after; }
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

}  // namespace kerf
