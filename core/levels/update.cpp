// SPDX-License-Identifier: MIT
#include "core/levels/update.hpp"

#include <algorithm>
#include <bit>
#include <utility>

#include "core/base/error.hpp"
#include "core/levels/update_vertices.hpp"

namespace kerf {
namespace {

using Cells = std::vector<std::int32_t>;

void sort_unique(Cells& cells) {
  std::sort(cells.begin(), cells.end());
  cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
}

// Appends the cells that are linked to `cell`.
void add_linked(const Level& level, std::int32_t cell, Cells& out) {
  for (const std::int32_t item : level.links_of(cell)) out.push_back(item / 8);
}

// Splits and appends cells as the octree did; the cells whose links are to be found anew.
Cells split_cells(const LinkedOctree& body, const CutEvent& event, Level& level, ChangeLog& log,
                  Touched& touched) {
  Cells relink;
  for (std::size_t i = 0; i < event.split.size(); ++i) {
    const std::int32_t cell = event.split[i], origin = log.origin(cell);
    if (cell == origin) {
      log.touch(cell);
      touched.whole.push_back(cell);
      add_linked(level, cell, relink);
    }
    for (int k = 1; k < 8; ++k) log.append_cell(origin, {}, 0);
  }
  sort_unique(touched.whole);
  for (std::int32_t cell = log.change().cells_before; cell < level.cells(); ++cell)
    touched.whole.push_back(cell);
  for (const std::int32_t cell : touched.whole) {
    const LinkedOctree::Node& node = body.nodes()[body.leaves()[cell]];
    level.corner[cell] = node.corner;
    level.size_log2[cell] = node.size_log2;
  }
  relink.insert(relink.end(), touched.whole.begin(), touched.whole.end());
  sort_unique(relink);
  return relink;
}

// Takes the links that were cut, whose ends are finest cells, out of the lists that have them
// still.
void cut_links(const LinkedOctree& body, const CutEvent& event, Level& level,
               std::vector<Touched::Faces>& relinked) {
  Rows rows(level.link_begin, level.linked, level.link_rows);
  Cells ends;
  for (const LinkKey key : event.disconnected) {
    const int axis = Lattice::link_axis(key);
    ends.clear();
    add_ends(body, key, ends);
    const std::int32_t a = ends[0], b = ends[1];
    if (rows.remove(a, 8 * b + 2 * axis + 1))
      relinked.push_back({a, static_cast<std::uint8_t>(2 << (2 * axis))});
    if (rows.remove(b, 8 * a + 2 * axis))
      relinked.push_back({b, static_cast<std::uint8_t>(1 << (2 * axis))});
  }
}

// One coarse cell whose children changed: which of them still hold together?
class Regroup {
 public:
  Regroup(Level& fine, ChangeLog& fine_log, Level& coarse, ChangeLog& log, int log2)
      : fine_(fine),
        fine_log_(fine_log),
        coarse_(coarse),
        log_(log),
        log2_(log2),
        children_(coarse.child_begin, coarse.children, coarse.child_rows) {}

  /// Returns whether the cell fell apart. `fresh`: cells that were parts of its children.
  bool operator()(std::int32_t cell, std::span<const std::int32_t> fresh) {
    const auto old = children_[cell];
    members_.assign(old.begin(), old.end());
    members_.insert(members_.end(), fresh.begin(), fresh.end());
    group_members();
    bool apart = false;
    for (std::size_t i = 0; i < members_.size(); ++i) {
      if (first_[i] != i) continue;
      part_.clear();
      for (std::size_t j = i; j < members_.size(); ++j)
        if (first_[j] == i) part_.push_back(members_[j]);
      if (i == 0) {
        keep(cell);
      } else {
        apart = true;
        add(cell);
      }
    }
    return apart;
  }
  void finish() { children_.pack_if_wasteful(); }

 private:
  bool merges(std::int32_t c) const { return fine_.size_log2[c] == log2_; }

  // first_[i]: the first member that member i is joined to.
  void group_members() {
    first_.resize(members_.size());
    for (std::size_t i = 0; i < members_.size(); ++i) first_[i] = i;
    for (std::size_t i = 0; i < members_.size(); ++i) {
      const std::int32_t a = members_[i];
      if (!merges(a)) continue;
      // Links towards the high side that stay in the block lead to cells of the same size.
      int stay = 0;
      for (int d = 0; d < 3; ++d)
        if (((fine_.corner[a][d] >> log2_) & 1) == 0) stay |= 2 << (2 * d);
      for (const std::int32_t item : fine_.links_of(a)) {
        if ((stay >> (item % 8) & 1) == 0) continue;
        const auto at = std::lower_bound(members_.begin(), members_.end(), item / 8);
        ensures(at != members_.end() && *at == item / 8,
                "a block is joined to another cell's child");
        unite(i, static_cast<std::size_t>(at - members_.begin()));
      }
    }
    for (std::size_t i = 0; i < members_.size(); ++i) first_[i] = find(i);
  }
  std::size_t find(std::size_t i) const {
    while (first_[i] != i) i = first_[i];
    return i;
  }
  void unite(std::size_t i, std::size_t j) {
    i = find(i);
    j = find(j);
    first_[std::max(i, j)] = std::min(i, j);
  }

