// SPDX-License-Identifier: MIT
//
// The numbers of patches: that every cell and vertex is there once, that points mean what the level
// says, and that groups and rows are what they are called; when they are made, and when cuts have
// changed some of them.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <set>
#include <utility>
#include <vector>

#include "tests/support/cut_octree.hpp"
#include "tests/support/patch_checks.hpp"
#include "tests/support/problem.hpp"

namespace kerf {
namespace {

using cpu::kGroup;
using cpu::PatchedLevel;
using cpu::PatchMoves;
using test::cut_octree;
using test::patches_of;
using test::Problem;
using test::ProblemOptions;

TEST(Patches, AreWholeWhenMade) {
  const Problem p = cut_octree(true);
  const std::vector<PatchedLevel> levels = patches_of(p.hierarchy, 1);
  test::expect_whole(levels);
  int hanging = 0, in_rows = 0, paired = 0, scattered = 0;  // cells, but for hanging points
  for (const PatchedLevel& l : levels) {
    hanging += static_cast<int>(l.hanging_point.size());
    for (const std::uint8_t row : l.row) {
      in_rows += cpu::run_of(cpu::RowKind(row)) > 1 ? kGroup : 0;
      paired += row == cpu::kPairs ? kGroup : 0;
      scattered += row == cpu::kScattered ? kGroup : 0;
    }
  }
  EXPECT_GT(hanging, 100);
  EXPECT_GT(in_rows, 800);
  EXPECT_GT(paired, 800);
  EXPECT_GT(scattered, 100);
  EXPECT_GT(levels[0].patches.size(), 4u);
  EXPECT_TRUE(std::any_of(levels[1].kind.begin(), levels[1].kind.end(), cpu::is_of_eight));
  EXPECT_GT(levels[0].shared, 100);
}

TEST(Patches, HaveRunsOfAllKinds) {
  std::set<std::pair<int, int>> own, shared;  // rows, whether the first vertex lies between points
  const auto count = [&](const Problem& p) {
    for (const PatchedLevel& l : patches_of(p.hierarchy, 1)) {
      const cpu::Transfer& t = l.transfer;
      const auto add = [&](const cpu::TransferBlock& block, auto& to) {
        for (int n = 0; n < block.runs; ++n) {
          const cpu::TransferRun& run = t.runs[static_cast<std::size_t>(block.first_run + n)];
          to.insert({run.rows, run.between});
        }
      };
      for (const cpu::TransferBlock& block : t.tiles) add(block, own);
      for (const cpu::TransferBlock& block : t.lead_blocks) add(block, shared);
    }
  };
  ProblemOptions options;
  options.max_levels = 2;
  options.with_oracle = false;
  count({LinkedOctree(test::box_body({64, 48, 40}), 0), options});
  const std::set<std::pair<int, int>> all{{1, 0}, {1, 1}, {2, 0}, {2, 1}, {4, 0}, {4, 1}};
  EXPECT_EQ(own, all);
  EXPECT_GE(shared.size(), 4u);
  count({LinkedOctree(test::box_body({64, 48, 40}), 2), options});
  EXPECT_TRUE(own.contains({cpu::TransferRun::kIdentity, 0}));
}

// No balanced octree has vertices with weights: they would lie on a coarse cell with hanging
// corners that has children beside the larger cell.
TEST(Patches, HaveMeansOfAllClasses) {
  std::array<int, cpu::TransferBlock::kMeans> own{}, shared{};
  const auto add = [](const std::vector<cpu::TransferBlock>& blocks, auto& to) {
    for (const cpu::TransferBlock& block : blocks)
      for (std::size_t n = 0; n < to.size(); ++n) to[n] += block.means[n];
  };
  const Problem p = cut_octree(true);
  for (const PatchedLevel& l : patches_of(p.hierarchy, 1)) {
    add(l.transfer.tiles, own);
    add(l.transfer.lead_blocks, shared);
  }
  for (const auto& classes : {own, shared})
    for (const int vertices : classes) EXPECT_GT(vertices, 20);
}

TEST(Patches, HaveLongRowsOfPointsAtLinesOfMemory) {
  ProblemOptions options;
  options.max_levels = 1;
  options.materials = 1;
  options.with_oracle = false;
  const Problem p({LinkedOctree(test::box_body({64, 48, 40}), 0), options});
  const PatchedLevel l = std::move(patches_of(p.hierarchy, 1)[0]);
  int rows = 0, at_lines = 0;
  test::for_groups(l, [&](std::int32_t, std::size_t g) {
    if (l.row[g] != cpu::kRow) return;
    ++rows;
    const std::uint16_t* const points = l.corners.data() + 8 * kGroup * g;
    at_lines += points[0] % 4 == 0 && points[2 * kGroup] % 4 == 0 && points[4 * kGroup] % 4 == 0 &&
                points[6 * kGroup] % 4 == 0;
  });
  EXPECT_GT(rows, 5000);
  EXPECT_GT(10 * at_lines, 9 * rows) << at_lines << " of " << rows;  // some patches have a step
}

// What two patches share is read in order by both.
TEST(Patches, HaveTheirCopiesInOrder) {
  const Problem p = cut_octree(true);
  int pairs = 0, jumps = 0;
  for (const PatchedLevel& l : patches_of(p.hierarchy, 1)) {
    for (const cpu::Patch& patch : l.patches)
      for (std::int32_t k = patch.copies.first + 1; k < patch.copies.end(); ++k) {
        const std::int32_t before = l.shared_number(l.copy_vertex[k - 1]),
                           here = l.shared_number(l.copy_vertex[k]);
        EXPECT_LT(before, here);
        ++pairs;
        jumps += here > before + 1;
      }
  }
  EXPECT_GT(pairs, 1000);
  EXPECT_LT(4 * jumps, pairs);
}

// The first patch of a body of 64^3 cells would have 64 by 16 by 16 of them; here half of these
// have eight points of their own each.
TEST(Patches, OfLooseCellsHaveNumbersForAllPoints) {
  LinkedOctree body(test::box_body({64, 64, 64}), 0);
  for (int z = 0; z < 16; ++z)
    for (int y = 0; y < 16; ++y)
      for (int x = 0; x < 32; ++x)
        for (int axis = 0; axis < 3; ++axis) test::disconnect(body, {x, y, z}, axis);
  ProblemOptions options;
  options.max_levels = 1;
  options.with_oracle = false;
  const Problem p(std::move(body), options);

  const std::vector<PatchedLevel> levels = patches_of(p.hierarchy, 2);

  const PatchedLevel& l = levels[0];
  EXPECT_EQ(l.patches.size(), 18u)
      << "the crowded one is halved, and the crowded half again, the others are not";
  int loose = 0;
  for (const cpu::Patch& patch : l.patches) {
    EXPECT_LE(patch.points, 0xFFFF);
    loose += patch.points > 8 * 4096;
  }
  EXPECT_EQ(loose, 2);
  test::expect_slots(l);
}

TEST(Patches, AreWholeWithoutDuplicates) {
  const Problem p = cut_octree(false);
  test::expect_whole(patches_of(p.hierarchy, 1));
}

// Where no cut is to come: the corners of other groups are where they are read, and are the same.
TEST(Patches, ForgetCornersOfRowsAlone) {
  const Problem p = cut_octree(true);
  std::size_t in_rows = 0, others = 0;
  for (const PatchedLevel& whole : patches_of(p.hierarchy, 1)) {
    PatchedLevel l = whole;
    l.forget_rows();
    ASSERT_EQ(l.corners_at.size(), l.groups());
    const std::size_t before = others;
    for (std::size_t g = 0; g < l.groups(); ++g) {
      if (cpu::run_of(cpu::RowKind(l.row[g])) > 1) {
        EXPECT_EQ(l.corners_at[g], -1);
        ++in_rows;
      } else {
        const std::uint16_t *const was = whole.corners_of(g), *const is = l.corners_of(g);
        EXPECT_TRUE(std::equal(was, was + 8 * kGroup, is)) << g;
        ++others;
      }
    }
    EXPECT_EQ(l.heads, whole.heads);
    EXPECT_EQ(l.row, whole.row);
    EXPECT_EQ(l.tiles(), whole.tiles());
    EXPECT_EQ(l.vertex.empty(), l.children.empty());  // on level 0
    EXPECT_EQ(l.corners.size(), 8 * kGroup * (others - before));
  }
  EXPECT_GT(in_rows, 50u);
  EXPECT_GT(others, 50u);
}

/// All that a sweep, a transfer or a coarse matrix reads.
void expect_same(const PatchedLevel& a, const PatchedLevel& b) {
  EXPECT_EQ(a.cell, b.cell);
  EXPECT_EQ(a.corners, b.corners);
  EXPECT_EQ(a.slots, b.slots);
  EXPECT_EQ(a.slots_at, b.slots_at);
  EXPECT_EQ(a.kind, b.kind);
  EXPECT_EQ(a.row, b.row);
  EXPECT_EQ(a.children, b.children);
  EXPECT_EQ(a.vertex, b.vertex);
  EXPECT_EQ(a.own_point, b.own_point);
  EXPECT_EQ(a.copy_point, b.copy_point);
  EXPECT_EQ(a.copy_vertex, b.copy_vertex);
  EXPECT_EQ(a.copies_of, b.copies_of);
  EXPECT_EQ(a.hanging_point, b.hanging_point);
  EXPECT_EQ(a.hanging_masters, b.hanging_masters);
  EXPECT_EQ(a.transfer.point, b.transfer.point);
  EXPECT_EQ(a.transfer.term_point, b.transfer.term_point);
  EXPECT_EQ(a.transfer.term_weight, b.transfer.term_weight);
  EXPECT_EQ(a.transfer.runs, b.transfer.runs);
  EXPECT_EQ(a.transfer.tiles, b.transfer.tiles);
  EXPECT_EQ(a.transfer.others, b.transfer.others);
  EXPECT_EQ(a.transfer.lead_others, b.transfer.lead_others);
  EXPECT_EQ(a.transfer.lead_blocks, b.transfer.lead_blocks);
  EXPECT_EQ(a.transfer.givers, b.transfer.givers);
}

TEST(Patches, AreTheSameForAnyNumberOfThreads) {
  const Problem p = cut_octree(true);
  const std::vector<PatchedLevel> one = patches_of(p.hierarchy, 1),
                                  more = patches_of(p.hierarchy, 3);
  for (std::size_t l = 0; l < one.size(); ++l) expect_same(one[l], more[l]);
}

/// Patches that follow the cuts of a body, with a vector and lanes that they move.
class Followed {
 public:
  explicit Followed(Problem& problem, int threads)
      : problem_(problem), threads_(threads), levels_(patches_of(problem.hierarchy, threads)) {
    for (const PatchedLevel& l : levels_) {
      vectors_.emplace_back(l.vertices(), 0);
      for (std::size_t v = 0; v < l.packed.size(); ++v) vectors_.back()[l.packed[v]] = int(v) + 1;
    }
    lanes_ = levels_[0].cell;
  }

