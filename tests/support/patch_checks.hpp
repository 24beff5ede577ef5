// SPDX-License-Identifier: MIT
//
// What must hold of patches, however they came about.
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <set>
#include <utility>
#include <vector>

#include "cpu/patched_level.hpp"
#include "kernels/transfer.hpp"

namespace kerf::test {

using cpu::kGroup;
using cpu::Patch;
using cpu::PatchedLevel;

inline std::vector<PatchedLevel> patches_of(const Hierarchy& hierarchy, int threads) {
  std::vector<PatchedLevel> out;
  for (std::size_t l = 0; l < hierarchy.levels.size(); ++l)
    out.push_back(cpu::make_patches(hierarchy, l, l == 0 ? nullptr : &out[l - 1], threads));
  return out;
}

/// body(patch, group) for all groups with cells.
template <class Body>
void for_groups(const PatchedLevel& l, const Body& body) {
  for (std::size_t p = 0; p < l.patches.size(); ++p)
    for (std::int32_t g = l.patches[p].groups.first; g < l.patches[p].groups.end(); ++g)
      body(static_cast<std::int32_t>(p), static_cast<std::size_t>(g));
}

inline void expect_all_once(const PatchedLevel& l) {
  std::vector<int> cells(l.level->corner.size()), vertices(l.level->point.size());
  for_groups(l, [&](std::int32_t p, std::size_t g) {
    EXPECT_EQ(l.patch_of[g], p);
    for (std::size_t edge = 0; edge < 4; ++edge)
      for (std::size_t lane = 0; lane < kGroup; lane += 4)
        EXPECT_EQ(l.heads[cpu::kHeads * g + 4 * edge + lane / 4],
                  l.corners[8 * kGroup * g + 2 * kGroup * edge + lane]);
    for (std::size_t k = 0; k < kGroup; ++k) {
      const std::int32_t c = l.cell[kGroup * g + k];
      if (c < 0) continue;
      ++cells[c];
      EXPECT_EQ(l.lane[c], int(kGroup * g + k));
    }
  });
  EXPECT_EQ(cells, std::vector<int>(cells.size(), 1));
  int shared = 0, others = 0;
  for (std::size_t k = 0; k < l.vertex.size(); ++k) {
    const std::int32_t v = l.vertex[k];
    EXPECT_EQ(l.fixed[k], v < 0 ? 0 : l.level->fixed[v]);
    if (v < 0) continue;
    ++vertices[v];
    EXPECT_EQ(l.packed[v], int(k));
    const std::int32_t home = l.home[k / kGroup];
    EXPECT_NE(home, PatchedLevel::kNowhere);
    ++(PatchedLevel::is_shared(home) ? shared : others);
    if (PatchedLevel::is_shared(home)) {
      EXPECT_LT(l.shared_number(int(k)), l.shared);
    }
  }
  EXPECT_EQ(shared, l.shared);
  EXPECT_EQ(vertices, std::vector<int>(vertices.size(), 1));
  EXPECT_EQ(l.vertices() % kGroup, 0u);
  EXPECT_EQ(l.groups() * kGroup, l.cell.size());
}

/// Where the points of a patch are, three coordinates each: hanging ones by their masters.
inline std::vector<Vec3d> places_of(const PatchedLevel& l, const Patch& patch) {
  std::vector<Vec3d> out(static_cast<std::size_t>(patch.points));
  const auto place = [&](std::int32_t packed) {
    const Vec3i& p = l.level->point[l.vertex[packed]];
    return Vec3d{double(p[0]), double(p[1]), double(p[2])};
  };
  for (std::int32_t v = patch.own.first; v < patch.own.end(); ++v)
    if (l.vertex[v] >= 0)
      out[l.own_point[v]] = place(v);
    else
      EXPECT_EQ(l.own_point[v], cpu::kNothing);
  for (std::int32_t k = patch.copies.first; k < patch.copies.end(); ++k)
    out[l.copy_point[k]] = place(l.copy_vertex[k]);
  for (std::int32_t h = patch.hanging.first; h < patch.hanging.end(); ++h) {
    Vec3d sum{};
    for (const std::uint16_t m : l.hanging_masters[h]) sum += out[m];
    out[l.hanging_point[h]] = 0.25 * sum;
  }
  return out;
}

inline void expect_corners_in_place(const PatchedLevel& l) {
  std::vector<std::vector<Vec3d>> places;
  for (const Patch& patch : l.patches) places.push_back(places_of(l, patch));
  for_groups(l, [&](std::int32_t p, std::size_t g) {
    for (std::size_t k = 0; k < kGroup; ++k) {
      const std::int32_t c = l.cell[kGroup * g + k];
      for (std::size_t i = 0; i < 8; ++i) {
        const std::uint16_t point = l.corners[8 * kGroup * g + kGroup * i + k];
        if (c < 0) {
          EXPECT_EQ(point, cpu::kNothing);
          continue;
        }
        for (int d = 0; d < 3; ++d)
          ASSERT_EQ(places[p][point][d],
                    l.level->corner[c][d] + (((int(i) >> d) & 1) << l.level->size_log2[c]));
      }
    }
  });
}

/// The vertex that a point of a patch is, by point; -1: none.
inline std::vector<std::int32_t> vertices_of(const PatchedLevel& l, const Patch& patch) {
  std::vector<std::int32_t> out(static_cast<std::size_t>(patch.points), -1);
  for (std::int32_t v = patch.own.first; v < patch.own.end(); ++v)
    if (l.vertex[v] >= 0) out[l.own_point[v]] = l.vertex[v];
  for (std::int32_t k = patch.copies.first; k < patch.copies.end(); ++k)
    out[l.copy_point[k]] = l.vertex[l.copy_vertex[k]];
  return out;
}

/// Slots are the very vertices of the level: of two at one place the right one.
inline void expect_slots(const PatchedLevel& l) {
  std::vector<std::vector<std::int32_t>> vertices;
  for (const Patch& patch : l.patches) vertices.push_back(vertices_of(l, patch));
  for_groups(l, [&](std::int32_t p, std::size_t g) {
    const std::uint16_t* at = l.folded(g) ? l.slots.data() + 8 * kGroup * std::size_t(l.slots_at[g])
                                          : l.corners.data() + 8 * kGroup * g;
    for (std::size_t k = 0; k < kGroup; ++k) {
      const std::int32_t c = l.cell[kGroup * g + k];
      if (c < 0) continue;
      for (std::size_t i = 0; i < 8; ++i)
        ASSERT_EQ(vertices[p][at[kGroup * i + k]], l.level->slots[c][i]);
    }
  });
}

/// The points of a row follow each other: of the whole group, or of halves or quarters of it, or of
/// edges along x.
inline void expect_rows(const PatchedLevel& l) {
  for_groups(l, [&](std::int32_t, std::size_t g) {
    const std::uint16_t* corners = l.corners.data() + 8 * kGroup * g;
    bool paired = true;
    for (int n = 0; n < 8 * kGroup; ++n)
      if (const int i = n / kGroup, k = n % kGroup; i % 2 == 0 && l.cell[kGroup * g + k] >= 0)
        paired = paired && corners[kGroup * (i + 1) + k] == corners[kGroup * i + k] + 1;
    EXPECT_EQ(l.row[g] != cpu::kScattered, paired);
    if (!paired) return;
    const int run = cpu::run_of(cpu::RowKind(l.row[g]));
    int longest = kGroup;  // all cells but the first ones of such runs continue those before
    const auto continues = [&](int k) {
      for (int i = 0; i < 8; i += 2)
        if (corners[kGroup * i + k] != corners[kGroup * (i + 1) + k - 1]) return false;
      return true;
    };
    for (std::size_t k = 0; k < kGroup; ++k)
      if (l.cell[kGroup * g + k] < 0) longest = 1;
    for (int k = 1; k < kGroup; ++k)
      while (longest > 1 && k % longest != 0 && !continues(k)) longest /= 2;
    EXPECT_EQ(run, longest < 4 ? 1 : longest);
    for (int i = 0; i < 8; i += 2)
      for (int k = 0; k < kGroup; ++k) {
        if (run == 1 && l.cell[kGroup * g + k] < 0) continue;
        EXPECT_EQ(corners[kGroup * (i + 1) + k], corners[kGroup * i + k] + 1);
        if (k % run != 0) {
          EXPECT_EQ(corners[kGroup * i + k], corners[kGroup * i + k - 1] + 1);
        }
      }
  });
}

/// Shared vertices have one copy in each patch that has a cell of them.
inline void expect_copies(const PatchedLevel& l) {
  std::set<std::pair<std::int32_t, std::int32_t>> expected, found;  // vertex, patch
  std::map<std::int32_t, std::int32_t> patch_of_copy;
  for (std::size_t n = 0; n < l.patches.size(); ++n)
    for (std::int32_t k = l.patches[n].copies.first; k < l.patches[n].copies.end(); ++k)
      patch_of_copy[k] = int(n);
  for_groups(l, [&](std::int32_t p, std::size_t g) {
    for (std::size_t k = 0; k < kGroup; ++k)
      if (const std::int32_t c = l.cell[kGroup * g + k]; c >= 0)
        for (const std::int32_t v : l.level->slots[c]) {
          const std::int32_t home = l.home[l.packed[v] / kGroup];
          if (PatchedLevel::is_shared(home))
            expected.insert({l.packed[v], p});
          else
            EXPECT_EQ(home, p);
        }
  });
  for (std::int32_t n = 0; n < l.shared; ++n)
    for (const std::int32_t k : l.copies(n)) {
      ASSERT_EQ(l.shared_number(l.copy_vertex[k]), n);
      ASSERT_TRUE(patch_of_copy.count(k) != 0);
      EXPECT_TRUE(found.insert({l.copy_vertex[k], patch_of_copy[k]}).second);
    }
  EXPECT_EQ(found, expected);
}

/// Groups that no patch has say so, and lanes without a cell have no children.
inline void expect_nothing_left(const PatchedLevel& l) {
  std::vector<bool> used(l.groups());
  for_groups(l, [&](std::int32_t, std::size_t g) { used[g] = true; });
  for (std::size_t g = 0; g < used.size(); ++g) {
    EXPECT_EQ(l.kind[g] == cpu::kNoCells, !used[g]) << "group " << g;
    EXPECT_EQ(l.patch_of[g] < 0, !used[g]) << "group " << g;
    for (std::size_t k = 0; k < kGroup; ++k) {
      const bool empty = l.cell[kGroup * g + k] < 0;
      EXPECT_TRUE(empty || used[g]) << "group " << g;
      for (std::size_t octant = 0; octant < 8 && empty && !l.children.empty(); ++octant)
        ASSERT_EQ(l.children[8 * kGroup * g + kGroup * octant + k], -1)
            << "group " << g << ", lane " << k;
    }
  }
}

/// Two children in one octant have no place of their own there.
inline void expect_children(const PatchedLevel& finer, const PatchedLevel& l) {
  for (std::int32_t c = 0; c < l.level->cells(); ++c) {
    const auto lane = static_cast<std::size_t>(l.lane[c]);
    bool partly = false, wholly = true;
    std::set<std::int32_t> expected, found;
    for (const std::int32_t child : l.level->children_of(c)) {
      partly = partly || finer.held[child] == cpu::kPartlyHeld;
      wholly = wholly && finer.held[child] == cpu::kWhollyHeld;
      if (finer.held[child] != cpu::kWhollyHeld) expected.insert(finer.lane[child]);
    }
    ASSERT_EQ(l.held[c], wholly ? cpu::kWhollyHeld : partly ? cpu::kPartlyHeld : cpu::kFree);
    const std::uint16_t kind = l.kind[lane / kGroup];
    // As the levels above level 0 number kinds.
    const auto kind_of = [&](std::int32_t child) {
      const std::uint16_t of = finer.kind[finer.lane[child] / kGroup];
      return finer.children.empty() ? cpu::kind_of_finest(of, 0) : of;
    };
    if (cpu::is_of_finest(kind)) {
      std::set<int> octants;
      for (const std::int32_t child : l.level->children_of(c)) {
        ASSERT_TRUE(cpu::is_of_finest(kind_of(child)));
        EXPECT_EQ(cpu::finest_kind(kind), cpu::finest_kind(kind_of(child)));
        EXPECT_EQ(cpu::doublings(kind),
                  cpu::doublings(kind_of(child)) + (cpu::is_of_eight(kind) ? 1 : 0));
        EXPECT_EQ(finer.level->place[child] == Level::kPassed, !cpu::is_of_eight(kind));
        octants.insert(finer.level->place[child] % 8);
      }
      EXPECT_EQ(l.level->children_of(c).size(), cpu::is_of_eight(kind) ? 8u : 1u);
      EXPECT_EQ(octants.size(), l.level->children_of(c).size());
      EXPECT_FALSE(cpu::is_of_eight(kind) && kernels::has_hanging(l.level->fold[c]));
    }
    bool eight = l.held[c] == cpu::kFree && l.level->children_of(c).size() == 8 &&
                 !kernels::has_hanging(l.level->fold[c]) && kind != cpu::kGeneral;
    std::set<std::pair<int, int>> kinds, places;
    for (const std::int32_t child : l.level->children_of(c)) {
      kinds.insert({finer.level->size_log2[child], kind_of(child)});
      eight = eight && cpu::is_of_finest(kind_of(child));
      places.insert({finer.level->place[child] % 8, 0});
    }
    eight = eight && kinds.size() == 1 && places.size() == 8;
    EXPECT_EQ(cpu::is_of_eight(kind), eight) << "cell " << c;
    const bool general = kind == cpu::kGeneral || kind == cpu::kGeneralPassed;
    EXPECT_EQ(l.held[c] == cpu::kPartlyHeld || general, cpu::is_held(kind));
    if (general) continue;
    for (std::size_t o = 0; o < 8; ++o)
      if (const std::int32_t at =
              l.children[8 * kGroup * (lane / kGroup) + kGroup * o + lane % kGroup];
          at >= 0)
        found.insert(at);
    ASSERT_EQ(found, expected);
  }
}

/// What the vertices of a block take: from its runs, or from terms; never both.
template <class Add, class RowOf>
void read_block(const cpu::Transfer& t, const cpu::TransferBlock& block, int count,
                const cpu::TransferVertex* other, const Add& add, const RowOf& row_of) {
  std::vector<int> times(static_cast<std::size_t>(count));
  const auto row_at = [&](int place) {
    EXPECT_LT(place, count);
    ++times[static_cast<std::size_t>(place)];
    return row_of(place);
  };
  for (int n = 0; n < block.runs; ++n) {
    const cpu::TransferRun& run = t.runs[static_cast<std::size_t>(block.first_run + n)];
    ASSERT_LE(run.first + run.size, count);
    for (int k = 0; k < run.size; ++k) {
      auto* const row = row_at(run.first + k);
      ASSERT_NE(row, nullptr);
      if (run.rows == cpu::TransferRun::kIdentity) {
        add(*row, run.point[0] + k, 1);
        continue;
      }
      const int place = run.between + k;
      for (int r = 0; r < run.rows; ++r)
        for (const int point : {place / 2, (place + 1) / 2})
          add(*row, run.point[r] + point, 0.5F / static_cast<float>(run.rows));
    }
  }
  auto term = static_cast<std::size_t>(block.first_term);
  const auto read = [&](int terms) {
    auto* const row = row_at(other->place());
    ASSERT_NE(row, nullptr);
    for (int n = 0; n < terms; ++n, ++term)
      add(*row, t.term_point[term], static_cast<float>(t.term_weight[term]) / 64);
    ++other;
  };
  const auto is_mean = [&](int terms) {
    for (int n = 0; n < terms; ++n)
      if (terms * t.term_weight[term + static_cast<std::size_t>(n)] != 64) return false;
    return std::set{1, 2, 4, 8}.count(terms) == 1;
  };
  for (int n = 0; n < cpu::TransferBlock::kMeans; ++n)
    for (int k = 0; k < block.means[n]; ++k) {
      EXPECT_TRUE(is_mean(1 << n));
      read(1 << n);
    }
  for (int k = 0; k < block.weighted; ++k) {
    EXPECT_FALSE(is_mean(other->terms()));
    read(other->terms());
  }
  bool gaps = false;
  for (int k = 0; k < count; ++k) {
    const bool none = times[static_cast<std::size_t>(k)] == 0;
    gaps = gaps || none;
    EXPECT_TRUE(times[static_cast<std::size_t>(k)] == 1 || row_of(k) == nullptr) << k;
  }
  EXPECT_EQ(block.gaps, gaps);
}

/// Rows of the transfer, as kernels/ give the weights to each cell of a vertex.
inline void expect_transfer(const PatchedLevel& l, const Level& next) {
  using Row = std::map<std::int32_t, float>;  // vertex of the next level, weight
  const cpu::Transfer& t = l.transfer;
  std::vector<Row> rows(l.level->point.size());
  std::vector<int> count(rows.size());
  std::set<std::pair<std::int32_t, std::int32_t>> expected, found;  // vertex of the next, point
  for (std::size_t p = 0; p < l.patches.size(); ++p) {
    const cpu::TransferPart& part = t.parts[p];
    const cpu::Range& own = l.patches[p].own;
    for (std::int32_t k = part.points.first; k < part.points.end(); ++k)
      expected.insert({t.point[k], k});
    const auto add = [&](Row& row, int point, float weight) {
      ASSERT_LT(point, part.points.size);
      row[t.point[part.points.first + point]] += weight;
    };
    for (std::int32_t first = own.first; first < own.end(); first += kGroup)
      read_block(t, t.tiles[first / kGroup], kGroup, t.others.data() + first, add,
                 [&](int k) -> Row* {
                   const std::int32_t v = l.vertex[first + k];
                   if (v < 0) return nullptr;
                   ++count[v];
                   return &rows[v];
                 });
    std::int32_t first = part.leads.first;
    for (std::int32_t b = part.lead_blocks.first; b < part.lead_blocks.end(); ++b, first += kGroup)
      read_block(t, t.lead_blocks[b], std::min(kGroup, part.leads.end() - first),
                 t.lead_others.data() + first, add, [&](int k) -> Row* {
                   const std::int32_t v = l.vertex[t.lead[first + k]];
                   ++count[v];
                   return &rows[v];
                 });
    EXPECT_GE(first, part.leads.end());
  }
  EXPECT_EQ(count, std::vector<int>(count.size(), 1));
  for (std::int32_t v = 0; v < next.vertices(); ++v)
    for (const std::int32_t k : t.givers_of(v)) found.insert({v, k});
  EXPECT_EQ(found, expected);
  for (std::int32_t c = 0; c < l.level->cells(); ++c) {
    const std::int32_t parent = l.level->parent[c];
    float w[8][8];
    kernels::transfer_weights(l.level->fold[c], l.level->place[c], next.fold[parent], w);
    for (std::size_t i = 0; i < 8; ++i) {
      Row row;
      for (std::size_t m = 0; m < 8; ++m)
        if (w[i][m] != 0) row[next.slots[parent][m]] += w[i][m];
      ASSERT_EQ(rows[l.level->slots[c][i]], row);
    }
  }
}

inline void expect_whole(const std::vector<PatchedLevel>& levels) {
  for (std::size_t l = 0; l < levels.size(); ++l) {
    SCOPED_TRACE(::testing::Message() << "level " << l);
    expect_all_once(levels[l]);
    expect_nothing_left(levels[l]);
    expect_corners_in_place(levels[l]);
    expect_slots(levels[l]);
    expect_rows(levels[l]);
    expect_copies(levels[l]);
    if (l > 0) expect_children(levels[l - 1], levels[l]);
    if (l + 1 < levels.size()) expect_transfer(levels[l], *levels[l + 1].level);
  }
}

}  // namespace kerf::test
