// SPDX-License-Identifier: MIT
//
// Statics: every piece must be held against sliding and turning.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "core/body/lattice.hpp"
#include "core/levels/hierarchy.hpp"

namespace kerf {

/// What was held so that crumbs stay where they are.
struct FrozenCrumbs {
  std::size_t pieces = 0;
  std::vector<std::size_t> components;  ///< 3 vertex + component, ascending
  std::string warning;                  ///< empty if there are none
};

/// Voxels and oblique blades leave crumbs: pieces of at most a thousandth of the volume that no
/// support meets. They would make the static problem singular, so level.fixed holds them where they
/// are. `piece` numbers the cells of `level` from 0 to pieces - 1.
/// @throws Error (bad_input) that names the first larger piece that can move as a rigid body: it
/// has no equilibrium of its own.
FrozenCrumbs hold_crumbs(const Lattice& lattice, std::span<const std::int32_t> piece,
                         std::size_t pieces, Level& level);

}  // namespace kerf