  void update(const HierarchyChange& change) {
    PatchMoves moves;
    for (std::size_t l = 0; l < levels_.size(); ++l) {
      const std::size_t before = levels_[l].groups_built;
      moves = cpu::update_patches(problem_.hierarchy, change, l, l == 0 ? nullptr : &levels_[l - 1],
                                  l == 0 ? nullptr : &moves, threads_, levels_[l]);
      remade_ += levels_[l].groups_built != before;
      move_vector(moves, levels_[l], change.levels[l].vertices_before, vectors_[l]);
      if (l == 0) move_lanes(moves, change.levels[0]);
    }
  }

  const std::vector<PatchedLevel>& levels() const { return levels_; }
  int remade() const { return remade_; }

 private:
  static void move_vector(const PatchMoves& moves, const PatchedLevel& l, std::int32_t before,
                          std::vector<int>& vector) {
    std::vector<int> values;
    for (const PatchMoves::Move& m : moves.vertices)
      values.push_back(std::exchange(vector[m.from], 0));
    vector.resize(l.vertices(), 0);
    for (std::size_t n = 0; n < values.size(); ++n) vector[moves.vertices[n].to] = values[n];
    for (std::size_t k = 0; k < vector.size(); ++k) {
      const std::int32_t v = l.vertex[k];
      ASSERT_EQ(vector[k], v < 0 || v >= before ? 0 : v + 1);
      if (v >= 0) vector[k] = v + 1;
    }
  }

