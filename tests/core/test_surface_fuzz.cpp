// SPDX-License-Identifier: MIT
//
// Surfaces of small bodies under random blades; KERF_FUZZ sets how many. A failure names the seed
// of its body: the blades before it come from the same seed.
#include <gtest/gtest.h>

#include <algorithm>

#include "core/body/cut.hpp"
#include "core/body/pieces.hpp"
#include "tests/support/bodies.hpp"
#include "tests/support/random_blades.hpp"
#include "tests/support/surface_cases.hpp"

namespace kerf {
namespace {

using test::blade_count;
using test::Dice;
using test::random_body;

constexpr int kBladesPerBody = 8;
constexpr std::uint64_t kFirstSeed = 20150900;

/// A surface that was brought up to date is the one built anew, to the last bit.
void expect_same_mesh(const SurfaceMesh& a, const SurfaceMesh& b) {
  EXPECT_EQ(a.reference, b.reference);
  EXPECT_EQ(a.triangles, b.triangles);
  EXPECT_EQ(a.normal_of, b.normal_of);
  EXPECT_EQ(a.cut_id, b.cut_id);
  EXPECT_EQ(a.piece, b.piece);
}

void cut_one_body(std::uint64_t seed, int blades, SurfaceMethod method) {
  Dice dice(seed);
  const Voxels voxels = random_body(dice);
  LinkedOctree body(voxels, dice.roll(4));
  test::RandomBlades random(voxels.lattice, dice);
  Surface surface(body, method);
  for (int i = 0; i < blades; ++i) {
    SCOPED_TRACE(::testing::Message() << "seed " << seed << ", blade " << i);

    const CutEvent event = cut(body, {}, random.next(), i + 1);
    surface.update(body, event);
    surface.bind(body);
    const SurfaceMesh mesh = test::mesh_at_rest(surface, body);

    EXPECT_TRUE(test::is_manifold(mesh));
    std::size_t pieces = 0;
    label_pieces(body, &pieces);
    EXPECT_TRUE(test::pieces_are_apart(mesh, pieces));
    Surface anew(body, method);
    anew.bind(body);
    expect_same_mesh(mesh, test::mesh_at_rest(anew, body));
    if (::testing::Test::HasFailure()) return;
  }
}

class SurfaceFuzz : public ::testing::TestWithParam<SurfaceMethod> {};

TEST_P(SurfaceFuzz, RandomBladesLeaveAManifoldThatIsAsBuiltAnew) {
  const int count = blade_count();
  ASSERT_GT(count, 0) << "KERF_FUZZ must be the number of blades";
  for (int done = 0, body = 0; done < count && !HasFailure(); done += kBladesPerBody, ++body)
    cut_one_body(kFirstSeed + static_cast<std::uint64_t>(body),
                 std::min(kBladesPerBody, count - done), GetParam());
}

INSTANTIATE_TEST_SUITE_P(Methods, SurfaceFuzz,
                         ::testing::Values(SurfaceMethod::dual_contouring,
                                           SurfaceMethod::splitting_cubes),
                         [](const auto& method) { return test::method_name(method.param); });

}  // namespace
}  // namespace kerf