  Vec3i block() const {
    Vec3i corner = fine_.corner[part_[0]];
    if (merges(part_[0]))
      for (int d = 0; d < 3; ++d) corner[d] = (corner[d] >> (log2_ + 1)) << (log2_ + 1);
    return corner;
  }
  std::uint8_t size() const {
    return static_cast<std::uint8_t>(fine_.size_log2[part_[0]] + (merges(part_[0]) ? 1 : 0));
  }

  void keep(std::int32_t cell) {
    const Vec3i corner = block();
    const std::uint8_t size_log2 = size();
    const auto old = children_[cell];
    const bool same_children = std::equal(old.begin(), old.end(), part_.begin(), part_.end());
    if (corner != coarse_.corner[cell] || size_log2 != coarse_.size_log2[cell] || !same_children)
      log_.touch(cell);
    coarse_.corner[cell] = corner;
    coarse_.size_log2[cell] = size_log2;
    if (!same_children) children_.set(cell, part_);
    set_parent(cell);
  }

  void add(std::int32_t origin) {
    const std::int32_t cell = log_.append_cell(origin, block(), size());
    children_.append(part_);
    set_parent(cell);
  }

  void set_parent(std::int32_t cell) {
    for (const std::int32_t c : part_) {
      int octant = 0;
      for (int d = 0; d < 3; ++d) octant |= ((fine_.corner[c][d] >> log2_) & 1) << d;
      const auto place = merges(c) ? static_cast<std::uint8_t>(octant) : Level::kPassed;
      if (fine_.parent[c] == cell && fine_.place[c] == place) continue;
      fine_log_.touch(c);
      fine_.parent[c] = cell;
      fine_.place[c] = place;
    }
  }

