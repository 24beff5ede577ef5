// SPDX-License-Identifier: MIT
#include "core/levels/update_vertices.hpp"

#include <algorithm>
#include <numeric>
#include <tuple>

#include "core/base/error.hpp"

namespace kerf {
namespace {

constexpr int kBetween = -1;  // in the middle of an edge or a face of a cell
constexpr int kApart = -2;    // outside

// Which corner of a cube point p is.
int corner_at(const Vec3i& corner, std::uint8_t size_log2, const Vec3i& p) {
  const int size = 1 << size_log2;
  int out = 0;
  bool between = false;
  for (int d = 0; d < 3; ++d) {
    const int offset = p[d] - corner[d];
    if (offset < 0 || offset > size) return kApart;
    if (offset == size)
      out |= 1 << d;
    else
      between = between || offset != 0;
  }
  return between ? kBetween : out;
}

Vec3i corner_point(const Level& level, std::int32_t cell, int corner) {
  Vec3i p = level.corner[cell];
  for (int d = 0; d < 3; ++d) p[d] += ((corner >> d) & 1) << level.size_log2[cell];
  return p;
}

class VertexUpdate {
 public:
  VertexUpdate(Level& level, ChangeLog& log)
      : level_(level),
        log_(log),
        rows_(level.incidence_begin, level.incidence, level.incidence_rows) {}

  void run(const Touched& touched) {
    for (const std::int32_t cell : touched.whole) {
      for (int i = 0; i < 8; ++i) collect(cell, i);
      set_octant(cell);
    }
    for (const Touched::Faces& t : touched.relinked)
      for (int i = 0; i < 8; ++i)
        if ((t.faces & faces_of_corner(i)) != 0) collect(t.cell, i);
    for (const Member& m : members_) log_.visited()[m.cell] = 0;
    number_vertices();
    for (const Component& c : components_)
      if (c.master < 0) place_vertex(c);
    for (const Component& c : components_)
      if (c.master >= 0) place_hanging(c);
    check_masters();
    rows_.pack_if_wasteful();
  }

 private:
  struct Member {
    std::int32_t cell;
    int corner;  // or kBetween
  };
  // Cells that a chain of links joins around a grid point.
  struct Component {
    Vec3i point;
    std::int32_t begin, end;       // of members_
    std::int32_t master = -1;      // a larger cell: then the corners of the others hang
    std::int32_t vertex = -1;      // the old one; then the one that it gets
    std::int32_t first_place = 0;  // the least 8 cell + corner
  };
  struct Hanging {
    std::int32_t cell, master;
    int corner;
  };

  static int faces_of_corner(int corner) {
    int faces = 0;
    for (int d = 0; d < 3; ++d) faces |= 1 << (2 * d + ((corner >> d) & 1));
    return faces;
  }
  bool visit(std::int32_t cell, int corner) {
    std::uint8_t& bits = log_.visited()[cell];
    if ((bits >> corner & 1) != 0) return false;
    bits = static_cast<std::uint8_t>(bits | 1 << corner);
    return true;
  }

  void collect(std::int32_t cell, int corner) {
    if (!visit(cell, corner)) return;
    Component c;
    c.point = corner_point(level_, cell, corner);
    c.begin = static_cast<std::int32_t>(members_.size());
    c.first_place = 8 * cell + corner;
    members_.push_back({cell, corner});
    for (std::size_t i = static_cast<std::size_t>(c.begin); i < members_.size(); ++i)
      add_neighbours(Member(members_[i]), c);
    c.end = static_cast<std::int32_t>(members_.size());
    components_.push_back(c);
  }

