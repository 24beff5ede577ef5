// SPDX-License-Identifier: MIT
//
// Pictures of the state for files and for the next cut.
#pragma once

#include <span>
#include <vector>

#include "core/simulation.hpp"

namespace kerf {

/// Deformed positions of the corners of all cells, eight per cell, m.
std::vector<Vec3d> cell_corners(const Lattice& lattice, const Level& level,
                                std::span<const double> displacement);

/// Deformed positions of the corners of some cells, from the displacements of their slots, eight
/// times three for each.
std::vector<Vec3d> corners_of_cells(const Lattice& lattice, const Level& level,
                                    std::span<const std::int32_t> cells,
                                    std::span<const double> of_slots);

/// Hanging corners of a level, each place of each component once.
std::size_t count_hanging(const Level& level);

/// Everything of a Snapshot but pieces, materials and rotations.
Snapshot make_snapshot(const LinkedOctree& body, const Hierarchy& hierarchy,
                       std::span<const double> displacement, std::span<const double> velocity,
                       std::span<const double> external);

}  // namespace kerf