  Level& fine_;
  ChangeLog& fine_log_;
  Level& coarse_;
  ChangeLog& log_;
  int log2_;
  Rows children_;
  Cells members_, part_;
  std::vector<std::size_t> first_;
};

// Coarse cells that may fall apart, coarse cells whose links may change, and the new fine cells in
// each of the former.
struct Blocks {
  Cells inward, outward;                                     // ascending
  std::vector<std::pair<std::int32_t, std::int32_t>> fresh;  // (coarse cell, new child), ascending
};

Blocks touched_blocks(Level& fine, const ChangeLog& fine_log, const Touched& from, int log2) {
  Blocks out;
  for (const std::int32_t c : from.whole) {
    const std::int32_t parent = fine.parent[fine_log.origin(c)];
    out.inward.push_back(parent);
    out.outward.push_back(parent);
    if (fine_log.is_new(c)) out.fresh.emplace_back(parent, c);
  }
  for (const Touched::Faces& t : from.relinked) {
    int leave = 0;  // faces on the surface of the block
    for (int d = 0; d < 3; ++d) leave |= 1 << (2 * d + ((fine.corner[t.cell][d] >> log2) & 1));
    if (fine.size_log2[t.cell] != log2) leave = 63;
    if ((t.faces & leave) != 0) out.outward.push_back(fine.parent[t.cell]);
    if ((t.faces & ~leave) != 0) out.inward.push_back(fine.parent[t.cell]);
  }
  sort_unique(out.inward);
  std::sort(out.fresh.begin(), out.fresh.end());
  fine.parent.resize(fine.corner.size(), -1);
  fine.place.resize(fine.corner.size(), 0);
  return out;
}

// Whether a component of a coarse vertex is held; see build_coarse_levels.
std::uint8_t coarse_fixed(const Level& fine, const Level& coarse, std::int32_t vertex) {
  std::uint8_t fixed = 7;
  for (const std::int32_t k : coarse.incidences_of(vertex)) {
    const std::int32_t cell = k / 8;
    for (const std::int32_t child : coarse.children_of(cell)) {
      const std::uint64_t takes =
          transfer_pattern(fine.fold[child], fine.place[child], coarse.fold[cell]);
      for (int i = 0; i < 8; ++i)
        if ((takes >> (8 * i + k % 8) & 1) != 0) fixed &= fine.fixed[fine.slots[child][i]];
      if (fixed == 0) return 0;
    }
  }
  return fixed;
}

// Whether some cell of the change has or had a hanging corner.
bool has_hanging(const Level& level, const ChangeLog& log) {
  const auto hangs = [](std::uint16_t fold) { return (fold & 255) != 0; };
  for (const CellBefore& was : log.change().before)
    if (hangs(was.fold)) return true;
  for (const std::int32_t cell : log.change().cells)
    if (hangs(level.fold[cell])) return true;
  return std::any_of(level.fold.begin() + log.change().cells_before, level.fold.end(), hangs);
}

// Supports of the coarse vertices that may be held otherwise now; returns the old ones that are.
// `apart`: coarse cells that are new or gave parts to new ones; `held`: old fine vertices that are
// held otherwise.
Cells update_fixed(const Level& fine, const ChangeLog& fine_log, Level& coarse, ChangeLog& log,
                   const Cells& apart, const Cells& held) {
  Cells vertices = log.change().vertices;
  // Where nothing hangs, no child went and no new vertex is held, a coarse vertex takes from more
  // places than before or from copies of the same, and what was free stays free.
  const bool look_at_all = has_hanging(fine, fine_log) || has_hanging(coarse, log) ||
                           std::any_of(fine.fixed.begin() + fine_log.change().vertices_before,
                                       fine.fixed.end(), [](std::uint8_t f) { return f != 0; });
  const auto add = [&](std::int32_t cell, bool all) {
    for (const std::int32_t v : coarse.slots[cell])
      if (all || coarse.fixed[v] != 0) vertices.push_back(v);
  };
  for (const std::int32_t cell : log.change().cells) add(cell, look_at_all);
  for (const std::int32_t cell : apart) add(cell, true);
  for (const std::int32_t v : held)
    for (const std::int32_t k : fine.incidences_of(v)) add(fine.parent[k / 8], true);
  sort_unique(vertices);
  Cells changed;
  for (const std::int32_t v : vertices) {
    const std::uint8_t fixed = coarse_fixed(fine, coarse, v);
    if (fixed == coarse.fixed[v]) continue;
    coarse.fixed[v] = fixed;
    log.touch_vertex(v);
    if (v < log.change().vertices_before) changed.push_back(v);
  }
  return changed;
}

}  // namespace

LevelUpdater::LevelUpdater() = default;
LevelUpdater::~LevelUpdater() = default;

void LevelUpdater::update_finest(const LinkedOctree& body, const CutEvent& event,
                                 Hierarchy& hierarchy) {
  const std::size_t levels = hierarchy.levels.size();
  change_.levels.resize(levels);
  scratch_.resize(levels);
  logs_.clear();
  logs_.reserve(levels);
  for (std::size_t l = 0; l < levels; ++l)
    logs_.emplace_back(hierarchy.levels[l], change_.levels[l], scratch_[l]);
  touched_ = {};
  Level& level = hierarchy.levels[0];
  const Cells relink = split_cells(body, event, level, logs_[0], touched_);
  update_links(
      level, relink, logs_[0],
      [&](std::int32_t cell, Cells& row) { add_links_of_leaf(body, cell, row); },
      touched_.relinked);
  cut_links(body, event, level, touched_.relinked);
  update_vertices(level, touched_, logs_[0]);
}

void LevelUpdater::coarsen(Hierarchy& hierarchy, std::size_t index) {
  Level &fine = hierarchy.levels[index], &coarse = hierarchy.levels[index + 1];
  ChangeLog &fine_log = logs_[index], &log = logs_[index + 1];
  const Blocks blocks = touched_blocks(fine, fine_log, touched_, static_cast<int>(index));
  Touched touched;
  Cells relink = blocks.outward, fresh;
  Regroup regroup(fine, fine_log, coarse, log, static_cast<int>(index));
  std::size_t at = 0;
  for (const std::int32_t cell : blocks.inward) {
    fresh.clear();
    for (; at < blocks.fresh.size() && blocks.fresh[at].first == cell; ++at)
      fresh.push_back(blocks.fresh[at].second);
    if (!regroup(cell, fresh)) continue;
    touched.whole.push_back(cell);
    relink.push_back(cell);
    add_linked(coarse, cell, relink);
  }
  regroup.finish();
  for (std::int32_t cell = log.change().cells_before; cell < coarse.cells(); ++cell) {
    touched.whole.push_back(cell);
    relink.push_back(cell);
  }
  sort_unique(relink);
  update_links(
      coarse, relink, log,
      [&](std::int32_t cell, Cells& row) {
        for (const std::int32_t child : coarse.children_of(cell))
          for (const std::int32_t item : fine.links_of(child))
            if (const std::int32_t other = fine.parent[item / 8]; other != cell)
              add_once(row, 8 * other + item % 8);
      },
      touched.relinked);
  update_vertices(coarse, touched, log);
  fine_log.finish();
  for (const std::int32_t cell : fine_log.change().cells) log.touch(fine.parent[cell]);
  touched_ = std::move(touched);
}

bool LevelUpdater::update_coarse(Hierarchy& hierarchy, const HierarchyOptions& options,
                                 std::vector<std::int32_t> held) {
  change_.levels[0].vertices.insert(change_.levels[0].vertices.end(), held.begin(), held.end());
  const std::size_t levels = options.duplicate_cells ? hierarchy.levels.size() : 1;
  for (std::size_t l = 0; l + 1 < levels; ++l) {
    coarsen(hierarchy, l);
    held = update_fixed(hierarchy.levels[l], logs_[l], hierarchy.levels[l + 1], logs_[l + 1],
                        touched_.whole, held);
  }
  logs_[levels - 1].finish();
  logs_.clear();
  if (options.duplicate_cells && has_all_levels(hierarchy, options)) return true;
  change_.levels.resize(1);
  return false;
}

}  // namespace kerf
