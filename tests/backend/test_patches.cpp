// SPDX-License-Identifier: MIT
//
// The numbers of patches: that every cell and vertex is there once, that points mean what the level
// says, and that groups and rows are what they are called.
#include <gtest/gtest.h>

#include <set>
#include <utility>
#include <vector>

#include "cpu/patched_level.hpp"
#include "tests/support/problem.hpp"

namespace kerf {
namespace {

using cpu::kGroup;
using cpu::Patch;
using cpu::PatchedLevel;
using test::Problem;
using test::ProblemOptions;

Problem cut_octree(bool duplicate) {
  LinkedOctree body(test::box_body({40, 22, 18}), 2);
  test::cut_plane(body, {9.3, 5.2, 4.1}, {1, 0.2, 0.3}, 5);
  ProblemOptions options;
  options.coarsest_vertices = 60;
  options.duplicate_cells = duplicate;
  options.with_oracle = false;
  return {std::move(body), options};
}

std::vector<PatchedLevel> patches_of(const Hierarchy& hierarchy, int threads) {
  std::vector<PatchedLevel> out;
  for (std::size_t l = 0; l < hierarchy.levels.size(); ++l)
    out.push_back(cpu::make_patches(hierarchy, l, l == 0 ? nullptr : &out[l - 1], threads));
  for (std::size_t l = 1; l < out.size(); ++l) cpu::fill_weights(out[l], out[l - 1]);
  return out;
}

/// Where the points of a patch are, three coordinates each: hanging ones by their masters.
std::vector<Vec3d> places_of(const PatchedLevel& l, const Patch& patch) {
  std::vector<Vec3d> out(static_cast<std::size_t>(patch.points));
  const auto place = [&](std::int32_t packed) {
    const Vec3i& p = l.level->point[l.vertex[packed]];
    return Vec3d{double(p[0]), double(p[1]), double(p[2])};
  };
  for (std::int32_t v = patch.first_own; v < patch.first_own + patch.own; ++v)
    if (l.vertex[v] >= 0) out[l.own_point[v]] = place(v);
  for (std::int32_t k = patch.first_copy; k < patch.first_copy + patch.copies; ++k)
    out[l.copy_point[k]] = place(l.copy_vertex[k]);
  for (std::int32_t h = patch.first_hanging; h < patch.first_hanging + patch.hanging; ++h) {
    Vec3d sum{};
    for (const std::uint16_t m : l.hanging_masters[h]) sum += out[m];
    out[l.hanging_point[h]] = 0.25 * sum;
  }
  return out;
}

TEST(Patches, HaveEveryCellAndVertexOnce) {
  const Problem p = cut_octree(true);
  for (const PatchedLevel& l : patches_of(p.hierarchy, 1)) {
    std::vector<int> cells(l.level->corner.size()), vertices(l.level->point.size());
    for (const std::int32_t c : l.cell)
      if (c >= 0) ++cells[c];
    for (const std::int32_t v : l.vertex)
      if (v >= 0) ++vertices[v];
    EXPECT_EQ(cells, std::vector<int>(cells.size(), 1));
    EXPECT_EQ(vertices, std::vector<int>(vertices.size(), 1));
    for (std::size_t v = 0; v < vertices.size(); ++v) EXPECT_EQ(l.vertex[l.packed[v]], int(v));
    for (std::size_t c = 0; c < cells.size(); ++c) EXPECT_EQ(l.cell[l.lane[c]], int(c));
    EXPECT_EQ(l.vertices() % kGroup, 0u);
  }
}

TEST(Patches, PutEveryCornerWhereItIs) {
  const Problem p = cut_octree(true);
  int hanging = 0, rows = 0;
  for (const PatchedLevel& l : patches_of(p.hierarchy, 1))
    for (const Patch& patch : l.patches) {
      const std::vector<Vec3d> place = places_of(l, patch);
      hanging += patch.hanging;
      for (std::int32_t g = patch.first_group; g < patch.first_group + patch.groups; ++g) {
        rows += l.row[g] != cpu::kScattered;
        for (int k = 0; k < kGroup; ++k) {
          const std::int32_t c = l.cell[kGroup * g + k];
          for (int i = 0; i < 8; ++i) {
            const std::uint16_t point = l.corners[64 * std::size_t(g) + 8 * i + k];
            if (c < 0) {
              EXPECT_EQ(point, patch.points - 1);
              continue;
            }
            for (int d = 0; d < 3; ++d)
              EXPECT_EQ(place[point][d],
                        l.level->corner[c][d] + (((i >> d) & 1) << l.level->size_log2[c]));
          }
        }
      }
    }
  EXPECT_GT(hanging, 100);
  EXPECT_GT(rows, 100);
}

// The points of a row follow each other; those of pairs of rows do in each half.
TEST(Patches, CallRowsWhatRowsAre) {
  const Problem p = cut_octree(true);
  for (const PatchedLevel& l : patches_of(p.hierarchy, 1))
    for (std::size_t g = 0; g < l.groups(); ++g) {
      const std::uint16_t* corners = l.corners.data() + 64 * g;
      if (l.row[g] == cpu::kScattered) continue;
      for (int i = 0; i < 8; i += 2)
        for (int k = 0; k < kGroup; ++k) {
          EXPECT_EQ(corners[8 * (i + 1) + k], corners[8 * i + k] + 1);
          const bool starts = k == 0 || (k == 4 && l.row[g] == cpu::kTwoRows);
          if (!starts) {
            EXPECT_EQ(corners[8 * i + k], corners[8 * i + k - 1] + 1);
          }
        }
    }
}

TEST(Patches, SumSharedVerticesOverAllTheirCopies) {
  const Problem p = cut_octree(true);
  for (const PatchedLevel& l : patches_of(p.hierarchy, 1)) {
    std::set<std::pair<std::int32_t, std::int32_t>> expected, found;  // vertex, patch
    for (std::size_t n = 0; n < l.patches.size(); ++n) {
      const Patch& patch = l.patches[n];
      for (std::int32_t g = patch.first_group; g < patch.first_group + patch.groups; ++g)
        for (int k = 0; k < kGroup; ++k)
          if (const std::int32_t c = l.cell[kGroup * g + k]; c >= 0)
            for (const std::int32_t v : l.level->slots[c])
              if (l.packed[v] >= l.first_shared) expected.insert({l.packed[v], int(n)});
    }
    for (std::int32_t v = l.first_shared; v < int(l.vertices()); ++v)
      for (std::int32_t i = l.copies_begin[v - l.first_shared];
           i < l.copies_begin[v - l.first_shared + 1]; ++i) {
        std::int32_t n = 0;
        while (l.copies_of[i] >= l.patches[n].first_copy + l.patches[n].copies) ++n;
        EXPECT_EQ(l.copy_vertex[l.copies_of[i]], v);
        EXPECT_TRUE(found.insert({v, n}).second);
      }
    EXPECT_EQ(found, expected);
  }
}

TEST(Patches, AreTheSameForAnyNumberOfThreads) {
  const Problem p = cut_octree(true);
  const std::vector<PatchedLevel> one = patches_of(p.hierarchy, 1),
                                  more = patches_of(p.hierarchy, 3);
  for (std::size_t l = 0; l < one.size(); ++l) {
    EXPECT_EQ(one[l].cell, more[l].cell);
    EXPECT_EQ(one[l].corners, more[l].corners);
    EXPECT_EQ(one[l].vertex, more[l].vertex);
    EXPECT_EQ(one[l].hanging_masters, more[l].hanging_masters);
  }
}

// Two children in one octant have no place of their own there.
TEST(Patches, MergeOneChildAnOctantOrGoTheGeneralWay) {
  for (const bool duplicate : {true, false}) {
    const Problem p = cut_octree(duplicate);
    const std::vector<PatchedLevel> all = patches_of(p.hierarchy, 1);
    for (std::size_t l = 1; l < all.size(); ++l)
      for (std::size_t lane = 0; lane < all[l].cell.size(); ++lane) {
        const std::int32_t c = all[l].cell[lane];
        if (c < 0 || all[l].kind[lane / kGroup] == cpu::kGeneral) continue;
        std::size_t found = 0;
        for (std::size_t o = 0; o < 8; ++o)
          found += all[l].children[64 * (lane / kGroup) + kGroup * o + lane % kGroup] >= 0;
        std::size_t expected = 0;
        for (const std::int32_t child : all[l].level->children_of(c))
          expected += all[l - 1].held[child] != cpu::kWhollyHeld;
        EXPECT_EQ(found, expected);
        EXPECT_EQ(all[l].held[c] == cpu::kPartlyHeld,
                  all[l].kind[lane / kGroup] >= cpu::kHeldMerged);
      }
  }
}

}  // namespace
}  // namespace kerf