  void move_lanes(const PatchMoves& moves, const LevelChange& change) {
    const PatchedLevel& l = levels_[0];
    std::vector<int> values;
    for (const PatchMoves::Move& m : moves.cells) values.push_back(lanes_[m.from]);
    lanes_.resize(l.cell.size(), -1);
    for (const cpu::Range& groups : moves.groups)
      std::fill(lanes_.begin() + kGroup * groups.first, lanes_.begin() + kGroup * groups.end(), -1);
    for (std::size_t n = 0; n < values.size(); ++n) lanes_[l.lane[moves.cells[n].to]] = values[n];
    for (std::size_t k = 0; k < lanes_.size(); ++k) {
      const std::int32_t c = l.cell[k], old = change.cells_before;
      ASSERT_EQ(lanes_[k], c < old ? c : change.origin[c - old]);
      lanes_[k] = c;
    }
  }

  Problem& problem_;
  int threads_;
  std::vector<PatchedLevel> levels_;
  std::vector<std::vector<int>> vectors_;  // per level: vertex + 1 where there is one
  std::vector<std::int32_t> lanes_;        // the cell of each lane
  int remade_ = 0;
};

struct Counts {
  int updates = 0, remade = 0, untouched = 0, divided = 0, changed = 0, added = 0;
  int alone = 0, moved = 0, tiles = 0, whole = 0;

