// SPDX-License-Identifier: MIT
//
// The surface as a VTK file, surface_NNNN.vtp, and back. docs/results.md has the table of arrays.
#pragma once

#include <filesystem>

#include "core/surface/surface_mesh.hpp"

namespace kerf {

/// Writes XML PolyData at rest positions. Normals are rounded to single precision; all else keeps
/// its bits. Points are shared by all triangles, so that the file is closed by index.
/// @throws Error (bad_input) if the file cannot be written.
void write_vtp(const std::filesystem::path& file, const SurfaceMesh& surface);

/// Reads what write_vtp wrote, and nothing else. Corners of one point with equal normals share an
/// entry of SurfaceMesh::normals; entries stand in the order in which triangles meet them.
/// Allocates in proportion to the file's size. Coordinates may be any numbers, also such that are
/// not finite.
/// @throws Error (bad_input) that names the file and what is wrong with it.
SurfaceMesh read_vtp(const std::filesystem::path& file);

}  // namespace kerf
