// SPDX-License-Identifier: MIT
//
// Bodies with the features that levels and operators must get right, by name.
#pragma once

#include <stdexcept>
#include <string>

#include "core/body/cut.hpp"
#include "core/body/linked_octree.hpp"
#include "tests/support/blades.hpp"
#include "tests/support/bodies.hpp"
#include "tests/support/random_blades.hpp"

namespace kerf::test {

inline void disconnect(LinkedOctree& body, const Vec3i& lower, int axis) {
  body.disconnect(lower, axis, halfway(body.lattice(), axis, 1));
}

/// All six links of a cell.
inline void isolate(LinkedOctree& body, const Vec3i& cell) {
  for (int axis = 0; axis < 3; ++axis)
    for (int side = -1; side <= 0; ++side) disconnect(body, plus(cell, axis, side), axis);
}

/// A plane through a place given in finest cells.
inline void cut_plane(LinkedOctree& body, const Vec3d& place, const Vec3d& normal, double reach) {
  const Lattice& l = body.lattice();
  cut(body, {}, plane_blade(l.origin + l.spacing * place, normal, reach * l.spacing), 1);
}

/// Random blades, one after another.
inline LinkedOctree randomly_cut(std::uint64_t seed) {
  Dice dice(seed);
  const int kind = dice.roll(3);
  const Voxels voxels = kind == 0   ? box_body({8 + dice.roll(5), 9, 7 + dice.roll(4)})
                        : kind == 1 ? ball_body(12)
                                    : two_limb_body({10, 6, 12});
  LinkedOctree body(voxels, dice.roll(4));
  RandomBlades blades(voxels.lattice, dice);
  for (int i = 0; i < 3; ++i) cut(body, {}, blades.next(), i + 1);
  return body;
}

inline LinkedOctree scene(const std::string& name) {
  if (name == "one_cell") return LinkedOctree(box_body({1, 1, 1}), 0);
  if (name == "uniform") return LinkedOctree(box_body({5, 4, 3}), 0);
  if (name == "octree1") return LinkedOctree(box_body({8, 6, 6}), 1);
  if (name == "octree2") return LinkedOctree(box_body({13, 12, 12}), 2);
  if (name == "octree3") return LinkedOctree(box_body({24, 24, 24}), 3);
  if (name == "ball") return LinkedOctree(ball_body(14), 2);
  if (name == "limbs") return LinkedOctree(two_limb_body({12, 6, 14}), 2);
  if (name == "floating") {  // a cell that hangs on nothing, inside others
    LinkedOctree body(box_body({5, 5, 4}), 0);
    isolate(body, {2, 2, 1});
    return body;
  }
  if (name == "bar") {  // longer than 32 cells and no multiple of 16, cut half through
    LinkedOctree body(box_body({37, 4, 3}), 0);
    cut_plane(body, {17.3, 2.6, 1.4}, {1, 0.3, 0.2}, 1.8);
    return body;
  }
  if (name == "half_cut") {  // a slanted cut that ends inside, beside larger leaves
    LinkedOctree body(box_body({12, 12, 12}), 2);
    cut_plane(body, {4.3, 1.2, 6.1}, {1, 0.4, 0.3}, 3.4);
    return body;
  }
  if (name == "crossed") {  // thin slices in all directions: many pieces and duplicates
    LinkedOctree body(box_body({9, 8, 8}), 2);
    cut_plane(body, {2.3, 4, 4}, {1, 0.1, 0.2}, 20);
    cut_plane(body, {3.6, 4, 4}, {1, 0.1, -0.2}, 20);
    cut_plane(body, {4.5, 3.4, 4}, {0.1, 1, 0.2}, 20);
    return body;
  }
  if (name == "arc") {
    LinkedOctree body(box_body({12, 11, 10}), 1);
    const Lattice& l = body.lattice();
    cut(body, {},
        sweep(arc_lines(l.origin + l.spacing * Vec3d{3.3, 5.2, 6.4}, 4.2 * l.spacing,
                        3.7 * l.spacing, 9)),
        1);
    return body;
  }
  throw std::logic_error("no such scene: " + name);
}

}  // namespace kerf::test
