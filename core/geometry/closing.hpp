// SPDX-License-Identifier: MIT
//
// Caps for the holes of a mesh.
#pragma once

#include "core/geometry/triangle_mesh.hpp"

namespace kerf {

/// Triangles that, added to `mesh`, make every edge be traversed as often forth as back; none if
/// that holds already. Each loop of open edges gets a fan about its middle, a little off, so that
/// no cap lies in a plane of the caller's lattice. The points are the caps' own.
///
/// With them the winding number W of mesh and caps together is an integer, and the generalised
/// winding number of the mesh alone is W less that of the caps, which are few.
TriangleMesh closing_caps(const TriangleMesh& mesh);

}  // namespace kerf
