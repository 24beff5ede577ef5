// SPDX-License-Identifier: MIT
//
// The grid-like tool of [DGW11] section 8.2: two families of parallel blades pushed into a cube.
#pragma once

#include <cmath>
#include <vector>

#include "core/geometry/blade.hpp"

namespace kerf::scenes {

/// Blades that cut the upper part of the cube [0, edge]^3, from y = edge (1 - depth) upwards, into
/// rods: `count` blades in each of two directions at equal distances edge / (count + 1) around the
/// middle, turned about the vertical axis by `angle`.
///
/// Units  edge in m, angle in rad; depth is a ratio.
inline std::vector<TriangleMesh> comb(double edge, int count, double depth, double angle) {
  const double c = std::cos(angle), s = std::sin(angle), middle = 0.5 * edge;
  const auto place = [&](double across, double along, double y) {
    return Vec3d{middle + c * across - s * along, y, middle + s * across + c * along};
  };
  std::vector<TriangleMesh> out;
  for (int direction = 0; direction < 2; ++direction)
    for (int i = 1; i <= count; ++i) {
      const double across = edge * (static_cast<double>(i) / (count + 1) - 0.5);
      const auto line = [&](double y) {
        const double reach = edge;  // beyond the corners of the cube at every angle
        return direction == 0 ? CutLine{place(across, -reach, y), place(across, reach, y)}
                              : CutLine{place(-reach, across, y), place(reach, across, y)};
      };
      out.push_back(sweep({line(1.5 * edge), line(edge * (1 - depth))}));
    }
  return out;
}

}  // namespace kerf::scenes
