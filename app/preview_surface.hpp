// SPDX-License-Identifier: MIT
//
// The boundary faces of a snapshot, made fit to be looked at: no drawing in here.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/simulation.hpp"

namespace kerf {

struct PreviewSurface {
  std::vector<Vec3d> points;                       ///< deformed, m
  std::vector<std::array<std::int32_t, 4>> quads;  ///< into points, counter-clockwise from outside
  std::vector<std::array<std::int32_t, 4>> normal_of;  ///< into normals
  std::vector<Vec3d> normals;                          ///< unit, outward
  std::vector<std::int32_t> cut_id;                    ///< per quad; 0: the object's own surface
  std::vector<std::int32_t> framed;  ///< points that the picture must hold: crumbs that
                                     ///< fall out of it must not make the rest small
  double cell = 0;                   ///< mean side of the quads, m
};

/// The boundary of cells is a staircase. Points are moved by at most half a cell side to smooth
/// it; the rim between surfaces of different cut ids is smoothed along itself and stays sharp.
/// Only the picture shows this; the files hold the true positions.
PreviewSurface preview_surface(const Snapshot& snapshot);

}  // namespace kerf
