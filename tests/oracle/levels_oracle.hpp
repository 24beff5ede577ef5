// SPDX-License-Identifier: MIT
//
// What the levels of a body should be, by brute force over finest cells and grid points. Shares no
// code with core/levels/ and kernels/; reads the octree's leaves and its finest links alone.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include "core/body/linked_octree.hpp"
#include "core/levels/hierarchy.hpp"

namespace kerf::oracle {

/// A cell of some level: the cube that it fills in, and the leaves of the body merged into it.
struct Cell {
  Vec3i corner{};
  int size = 1;                      ///< finest cells
  std::vector<std::int32_t> leaves;  ///< ascending, in the order of LinkedOctree::leaves()
};

/// {a, b, axis}: a is on the low side.
using Joins = std::set<std::array<int, 3>>;

/// Vertex -> weight.
using Weights = std::map<int, double>;

/// One level: its cells, and the field over them.
struct Grid {
  std::vector<Cell> cells;
  Joins joins;
  std::vector<std::array<Weights, 8>> corner;  ///< the value at each corner of each cell
  std::vector<std::array<bool, 8>> hangs;
  std::vector<Vec3i> point;  ///< of each vertex
};

/// Which (leaf, corner) share a vertex, from the eight finest cells around every grid point.
struct Sharing {
  std::vector<std::array<int, 8>> group;   ///< per leaf and corner; equal iff they share
  std::vector<std::array<bool, 8>> hangs;  ///< some leaf of the group lacks the point as a corner
};
Sharing share_by_octants(const LinkedOctree& body);

/// All levels of the body: as many as `hierarchy` has, their cells and vertices numbered as there.
/// @throws std::runtime_error that says where the hierarchy is not what it should be.
std::vector<Grid> grids_like(const LinkedOctree& body, const Hierarchy& hierarchy,
                             bool duplicate_cells = true);

/// The cell of `coarse` that holds the leaves of each cell of `fine`.
std::vector<int> parents(const Grid& fine, const Grid& coarse);

/// Per vertex of `fine`: its value from the vertices of `coarse`, by the place of its grid point in
/// the coarse cells around it.
/// @throws std::runtime_error if two cells around a vertex do not agree.
std::vector<Weights> prolongation(const Grid& fine, const Grid& coarse);

}  // namespace kerf::oracle
