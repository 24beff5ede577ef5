// SPDX-License-Identifier: MIT
//
// What a method that draws the surface must do.
#pragma once

#include <memory>
#include <span>

#include "core/body/linked_octree.hpp"
#include "core/surface/dual_grid.hpp"
#include "core/surface/triangle_store.hpp"

namespace kerf {

/// Builds and rebuilds the surface in dual cells. Both methods walk the same sheets of the same
/// table (dual_pattern.hpp) and differ in where they put vertices. Links are disconnected and never
/// joined again, so what a dual cell needs only grows.
class SurfaceBuilder {
 public:
  virtual ~SurfaceBuilder() = default;
  /// Brings `store` up to date in the dual cells around `points` (ascending, each once). All links
  /// whose state or record changed have their four dual cells among them.
  virtual void rebuild(const LinkedOctree& body, std::span<const GridKey> points,
                       TriangleStore& store) = 0;
  virtual std::size_t bytes() const = 0;
};

/// One vertex for each sheet of each dual cell, two triangles for each side of a cut link.
/// Source  Ju, Losasso, Schaefer, Warren 2002 [JLSW02]; Wu, Dick, Westermann 2011 [WDW11], as
///         [WWD15] section 2.3.2 tells it.
std::unique_ptr<SurfaceBuilder> make_dual_contouring();

/// Two vertices on each cut link, and in each dual cell a fan around one vertex for each sheet.
/// Source  Pietroni, Ganovelli, Cignoni, Scopigno 2009 [PGCS09] as told in [DGW11] section 7.
std::unique_ptr<SurfaceBuilder> make_splitting_cubes();

/// The disconnected links of the dual cells at `points` with material at an end, ascending.
std::vector<LinkKey> links_around(const LinkedOctree& body, std::span<const GridKey> points,
                                  std::span<const DualCell> cells);

/// The grid edges that end in one of `points`, as 3 point_key + axis of their low end, ascending.
std::vector<GridKey> edges_around(const Lattice& lattice, std::span<const GridKey> points);

/// The normal of a side of a link, out of the material.
inline Vec3f outward_normal(const LinkSide& side) {
  const double sign = side.facing ? 1 : -1;
  return {static_cast<float>(sign * side.normal.x), static_cast<float>(sign * side.normal.y),
          static_cast<float>(sign * side.normal.z)};
}

}  // namespace kerf
