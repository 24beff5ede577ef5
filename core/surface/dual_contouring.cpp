// SPDX-License-Identifier: MIT
//
// Dual contouring of the links.
//
// Layout  Each side of a disconnected link is a patch: a quadrilateral whose corners are the
//         vertices of the four dual cells around the link, on the sheets of that side.
//
//              q3-----m-----q2      Patches are split along a diagonal. Where that would put four
//               |  \  |  /  |       triangles on one edge, the edge gets a vertex of its own for
//               |   - c -   |       each arc (m) or each side of the link (c), and the patch
//               |  /     \  |       becomes a fan around its middle c.
//              q0----------q1
//
//         That happens where one sheet comes twice to the same two grid points: around thin walls
//         and tunnels, and at cuts a cell wide.
//
// Source  [JLSW02], [WWD15] section 2.3.2; the fans are ours, so that the surface is a manifold.
#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "core/base/error.hpp"
#include "core/surface/surface_builder.hpp"

namespace kerf {
namespace {

/// The vertices of a dual cell, by sheet.
struct DualVertices {
  DualCell cell;
  std::array<std::int32_t, kMostSheets> vertex{-1, -1, -1, -1, -1, -1, -1, -1};
};

/// One side of a link: its triangles, and the vertex in their middle, if there is one.
struct Patch {
  std::array<std::int32_t, 8> triangle{-1, -1, -1, -1, -1, -1, -1, -1};
  std::int32_t middle = -1;
};

/// What a patch is made from.
struct Outline {
  bool present = false;
  std::array<std::int32_t, 4> corner{};  // vertices, counter-clockwise from outside
  std::array<std::int32_t, 4> mid{};     // of the edge from corner i to the next, or -1
  LinkSide side;
  Vec3d hit{};  // m
  int diagonal = 0;
  bool fan = false;
};

// Kinds of vertices, for keys that are unique and the same whatever was built before.
enum class Kind : std::uint64_t { sheet, edge, patch };
std::uint64_t vertex_key(Kind kind, std::uint64_t number) {
  return static_cast<std::uint64_t>(kind) << 62 | number;
}

/// Whether at least two arcs of material lie around a face of a dual cell; once so, always so.
bool has_arcs(const DualCell& cell, int axis, int side) {
  const std::array<int, 4> ring = dual_face(axis, side);
  int arcs = 0;
  for (int k = 0; k < 4; ++k)
    if ((cell.connected >> dual_link(ring[k], dual_face_axis(axis, k)) & 1) == 0 &&
        cell.is_present(ring[k]))
      ++arcs;
  return arcs >= 2;
}

/// The grid edges from `points` with at least two arcs of material around them, ascending.
std::vector<GridKey> edges_of_arcs(const Lattice& lattice, std::span<const GridKey> points,
                                   std::span<const DualCell> cells) {
  std::vector<GridKey> edges;
  for (std::size_t i = 0; i < points.size(); ++i)
    for (int axis = 0; axis < 3; ++axis)
      for (int side = 0; side < 2; ++side) {
        if (!has_arcs(cells[i], axis, side)) continue;
        const Vec3i low = shifted(key_point(lattice, points[i]), axis, side - 1);
        edges.push_back(3 * point_key(lattice, low) + static_cast<GridKey>(axis));
      }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  return edges;
}

class DualContouring final : public SurfaceBuilder {
 public:
  void rebuild(const LinkedOctree& body, std::span<const GridKey> points,
               TriangleStore& store) override;
  std::size_t bytes() const override {
    constexpr std::size_t kOfANode = 2 * sizeof(void*);
    return duals_.size() * (sizeof(DualVertices) + sizeof(GridKey) + kOfANode) +
           patches_.size() * (2 * sizeof(Patch) + sizeof(LinkKey) + kOfANode) +
           mids_.size() * (4 * sizeof(std::int32_t) + sizeof(GridKey) + kOfANode);
  }

 private:
  void remove_patches(std::span<const LinkKey> links);
  void place_vertices(GridKey key, const DualCell& cell);
  void place_mids(GridKey edge);
  std::int32_t add_mid(GridKey edge, int arc, int from, int to);
  Outline outline(const Vec3i& lower, int axis, int end, const LinkCut& cut) const;
  std::int32_t mid_of(const Vec3i& p, const Vec3i& q, const Vec3i& cell) const;
  void choose_diagonals(Outline (&sides)[2], int axis) const;
  int better_diagonal(const Outline& o, int axis) const;
  void add_patch(LinkKey link, const Vec3i& lower, int axis, int end, const Outline& o);
  std::int32_t vertex_at(const Vec3i& p, const Vec3i& cell, int axis) const;

