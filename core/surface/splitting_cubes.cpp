// SPDX-License-Identifier: MIT
//
// Splitting cubes over the links.
//
// Layout  A sheet of a dual cell is a polygon through the surface points on its links, each at the
//         side of its corner; where the cut ends in a face between two corners, through the tip
//         there. The polygon is a fan around a vertex inside, which the normals place.
//
// Source  [PGCS09] as told in [DGW11] section 7: two vertices for each cut link, interior vertices
//         placed by the normals.
#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "core/base/error.hpp"
#include "core/surface/surface_builder.hpp"

namespace kerf {
namespace {

struct Sheet {
  std::int32_t inside = -1;             // the vertex in the middle
  std::vector<std::int32_t> triangles;  // of its fan
};

// Kinds of vertices, for keys that are unique and the same whatever was built before.
enum class Kind : std::uint64_t { link, tip, sheet };
std::uint64_t vertex_key(Kind kind, std::uint64_t number) {
  return static_cast<std::uint64_t>(kind) << 62 | number;
}

class SplittingCubes final : public SurfaceBuilder {
 public:
  void rebuild(const LinkedOctree& body, std::span<const GridKey> points,
               TriangleStore& store) override;
  std::size_t bytes() const override {
    constexpr std::size_t kOfANode = 2 * sizeof(void*);
    std::size_t sum = ends_.size() * (sizeof(LinkKey) + 2 * sizeof(std::int32_t) + kOfANode) +
                      tips_.size() * (sizeof(GridKey) + sizeof(std::int32_t) + kOfANode);
    for (const auto& [key, sheets] : sheets_) {
      sum += sizeof(GridKey) + sizeof(sheets) + kOfANode;
      for (const Sheet& sheet : sheets)
        sum += sizeof(Sheet) + sheet.triangles.capacity() * sizeof(std::int32_t);
    }
    return sum;
  }

 private:
  void remove_fans(GridKey key);
  void place_ends(LinkKey link);
  void place_tip(GridKey edge);
  void add_fans(GridKey key, const DualCell& cell);
  void add_fan(GridKey key, const DualCell& cell, int sheet, Sheet& out);
  std::int32_t end_of(const Vec3i& p, int corner) const;

