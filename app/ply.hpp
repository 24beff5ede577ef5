// SPDX-License-Identifier: MIT
//
// The surface as a binary PLY file, surface_NNNN.ply.
#pragma once

#include <filesystem>

#include "core/surface/surface_mesh.hpp"

namespace kerf {

/// Writes the deformed surface, little endian: per point its place (m) and one normal, per triangle
/// its points, cut id, piece and the colour of its cut. Closed by index.
/// @throws Error (bad_input) if the file cannot be written.
void write_ply(const std::filesystem::path& file, const SurfaceMesh& surface);

}  // namespace kerf
