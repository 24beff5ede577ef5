// SPDX-License-Identifier: MIT
//
// Random blades on small bodies, seen from the levels: which corners are one vertex, what the
// coarse cells are, and whether every matrix is positive definite. KERF_FUZZ sets how many blades.
#include <gtest/gtest.h>

#include <map>
#include <stdexcept>

#include "core/body/cut.hpp"
#include "core/solve/sparse_cholesky.hpp"
#include "cpu/cpu_backend.hpp"
#include "tests/oracle/levels_oracle.hpp"
#include "tests/support/octree_invariants.hpp"
#include "tests/support/random_blades.hpp"

namespace kerf {
namespace {

constexpr std::uint64_t kFirstSeed = 20150601;
constexpr int kBladesPerBody = 4;

Hierarchy hierarchy_of(const LinkedOctree& body) {
  Hierarchy out;
  out.levels.push_back(finest_level(body));
  out.spacing = body.lattice().spacing;
  out.poisson = {0.4};
  for (const std::uint8_t log2 : out.levels[0].size_log2) {
    const double side = out.spacing * (1 << log2);
    out.values.push_back({side, side * side * side, 0});
  }
  build_coarse_levels(out, {.coarsest_vertices = 12, .max_levels = 0, .duplicate_cells = true});
  return out;
}

// Two corners are one vertex iff the brute force over octants says so.
void expect_same_sharing(const LinkedOctree& body, const Level& level) {
  const oracle::Sharing sharing = oracle::share_by_octants(body);
  ASSERT_EQ(sharing.group.size(), level.slots.size());
  std::map<int, std::int32_t> vertex_of_group;
  std::map<std::int32_t, int> group_of_vertex;
  for (std::size_t cell = 0; cell < sharing.group.size(); ++cell)
    for (std::size_t i = 0; i < 8; ++i) {
      const bool hangs = (level.fold[cell] >> i) & 1;
      ASSERT_EQ(hangs, sharing.hangs[cell][i]) << "cell " << cell << " corner " << i;
      if (hangs) continue;
      const int group = sharing.group[cell][i];
      const std::int32_t vertex = level.slots[cell][i];
      ASSERT_EQ(vertex_of_group.try_emplace(group, vertex).first->second, vertex);
      ASSERT_EQ(group_of_vertex.try_emplace(vertex, group).first->second, group);
    }
}

// With some mass even loose pieces have a positive definite matrix, on every level.
void expect_positive_definite(const Hierarchy& hierarchy) {
  const auto backend = make_cpu_backend({.threads = 1, .tile_log2 = 0});
  backend->load(hierarchy);
  backend->set_operator({1, 1e-2 / (hierarchy.spacing * hierarchy.spacing)});
  for (std::size_t l = 0; l < hierarchy.levels.size(); ++l) {
    const Level& level = hierarchy.levels[l];
    AssembledLevel matrix(level);
    matrix.assemble(level, [&](std::int32_t cell, std::span<double> out) {
      backend->read_cell_matrix(static_cast<int>(l), cell, out);
    });
    SparseCholesky factor(CholeskyEngine::simplicial);
    factor.analyse(matrix);
    EXPECT_TRUE(factor.factor(matrix)) << "level " << l;
    if (l + 1 < hierarchy.levels.size()) backend->coarsen(static_cast<int>(l));
  }
}

TEST(LevelFuzz, RandomCutsKeepSharingHierarchyAndDefiniteness) {
  const int blades = test::blade_count(60);
  for (int done = 0; done < blades; done += kBladesPerBody) {
    const std::uint64_t seed = kFirstSeed + static_cast<std::uint64_t>(done);
    SCOPED_TRACE(testing::Message() << "seed of the body " << seed);
    test::Dice dice(seed);
    const Voxels voxels = test::random_body(dice);
    LinkedOctree body(voxels, dice.roll(3));
    test::RandomBlades random(body.lattice(), dice);
    for (int i = 0; i < kBladesPerBody && done + i < blades; ++i) {
      cut(body, {}, random.next(), i + 1);

      const Hierarchy hierarchy = hierarchy_of(body);

      expect_same_sharing(body, hierarchy.levels[0]);
      EXPECT_NO_THROW(oracle::grids_like(body, hierarchy));
      expect_positive_definite(hierarchy);
      if (testing::Test::HasFailure()) FAIL() << "at blade " << i;
    }
  }
}

}  // namespace
}  // namespace kerf
