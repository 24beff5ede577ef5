// SPDX-License-Identifier: MIT
//
// A solid and its material regions on the finest lattice.
//
// Source  [DGW11] section 4.1: a cell is inside iff its centre is.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/body/lattice.hpp"
#include "core/body/solid.hpp"

namespace kerf {

struct Voxels {
  Lattice lattice;
  std::vector<std::uint8_t> label;  ///< per cell: 0 outside, 1 + material index inside
  std::vector<std::pair<LinkKey, LinkCut>> crossings;  ///< ascending; at least one end inside
  std::vector<std::string> warnings;
};

/// A lattice of cubes that starts at bounds.lo, `resolution` cells along the longest side, every
/// side rounded up to whole cells of 2^refinement. So an axis-aligned box is represented exactly
/// when its sides are whole multiples of the spacing, and its multigrid blocks start at its corner.
/// @throws Error (bad_input) for a resolution < 1, or bounds that are empty or not finite;
///         Error (unavailable) that names the bytes if the lattice needs more than
///         `memory_limit` bytes (0: the memory of this machine).
Lattice make_lattice(const Box3& bounds, int resolution, int refinement,
                     std::size_t memory_limit = 0);

/// Material i + 1 fills regions[i]; later regions win; material 0 fills the rest.
/// @throws Error (bad_input) if no cell centre is inside.
Voxels voxelise(const Solid& body, const Lattice& lattice,
                const std::vector<std::shared_ptr<const Solid>>& regions = {});

}  // namespace kerf
