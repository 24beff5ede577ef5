// SPDX-License-Identifier: MIT
//
// What a small cut costs does not grow with the body: what it changes, and the memory that it asks
// for, in bodies that are alike around it. Not counted are the search for the leaves near a blade,
// which passes over all vertices, and marks of patches, zeroed by calloc
// (docs/decisions/0008-a-cut-changes-levels-in-place.md).
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "core/near_leaves.hpp"
#include "core/structure.hpp"
#include "core/surface/surface.hpp"
#include "cpu/fast_backend.hpp"
#include "tests/support/blades.hpp"
#include "tests/support/counted_memory.hpp"
#include "tests/support/physics.hpp"

namespace kerf {
namespace {

constexpr double kSpacing = 1.0 / 128;  // m, exact

/// A bar along x.
SimulationSetup bar(int cells, int refinement, int coarsest_vertices) {
  SimulationSetup setup;
  setup.body = {test::box_solid(kSpacing * Vec3d{double(cells), 32, 32}), cells, refinement};
  setup.supports = {{{{-1, -1, -1}, {2, 1e-4, 2}}, {}, {true, true, true}}};
  setup.solver.coarsest_vertices = coarsest_vertices;
  return setup;
}

struct Cost {
  std::vector<std::size_t> changed;  ///< links, leaves, cells and vertices of levels 0 to 2
  std::size_t bytes = 0;             ///< allocated
  bool in_place = false;
  bool coarsest_changed = false;  ///< whether other cells meet at its vertices
};

/// A body with all that follows a blade, and one small cut far from where others are to be.
class CutBody {
 public:
  CutBody(int cells, int refinement, int coarsest_vertices, bool mixed)
      : setup_(bar(cells, refinement, coarsest_vertices)),
        lattice_(make_lattice(setup_.body.solid->bounds(), cells, refinement)),
        body_(voxelise(*setup_.body.solid, lattice_), refinement),
        surface_(body_, SurfaceMethod::dual_contouring),
        structure_(setup_, body_),
        backend_(make_fast_backend({.threads = 1, .single_cycle = mixed})) {
    surface_.bind(body_);
    backend_->load(structure_.hierarchy());
    displacement_ = backend_->add_vector();
    pass({4.4, 18.3, 5.2});
  }

  std::size_t cells() const { return structure_.finest().slots.size(); }

  /// A blade at a place, and its width, in cells.
  Cost pass(const Vec3d& place, double width = 4.6) {
    const TriangleMesh blade =
        test::plane_blade(lattice_.origin + kSpacing * place, {1, 0.2, 0.1}, width / 2 * kSpacing);
    Cost out;
    const DeformedLeaves leaves =
        leaves_near(*backend_, structure_, lattice_, displacement_, blade);
    test::count_allocations();
    const CutEvent event = cut_near(body_, leaves, blade, ++blades_);
    out.in_place = structure_.update(body_, event);
    if (!out.in_place) return out;
    backend_->update(structure_.hierarchy(), structure_.change());
    surface_.update(body_, event);
    surface_.bind(body_);
    out.bytes = test::allocated_bytes();
    out.changed = {event.links_hit, event.disconnected.size(), event.split.size()};
    out.coarsest_changed = !structure_.change().levels.back().vertices.empty();
    for (std::size_t l = 0; l < 3; ++l) {
      const LevelChange& change = structure_.change().levels[l];
      out.changed.push_back(change.cells.size());
      out.changed.push_back(change.vertices.size());
    }
    return out;
  }

  /// Whether the coarsest level is solved to the bits of a backend that is loaded as it is now.
  bool solves_as_loaded_anew() {
    structure_.pack();
    const auto anew = make_fast_backend({.threads = 1});
    anew->load(structure_.hierarchy());
    return solve_coarsest(*backend_) == solve_coarsest(*anew);
  }

 private:
  std::vector<double> solve_coarsest(Backend& backend) const {
    const Hierarchy& hierarchy = structure_.hierarchy();
    const int last = static_cast<int>(hierarchy.levels.size()) - 1;
    backend.set_operator({0.8, 400});
    backend.prepare(0);
    for (int l = 0; l < last; ++l) {
      backend.coarsen(l);
      backend.prepare(l + 1);
    }
    backend.factor_coarsest();
    const Level& level = hierarchy.levels.back();
    std::vector<double> values(3 * level.point.size());
    for (std::size_t i = 0; i < values.size(); ++i)
      values[i] = (level.fixed[i / 3] >> i % 3) & 1 ? 0 : 1 + static_cast<double>(i % 7);
    backend.write(last, kRight, values);
    backend.solve_coarsest();
    backend.read(last, kSolution, values);
    return values;
  }

  SimulationSetup setup_;
  Lattice lattice_;
  LinkedOctree body_;
  Surface surface_;
  Structure structure_;
  std::unique_ptr<Backend> backend_;
  int displacement_ = 0;
  std::int32_t blades_ = 0;
};

void expect_local(int refinement) {
  constexpr int kCoarsest = 250;  // vertices, whose order of elimination takes next to nothing
  CutBody small(128, refinement, kCoarsest, true), large(1024, refinement, kCoarsest, true);
  ASSERT_GT(large.cells(), 7 * small.cells());
  for (int i = 0; i < 6; ++i) {
    SCOPED_TRACE(::testing::Message() << "blade " << i);
    const Vec3d place{4.31 + 0.1 * i, 5.2, 4.6 + 0.3 * i};
    const Cost a = small.pass(place), b = large.pass(place);
    ASSERT_TRUE(a.in_place && b.in_place);
    EXPECT_GT(a.changed[0], 15u);
    EXPECT_GT(a.changed[3], 0u);
    EXPECT_EQ(a.changed, b.changed);
    if (i == 0) continue;  // lists of all cells or vertices that are full grow by a part
    // Some lists are as long as the patches that a blade touches, and more levels have full ones in
    // the large body. One number of 32 bits for each of its cells would take 4 MB.
    EXPECT_LT(b.bytes, a.bytes + 3'000'000);
  }
}

TEST(CutCost, OfASmallCutInAUniformBody) { expect_local(0); }
TEST(CutCost, OfASmallCutInAnOctree) { expect_local(2); }

TEST(CutCost, IsWithoutTheOrderOfACoarsestLevelThatIsAsItWas) {
  CutBody body(64, 0, 1500, false);
  const Cost narrow = body.pass({6.6, 6.2, 6.4}, 1.6);
  ASSERT_TRUE(narrow.in_place);
  EXPECT_GT(narrow.changed[1], 0u);
  EXPECT_FALSE(narrow.coarsest_changed);
  EXPECT_LT(narrow.bytes, 1'500'000u);
  EXPECT_TRUE(body.solves_as_loaded_anew());

  const Cost wide = body.pass({24.3, 16.2, 16.1}, 22);
  ASSERT_TRUE(wide.in_place);
  EXPECT_TRUE(wide.coarsest_changed);
  EXPECT_TRUE(body.solves_as_loaded_anew());
}

}  // namespace
}  // namespace kerf
