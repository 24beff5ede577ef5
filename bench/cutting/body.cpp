// SPDX-License-Identifier: MIT
#include "bench/cutting/body.hpp"

#include <algorithm>
#include <cmath>

#include "core/base/error.hpp"
#include "core/base/timer.hpp"
#include "core/body/cut.hpp"

namespace kerf::cutting {
namespace {

constexpr int kOctreeLevels = 2;
// Links at a quarter of the cells tell which parts a cell falls into; thinner slivers are missed.
constexpr int kPartLevels = 2;

void fill_values(CutBody& out, const Elastic& material) {
  out.hierarchy.poisson = {material.poisson};
  for (const std::uint8_t log2 : out.level().size_log2) {
    const double side = out.hierarchy.spacing * (1 << log2);
    out.hierarchy.values.push_back(
        {material.young * side, material.density * std::pow(side, 3), 0});
  }
}

void cut_all(LinkedOctree& octree, const Shape& shape) {
  std::int32_t id = 0;
  for (const TriangleMesh& blade : shape.blades) cut(octree, {}, blade, ++id);
}

CutBody link_body(const Shape& shape, int refinement) {
  CutBody out;
  const Timer whole;
  out.lattice = make_lattice(shape.box, shape.cells, refinement);
  LinkedOctree octree(voxelise(*make_box(shape.box), out.lattice), refinement);
  out.octree_seconds = whole.seconds();
  const Timer blades;
  cut_all(octree, shape);
  out.cut_seconds = blades.seconds();
  const AddTime levels(out.level_seconds);
  out.hierarchy.levels.push_back(finest_level(octree));
  out.hierarchy.spacing = out.lattice.spacing;
  out.hierarchy.cut = !shape.blades.empty();
  out.octree_bytes = octree.bytes();
  return out;
}

// Finest cells that a triangle of a blade meets hold nothing.
std::size_t remove_cells(const Shape& shape, Voxels& voxels) {
  const Lattice& lattice = voxels.lattice;
  std::size_t removed = 0;
  for (const TriangleMesh& blade : shape.blades)
    for (const auto& corners : blade.triangles) {
      Vec3d triangle[3];
      Box3 around;
      for (std::size_t i = 0; i < 3; ++i) {
        triangle[i] = blade.points[static_cast<std::size_t>(corners[i])];
        around.add(triangle[i]);
      }
      Vec3i low, high;
      for (int d = 0; d < 3; ++d) {
        const auto k = static_cast<std::size_t>(d);
        const auto at = [&](double x) {
          return std::floor((x - lattice.origin[d]) / lattice.spacing);
        };
        low[k] = static_cast<std::int32_t>(std::max(0.0, at(around.lo[d])));
        high[k] = static_cast<std::int32_t>(std::min(lattice.size[k] - 1.0, at(around.hi[d])));
      }
      for (Vec3i c = low; c[2] <= high[2]; ++c[2])
        for (c[1] = low[1]; c[1] <= high[1]; ++c[1])
          for (c[0] = low[0]; c[0] <= high[0]; ++c[0]) {
            std::uint8_t& label = voxels.label[lattice.index(c)];
            const Vec3d at = lattice.point(c);
            const Vec3d side{lattice.spacing, lattice.spacing, lattice.spacing};
            if (label == 0 || !meets(triangle, {at, at + side})) continue;
            label = 0;
            ++removed;
          }
    }
  return removed;
}

CutBody deleted_body(const Shape& shape) {
  CutBody out;
  const Timer whole;
  out.lattice = make_lattice(shape.box, shape.cells, 0);
  Voxels voxels = voxelise(*make_box(shape.box), out.lattice);
  out.octree_seconds = whole.seconds();
  const Timer blades;
  const std::size_t removed = remove_cells(shape, voxels);
  out.cut_seconds = blades.seconds();
  const Timer build;
  const LinkedOctree octree(voxels, 0);
  out.octree_seconds += build.seconds();
  const AddTime levels(out.level_seconds);
  out.hierarchy.levels.push_back(finest_level(octree));
  out.hierarchy.spacing = out.lattice.spacing;
  out.hierarchy.cut = removed > 0;
  out.octree_bytes = octree.bytes();
  out.removed = static_cast<double>(removed) / static_cast<double>(out.lattice.cells());
  return out;
}

// The coarse cells of a hierarchy over finer links are the parts of the cells, joined as they
// should be: such a level, in units of its own cells, is the body.
CutBody duplicated_body(const Shape& shape) {
  Shape fine = shape;
  fine.cells <<= kPartLevels;
  CutBody out = link_body(fine, kPartLevels);
  const AddTime levels(out.level_seconds);
  build_coarse_levels(out.hierarchy, {1, kPartLevels + 1, true});
  ensures(out.hierarchy.levels.size() == kPartLevels + 1, "parts of cells need all levels below");
  Level level = std::move(out.hierarchy.levels.back());
  const auto scaled = [](Vec3i p) {
    for (std::int32_t& x : p) x >>= kPartLevels;
    return p;
  };
  for (std::vector<LatticePoint>* points : {&level.corner, &level.point})
    for (LatticePoint& p : *points) p = scaled(p);
  out.lattice.size = scaled(out.lattice.size);
  for (std::uint8_t& log2 : level.size_log2) {
    ensures(log2 == kPartLevels, "cells of one size alone are left");
    log2 = 0;
  }
  std::fill(level.fold.begin(), level.fold.end(), std::uint16_t{0});
  for (std::int32_t c = 0; c < level.cells(); ++c)  // the octant, as in a level that was built
    for (int d = 0; d < 3; ++d)
      level.fold[c] =
          static_cast<std::uint16_t>(level.fold[c] | (level.corner[c][d] & 1) << (8 + d));
  level.child_begin.clear();
  level.children.clear();
  level.child_rows = {};
  out.lattice.spacing *= 1 << kPartLevels;
  out.hierarchy.spacing = out.lattice.spacing;
  out.hierarchy.levels.clear();
  out.hierarchy.levels.push_back(std::move(level));
  return out;
}

CutBody body_of(const Shape& shape, Method method) {
  switch (method) {
    case Method::octree:
      return link_body(shape, kOctreeLevels);
    case Method::deletion:
      return deleted_body(shape);
    case Method::virtual_nodes:
      return duplicated_body(shape);
    case Method::uniform:
      break;
  }
  return link_body(shape, 0);
}

}  // namespace

const std::vector<MethodInfo>& methods() {
  static const std::vector<MethodInfo> all{
      {Method::uniform, "uniform", "a grid of equal cells; a blade disconnects links"},
      {Method::octree, "octree",
       "the same, two levels of larger cells inside; a blade refines them"},
      {Method::deletion, "deletion", "a grid of equal cells without those that a blade meets"},
      {Method::virtual_nodes, "virtual-nodes",
       "a grid of equal cells; one that falls apart is there once for each part, at full "
       "stiffness"}};
  return all;
}

const char* name_of(Method method) {
  for (const MethodInfo& info : methods())
    if (info.method == method) return info.name;
  return "";
}

CutBody make_body(const Shape& shape, Method method) {
  CutBody out = body_of(shape, method);
  fill_values(out, shape.material);
  return out;
}

// By separating axes: the three of the box, the normal, and the nine products of edges.
bool meets(const Vec3d (&triangle)[3], const Box3& box) {
  const Vec3d middle = 0.5 * (box.lo + box.hi), half = 0.5 * box.extent();
  Vec3d p[3];
  for (int i = 0; i < 3; ++i) p[i] = triangle[i] - middle;
  const auto separates = [&](const Vec3d& axis) {
    const double a = dot(axis, p[0]), b = dot(axis, p[1]), c = dot(axis, p[2]);
    const double reach =
        half.x * std::abs(axis.x) + half.y * std::abs(axis.y) + half.z * std::abs(axis.z);
    return std::min({a, b, c}) >= reach || std::max({a, b, c}) <= -reach;
  };
  const auto is_zero = [](const Vec3d& v) { return dot(v, v) == 0; };
  const Vec3d edges[3] = {p[1] - p[0], p[2] - p[1], p[0] - p[2]};
  const Vec3d axes[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  for (const Vec3d& axis : axes) {
    if (separates(axis)) return false;
    for (const Vec3d& edge : edges) {
      const Vec3d across = cross(axis, edge);
      if (!is_zero(across) && separates(across)) return false;
    }
  }
  const Vec3d normal = cross(edges[0], edges[1]);
  return is_zero(normal) || !separates(normal);
}

}  // namespace kerf::cutting
