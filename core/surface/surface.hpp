// SPDX-License-Identifier: MIT
//
// The surface of a linked body: built once, rebuilt where blades pass, moved by the body.
//
//   Surface surface(body, SurfaceMethod::dual_contouring);
//   surface.bind(body);                        // after construction and after each cut
//   surface.update(body, event);               // after a cut, before bind
//   backend.move_surface(surface.view(), u, ...)
//
// The surface lives on the finest level, where all disconnected links are. Those of the object's
// own surface and those of cuts are treated alike.
//
// Source  [DGW11] section 7; [WWD15] section 2.3.2; [WDW13] section 3.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <unordered_map>
#include <vector>

#include "core/body/cut.hpp"
#include "core/body/linked_octree.hpp"
#include "core/setup.hpp"
#include "core/surface/surface_mesh.hpp"
#include "core/surface/surface_view.hpp"
#include "core/surface/triangle_store.hpp"

namespace kerf {

class SurfaceBuilder;

class Surface {
 public:
  /// Needs  a method other than none.
  Surface(const LinkedOctree& body, SurfaceMethod method);
  ~Surface();
  Surface(Surface&&) noexcept;
  Surface& operator=(Surface&&) noexcept;

  /// Rebuilds the dual cells that a cut touched. `body` is the body after the cut.
  void update(const LinkedOctree& body, const CutEvent& event);
  /// Finds the cells of level 0, by their place in body.leaves(), that vertices move with. A vertex
  /// belongs to the nearest finest cell of its own component, and moves with the leaf around it.
  /// Looks only at vertices that changed since the last call, and at those in leaves that were
  /// split.
  void bind(const LinkedOctree& body);

  /// No blade is to come: gives back what only changes ask for. `update` and `bind` cannot be
  /// called any more.
  void forget_changes();

  const TriangleStore& store() const { return store_; }
  SurfaceView view() const;
  std::size_t bytes() const;

  /// Without free slots, in an order that depends on the surface alone.
  /// Shapes  positions: per slot of a vertex; normals: per slot of a normal; piece: per cell.
  SurfaceMesh mesh(std::span<const Vec3d> positions, std::span<const Vec3d> normals,
                   std::span<const std::int32_t> piece) const;

 private:
  void rebuild(const LinkedOctree& body, std::vector<std::uint64_t> points);
  void bind_vertex(const LinkedOctree& body, std::int32_t v);

  std::unique_ptr<SurfaceBuilder> builder_;
  TriangleStore store_;
  std::vector<BoundPoint> points_;
  std::size_t splits_seen_ = 0;
  /// Vertices that were bound to a leaf larger than a finest cell, by its number.
  std::unordered_map<std::int32_t, std::vector<std::int32_t>> in_larger_;
};

}  // namespace kerf