  /// Cells that stayed where they were, with other vertices or as they were; and new ones in
  /// patches most of whose cells stayed. New vertices of one patch among the shared ones, for lack
  /// of room; and patches whose own vertices moved. Patches of which some tiles take other values
  /// and only those were made again; and those where after this all were.
  void count(const PatchedLevel& before, const PatchedLevel& now, const LevelChange& change) {
    std::vector<int> stayed(before.patches.size());
    for (std::size_t c = 0; c < before.lane.size(); ++c) {
      const bool same = before.lane[c] == now.lane[c];
      untouched += same;
      stayed[std::size_t(before.patch_of_cell(int(c)))] += same ? 1 : -1;
    }
    for (std::size_t i = 0; i < change.before.size(); ++i)
      changed += before.lane[change.cells[i]] == now.lane[change.cells[i]] &&
                 change.before[i].slots != now.level->slots[change.cells[i]];
    for (std::int32_t c = change.cells_before; c < now.level->cells(); ++c)
      if (const auto p = std::size_t(now.patch_of_cell(c)); p < stayed.size())
        added += stayed[p] > 0;
    for (std::int32_t v = change.vertices_before; v < now.level->vertices(); ++v) {
      const std::int32_t packed = now.packed[v];
      alone += PatchedLevel::is_shared(now.home[packed / kGroup]) &&
               now.copies(now.shared_number(packed)).size() == 1;
    }
    for (std::size_t n = 0; n < before.patches.size() && now.groups_built == before.groups_built;
         ++n)
      moved += before.patches[n].own.first != now.patches[n].own.first;
    const auto &parts_before = before.transfer.parts, &parts = now.transfer.parts;
    for (std::size_t n = 0; n < std::min(parts_before.size(), parts.size()); ++n) {
      const std::int32_t more = parts_before[n].more_terms.size, is = parts[n].more_terms.size;
      tiles += is > more;
      whole += is == 0 && more > 0;
    }
  }
};

/// A few old vertices that lie together.
std::vector<std::int32_t> some_vertices(const Level& level, test::Dice& dice) {
  std::vector<std::int32_t> out;
  const Vec3i& middle = level.point[dice.roll(level.vertices())];
  for (std::int32_t v = 0; v < level.vertices(); ++v) {
    int far = 0;
    for (int d = 0; d < 3; ++d) far = std::max(far, std::abs(level.point[v][d] - middle[d]));
    if (far <= 2) out.push_back(v);
  }
  return out;
}

void cut_and_follow(std::uint64_t seed, int refinement, int blades, Counts& counts) {
  test::Dice dice(seed);
  const Voxels voxels = test::box_body({34 + dice.roll(8), 20, 18});
  ProblemOptions options;
  options.coarsest_vertices = 1;
  options.max_levels = 3;
  options.with_oracle = false;
  Problem p(LinkedOctree(voxels, refinement), options);
  test::RandomBlades random(voxels.lattice, dice);
  LevelUpdater updater;
  Followed one(p, 1), two(p, 2);
  for (int i = 0; i < blades; ++i) {
    SCOPED_TRACE(::testing::Message() << "seed " << seed << ", blade " << i);
    const CutEvent event = cut(p.body, {}, random.next(), i + 1);
    std::vector<std::int32_t> turned;
    if (i % 2 == 1) turned = some_vertices(p.hierarchy.levels[0], dice);
    ASSERT_TRUE(p.update(updater, event, turned));
    const std::size_t patches = one.levels()[0].patches.size();
    const int remade = one.remade();
    const std::vector<PatchedLevel> before = one.levels();
    one.update(updater.change());
    two.update(updater.change());
    test::expect_whole(one.levels());
    if (::testing::Test::HasFailure()) return;
    for (std::size_t l = 0; l < one.levels().size(); ++l)
      expect_same(one.levels()[l], two.levels()[l]);
    if (::testing::Test::HasFailure()) return;
    ++counts.updates;
    counts.divided += one.remade() == remade && one.levels()[0].patches.size() > patches;
    for (std::size_t l = 0; l < before.size(); ++l)
      counts.count(before[l], one.levels()[l], updater.change().levels[l]);
  }
  counts.remade += one.remade();
}

TEST(Patches, StayWholeUnderCuts) {
  Counts counts;
  for (const std::uint64_t seed : {1, 2, 3, 4, 5})
    cut_and_follow(seed, static_cast<int>(seed % 3), 10, counts);
  EXPECT_EQ(counts.updates, 50);
  EXPECT_GT(counts.remade, 0);
  EXPECT_GT(counts.divided, 0);
  EXPECT_GT(counts.untouched, 1000);
  EXPECT_GT(counts.changed, 1000);
  EXPECT_GT(counts.added, 1000);
  EXPECT_GT(counts.alone, 1000);
  EXPECT_GT(counts.moved, 10);
  EXPECT_GT(counts.tiles, 10);
  EXPECT_GT(counts.whole, 10);
}

}  // namespace
}  // namespace kerf
