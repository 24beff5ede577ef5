// SPDX-License-Identifier: MIT
#include "core/surface/surface_builder.hpp"

#include <algorithm>

namespace kerf {
namespace {

void sort_unique(std::vector<std::uint64_t>& keys) {
  std::sort(keys.begin(), keys.end());
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
}

}  // namespace

std::vector<LinkKey> links_around(const LinkedOctree& body, std::span<const GridKey> points,
                                  std::span<const DualCell> cells) {
  const Lattice& lattice = body.lattice();
  std::vector<LinkKey> links;
  links.reserve(4 * points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3i p = key_point(lattice, points[i]);
    for (int axis = 0; axis < 3; ++axis)
      for (int o = 0; o < 8; ++o) {
        const int other = o | 1 << axis;
        if (o == other || (cells[i].connected >> dual_link(o, axis) & 1) != 0) continue;
        if (cells[i].is_present(o) || cells[i].is_present(other))
          links.push_back(lattice.link_key(octant_cell(p, o), axis));
      }
  }
  sort_unique(links);
  return links;
}

std::vector<GridKey> edges_around(const Lattice& lattice, std::span<const GridKey> points) {
  std::vector<GridKey> edges;
  edges.reserve(6 * points.size());
  for (const GridKey key : points) {
    const Vec3i p = key_point(lattice, key);
    for (int axis = 0; axis < 3; ++axis) {
      const auto d = static_cast<std::size_t>(axis);
      if (p[d] < lattice.size[d]) edges.push_back(3 * key + static_cast<GridKey>(axis));
      if (p[d] > 0)
        edges.push_back(3 * point_key(lattice, shifted(p, axis, -1)) + static_cast<GridKey>(axis));
    }
  }
  sort_unique(edges);
  return edges;
}

}  // namespace kerf
