// SPDX-License-Identifier: MIT
//
// From what a backend holds of the deformed body to what the octree cuts.
#pragma once

#include "core/backend.hpp"
#include "core/body/cut.hpp"
#include "core/structure.hpp"

namespace kerf {

/// The leaves that a blade may meet, deformed as a vector of the backend says, for cut_near.
/// @throws Error (bad_input) if the body lies where no number is
DeformedLeaves leaves_near(const Backend& backend, const Structure& structure,
                           const Lattice& lattice, int displacement, const TriangleMesh& blade);

}  // namespace kerf
