// SPDX-License-Identifier: MIT
//
// The surface of a running simulation: it follows the body and does not touch it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>

#include "tests/support/physics.hpp"
#include "tests/support/surface_cases.hpp"

namespace kerf {
namespace {

constexpr double kRounding = 1e-12;  // of bodies of 1 m

/// A block of 1 x 1 x 0.5 m that sags from its floor, cut in two downwards from 0.02 to 0.08 s, and
/// then by a blade that passes where it is cut already.
SimulationSetup block(SurfaceMethod method, int refinement = 1) {
  SimulationSetup setup;
  setup.surface = method;
  setup.body = {test::box_solid({1, 1, 0.5}), 16, refinement};
  setup.material = {2e4, 0.4, 1000, 0, 0.01};
  setup.supports = {{{{-9, -9, -9}, {9, 0.001, 9}}, {}, {true, true, true}}};
  setup.loads = {Gravity{{3, -9.81, 0}}};
  setup.time.duration = 0.12;
  CutSetup cut;
  cut.start = 0.02;
  cut.end = 0.08;
  cut.lines = test::straight_cut({0.53, 1.5, -1}, {0.47, -0.4, -1}, {0.04, 0.1, 3});
  CutSetup again;
  again.start = 0.1;
  again.deformed = false;
  again.lines = test::straight_cut({0.52, 1.5, -1}, {0.45, 0.5, -1}, {0.04, 0.1, 3});
  setup.cuts = {cut, again};
  return setup;
}

TEST(SimulationSurface, BoxKeepsTheNormalsOfItsFacesAtEdgesAndCorners) {
  constexpr double kFloat = 1e-6;  // records are floats
  SimulationSetup setup = block(SurfaceMethod::dual_contouring);
  setup.body.resolution = 8;
  setup.cuts.clear();

  const SurfaceMesh mesh = Simulation(setup, test::cpu()).surface_mesh();

  std::vector<std::set<std::int32_t>> normals(mesh.reference.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k)
      normals[static_cast<std::size_t>(mesh.triangles[t][k])].insert(mesh.normal_of[t][k]);
  std::map<std::size_t, std::size_t> points;  // by their number of normals
  for (const auto& of_point : normals) ++points[of_point.size()];
  for (const Vec3d& n : mesh.normals)
    EXPECT_NEAR(std::max({std::abs(n.x), std::abs(n.y), std::abs(n.z)}), 1, kFloat);
  // 8 x 8 x 4 cells: a grid point each, 8 corners, 4 (7 + 7 + 3) on edges.
  EXPECT_EQ(points[3], 8u);
  EXPECT_EQ(points[2], 68u);
  EXPECT_EQ(points[1], mesh.reference.size() - 76);
}

TEST(SimulationSurface, LeavesTheStateAsItIsWithoutOne) {
  for (const TimeMode mode : {TimeMode::dynamic, TimeMode::statics}) {
    std::vector<std::uint64_t> hashes;
    for (const SurfaceMethod method :
         {SurfaceMethod::none, SurfaceMethod::dual_contouring, SurfaceMethod::splitting_cubes}) {
      SimulationSetup setup = block(method);
      setup.body.resolution = 8;
      setup.material.young = 2e5;
      setup.time.mode = mode;
      for (CutSetup& cut : setup.cuts) cut.lines[1] = {{0.5, 0.4, -1}, {0.54, 0.5, 2}};  // half-way
      Simulation simulation(setup, test::cpu());
      while (!simulation.finished()) simulation.step();
      hashes.push_back(simulation.state_hash());

      EXPECT_GT(simulation.links_cut(), 0u);
      EXPECT_EQ(simulation.surface_mesh().triangles.empty(), method == SurfaceMethod::none);
    }

    EXPECT_EQ(hashes[0], hashes[1]);
    EXPECT_EQ(hashes[0], hashes[2]);
  }
}

TEST(SimulationSurface, HasItsPartsOfTheTimes) {
  const std::set<std::string> phases{"surface", "surface_bind", "surface_positions",
                                     "surface_normals"};
  for (const SurfaceMethod method : {SurfaceMethod::none, SurfaceMethod::splitting_cubes}) {
    Simulation simulation(block(method), test::cpu());
    while (!simulation.finished()) simulation.step();

    std::map<std::string, double> found;
    for (const auto& [phase, seconds] : simulation.seconds())
      if (phases.contains(phase)) found[phase] += seconds;

    ASSERT_EQ(found.size(), phases.size());
    for (const auto& [phase, seconds] : found)
      EXPECT_EQ(seconds > 0, method != SurfaceMethod::none) << phase;
  }
}

TEST(SimulationSurface, CountsItsBytes) {
  const Simulation without(block(SurfaceMethod::none), test::cpu());
  const Simulation with(block(SurfaceMethod::dual_contouring), test::cpu());

  const std::size_t points = with.surface_mesh().reference.size();
  EXPECT_GT(with.bytes(), without.bytes() + points * sizeof(BoundPoint));
}

/// The field of a leaf at a place at rest, from the deformed positions of its corners.
Vec3d field_of(const LinkedOctree& body, std::int32_t leaf, const Vec3d* corners, const Vec3d& x) {
  const auto& node = body.nodes()[static_cast<std::size_t>(leaf)];
  const double side = body.lattice().spacing * (1 << node.size_log2);
  const Vec3d low = body.lattice().point(node.corner);
  Vec3d out;
  for (int i = 0; i < 8; ++i) {
    double weight = 1;
    for (int d = 0; d < 3; ++d) {
      const double t = (x[d] - low[d]) / side;
      weight *= (i >> d & 1) != 0 ? t : 1 - t;
    }
    out += weight * corners[i];
  }
  return out;
}

/// Places in body.leaves() of the leaves over the finest cells around x.
std::set<std::size_t> leaves_near(const LinkedOctree& body,
                                  const std::map<std::int32_t, std::size_t>& place_of,
                                  const Vec3d& x) {
  std::set<std::size_t> out;
  for (int i = 0; i < 27; ++i) {
    const int by[3] = {i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1};
    Vec3i c;
    for (int d = 0; d < 3; ++d)
      c[static_cast<std::size_t>(d)] =
          by[d] +
          static_cast<int>(std::floor((x[d] - body.lattice().origin[d]) / body.lattice().spacing));
    const std::int32_t leaf = body.leaf_at(c);
    if (leaf >= 0) out.insert(place_of.at(leaf));
  }
  return out;
}

// The surface does not say which cell a point is bound to; so the point must lie where one of the
// cells of its piece around it says, and every point must.
void expect_points_on_the_field(const Simulation& simulation) {
  const SurfaceMesh mesh = simulation.surface_mesh();
  const std::vector<Vec3d> corners = simulation.deformed_corners();
  const std::vector<std::int32_t> piece = label_pieces(simulation.body(), nullptr);
  const NodeList leaves = simulation.body().leaves();
  std::map<std::int32_t, std::size_t> place_of;
  for (std::size_t i = 0; i < leaves.size(); ++i) place_of[leaves[i]] = i;
  ASSERT_FALSE(mesh.reference.empty());
  double moved = 0;
  for (std::size_t p = 0; p < mesh.reference.size(); ++p) {
    const Vec3d& x = mesh.reference[p];
    double least = 1e9;
    for (const std::size_t leaf : leaves_near(simulation.body(), place_of, x))
      if (piece[leaf] == mesh.piece[p])
        least =
            std::min(least, norm(field_of(simulation.body(), leaves[leaf], &corners[8 * leaf], x) -
                                 mesh.position(static_cast<std::int32_t>(p))));
    ASSERT_LT(least, kRounding) << "point " << p;
    moved = std::max(moved, norm(mesh.displacement[p]));
  }
  EXPECT_GT(moved, 1e-4);
}

class Methods : public ::testing::TestWithParam<SurfaceMethod> {};
INSTANTIATE_TEST_SUITE_P(SimulationSurface, Methods, ::testing::ValuesIn(test::kMethods),
                         [](const auto& method) { return test::method_name(method.param); });

TEST_P(Methods, LiesOnTheDeformedBodyAfterEveryStep) {
  for (const int refinement : {0, 2}) {
    Simulation simulation(block(GetParam(), refinement), test::cpu());
    EXPECT_TRUE(test::is_manifold(simulation.surface_mesh()));
    std::size_t most_pieces = 0;
    while (!simulation.finished()) {
      simulation.step();

      const SurfaceMesh mesh = simulation.surface_mesh();
      EXPECT_TRUE(test::is_manifold(mesh));
      EXPECT_TRUE(test::pieces_are_apart(mesh, simulation.pieces()));
      for (const Vec3d& n : mesh.normals) ASSERT_NEAR(norm(n), 1, kRounding);
      expect_points_on_the_field(simulation);
      most_pieces = std::max(most_pieces, simulation.pieces());
    }
    EXPECT_GE(most_pieces, 2u);
  }
}

// A blade that only passes nearer changes no cell, but the surface follows it at once.
TEST_P(Methods, FollowsABladeThatOnlyComesNearer) {
  SimulationSetup setup = block(GetParam(), 0);
  setup.cuts.clear();
  for (const double x : {0.505, 0.48}) {  // between the centres at 15/32 and 17/32
    CutSetup cut;
    cut.start = setup.cuts.empty() ? 0 : 0.04;
    cut.deformed = false;
    cut.lines = test::straight_cut({x, 1.5, -1}, {x, -0.5, -1}, {0, 0, 3});
    setup.cuts.push_back(cut);
  }
  setup.time.duration = 0.08;
  Simulation simulation(setup, test::cpu());
  std::vector<std::set<std::int32_t>> ids;
  while (!simulation.finished()) {
    const StepReport report = simulation.step();

    const SurfaceMesh mesh = simulation.surface_mesh();
    ids.emplace_back(mesh.cut_id.begin(), mesh.cut_id.end());
    EXPECT_TRUE(test::is_manifold(mesh));
    expect_points_on_the_field(simulation);
    if (!report.cuts.empty() && report.cuts[0].cut_id == 2) {
      EXPECT_FALSE(report.cuts[0].changed());
      EXPECT_EQ(report.cuts[0].moved.size(), 16u * 8u);
    }
  }

  ASSERT_EQ(ids.size(), 4u);
  EXPECT_EQ(ids[0], (std::set<std::int32_t>{0, 1}));
  EXPECT_EQ(ids[3], (std::set<std::int32_t>{0, 1, 2}));
}

TEST_P(Methods, GivesTheSameMeshForAnyThreads) {
  SurfaceMesh one;
  for (const int threads : {1, 3}) {
    Simulation simulation(block(GetParam(), 1), test::cpu(threads));
    while (!simulation.finished()) simulation.step();

    const SurfaceMesh mesh = simulation.surface_mesh();
    if (threads == 1) one = mesh;
    EXPECT_EQ(mesh.displacement, one.displacement);
    EXPECT_EQ(mesh.normals, one.normals);
  }
}

}  // namespace
}  // namespace kerf
