// SPDX-License-Identifier: MIT
//
// A surface that changes in parts: vertices, triangles and normals in slots that are freed and used
// again, so that a change costs what it touches.
//
// Layout  structure of arrays, 32-bit indices, -1 for none.
//         Corner 3 t + k is corner k of triangle t. The corners at one vertex form a list,
//         ascending by (group, smooth part, order); the corners of a part follow each other and
//         share a normal:
//
//           first_corner[v] -> 3 t + k -> next_corner[3 t + k] -> ... -> -1
//           normal_of[3 t + k]: the normal of that corner
//
//         A free slot: a vertex without corners; a triangle of three indices 0. So the arrays may
//         be drawn as they are.
//         Sums over a list run in its order, which depends on the surface alone, not on its past.
#pragma once

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/geometry/vec.hpp"

namespace kerf {

class TriangleStore {
 public:
  /// Where a vertex is at rest, and the finest cell that it moves with.
  struct Vertex {
    Vec3d reference{};  ///< m
    Vec3i cell{};       ///< on the finest lattice; holds material
  };

  /// `key` names the vertex among all of a surface, for ever.
  std::int32_t add_vertex(std::uint64_t key, const Vertex& vertex);
  void set_vertex(std::int32_t v, const Vertex& vertex);
  /// Needs  v has no triangles.
  void remove_vertex(std::int32_t v);

  /// `group` tells which triangles around a vertex may share a normal: those of one cut id. They do
  /// if their surfaces, whose outward normal there is `true_normal`, bend by less than a crease; so
  /// the two sides of a cut do not, where they meet at its tip.
  /// `order` names the triangle among all of a surface, for ever.
  std::int32_t add_triangle(const std::array<std::int32_t, 3>& vertices, std::int32_t group,
                            const Vec3f& true_normal, std::uint64_t order);
  void remove_triangle(std::int32_t t);

  /// Hands out normals to the vertices whose triangles changed since the last call.
  void finish();
  /// Gives back what only changes ask for; nothing may be changed any more. Keys and orders go too
  /// where they are those of the slots and no slot is free, and groups where all are 0.
  void forget_changes();
  /// The vertices that were added, set or removed since the last call; some of them twice.
  std::vector<std::int32_t> take_moved() { return std::exchange(moved_, {}); }

  std::size_t vertex_slots() const { return first_corner.size(); }
  std::size_t triangle_slots() const { return triangles.size(); }
  std::size_t normal_slots() const { return normals_; }
  std::size_t vertices_used() const { return first_corner.size() - free_vertices_.size(); }
  std::size_t triangles_used() const { return triangles.size() - free_triangles_.size(); }
  std::size_t bytes() const;

  // Per vertex.
  std::vector<Vec3d> reference;    ///< m; empty once changes are forgotten
  std::vector<Vec3i> finest_cell;  ///< the same
  std::vector<std::uint64_t> vertex_key;
  std::vector<std::int32_t> first_corner;
  std::vector<std::uint8_t> used;  ///< 0: the slot is free
  // Per triangle.
  std::vector<std::array<std::int32_t, 3>> triangles;
  std::vector<std::int32_t> group;
  std::vector<Vec3f> true_normal;  ///< unit, outward, of the surface that the triangle stands for;
                                   ///< empty once changes are forgotten
  std::vector<std::uint64_t> order;
  // Per corner of a triangle.
  std::vector<std::int32_t> next_corner;
  std::vector<std::int32_t> normal_of;

 private:
  bool comes_before(std::int32_t a, std::int32_t b) const;
  void mark(std::int32_t v);
  void part_at_creases(std::int32_t v);
  std::int32_t take_normal(std::int32_t v);

  std::vector<std::int32_t> first_normal_;  // per vertex; a list through next_normal_
  std::vector<std::int32_t> next_normal_;   // per normal
  std::size_t normals_ = 0;
  std::vector<std::int32_t> free_vertices_, free_triangles_, free_normals_;
  std::vector<std::int32_t> changed_, moved_;
  std::vector<std::uint8_t> is_changed_;
  /// Of the vertex at hand: its corners, and the smooth part of its group that each belongs to.
  struct Around {
    std::int32_t corner, part;
  };
  std::vector<Around> around_;
  std::vector<std::int32_t> parts_;
};

}  // namespace kerf