  std::unordered_map<LinkKey, std::array<std::int32_t, 2>> ends_;  // vertices on the links
  std::unordered_map<GridKey, std::int32_t> tips_;                 // per grid edge
  std::unordered_map<GridKey, std::vector<Sheet>> sheets_;         // per dual cell
  // Of the call of `rebuild` under way.
  const LinkedOctree* body_ = nullptr;
  TriangleStore* store_ = nullptr;
};

void SplittingCubes::rebuild(const LinkedOctree& body, std::span<const GridKey> points,
                             TriangleStore& store) {
  body_ = &body;
  store_ = &store;
  const Lattice& lattice = body.lattice();
  std::vector<DualCell> cells;
  cells.reserve(points.size());
  for (const GridKey key : points) cells.push_back(read_dual_cell(body, key_point(lattice, key)));
  for (const GridKey key : points) remove_fans(key);
  for (const LinkKey link : links_around(body, points, cells)) place_ends(link);
  // A tip changes with the links around its edge, which both ends of the edge see.
  for (const GridKey edge : edges_around(lattice, points)) place_tip(edge);
  for (std::size_t i = 0; i < points.size(); ++i) add_fans(points[i], cells[i]);
}

void SplittingCubes::remove_fans(GridKey key) {
  const auto found = sheets_.find(key);
  if (found == sheets_.end()) return;
  for (const Sheet& sheet : found->second) {
    for (const std::int32_t t : sheet.triangles) store_->remove_triangle(t);
    if (sheet.inside >= 0) store_->remove_vertex(sheet.inside);
  }
  found->second.clear();
}

void SplittingCubes::place_ends(LinkKey link) {
  const Lattice& lattice = body_->lattice();
  const Vec3i lower = lattice.link_lower(link);
  const int axis = Lattice::link_axis(link);
  const LinkCut* cut = body_->record(lower, axis);
  ensures(cut != nullptr, "a disconnected link has no record");
  const auto [place, is_new] = ends_.try_emplace(link, std::array<std::int32_t, 2>{-1, -1});
  for (int end = 0; end < 2; ++end) {
    const Vec3i cell = shifted(lower, axis, end);
    if (body_->leaf_at(cell) < 0) continue;
    const LinkSide side = link_side(*cut, axis, end, lattice.spacing);
    const TriangleStore::Vertex vertex{lattice.center(lower) + lattice.spacing * side.point, cell};
    std::int32_t& v = place->second[static_cast<std::size_t>(end)];
    if (v >= 0)
      store_->set_vertex(v, vertex);
    else
      v = store_->add_vertex(vertex_key(Kind::link, 2 * link + static_cast<LinkKey>(end)), vertex);
  }
}

/// Where a cut ends in a face with one disconnected link: in the plane of its normal, half a cell
/// from the link unless the plane leaves the face before.
void SplittingCubes::place_tip(GridKey edge) {
  const Lattice& lattice = body_->lattice();
  const int axis = static_cast<int>(edge % 3);
  const Vec3i p = key_point(lattice, edge / 3);
  const DualCell cell = read_dual_cell(*body_, p);
  const std::array<int, 4> ring = dual_face(axis, 1);
  int cut_links = 0, at = 0;
  for (int k = 0; k < 4; ++k)
    if ((cell.connected >> dual_link(ring[k], dual_face_axis(axis, k)) & 1) == 0) {
      ++cut_links;
      at = k;
    }
  const auto old = tips_.find(edge);
  if (cut_links != 1) {
    if (old == tips_.end()) return;
    store_->remove_vertex(old->second);
    tips_.erase(old);
    return;
  }
  const int along = dual_face_axis(axis, at), across = 3 - axis - along;
  const SurfaceHit hit = corner_hit(*body_, p, dual_corner(ring[at], along));
  // To the middle of the face, or as far as the plane stays in it.
  Vec3d x = hit.point;
  const double step = -x[across];
  if (hit.normal[along] != 0) {
    const double rise = -step * hit.normal[across] / hit.normal[along];
    const double room = rise > 0 ? 0.5 - x[along] : 0.5 + x[along];
    const double part = std::abs(rise) > room ? room / std::abs(rise) : 1;
    x[across] += part * step;
    x[along] += part * rise;
  }
  unsigned octants = 0;
  for (const int o : ring) octants |= 1u << o;
  const TriangleStore::Vertex vertex{lattice.point(p) + lattice.spacing * x,
                                     octant_cell(p, nearest_octant(octants, x))};
  if (old == tips_.end())
    tips_.emplace(edge, store_->add_vertex(vertex_key(Kind::tip, edge), vertex));
  else
    store_->set_vertex(old->second, vertex);
}

std::int32_t SplittingCubes::end_of(const Vec3i& p, int corner) const {
  const int octant = corner / 3, axis = corner % 3, end = octant >> axis & 1;
  const LinkKey link = body_->lattice().link_key(octant_cell(p, octant & ~(1 << axis)), axis);
  return ends_.at(link)[static_cast<std::size_t>(end)];
}

void SplittingCubes::add_fans(GridKey key, const DualCell& cell) {
  std::vector<Sheet>& sheets = sheets_[key];
  sheets.resize(cell.pattern().sheets);
  for (int s = 0; s < cell.pattern().sheets; ++s)
    if (cell.has_sheet(s)) add_fan(key, cell, s, sheets[static_cast<std::size_t>(s)]);
}

void SplittingCubes::add_fan(GridKey key, const DualCell& cell, int sheet, Sheet& out) {
  constexpr std::uint64_t kMostTriangles = 2 * kDualCorners;
  const Lattice& lattice = body_->lattice();
  const DualPattern& pattern = cell.pattern();
  const Vec3i p = key_point(lattice, key);
  const auto s = static_cast<std::size_t>(sheet);
  const std::uint64_t number = kMostSheets * key + s;
  const Vec3d x = sheet_place(*body_, p, cell, sheet);
  out.inside = store_->add_vertex(vertex_key(Kind::sheet, number),
                                  {lattice.point(p) + lattice.spacing * x,
                                   octant_cell(p, nearest_octant(pattern.octants[s], x))});
  const auto add = [&](std::int32_t a, std::int32_t b, int corner) {
    const int octant = corner / 3, axis = corner % 3;
    const LinkCut* cut = body_->record(octant_cell(p, octant & ~(1 << axis)), axis);
    const LinkSide side = link_side(*cut, axis, octant >> axis & 1, lattice.spacing);
    out.triangles.push_back(store_->add_triangle({out.inside, a, b}, side.cut_id,
                                                 outward_normal(side),
                                                 kMostTriangles * number + out.triangles.size()));
  };
  int corner = pattern.first[s];
  do {
    const int next = pattern.next[static_cast<std::size_t>(corner)];
    const std::uint8_t tip = pattern.tip[static_cast<std::size_t>(corner)];
    if (tip == kNoSheet) {
      add(end_of(p, corner), end_of(p, next), corner);
    } else {
      const int axis = tip / 2;
      const GridKey edge = 3 * point_key(lattice, tip % 2 == 1 ? p : shifted(p, axis, -1)) +
                           static_cast<GridKey>(axis);
      const std::int32_t t = tips_.at(edge);
      add(end_of(p, corner), t, corner);
      add(t, end_of(p, next), next);
    }
    corner = next;
  } while (corner != pattern.first[s]);
}

}  // namespace

std::unique_ptr<SurfaceBuilder> make_splitting_cubes() {
  return std::make_unique<SplittingCubes>();
}

}  // namespace kerf
