// SPDX-License-Identifier: MIT
#include "app/figures.hpp"

#include <algorithm>
#include <map>
#include <tuple>

#include "core/body/pieces.hpp"

namespace kerf {
namespace {

double cube(std::int32_t side) {
  const auto s = static_cast<double>(side);
  return s * s * s;
}

/// The corners of a cell at rest.
std::array<Vec3d, 8> rest_corners(const Lattice& lattice, const Vec3i& corner, std::int32_t side) {
  std::array<Vec3d, 8> out;
  for (std::size_t k = 0; k < 8; ++k) {
    Vec3i p = corner;
    for (std::size_t d = 0; d < 3; ++d) p[d] += (k >> d & 1) != 0 ? side : 0;
    out[k] = lattice.point(p);
  }
  return out;
}

/// What the finest cells say of the cells above them.
struct Content {
  std::vector<double> volume;       // in finest cells
  std::vector<std::int32_t> piece;  // of the first leaf
};

Content content_of(const LinkedOctree& body, const Hierarchy& hierarchy, std::size_t level) {
  Content content;
  content.piece = label_pieces(body, nullptr);
  for (const std::uint8_t log2 : hierarchy.levels[0].size_log2)
    content.volume.push_back(cube(1 << log2));
  for (std::size_t fine = 0; fine < level; ++fine) {
    const Level& coarse = hierarchy.levels[fine + 1];
    Content above;
    for (std::int32_t p = 0; p < coarse.cells(); ++p) {
      const auto children = coarse.children_of(p);
      above.piece.push_back(content.piece[static_cast<std::size_t>(children[0])]);
      above.volume.push_back(0);
      for (const std::int32_t c : children)
        above.volume.back() += content.volume[static_cast<std::size_t>(c)];
    }
    content = std::move(above);
  }
  return content;
}

/// How many cells share each one's place, and which of them it is.
void count_copies(const Level& level, LevelFigure& out) {
  std::map<std::tuple<std::uint8_t, Vec3i>, std::int32_t> cells_at;
  const auto place = [&](std::size_t c) { return std::tuple(level.size_log2[c], level.corner[c]); };
  for (std::size_t c = 0; c < level.corner.size(); ++c) out.copy.push_back(cells_at[place(c)]++);
  for (std::size_t c = 0; c < level.corner.size(); ++c) out.copies.push_back(cells_at[place(c)]);
}

/// Both ends of a disconnected link, as far as they are inside.
void add_ends(const LinkedOctree& body, LinkKey key, const LinkCut& link, LinksFigure& out) {
  const Lattice& lattice = body.lattice();
  const int axis = Lattice::link_axis(key);
  for (int end = 0; end < 2; ++end) {
    Vec3i cell = lattice.link_lower(key);
    cell[static_cast<std::size_t>(axis)] += end;
    if (body.leaf_at(cell) < 0) continue;
    const Vec3d centre = lattice.center(cell);
    Vec3d point = centre;
    const double distance = link.end[end].distance;
    point[axis] += end == 0 ? distance : -distance;
    out.segments.push_back({centre, point});
    out.state.push_back(link.end[end].cut_id > 0 ? LinkState::cut : LinkState::surface);
    out.cut_id.push_back(link.end[end].cut_id);
  }
}

}  // namespace

LevelFigure level_figure(const LinkedOctree& body, const Hierarchy& hierarchy, std::size_t level,
                         std::span<const Vec3d> corners) {
  const Level& cells = hierarchy.levels[level];
  Content content = content_of(body, hierarchy, level);
  LevelFigure out;
  out.piece = std::move(content.piece);
  for (std::size_t c = 0; c < cells.corner.size(); ++c) {
    const std::int32_t side = 1 << cells.size_log2[c];
    for (const Vec3d& p : rest_corners(body.lattice(), cells.corner[c], side)) {
      if (level == 0) out.displacement.push_back(corners[out.points.size()] - p);
      out.points.push_back(p);
    }
    out.size.push_back(side);
    out.fill.push_back(content.volume[c] / cube(side));
  }
  count_copies(cells, out);
  return out;
}

LinksFigure links_figure(const LinkedOctree& body) {
  LinksFigure out;
  const NodeList& leaves = body.leaves();
  const auto centre = [&](std::int32_t leaf) {
    const auto& node =
        body.nodes()[static_cast<std::size_t>(leaves[static_cast<std::size_t>(leaf)])];
    const auto corners = rest_corners(body.lattice(), node.corner, 1 << node.size_log2);
    return 0.5 * (corners[0] + corners[7]);
  };
  for (const LeafLink& link : leaf_links(body)) {
    out.segments.push_back({centre(link.a), centre(link.b)});
    out.state.push_back(LinkState::connected);
    out.cut_id.push_back(0);
  }
  std::vector<LinkKey> keys;
  for (const auto& [key, link] : body.records()) keys.push_back(key);
  std::sort(keys.begin(), keys.end());
  for (const LinkKey key : keys) add_ends(body, key, body.records().at(key), out);
  return out;
}

}  // namespace kerf
