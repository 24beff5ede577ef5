// SPDX-License-Identifier: MIT
//
// Colours of the vertices of a level, for Gauss-Seidel.
#pragma once

#include <cstdint>
#include <vector>

#include "core/levels/hierarchy.hpp"

namespace kerf {

struct Colours {
  std::vector<std::int32_t> begin;  ///< per colour + 1, into order
  std::vector<std::int32_t> order;  ///< vertices; no two of one colour share a cell

  int count() const { return static_cast<int>(begin.size()) - 1; }
};

Colours colour_vertices(const Level& level);

}  // namespace kerf
