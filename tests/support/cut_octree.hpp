// SPDX-License-Identifier: MIT
//
// A bar of cells of three sizes with an oblique cut.
#pragma once

#include <utility>

#include "tests/support/problem.hpp"
#include "tests/support/scenes.hpp"

namespace kerf::test {

/// `duplicate`: with coarse cells duplicated across the cut.
inline Problem cut_octree(bool duplicate) {
  LinkedOctree body(box_body({56, 22, 18}), 2);
  cut_plane(body, {9.3, 5.2, 4.1}, {1, 0.2, 0.3}, 5);
  ProblemOptions options;
  options.coarsest_vertices = 60;
  options.duplicate_cells = duplicate;
  options.with_oracle = false;
  return {std::move(body), options};
}

}  // namespace kerf::test
