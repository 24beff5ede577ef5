// SPDX-License-Identifier: MIT
//
// The generalised winding number at all centres of a lattice, without evaluating it at each.
#pragma once

#include <cstdint>
#include <vector>

#include "core/body/lattice.hpp"
#include "core/geometry/winding.hpp"

namespace kerf {

/// The winding number at every cell centre, rounded to the nearest integer (at most 100 either
/// way).
///
/// Away from triangles the winding number is harmonic, so over a box free of triangles it takes
/// its extremes on the box's boundary: if all boundary centres of such a box round to the same
/// integer, the centres within do as well.
std::vector<std::int8_t> rounded_winding(const WindingTree& tree, const Lattice& lattice);

}  // namespace kerf
