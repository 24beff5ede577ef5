// SPDX-License-Identifier: MIT
//
// A blade: the surface that a tool's edge sweeps.
//
// Source  Dick, Georgii, Westermann 2011 [DGW11], section 4.1.
#pragma once

#include <vector>

#include "core/geometry/triangle_mesh.hpp"

namespace kerf {

/// One position of the tool's edge: a polyline of at least two points, in m.
using CutLine = std::vector<Vec3d>;

/// The cutting front: the strip between consecutive cut lines, two triangles for each pair of
/// edge segments. Every line has the same number of points. Points are shared between strips, so
/// that the sweep has no cracks.
/// @throws Error (bad_input) for fewer than two lines, lines of different or too small length, or
/// a coordinate that is not finite.
TriangleMesh sweep(const std::vector<CutLine>& lines);

/// The tool's edge at `t` in [0, 1] of its path through `lines`, equal time from line to line.
CutLine edge_at(const std::vector<CutLine>& lines, double t);

/// The front swept from `t0` to `t1`, 0 <= t0 < t1 <= 1, with every line that lies between.
TriangleMesh sweep_between(const std::vector<CutLine>& lines, double t0, double t1);

}  // namespace kerf
