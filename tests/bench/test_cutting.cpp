// SPDX-License-Identifier: MIT
//
// Every scene of kerf_cutting at its smallest size with every method; errors and orders against
// what the theory of linear elements allows; the files, the picture and the command line.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "bench/cutting/body.hpp"
#include "bench/cutting/exact.hpp"
#include "bench/cutting/figures.hpp"
#include "bench/cutting/options.hpp"
#include "bench/cutting/scenes.hpp"
#include "core/base/error.hpp"
#include "tests/support/files.hpp"

namespace kerf::cutting {
namespace {

constexpr int kThreads = 2;

std::vector<Record> run(const std::string& scene, Method method, const std::vector<int>& sizes) {
  std::vector<Record> out;
  for (const int size : sizes) out.push_back(run_scene(find_scene(scene), method, size, kThreads));
  add_orders(out);
  return out;
}

// ---- every scene and method

struct Case {
  const Scene* scene;
  Method method;
};

class CuttingScene : public testing::TestWithParam<Case> {};

TEST_P(CuttingScene, RunsAtItsSmallestSize) {
  const auto [scene, method] = GetParam();

  const Record r = run_scene(*scene, method, scene->sizes.front(), kThreads);

  EXPECT_GT(r.cost.cells, 0u);
  EXPECT_GT(r.cost.unknowns, 0u);
  EXPECT_GT(r.cost.bytes, 0);
  EXPECT_GT(r.h, 0);
  EXPECT_LE(r.cost.residual, 1e-9);
  EXPECT_TRUE(std::isfinite(r.value));
  EXPECT_TRUE(std::isfinite(r.error));
  EXPECT_LT(r.error, 2);  // removal of cells can be as bad as that
  EXPECT_EQ(r.cost.removed > 0, method == Method::deletion);
}

std::vector<Case> all_cases() {
  std::vector<Case> out;
  for (const Scene& scene : scenes())
    for (const MethodInfo& info : methods()) out.push_back({&scene, info.method});
  return out;
}

std::string case_name(const testing::TestParamInfo<Case>& info) {
  std::string name = text(info.param.scene->name, "_", name_of(info.param.method));
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
}

INSTANTIATE_TEST_SUITE_P(All, CuttingScene, testing::ValuesIn(all_cases()), case_name);

// ---- orders

// Trilinear elements: displacement and energy converge with the square of h where the solution is
// smooth. A thousandth: the interpolant of the quadratic field is off by a w h^2 / 8 = 1/512 of
// a field of about 1.
TEST(CuttingBar, ConvergesWithTheSquareOfTheCellOnTheGrid) {
  const Record r = run("bar", Method::uniform, {4, 8}).back();

  EXPECT_LT(r.error, 1e-3);
  EXPECT_GT(r.order, 1.8);
  EXPECT_GT(r.energy_order, 1.8);
  EXPECT_EQ(r.cost.pieces, 2u);
}

// Larger cells inside are four times as wide at most: sixteen times the error.
TEST(CuttingBar, LosesLittleInLargerCells) {
  const Record grid = run("bar", Method::uniform, {8}).back();
  const Record octree = run("bar", Method::octree, {8}).back();

  EXPECT_LT(octree.cost.cells, grid.cost.cells);
  EXPECT_LT(octree.error, 16 * grid.error);
}

// The cut moves to the nearest plane of the grid, here a third of a cell away; a removed layer or
// copies of whole cells are worse.
TEST(CuttingBar, BetweenPlanesIsFirstOrderAndBetterThanRemovedCells) {
  const std::vector<Record> grid = run("bar-between", Method::uniform, {4, 8});
  const Record removed = run("bar-between", Method::deletion, {8}).back();
  const Record copies = run("bar-between", Method::virtual_nodes, {8}).back();

  EXPECT_GT(grid[1].order, 0.8);
  EXPECT_LT(grid[1].error, removed.error);
  EXPECT_LT(grid[1].energy_error, copies.energy_error);
  EXPECT_GT(copies.cost.cells, grid[1].cost.cells);
}

// A section of n cells is too stiff by about 1 / n^2 of shear in the bending field.
TEST(CuttingRods, ApproachBeamTheoryAndAreAllAlike) {
  const Record r = run("rods", Method::uniform, {2, 4}).back();

  EXPECT_EQ(r.cost.pieces, 9u);
  EXPECT_LT(r.error, 1.0 / 16);
  EXPECT_GT(r.order, 1.5);
  for (const Part& rod : r.parts) EXPECT_NEAR(rod.value, r.value, 1e-7 * r.value) << rod.name;
  EXPECT_LT(r.value, r.exact);  // elements of displacements are too stiff
}

// Copies of whole cells make every rod as stiff as the cells it touches.
TEST(CuttingRods, BetweenPlanesAreWorseOffWithWholeCopiesOrHoles) {
  const Record grid = run("rods-between", Method::uniform, {2}).back();
  const Record copies = run("rods-between", Method::virtual_nodes, {2}).back();
  const Record removed = run("rods-between", Method::deletion, {2}).back();

  EXPECT_LT(grid.error, copies.error);
  EXPECT_LT(copies.value, copies.exact);
  EXPECT_LT(grid.error, removed.error);
  EXPECT_GT(removed.value, removed.exact);
}

// Two and a half percent: an arm of n = 8 cells is too stiff by about 1 / n^2, the theory leaves
// out (1/6)^3, and the tip of the slit is some part of a cell off.
TEST(CuttingCantilevers, OpenAsFractureMechanicsSays) {
  const Record r = run("cantilevers", Method::uniform, {4, 8}).back();

  EXPECT_LT(r.error, 0.025);
  EXPECT_GT(r.order, 1.2);
  EXPECT_LT(r.value, r.exact);
}

// At the rim stress is singular, so that the order is one; a rim that is off by half a cell is off
// by 3 h / 2 in volume, radius 1.
TEST(CuttingPenny, OpensAsSneddonSays) {
  const Record r = run("penny", Method::uniform, {4, 8}).back();

  EXPECT_LT(r.energy_error, 1.5 * r.h);
  EXPECT_GT(r.energy_order, 0.8);
  EXPECT_LT(r.error, 1.5 * r.h);
  EXPECT_LT(std::abs(r.parts[1].value / r.parts[1].exact - 1), r.h);  // its area
}

// The same bound for every angle, and between them.
TEST(CuttingTilt, ShowsLittleInStiffness) {
  const Record r = run("tilted", Method::uniform, {4}).back();

  ASSERT_EQ(r.parts.size(), 7u);
  for (const Part& part : r.parts)
    EXPECT_LT(std::abs(part.value / part.exact - 1), 1.5 * r.h) << part.name;
  EXPECT_LT(r.spread, 0.75 * r.h);
  EXPECT_NEAR(r.parts[1].value, r.parts[5].value, 1e-6 * r.value);  // 15 and 75 degrees mirror
}

// What differs is rounding and the linear solver.
TEST(CuttingOrders, DoNotMatter) {
  for (const Method method : {Method::uniform, Method::octree}) {
    const Record r = run("orders", method, {16}).back();

    EXPECT_LT(r.error, 1e-9) << name_of(method);
    EXPECT_LT(r.energy_error, 1e-9) << name_of(method);
    ASSERT_EQ(r.parts.size(), 4u);
  }
}

// ---- what the scenes stand on

// On the axis, from the harmonic function g that is half the opening on the disk and zero around
// it: u = g - z g' / (2 (1 - nu)), g = u(0) (1 - z arccot z).
TEST(CuttingExact, PennyCrackMovesItsAxisAsPotentialTheorySays) {
  const Elastic material{1000, 0.3, 1};
  const Vec3d normal{0.6, 0, 0.8};
  const PennyCrack crack(normal, 1, 2, material);
  const double half = 0.5 * crack.opening(0);
  for (const double z : {1.0, 2.0, 5.0}) {
    const double angle = std::atan(1 / z);
    const double g = half * (1 - z * angle), slope = half * (z / (1 + z * z) - angle);

    const Vec3d u = crack.displacement(z * normal);

    EXPECT_NEAR(dot(u, normal), g - z * slope / (2 * (1 - 0.3)), 1e-6 * half) << z;
    EXPECT_NEAR(norm(u), dot(u, normal), 1e-9 * half) << z;
  }
}

TEST(CuttingExact, PennyCrackHoldsTheVolumeOfItsOpening) {
  const PennyCrack crack({0, 0, 1}, 2, 3, {1000, 0.25, 1});
  constexpr int kRings = 2000;
  double sum = 0;
  for (int i = 0; i < kRings; ++i) {
    const double r = 2 * (i + 0.5) / kRings;
    sum += 2 * 3.14159265358979 * r * crack.opening(r) * 2 / kRings;
  }

  EXPECT_NEAR(sum, crack.volume(), 1e-4 * crack.volume());
}

TEST(CuttingExact, HangingBarObeysEquilibriumAndHooke) {
  const HangingBar bar{2, 1.5, 0.7, {500, 0.3, 1}};
  constexpr double kStep = 1e-4;
  const Vec3d p{0.8, 0.2, -0.3};
  const auto u = [&](double x, double y, double z) { return bar.displacement(x, y, z); };
  const double strain = (u(p.x + kStep, p.y, p.z).x - u(p.x - kStep, p.y, p.z).x) / (2 * kStep);
  const double across = (u(p.x, p.y + kStep, p.z).y - u(p.x, p.y - kStep, p.z).y) / (2 * kStep);
  const double shear = (u(p.x, p.y + kStep, p.z).x - u(p.x, p.y - kStep, p.z).x +
                        u(p.x + kStep, p.y, p.z).y - u(p.x - kStep, p.y, p.z).y) /
                       (2 * kStep);

  EXPECT_NEAR(500 * strain, 0.7 * (2 - p.x), 1e-9);  // stress: the weight of what hangs below
  EXPECT_NEAR(across, -0.3 * strain, 1e-12);
  EXPECT_NEAR(shear, 0, 1e-12);
}

TEST(CuttingBody, CellsAreRemovedWhereABladeMeetsTheirInside) {
  const Vec3d flat[3] = {{-1, -1, 0.5}, {3, -1, 0.5}, {-1, 3, 0.5}};
  const Vec3d beside[3] = {{-1, -1, 1}, {3, -1, 1}, {-1, 3, 1}};
  const Vec3d corner[3] = {{1.6, 0.5, 0.5}, {0.5, 1.6, 0.5}, {1.6, 1.6, 0.5}};

  EXPECT_TRUE(meets(flat, {{0, 0, 0}, {1, 1, 1}}));
  EXPECT_FALSE(meets(beside, {{0, 0, 0}, {1, 1, 1}}));  // on its face
  EXPECT_FALSE(meets(corner, {{0, 0, 0}, {1, 1, 1}}));  // its box meets, the triangle does not
}

TEST(CuttingBody, CopiesStandWhereACellFallsApart) {
  const Shape shape{
      {{0, 0, 0}, {4, 1, 1}}, 4, {}, {{{{2.4, -1, -1}, {2.4, 3, -1}, {2.4, -1, 3}}, {{0, 1, 2}}}}};

  const CutBody uniform = make_body(shape, Method::uniform);
  const CutBody copies = make_body(shape, Method::virtual_nodes);

  EXPECT_EQ(uniform.level().cells(), 4);
  EXPECT_EQ(copies.level().cells(), 5);
  EXPECT_EQ(copies.level().vertices(), 4 * 7);  // 3 + 1 planes of four, less what is joined
}

// ---- files and command line

class CuttingFiles : public test::FolderTest {};

TEST_F(CuttingFiles, LinesAreReadBack) {
  const std::vector<Record> records = run("bar", Method::uniform, {4, 8});
  write_json(root_ / "a.jsonl", records, {"c0ffee", "release", "epyc"});

  const std::vector<Record> back = read_json(root_ / "a.jsonl");

  ASSERT_EQ(back.size(), 2u);
  EXPECT_EQ(back[1].scene, "bar");
  EXPECT_EQ(back[1].error, records[1].error);
  EXPECT_EQ(back[1].order, records[1].order);
  EXPECT_TRUE(std::isnan(back[0].order));
  EXPECT_NE(markdown_tables(back).find("| uniform | 8 | 2048 |"), std::string::npos);
  EXPECT_NE(plot_svg(back).find("bar: error against cells"), std::string::npos);
}

TEST_F(CuttingFiles, DamagedLinesAreNamed) {
  std::ofstream(root_ / "bad.jsonl") << "{\"scene\": 3}\n";

  try {
    read_json(root_ / "bad.jsonl");
    ADD_FAILURE() << "was read";
  } catch (const Error& error) {
    EXPECT_EQ(std::string(error.what()).find((root_ / "bad.jsonl").string() + ":1: "), 0u)
        << error.what();
  }
}

std::string refusal(std::vector<const char*> arguments) {
  arguments.insert(arguments.begin(), "kerf_cutting");
  try {
    parse_options(static_cast<int>(arguments.size()), arguments.data());
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(CuttingOptions, NamesAndValuesAreChecked) {
  EXPECT_EQ(refusal({"--scene", "bars"}), "--scene: no scene 'bars'; did you mean 'bar'?");
  EXPECT_EQ(refusal({"--scene", "bar", "--method", "octre"}),
            "--method: no method 'octre'; did you mean 'octree'?");
  EXPECT_EQ(refusal({"--sceen", "bar"}), "no option '--sceen'; did you mean '--scene'?");
  EXPECT_EQ(refusal({"--scene", "bar", "--sizes", "4,x"}),
            "--sizes must be a number from 1 to 1024, not 'x'");
  EXPECT_EQ(refusal({"--plot", "a.jsonl"}), "--plot FILE.jsonl and --svg FILE.svg go together");
  EXPECT_EQ(refusal({"--scene"}), "--scene needs a value");
  EXPECT_NE(refusal({}), "");
}

}  // namespace
}  // namespace kerf::cutting
