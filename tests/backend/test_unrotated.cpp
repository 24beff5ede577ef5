// SPDX-License-Identifier: MIT
//
// Matrices that the mixed backend stores without rotation and keeps while cells turn: whatever came
// before, they are those of a backend that never saw anything else. That these are right is for
// test_fast.cpp.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "tests/support/as_one.hpp"
#include "tests/support/random_blades.hpp"
#include "tests/support/solves.hpp"

namespace kerf {
namespace {

using oracle::Vector;
using test::Problem;
using test::ProblemOptions;
using test::relative;

constexpr OperatorScale kDynamic{0.8, 400};

ProblemOptions options_of(test::Holds holds, int levels) {
  ProblemOptions options;
  options.holds = holds;
  options.coarsest_vertices = 1;
  options.max_levels = levels;
  options.materials = 1;
  options.with_oracle = false;
  return options;
}

/// Adds a turn by twice `half`, in radians.
void add_rotation(double half, std::vector<double>& out) {
  for (const double part : {std::cos(half), 0.0, 0.6 * std::sin(half), 0.8 * std::sin(half)})
    out.push_back(part);
}

/// Turns cells of level 0 by less than a twentieth of a radian one from the next but one; those
/// with a smaller x than `wild` anyhow.
std::vector<double> rotations_of(const Problem& p, double start, double wild) {
  const Level& finest = p.hierarchy.levels[0];
  test::Dice dice(3);
  std::vector<double> out;
  for (std::int32_t c = 0; c < finest.cells(); ++c) {
    const Vec3i& at = finest.corner[c];
    add_rotation(
        at[0] < wild ? dice.between(-1, 1) : start + 0.002 * (at[0] + 2 * at[1] + 3 * at[2]), out);
  }
  return out;
}

struct Operators {
  std::vector<Vector> products;  ///< of all levels, and all matrices of the coarsest
  std::vector<Vector> inverses;  ///< of the diagonal blocks of all levels, times a vector
};

/// Of values that are made again.
Operators operators_of(const Problem& p, Backend& backend, const std::vector<double>& rotations) {
  Operators out;
  backend.write_rotations(rotations);
  for (int l = 0; l < p.levels(); ++l) {
    if (l > 0) backend.coarsen(l - 1);
    backend.prepare(l);
    test::write(backend, l, kKrylovX, p.free_vector(l, 7));
    backend.apply(l, kKrylovX, kKrylovV);
    out.products.push_back(p.read(backend, l, kKrylovV));
    backend.precondition_jacobi(l, kKrylovX, kKrylovV);
    out.inverses.push_back(p.read(backend, l, kKrylovV));
  }
  Vector matrix(300);
  const int last = p.levels() - 1;
  for (std::int32_t c = 0; c < p.level(last).cells(); ++c) {
    backend.read_cell_matrix(last, c, {matrix.data(), 300});
    out.products.push_back(matrix);
  }
  return out;
}

// Cells are near each other's rotation, some are not for a while and then are again; and the
// operator is another, or that of the beginning.
TEST(UnrotatedMatrices, AreThoseOfNowWhateverCameBefore) {
  struct Stage {
    double start, wild;
    OperatorScale scale;
  };
  constexpr OperatorScale kStatic{1, 0};
  const Problem p = test::cut_block({33, 22, 15}, {14.3, 9.2, 7.1}, 8, 60);
  ASSERT_GE(p.levels(), 4);
  const auto ones = test::as_one(p, rotations_of(p, 0.2, 0), 0.1);
  for (const std::size_t level : {1, 2}) ASSERT_GT(ones.count[1][level], 10) << level;
  const auto kept = test::make_backend("mixed");
  kept->load(p.hierarchy);
  int stage = 0;
  for (const Stage& s : {Stage{0.2, 0, kDynamic}, Stage{0.7, 0, kDynamic}, Stage{0.7, 9, kDynamic},
                         Stage{0.1, 0, kDynamic}, Stage{0.1, 99, kDynamic}, Stage{0.3, 0, kDynamic},
                         Stage{0.3, 0, {0.8, 500}}, Stage{0.3, 0, kStatic}, Stage{0.4, 9, kStatic},
                         Stage{0.4, 0, kDynamic}}) {
    SCOPED_TRACE(::testing::Message() << "stage " << stage++);
    const std::vector<double> rotations = rotations_of(p, s.start, s.wild);
    const auto fresh = test::make_backend("mixed");
    fresh->load(p.hierarchy);
    for (Backend* backend : {kept.get(), fresh.get()}) backend->set_operator(s.scale);
    const Operators found = operators_of(p, *kept, rotations);
    const Operators expected = operators_of(p, *fresh, rotations);
    ASSERT_EQ(found.products, expected.products);
    ASSERT_EQ(found.inverses, expected.inverses);
  }
}

/// Cuts a body again and again: a backend that follows and one that is loaded after each blade have
/// the same operators. Named vertices are held or free in turn.
template <class Blade, class Vertex>
void expect_to_follow(Problem& p, int blades, const Blade& blade, const Vertex& vertex) {
  constexpr double kCoded = 5e-5;  // one more or less of 32767, where sums have another order
  constexpr double kInverted = 2e-3;
  const auto kept = test::make_backend("mixed", 2);
  kept->load(p.hierarchy);
  kept->set_operator(kDynamic);
  operators_of(p, *kept, rotations_of(p, 0.2, 0));
  LevelUpdater updater;
  for (int i = 0; i < blades; ++i) {
    SCOPED_TRACE(::testing::Message() << "blade " << i);
    ASSERT_TRUE(p.update(updater, cut(p.body, {}, blade(i), i + 1), vertex()));
    kept->update(p.hierarchy, updater.change());
    const auto fresh = test::make_backend("mixed");
    fresh->load(p.hierarchy);
    fresh->set_operator(kDynamic);
    const std::vector<double> rotations = rotations_of(p, 0.2 + 0.1 * i, 0);
    const Operators found = operators_of(p, *kept, rotations);
    const Operators expected = operators_of(p, *fresh, rotations);
    for (std::size_t n = 0; n < found.products.size(); ++n)
      ASSERT_LE(relative(found.products[n], expected.products[n]), kCoded) << n;
    for (std::size_t n = 0; n < found.inverses.size(); ++n)
      ASSERT_LE(relative(found.inverses[n], expected.inverses[n]), kInverted) << "level " << n;
  }
}

TEST(UnrotatedMatrices, OfABodyThatIsLoadedAreNotThoseOfTheOneBefore) {
  const Problem before = test::cut_block({33, 22, 15}, {14.3, 9.2, 7.1}, 8, 60);
  const Problem p = test::cut_block({33, 22, 15}, {17.3, 12.2, 6.1}, 8, 60);
  const auto kept = test::make_backend("mixed"), fresh = test::make_backend("mixed");
  kept->load(before.hierarchy);
  kept->set_operator(kDynamic);
  operators_of(before, *kept, rotations_of(before, 0.2, 0));
  for (Backend* backend : {kept.get(), fresh.get()}) {
    backend->load(p.hierarchy);
    backend->set_operator(kDynamic);
  }
  const std::vector<double> rotations = rotations_of(p, 0.2, 0);
  EXPECT_EQ(operators_of(p, *kept, rotations).products,
            operators_of(p, *fresh, rotations).products);
}

// A factor is made of it: where its cells are eight of nearly one rotation, too.
TEST(UnrotatedMatrices, AreNoneOnTheCoarsestLevel) {
  for (const int levels : {2, 3}) {
    const Problem p(LinkedOctree(test::box_body({16, 16, 16}), 0),
                    options_of(test::Holds::none, levels));
    ASSERT_EQ(p.levels(), levels);
    std::vector<double> rotations;
    for (std::int32_t c = 0; c < p.level(0).cells(); ++c) {
      const Vec3i at = p.level(0).corner[c];
      add_rotation(0.2 + (at[0] >> (levels - 2) & 1 ? 0.04 : -0.04), rotations);
    }
    Operators of[2];
    for (const int i : {0, 1}) {
      const auto backend = test::make_backend(i == 0 ? "cpu" : "mixed");
      backend->load(p.hierarchy);
      backend->set_operator(kDynamic);
      of[i] = operators_of(p, *backend, rotations);
    }
    for (std::size_t n = static_cast<std::size_t>(levels) - 1; n < of[0].products.size(); ++n)
      ASSERT_LE(relative(of[1].products[n], of[0].products[n]), 2e-6) << n;
  }
}

// Groups get other cells, more of them or other places; cells are split, or have vertices that are
// held otherwise.
TEST(UnrotatedMatrices, FollowCutsAsIfLoadedAfterThem) {
  for (const int refinement : {0, 1, 2}) {
    SCOPED_TRACE(::testing::Message() << "refinement " << refinement);
    const Voxels voxels = test::box_body({33, 18, 14});
    Problem p(LinkedOctree(voxels, refinement), options_of(test::Holds::one_side, 4));
    test::Dice dice(refinement + 1);
    test::RandomBlades random(voxels.lattice, dice);
    expect_to_follow(
        p, 6, [&](int) { return random.next(); },
        [&] { return std::vector<std::int32_t>{dice.roll(p.level(0).vertices())}; });
  }
}

// A wall of cut cells, and small blades across it: patches are large enough to stay as they are but
// for some cells, which lose some of those below.
TEST(UnrotatedMatrices, FollowSmallCutsThroughCellsThatAreCutAlready) {
  const Voxels voxels = test::box_body({64, 48, 48});
  Problem p(LinkedOctree(voxels, 0), options_of(test::Holds::one_side, 3));
  const double h = voxels.lattice.spacing;
  const Vec3d wall = voxels.lattice.origin + h * Vec3d{29.3, 20.4, 18.4};
  expect_to_follow(
      p, 3,
      [&](int i) {
        if (i == 0) return test::plane_blade(wall, {1, 0, 0}, 99 * h);
        return test::plane_blade(wall + (i - 1) * h * Vec3d{0, 9, 7}, {0, 1, 0.4}, 4 * h);
      },
      [] { return std::vector<std::int32_t>{}; });
}

}  // namespace
}  // namespace kerf