  void add_neighbours(const Member& member, Component& c) {
    const std::uint8_t size_log2 = level_.size_log2[member.cell];
    const int faces =
        member.corner >= 0 ? faces_of_corner(member.corner) : faces_of_point(member.cell, c.point);
    for (const std::int32_t item : level_.links_of(member.cell)) {
      if ((faces >> (item % 8) & 1) == 0) continue;
      const std::int32_t other = item / 8;
      // Across a face between cells of one size a corner is the mirrored one.
      const int corner = member.corner >= 0 && level_.size_log2[other] == size_log2
                             ? member.corner ^ 1 << (item % 8 / 2)
                             : corner_at(level_.corner[other], level_.size_log2[other], c.point);
      if (corner == kApart) continue;
      if (corner == kBetween) {
        const auto known = [other](const Member& m) { return m.cell == other; };
        if (std::any_of(members_.begin() + c.begin, members_.end(), known)) continue;
        if (c.master < 0 || other < c.master) c.master = other;
      } else {
        if (!visit(other, corner)) continue;
        c.first_place = std::min(c.first_place, 8 * other + corner);
      }
      members_.push_back({other, corner});
    }
  }
  int faces_of_point(std::int32_t cell, const Vec3i& p) const {
    int faces = 0;
    for (int d = 0; d < 3; ++d) {
      if (p[d] == level_.corner[cell][d]) faces |= 1 << (2 * d);
      if (p[d] == level_.corner[cell][d] + (1 << level_.size_log2[cell])) faces |= 2 << (2 * d);
    }
    return faces;
  }

  // The vertex that a corner had; -1 if it hung, or was none.
  std::int32_t old_vertex(const Member& m, const Vec3i& point) const {
    const std::int32_t origin = log_.origin(m.cell);
    if (!log_.is_touched(origin))  // it fills the same cube still
      return (level_.fold[origin] >> m.corner & 1) != 0 ? -1 : level_.slots[origin][m.corner];
    const CellBefore was = log_.before(origin);
    const int corner = corner_at(was.corner, was.size_log2, point);
    return corner < 0 || (was.fold >> corner & 1) != 0 ? -1 : was.slots[corner];
  }

  void number_vertices() {
    for (Component& c : components_)
      for (std::int32_t i = c.begin; i < c.end; ++i) {
        if (members_[i].corner < 0) continue;
        const std::int32_t v = old_vertex(members_[i], c.point);
        ensures(v < 0 || c.master < 0, "a vertex begins to hang");
        ensures(v < 0 || c.vertex < 0 || c.vertex == v, "a cut merged two vertices");
        c.vertex = std::max(c.vertex, v);
      }
    // Of those that were one vertex, the first by place keeps it; the others are numbered by place.
    struct Claim {
      std::int32_t vertex, first_place, component;
    };
    std::vector<Claim> claims, fresh;
    claims.reserve(components_.size());
    for (std::size_t i = 0; i < components_.size(); ++i) {
      const Component& c = components_[i];
      if (c.master >= 0) continue;
      (c.vertex < 0 ? fresh : claims)
          .push_back({c.vertex, c.first_place, static_cast<std::int32_t>(i)});
    }
    std::sort(claims.begin(), claims.end(), [](const Claim& a, const Claim& b) {
      return std::tuple(a.vertex, a.first_place) < std::tuple(b.vertex, b.first_place);
    });
    for (std::size_t i = 1; i < claims.size(); ++i)
      if (claims[i].vertex == claims[i - 1].vertex) fresh.push_back(claims[i]);
    std::sort(fresh.begin(), fresh.end(),
              [](const Claim& a, const Claim& b) { return a.first_place < b.first_place; });
    for (const Claim& claim : fresh) {
      Component& c = components_[claim.component];
      c.vertex = level_.vertices();
      level_.point.push_back(c.point);
      level_.fixed.push_back(0);
      rows_.append({});
    }
  }

  void set_octant(std::int32_t cell) {
    int octant = 0;
    for (int d = 0; d < 3; ++d)
      octant |= ((level_.corner[cell][d] >> level_.size_log2[cell]) & 1) << d;
    const auto fold = static_cast<std::uint16_t>((level_.fold[cell] & 255) | octant << 8);
    if (fold == level_.fold[cell]) return;
    log_.touch(cell);
    level_.fold[cell] = fold;
  }

  void set_slot(std::int32_t cell, int slot, std::int32_t vertex, bool hangs) {
    std::uint16_t& fold = level_.fold[cell];
    std::int32_t& at = level_.slots[cell][slot];
    if (at == vertex && (fold >> slot & 1) == (hangs ? 1 : 0)) return;
    log_.touch(cell);
    fold = static_cast<std::uint16_t>((fold & ~(1 << slot)) | (hangs ? 1 << slot : 0));
    if (at == vertex) return;
    if (at >= 0) {
      rows_.remove(at, 8 * cell + slot);
      log_.touch_vertex(at);
    }
    rows_.insert(vertex, 8 * cell + slot);
    log_.touch_vertex(vertex);
    at = vertex;
  }

