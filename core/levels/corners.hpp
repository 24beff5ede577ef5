// SPDX-License-Identifier: MIT
//
// From vertex values to corner values and back, on the host, for level 0.
#pragma once

#include <span>
#include <vector>

#include "core/geometry/vec.hpp"
#include "core/levels/hierarchy.hpp"

namespace kerf {

/// Values at the eight corners of a cell, hanging corners interpolated.
void corner_values(const Level& level, std::int32_t cell, std::span<const double> vertex_values,
                   Vec3d (&out)[8]);

/// Vertex values of a refined or cut level, from the corner values of the level before.
/// origin[c] is the cell of the old level that the new cell c lay in. The field is unchanged.
std::vector<double> transfer_values(const Level& before, std::span<const double> values,
                                    const Level& after, std::span<const std::int32_t> origin);

}  // namespace kerf
