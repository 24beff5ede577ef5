// SPDX-License-Identifier: MIT
//
// Supports and loads on the vertices of level 0.
#pragma once

#include <vector>

#include "core/levels/hierarchy.hpp"
#include "core/setup.hpp"

namespace kerf {

/// Sets level.fixed from the supports (later ones win) and returns the held displacement,
/// 3 per vertex, m; zero in free components.
std::vector<double> apply_supports(const Lattice& lattice, const std::vector<Support>& supports,
                                   Level& level);

/// External force on the vertices, 3 per vertex, N. Reference state; hanging corners pass their
/// share to their masters.
/// @throws Error (bad_input) if a box force meets no cell.
std::vector<double> external_force(const Lattice& lattice, const std::vector<Load>& loads,
                                   const Hierarchy& hierarchy);

}  // namespace kerf
