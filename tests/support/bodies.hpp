// SPDX-License-Identifier: MIT
//
// Small bodies for tests, built cell by cell without a solid.
#pragma once

#include <utility>
#include <vector>

#include "core/body/voxelise.hpp"

namespace kerf::test {

inline Vec3i plus(Vec3i c, int axis, int by) {
  c[static_cast<std::size_t>(axis)] += by;
  return c;
}

/// A lattice whose origin and spacing are not round, so that nothing holds by luck.
inline Lattice lattice_of(const Vec3i& size) { return {{0.31, -0.17, 0.05}, 0.07, size}; }

/// A crossing halfway, normal along `axis`.
inline LinkCut halfway(const Lattice& lattice, int axis, std::int32_t cut_id = 0) {
  LinkEnd end;
  end.distance = static_cast<float>(0.5 * lattice.spacing);
  end.normal[axis] = 1;
  end.cut_id = cut_id;
  return {{end, end}};
}

/// `label(cell)` gives 0 outside, 1 + material inside; `crossed(lower, axis)` tells of a link
/// between two inside cells whether the surface crosses it. Every link to the outside is crossed
/// halfway.
template <class Label, class Crossed>
Voxels make_voxels(const Lattice& lattice, const Label& label, const Crossed& crossed) {
  Voxels voxels;
  voxels.lattice = lattice;
  for (std::size_t i = 0; i < lattice.cells(); ++i)
    voxels.label.push_back(static_cast<std::uint8_t>(label(lattice.cell(i))));
  const auto inside = [&](const Vec3i& c) {
    return lattice.inside(c) && voxels.label[lattice.index(c)] != 0;
  };
  for (Vec3i c{0, 0, -1}; c[2] < lattice.size[2]; ++c[2])
    for (c[1] = -1; c[1] < lattice.size[1]; ++c[1])
      for (c[0] = -1; c[0] < lattice.size[0]; ++c[0])
        for (int axis = 0; axis < 3; ++axis) {
          const bool a = inside(c), b = inside(plus(c, axis, 1));
          if (a != b || (a && crossed(c, axis)))
            voxels.crossings.emplace_back(lattice.link_key(c, axis), halfway(lattice, axis));
        }
  return voxels;
}

template <class Label>
Voxels make_voxels(const Lattice& lattice, const Label& label) {
  return make_voxels(lattice, label, [](const Vec3i&, int) { return false; });
}

/// A box that fills its lattice.
inline Voxels box_body(const Vec3i& size) {
  return make_voxels(lattice_of(size), [](const Vec3i&) { return 1; });
}

/// A ball that fits its lattice of n^3 cells.
inline Voxels ball_body(int n) {
  return make_voxels(lattice_of({n, n, n}), [n](const Vec3i& c) {
    double r2 = 0;
    for (const std::int32_t k : c) r2 += (k + 0.5 - 0.5 * n) * (k + 0.5 - 0.5 * n);
    return r2 < 0.25 * n * n ? 1 : 0;
  });
}

/// A box of `size` that is slit from the top, z >= size.z / 4, between x = size.x / 2 - 1 and the
/// next cell: two limbs with a gap thinner than a cell, joined at the bottom.
inline Voxels two_limb_body(const Vec3i& size) {
  return make_voxels(
      lattice_of(size), [](const Vec3i&) { return 1; },
      [size](const Vec3i& c, int axis) {
        return axis == 0 && c[0] == size[0] / 2 - 1 && c[2] >= size[2] / 4;
      });
}

}  // namespace kerf::test
