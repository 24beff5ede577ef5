// SPDX-License-Identifier: MIT
//
// Products of level 0 by blocks of vertices, on the mirror of a device: the lists against brute
// force, the results against records to the bit, before and after cuts and in any order of threads.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/simulation.hpp"
#include "gpu/vertex_blocks.hpp"
#include "tests/support/mirror_backend.hpp"
#include "tests/support/physics.hpp"
#include "tests/support/solves.hpp"

namespace kerf {
namespace {

using gpu::kBlockVertices;
using gpu::VertexBlocks;
using oracle::Vector;
using test::Loaded;
using test::make_mirror_backend;
using test::MirrorOptions;
using test::Problem;
using test::ProblemOptions;
using test::ThreadOrder;

constexpr OperatorScale kDynamic{0.8, 400};

MirrorOptions by_records() {
  MirrorOptions options;
  options.backend.blocks = false;
  return options;
}

std::vector<std::int32_t> sorted(const std::set<std::int32_t>& cells) {
  return {cells.begin(), cells.end()};
}

/// Each vertex in one block, and in the list of the block all its cells and no others.
void expect_right(const VertexBlocks& blocks, const Level& level) {
  std::vector<std::int32_t> all = blocks.order();
  std::sort(all.begin(), all.end());
  ASSERT_EQ(all.size(), level.point.size());
  for (std::size_t v = 0; v < all.size(); ++v) ASSERT_EQ(all[v], static_cast<std::int32_t>(v));
  std::vector<std::set<std::int32_t>> expected(static_cast<std::size_t>(blocks.count()));
  std::vector<std::int32_t> block_of(all.size());
  for (std::size_t i = 0; i < all.size(); ++i)
    block_of[static_cast<std::size_t>(blocks.order()[i])] =
        static_cast<std::int32_t>(i) / kBlockVertices;
  for (std::int32_t c = 0; c < level.cells(); ++c)
    for (const std::int32_t v : level.slots[c]) expected[block_of[v]].insert(c);
  std::size_t most = 0;
  for (std::int32_t b = 0; b < blocks.count(); ++b) {
    const auto row = row_of(blocks.begin(), blocks.cells(), blocks.rows(), b);
    EXPECT_EQ(std::vector<std::int32_t>(row.begin(), row.end()), sorted(expected[b])) << b;
    most = std::max(most, row.size());
  }
  EXPECT_GE(blocks.most_cells(), most);
}

TEST(VertexBlocks, HoldEachVertexOnceAndTheCellsAroundIt) {
  for (const int refinement : {0, 2}) {
    const LinkedOctree body(test::box_body({20, 17, 23}), refinement);
    const Level level = finest_level(body);
    VertexBlocks blocks;
    blocks.build(level);
    EXPECT_GT(blocks.count(), 3);
    expect_right(blocks, level);
  }
}

// What they are for: a block of 8 x 8 x 4 vertices meets 9 x 9 x 5 cells.
TEST(VertexBlocks, OfAUniformBodyShareFewCells) {
  const LinkedOctree body(test::box_body({64, 64, 64}), 0);
  const Level level = finest_level(body);
  VertexBlocks blocks;
  blocks.build(level);
  const double listed = static_cast<double>(blocks.cells().size()) / level.cells();
  EXPECT_LE(listed, 1.65);  // 9 9 5 / (8 8 4) is 1.58
  EXPECT_GE(listed, 1.5);
}

TEST(VertexBlocks, FollowCuts) {
  for (const int refinement : {0, 1}) {
    LinkedOctree body(test::box_body({24, 20, 18}), refinement);
    ProblemOptions options;
    options.with_oracle = false;
    options.coarsest_vertices = 60;
    Problem p(LinkedOctree(body), options);
    LevelUpdater updater;
    VertexBlocks blocks;
    blocks.build(p.level(0));
    std::int32_t appended = 0;
    for (const double x : {7.3, 15.6, 16.1, 11.2}) {
      const Lattice& l = p.body.lattice();
      const CutEvent event = kerf::cut(p.body, {},
                                       test::plane_blade(l.origin + l.spacing * Vec3d{x, 9.3, 8.2},
                                                         {1, 0.2, 0.1}, 4.2 * l.spacing),
                                       1);
      p.update(updater, event);
      const LevelChange& change = updater.change().levels[0];
      std::vector<std::int32_t> changed;
      for (const std::int32_t v : change.vertices)
        if (v < change.vertices_before) changed.push_back(v);
      for (std::int32_t v = change.vertices_before; v < p.level(0).vertices(); ++v)
        changed.push_back(v);
      appended += p.level(0).vertices() - change.vertices_before;
      const std::vector<std::int32_t> touched = blocks.update(p.level(0), changed);
      EXPECT_LT(static_cast<std::int32_t>(touched.size()), blocks.count());
      expect_right(blocks, p.level(0));
    }
    EXPECT_GT(appended, 50);
  }
}

/// An octree of three materials, cut and held, whose blocks meet more cells than two chunks have.
Problem large_octree() {
  LinkedOctree body(test::box_body({32, 26, 24}), 2);
  test::cut_plane(body, {14.3, 9.2, 7.1}, {1, 0.2, 0.3}, 3);
  ProblemOptions options;
  options.coarsest_vertices = 60;
  options.with_oracle = false;
  return {std::move(body), options};
}

/// Forces, products and a residual.
std::vector<Vector> products(const Problem& p, std::unique_ptr<Backend> machine) {
  const Loaded loaded(p, std::move(machine), kDynamic, {}, p.deformation());
  Backend& backend = *loaded.backend;
  const int in = loaded.extra, out = loaded.extra + 1;
  std::vector<Vector> kept;
  const auto keep = [&](int id) { kept.push_back(p.read(backend, 0, id)); };
  backend.elastic_force(in, out);
  keep(out);
  backend.apply_scaled({-0.3, 170}, in, out);
  keep(out);
  backend.apply(0, in, out);
  keep(out);
  test::write(backend, 0, kSolution, p.free_vector(0, 3));
  test::write(backend, 0, kRight, p.free_vector(0, 4));
  backend.apply(0, kSolution, kScratch);
  keep(kScratch);
  EXPECT_GT(backend.residual(0), 0);
  keep(kResidual);
  return kept;
}

TEST(BlockProducts, HaveTheBitsOfRecordsInAnyOrderOfThreads) {
  const Problem p = large_octree();
  VertexBlocks blocks;
  blocks.build(p.level(0));
  ASSERT_GT(blocks.most_cells(), 2u * kBlockVertices);  // three chunks
  for (const bool single : {false, true}) {
    const std::vector<Vector> expected = products(p, make_mirror_backend(single, by_records()));
    for (const ThreadOrder order :
         {ThreadOrder::rising, ThreadOrder::falling, ThreadOrder::strided}) {
      MirrorOptions options;
      options.order = order;
      EXPECT_EQ(products(p, make_mirror_backend(single, options)), expected);
    }
  }
}

class BlocksOfADevice : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Device, BlocksOfADevice, ::testing::Values("cuda", "cuda_mixed"),
                         [](const auto& parameters) { return parameters.param; });

TEST_P(BlocksOfADevice, HaveTheBitsOfItsRecordsAndOfTheMirror) {
  const std::string name = GetParam();
  const std::string why = test::why_missing(name);
  if (!why.empty() && test::is_required(name)) FAIL() << why;
  if (!why.empty()) GTEST_SKIP() << why;
  const Problem p = large_octree();
  const std::vector<Vector> found = products(p, test::make_backend(name));
  EXPECT_EQ(found, products(p, test::make_backend(name + "_records")));
  EXPECT_EQ(found, products(p, make_mirror_backend(name == "cuda_mixed")));
}

// Steps go to and fro between two vectors, and end in the solution whatever their number.
TEST(BlockProducts, SmoothAsRecordsDoWithAnyDegree) {
  const Problem p = large_octree();
  for (const int degree : {1, 2, 3, 4}) {
    SmootherOptions smoother;
    smoother.degree = degree;
    const Loaded found(p, make_mirror_backend(true), kDynamic, smoother, p.deformation());
    const Loaded expected(p, make_mirror_backend(true, by_records()), kDynamic, smoother,
                          p.deformation());
    Vector after[2][3];
    for (int i = 0; i < 2; ++i) {
      Backend& backend = *(i == 0 ? found : expected).backend;
      test::write(backend, 0, kRight, p.free_vector(0, 4));
      backend.zero(0, kSolution);
      backend.smooth(0, SweepOrder::forward, 1);
      after[i][0] = p.read(backend, 0, kSolution);
      backend.smooth(0, SweepOrder::backward, 1);
      after[i][1] = p.read(backend, 0, kSolution);
      backend.smooth(0, SweepOrder::forward, 3);
      after[i][2] = p.read(backend, 0, kSolution);
    }
    for (int k = 0; k < 3; ++k) EXPECT_EQ(after[0][k], after[1][k]) << degree << ", " << k;
    EXPECT_NE(after[0][0], after[0][1]);
  }
}

// Recorded cycles, with a copy behind an odd number of products, and threads in another order.
TEST(BlockProducts, SolveAsRecordsDoWithAnyDegree) {
  const Problem p = large_octree();
  MirrorOptions falling;
  falling.order = ThreadOrder::falling;
  for (const int degree : {1, 2, 3}) {
    SolverSetup setup;
    setup.degree = degree;
    const test::Solved found =
        test::solve(p, *make_mirror_backend(true, falling), setup, kDynamic, 1e-6);
    const test::Solved expected =
        test::solve(p, *make_mirror_backend(true, by_records()), setup, kDynamic, 1e-6);
    EXPECT_TRUE(found.stats.converged);
    EXPECT_EQ(found.history, expected.history);
    EXPECT_EQ(found.x, expected.x);
  }
}

// Blocks with more cells than codes can name: records take over, and need their memory again.
TEST(BlockProducts, WithTooManyCellsAreMadeByRecords) {
  const Problem p = large_octree();
  MirrorOptions few;
  few.backend.most_block_cells = 300;
  const Loaded found(p, make_mirror_backend(true, few), kDynamic, {}, p.deformation());
  const Loaded blocks(p, make_mirror_backend(true), kDynamic, {}, p.deformation());
  EXPECT_GT(test::counters_of(*found.backend).bytes_held,
            test::counters_of(*blocks.backend).bytes_held);
  for (const Loaded* loaded : {&found, &blocks}) {
    test::write(*loaded->backend, 0, kSolution, p.free_vector(0, 3));
    loaded->backend->apply(0, kSolution, kScratch);
  }
  EXPECT_EQ(p.read(*found.backend, 0, kScratch), p.read(*blocks.backend, 0, kScratch));
}

// The second time a cut gives some block one cell too many, so that records take over in the run.
TEST(BlockProducts, RunsWithCutsEndInTheSameBits) {
  std::size_t before_cuts = 0;
  for (const int refinement : {0, 1, 1}) {
    const bool takes_over = before_cuts > 0 && refinement == 1;
    SimulationSetup setup;
    setup.body = {test::box_solid({1, 1, 0.5}), 9, refinement};
    setup.material = {1e5, 0.4, 1000, 0, 0.01};
    setup.supports = {{{{-9, -9, -9}, {9, 0.001, 9}}, {}, {true, true, true}}};
    setup.loads = {Gravity{{3, -9.81, 0}}};
    setup.time.step = 0.01;
    setup.time.duration = 0.08;
    setup.solver.coarsest_vertices = 40;
    CutSetup cut;
    cut.start = 0.015;
    cut.end = 0.065;
    cut.lines = {{{0.53, 1.5, -1}, {0.57, 1.6, 2}}, {{0.48, 0.4, -1}, {0.52, 0.5, 2}}};
    setup.cuts = {cut};
    MirrorOptions falling;
    falling.order = ThreadOrder::falling;
    if (takes_over) falling.backend.most_block_cells = before_cuts;
    Simulation found(setup, make_mirror_backend(refinement == 1, falling));
    if (refinement == 1) {
      VertexBlocks blocks;
      blocks.build(found.hierarchy().levels[0]);
      before_cuts = blocks.most_cells();
    }
    Simulation expected(setup, make_mirror_backend(refinement == 1, by_records()));
    while (!found.finished()) {
      found.step();
      expected.step();
      ASSERT_EQ(found.state_hash(), expected.state_hash()) << found.time();
    }
    EXPECT_GT(found.links_cut(), 20u);
    if (takes_over) {
      VertexBlocks blocks;
      blocks.build(found.hierarchy().levels[0]);
      EXPECT_GT(blocks.most_cells(), before_cuts);
    } else {
      EXPECT_LT(found.backend().bytes(), expected.backend().bytes());
    }
  }
}

}  // namespace
}  // namespace kerf
