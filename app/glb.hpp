// SPDX-License-Identifier: MIT
//
// The surface as binary glTF 2.0, surface_NNNN.glb, for browsers and Blender.
#pragma once

#include <filesystem>
#include <string>

#include "core/surface/surface_mesh.hpp"

namespace kerf {

/// Why `surface` cannot be a GLB file: a number that is not finite or too large for single
/// precision, or more than such a file holds. Empty if it can.
std::string glb_obstacle(const SurfaceMesh& surface);

/// Writes the deformed surface as one mesh with one primitive and one material per cut id, the
/// object's own surface first. Positions (m) are single precision relative to the node, which
/// stands in the middle of the surface, so that a body far from the origin keeps its detail.
/// @throws Error (bad_input) if there is an obstacle, or the file cannot be written.
void write_glb(const std::filesystem::path& file, const SurfaceMesh& surface);

}  // namespace kerf