  void place_vertex(const Component& c) {
    for (std::int32_t i = c.begin; i < c.end; ++i)
      set_slot(members_[i].cell, members_[i].corner, c.vertex, false);
  }

  void place_hanging(const Component& c) {
    for (std::int32_t i = c.begin; i < c.end; ++i) {
      const Member& m = members_[i];
      if (m.corner < 0) continue;
      hanging_.push_back({m.cell, c.master, m.corner});
      set_slot(m.cell, m.corner, vertex_of_parent(m.cell, c.master, m.corner), true);
    }
  }

  // The vertex of the larger cell `master` at a corner of the cube of twice the side over `cell`.
  std::int32_t vertex_of_parent(std::int32_t cell, std::int32_t master, int corner) const {
    Vec3i p{};
    for (int d = 0; d < 3; ++d)
      p[d] = ((level_.corner[cell][d] >> (level_.size_log2[cell] + 1)) + ((corner >> d) & 1))
             << (level_.size_log2[cell] + 1);
    const int at = corner_at(level_.corner[master], level_.size_log2[master], p);
    ensures(at >= 0 && (level_.fold[master] >> at & 1) == 0,
            "a hanging corner asks for a place that is no vertex");
    return level_.slots[master][at];
  }

  // The masters of a hanging corner must be slots of its cell; see rule 3 of LinkedOctree.
  void check_masters() const {
    for (const Hanging& h : hanging_) {
      const int octant = level_.fold[h.cell] >> 8, span = h.corner ^ octant;
      for (int sub = span;; sub = (sub - 1) & span) {
        const int j = octant ^ sub;
        ensures(vertex_of_parent(h.cell, h.master, j) == level_.slots[h.cell][j],
                "a cell depends on more than eight vertices");
        if (sub == 0) break;
      }
    }
  }

  Level& level_;
  ChangeLog& log_;
  Rows rows_;
  std::vector<Member> members_;
  std::vector<Component> components_;
  std::vector<Hanging> hanging_;
};

}  // namespace

std::int32_t ChangeLog::append_cell(std::int32_t origin, const Vec3i& corner,
                                    std::uint8_t size_log2) {
  const std::int32_t cell = level_.cells();
  change_.origin.push_back(origin);
  level_.corner.push_back(corner);
  level_.size_log2.push_back(size_log2);
  level_.fold.push_back(0);
  level_.slots.push_back({-1, -1, -1, -1, -1, -1, -1, -1});
  if (scratch_.listed.size() < level_.corner.size()) {
    scratch_.listed.resize(level_.corner.capacity(), 0);
    scratch_.visited.resize(level_.corner.capacity(), 0);
  }
  return cell;
}

void ChangeLog::finish() {
  std::vector<std::int32_t> order(change_.cells.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(),
            [&](std::int32_t a, std::int32_t b) { return change_.cells[a] < change_.cells[b]; });
  std::vector<std::int32_t> cells;
  std::vector<CellBefore> before;
  cells.reserve(order.size() + change_.origin.size());
  before.reserve(order.size());
  for (const std::int32_t i : order) {
    cells.push_back(change_.cells[i]);
    before.push_back(change_.before[i]);
    scratch_.listed[change_.cells[i]] = 0;
  }
  for (std::int32_t cell = change_.cells_before; cell < level_.cells(); ++cell)
    cells.push_back(cell);
  change_.cells = std::move(cells);
  change_.before = std::move(before);
  std::sort(change_.vertices.begin(), change_.vertices.end());
  change_.vertices.erase(std::unique(change_.vertices.begin(), change_.vertices.end()),
                         change_.vertices.end());
}

CellBefore LevelChange::cell_before(const Level& level, std::int32_t cell) const {
  const auto last = cells.begin() + static_cast<std::ptrdiff_t>(before.size());
  const auto found = std::lower_bound(cells.begin(), last, cell);
  if (found != last && *found == cell) return before[found - cells.begin()];
  return {level.corner[cell], level.size_log2[cell], level.fold[cell], level.slots[cell]};
}

void update_vertices(Level& level, const Touched& touched, ChangeLog& log) {
  VertexUpdate(level, log).run(touched);
}

}  // namespace kerf
