// SPDX-License-Identifier: MIT
//
// Whether the supports leave no piece free to slide or turn.
#pragma once

#include <span>

#include "core/body/lattice.hpp"
#include "core/levels/hierarchy.hpp"

namespace kerf {

/// `piece` numbers the cells of `level` from 0 to pieces - 1.
/// @throws Error (bad_input) that names the first piece that can move as a rigid body: the static
/// problem has then no or no single solution.
void expect_held(const Lattice& lattice, const Level& level, std::span<const std::int32_t> piece,
                 std::size_t pieces);

}  // namespace kerf