  std::unordered_map<GridKey, DualVertices> duals_;
  std::unordered_map<LinkKey, std::array<Patch, 2>> patches_;
  /// Per grid edge that needs them: for each octant around it, the vertex of its arc, or -1.
  std::unordered_map<GridKey, std::array<std::int32_t, 4>> mids_;
  // Of the call of `rebuild` under way.
  const LinkedOctree* body_ = nullptr;
  TriangleStore* store_ = nullptr;
};

void DualContouring::rebuild(const LinkedOctree& body, std::span<const GridKey> points,
                             TriangleStore& store) {
  body_ = &body;
  store_ = &store;
  const Lattice& lattice = body.lattice();
  std::vector<DualCell> cells;
  cells.reserve(points.size());
  for (const GridKey key : points) cells.push_back(read_dual_cell(body, key_point(lattice, key)));
  const std::vector<LinkKey> links = links_around(body, points, cells);
  if (duals_.empty()) {
    duals_.reserve(points.size() + points.size() / 2);
    patches_.reserve(links.size() + links.size() / 2);
  }

  remove_patches(links);
  for (std::size_t i = 0; i < points.size(); ++i) place_vertices(points[i], cells[i]);
  for (const GridKey edge : edges_of_arcs(lattice, points, cells)) place_mids(edge);
  for (const LinkKey link : links) {
    const Vec3i lower = lattice.link_lower(link);
    const int axis = Lattice::link_axis(link);
    const LinkCut* cut = body.record(lower, axis);
    ensures(cut != nullptr, "a disconnected link has no record");
    Outline sides[2] = {outline(lower, axis, 0, *cut), outline(lower, axis, 1, *cut)};
    choose_diagonals(sides, axis);
    for (int end = 0; end < 2; ++end)
      if (sides[end].present) add_patch(link, lower, axis, end, sides[end]);
  }
}

void DualContouring::remove_patches(std::span<const LinkKey> links) {
  for (const LinkKey link : links) {
    const auto found = patches_.find(link);
    if (found == patches_.end()) continue;
    for (Patch& patch : found->second) {
      for (std::int32_t& t : patch.triangle) {
        if (t >= 0) store_->remove_triangle(t);
        t = -1;
      }
      if (patch.middle >= 0) store_->remove_vertex(patch.middle);
      patch.middle = -1;
    }
  }
}

/// The vertices on the sheets of one dual cell. Their triangles are gone already.
void DualContouring::place_vertices(GridKey key, const DualCell& cell) {
  const Lattice& lattice = body_->lattice();
  const Vec3i p = key_point(lattice, key);
  DualVertices& dual = duals_[key];
  for (int s = 0; s < kMostSheets; ++s)
    if (dual.vertex[s] >= 0 && (s >= cell.pattern().sheets || !cell.has_sheet(s))) {
      store_->remove_vertex(dual.vertex[s]);
      dual.vertex[s] = -1;
    }
  dual.cell = cell;
  for (int s = 0; s < cell.pattern().sheets; ++s) {
    if (!cell.has_sheet(s)) continue;
    const Vec3d x = sheet_place(*body_, p, cell, s);
    const int octant = nearest_octant(cell.pattern().octants[s], x);
    const TriangleStore::Vertex vertex{lattice.point(p) + lattice.spacing * x,
                                       octant_cell(p, octant)};
    if (dual.vertex[s] < 0)
      dual.vertex[s] = store_->add_vertex(
          vertex_key(Kind::sheet, kMostSheets * key + static_cast<GridKey>(s)), vertex);
    else
      store_->set_vertex(dual.vertex[s], vertex);
  }
}

/// The vertex at grid point p of the sheet that passes the link of `cell` along `axis`.
std::int32_t DualContouring::vertex_at(const Vec3i& p, const Vec3i& cell, int axis) const {
  const auto found = duals_.find(point_key(body_->lattice(), p));
  ensures(found != duals_.end(), "a disconnected link has a grid point without a dual cell");
  const int corner = dual_corner(octant_of(p, cell), axis);
  const std::uint8_t sheet = found->second.cell.pattern().sheet[static_cast<std::size_t>(corner)];
  ensures(sheet != kNoSheet && found->second.vertex[sheet] >= 0,
          "a side of a disconnected link lies on no sheet");
  return found->second.vertex[sheet];
}

/// Gives each arc around a grid edge a vertex of its own if several would join the same two
/// vertices.
void DualContouring::place_mids(GridKey edge) {
  const auto old = mids_.find(edge);
  if (old != mids_.end()) {
    for (int k = 0; k < 4; ++k) {
      const std::int32_t v = old->second[static_cast<std::size_t>(k)];
      if (v >= 0 &&
          std::find(old->second.begin(), old->second.begin() + k, v) == old->second.begin() + k)
        store_->remove_vertex(v);
    }
    mids_.erase(old);
  }
  const Lattice& lattice = body_->lattice();
  const int axis = static_cast<int>(edge % 3);
  const auto here = duals_.find(edge / 3);
  if (here == duals_.end()) return;
  const DualCell& cell = here->second.cell;
  const std::array<int, 4> ring = dual_face(axis, 1);
  // Arcs: from[a], to[a] are places in the ring; an arc of absent cells is none.
  int from[4], to[4], arcs = 0;
  for (int k = 0; k < 4; ++k) {
    const auto cut_after = [&](int i) {
      return (cell.connected >> dual_link(ring[i % 4], dual_face_axis(axis, i % 4)) & 1) == 0;
    };
    if (!cut_after(k + 3) || !cell.is_present(ring[k])) continue;
    from[arcs] = to[arcs] = k;
    while (!cut_after(to[arcs])) ++to[arcs];
    ++arcs;
  }
  if (arcs < 2) return;

  const Vec3i p = key_point(lattice, edge / 3), q = shifted(p, axis, 1);
  std::int32_t at_p[4], at_q[4];
  for (int a = 0; a < arcs; ++a) {
    const Vec3i c = octant_cell(p, ring[to[a] % 4]);
    at_p[a] = vertex_at(p, c, dual_face_axis(axis, to[a] % 4));
    at_q[a] = vertex_at(q, c, dual_face_axis(axis, to[a] % 4));
  }
  std::array<std::int32_t, 4> mids{-1, -1, -1, -1};
  bool any = false;
  for (int a = 0; a < arcs; ++a)
    for (int b = 0; b < arcs; ++b) {
      if (a == b || at_p[a] != at_p[b] || at_q[a] != at_q[b]) continue;
      const std::int32_t v = add_mid(edge, a, from[a], to[a]);
      for (int k = from[a]; k <= to[a]; ++k) mids[static_cast<std::size_t>(k % 4)] = v;
      any = true;
      break;
    }
  if (any) mids_.emplace(edge, mids);
}

/// In the face of four cells around the edge: the place that fits the surface points at the two
/// ends of the arc from ring place `from` to `to`; half-way between them if they lie in one plane.
std::int32_t DualContouring::add_mid(GridKey edge, int arc, int from, int to) {
  const Lattice& lattice = body_->lattice();
  const int axis = static_cast<int>(edge % 3);
  const Vec3i p = key_point(lattice, edge / 3);
  const std::array<int, 4> ring = dual_face(axis, 1);
  SurfaceHit hits[2] = {
      corner_hit(*body_, p, dual_corner(ring[from], dual_face_axis(axis, (from + 3) % 4))),
      corner_hit(*body_, p, dual_corner(ring[to % 4], dual_face_axis(axis, to % 4)))};
  for (SurfaceHit& hit : hits) hit.point[axis] = hit.normal[axis] = 0;
  Vec3d x = fit_vertex(hits);
  x[axis] = 0.5;
  unsigned octants = 0;
  for (int k = from; k <= to; ++k) octants |= 1u << ring[k % 4];
  return store_->add_vertex(
      vertex_key(Kind::edge, 4 * edge + static_cast<GridKey>(arc)),
      {lattice.point(p) + lattice.spacing * x, octant_cell(p, nearest_octant(octants, x))});
}

std::int32_t DualContouring::mid_of(const Vec3i& p, const Vec3i& q, const Vec3i& cell) const {
  if (mids_.empty()) return -1;
  const int axis = p[0] != q[0] ? 0 : p[1] != q[1] ? 1 : 2;
  const Vec3i& low = p < q ? p : q;
  const auto found = mids_.find(3 * point_key(body_->lattice(), low) + static_cast<GridKey>(axis));
  if (found == mids_.end()) return -1;
  const std::array<int, 4> ring = dual_face(axis, 1);
  const auto k = std::find(ring.begin(), ring.end(), octant_of(low, cell)) - ring.begin();
  return found->second[static_cast<std::size_t>(k)];
}

Outline DualContouring::outline(const Vec3i& lower, int axis, int end, const LinkCut& cut) const {
  Outline out;
  const Lattice& lattice = body_->lattice();
  const Vec3i cell = shifted(lower, axis, end);
  if (body_->leaf_at(cell) < 0) return out;
  out.present = true;
  out.side = link_side(cut, axis, end, lattice.spacing);
  out.hit = lattice.center(lower) + lattice.spacing * out.side.point;
  std::array<Vec3i, 4> points = face_points(lower, axis);
  if (end == 1) std::reverse(points.begin() + 1, points.end());
  for (std::size_t i = 0; i < 4; ++i) {
    out.corner[i] = vertex_at(points[i], cell, axis);
    out.mid[i] = mid_of(points[i], points[(i + 1) % 4], cell);
    out.fan = out.fan || out.mid[i] >= 0;
  }
  return out;
}

/// The diagonal (0: from corner 0, 1: from corner 1) whose triangles pass nearer to the surface
/// point on the link, which lies between all four corners seen along the link.
int DualContouring::better_diagonal(const Outline& o, int axis) const {
  const int u = (axis + 1) % 3, v = (axis + 2) % 3;
  double miss[2] = {0, 0};
  for (std::size_t diagonal = 0; diagonal < 2; ++diagonal) {
    double least = HUGE_VAL;
    for (std::size_t half = 0; half < 2; ++half) {
      Vec3d x[3];
      for (std::size_t k = 0; k < 3; ++k)
        x[k] = store_->reference[o.corner[(diagonal + 2 * half + k) % 4]] - o.hit;
      const Vec3d n = cross(x[1] - x[0], x[2] - x[0]);
      // The triangle holds the link if no edge has it on the wrong side.
      double inside = HUGE_VAL;
      for (int k = 0; k < 3; ++k) {
        const Vec3d &a = x[k], &b = x[(k + 1) % 3];
        inside = std::min(inside, (a[u] * b[v] - a[v] * b[u]) * (n[axis] < 0 ? -1 : 1));
      }
      constexpr double kRounding = 1e-9;
      const double h = body_->lattice().spacing;
      if (inside < -kRounding * h * h || n[axis] == 0) continue;
      least = std::min(least, std::abs(dot(n, x[0]) / n[axis]));
    }
    miss[diagonal] = least;
  }
  constexpr double kTie = 1e-6;  // of a cell: flat patches all take diagonal 0
  return miss[1] < miss[0] - kTie * body_->lattice().spacing ? 1 : 0;
}

void DualContouring::choose_diagonals(Outline (&sides)[2], int axis) const {
  for (Outline& o : sides)
    if (o.present && !o.fan) o.diagonal = better_diagonal(o, axis);
  if (!sides[0].present || !sides[1].present || sides[0].fan || sides[1].fan) return;
  // The sides go around opposite ways from the same corner, so their diagonals lie over each other.
  const auto shared = [&](int i) {
    return sides[0].corner[static_cast<std::size_t>(i)] ==
           sides[1].corner[static_cast<std::size_t>((4 - i) % 4)];
  };
  const auto blocked = [&](int diagonal) { return shared(diagonal) && shared(diagonal + 2); };
  const int diagonal = sides[0].diagonal;
  if (diagonal != sides[1].diagonal || !blocked(diagonal)) return;
  if (!blocked(1 - diagonal))
    sides[0].diagonal = sides[1].diagonal = 1 - diagonal;
  else
    sides[0].fan = sides[1].fan = true;
}

void DualContouring::add_patch(LinkKey link, const Vec3i& lower, int axis, int end,
                               const Outline& o) {
  constexpr std::uint64_t kMostTriangles = 8;
  Patch& patch = patches_[link][static_cast<std::size_t>(end)];
  const std::int32_t group = o.side.cut_id;
  const std::uint64_t number = 2 * link + static_cast<std::uint64_t>(end);
  std::size_t count = 0;
  const auto add = [&](std::int32_t a, std::int32_t b, std::int32_t c) {
    patch.triangle[count] = store_->add_triangle({a, b, c}, group, outward_normal(o.side),
                                                 kMostTriangles * number + count);
    ++count;
  };
  if (!o.fan) {
    const auto d = static_cast<std::size_t>(o.diagonal);
    add(o.corner[d], o.corner[d + 1], o.corner[d + 2]);
    add(o.corner[d], o.corner[d + 2], o.corner[(d + 3) % 4]);
    return;
  }
  patch.middle =
      store_->add_vertex(vertex_key(Kind::patch, number), {o.hit, shifted(lower, axis, end)});
  for (std::size_t i = 0; i < 4; ++i) {
    std::int32_t from = o.corner[i];
    if (o.mid[i] >= 0) {
      add(patch.middle, from, o.mid[i]);
      from = o.mid[i];
    }
    add(patch.middle, from, o.corner[(i + 1) % 4]);
  }
}

}  // namespace

std::unique_ptr<SurfaceBuilder> make_dual_contouring() {
  return std::make_unique<DualContouring>();
}

}  // namespace kerf
