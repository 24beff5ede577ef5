// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>

#include "app/progress.hpp"
#include "app/results.hpp"
#include "core/base/error.hpp"
#include "tests/support/files.hpp"
#include "tests/support/scenes.hpp"
#include "tests/support/surfaces.hpp"

namespace kerf {
namespace {

namespace fs = std::filesystem;
using test::read_all;
using test::vtk_array;

/// Two unit cells side by side along x that share no vertex: the link between them is cut.
Snapshot two_cut_cells() {
  Snapshot s;
  for (int c = 0; c < 2; ++c) {
    std::array<std::int32_t, 8> cell;
    for (int k = 0; k < 8; ++k) {
      cell[static_cast<std::size_t>(k)] = static_cast<std::int32_t>(s.points.size());
      s.points.push_back({c + double(k & 1), double(k >> 1 & 1), double(k >> 2)});
      s.displacement.push_back({0.1 * c, 0.01 * k, 0});
      s.velocity.push_back({0, 0, 1.0 * c});
      s.external_force.push_back({0, -1.0 / 3.0, 0});
      s.fixed.push_back(c == 0 && k == 0 ? 7 : 0);
      s.masters.push_back({-1, -1, -1, -1});
    }
    s.cells.push_back(cell);
    s.size_log2.push_back(0);
    s.piece.push_back(c);
    s.young.push_back(1e4 + c);
    s.poisson.push_back(0.4);
    s.density.push_back(1000);
    s.rotation.push_back(Mat3d::identity());
    for (int face = 0; face < 6; ++face)
      s.boundary.push_back({c, face, face == (c == 0 ? 1 : 0) ? 1 : 0});
  }
  s.masters[3] = {0, 1, -1, -1};
  return s;
}

class ResultsTest : public test::FolderTest {
 protected:
  void touch(const fs::path& file) { test::write_all(file, "x"); }
};

TEST_F(ResultsTest, OneAtATimeWritesIntoAFolder) {
  {
    const FolderLock lock(root_);
    EXPECT_THROW(FolderLock{root_}, Error);
    EXPECT_THROW(ResultsFolder(root_, {}), Error);
  }
  EXPECT_NO_THROW(FolderLock{root_});
  EXPECT_EQ(names(root_), std::vector<std::string>{});
}

// Of a run whose temporary files somebody removed, nothing counts.
TEST_F(ResultsTest, AnEarlierRunStaysWhereAFileIsGone) {
  touch(root_ / "summary.json");
  touch(root_ / "body_0000.vtu");
  {
    ResultsFolder results(root_, {});
    touch(results.add_file("body_0000.vtu"));
    fs::remove(results.add_file("preview.png"));
    EXPECT_THROW(results.commit({}), Error);
  }
  EXPECT_EQ(names(root_), (std::vector<std::string>{"body_0000.vtu", "summary.json"}));
  EXPECT_EQ(read_all(root_ / "summary.json"), "x");
}

TEST_F(ResultsTest, VtuHoldsWhatAnOutsiderNeedsToTheLastBit) {
  const Snapshot s = two_cut_cells();
  write_vtu(root_ / "a.vtu", s);
  const std::string vtu = read_all(root_ / "a.vtu");

  EXPECT_NE(vtu.find("NumberOfPoints=\"16\" NumberOfCells=\"2\""), std::string::npos);
  const auto points = vtk_array<double>(vtu, "Points", "Points");
  const auto force = vtk_array<double>(vtu, "PointData", "external_force");
  const auto displacement = vtk_array<double>(vtu, "PointData", "displacement");
  ASSERT_EQ(points.size(), 48u);
  ASSERT_EQ(displacement.size(), 48u);
  for (std::size_t i = 0; i < 16; ++i) {
    EXPECT_EQ(points[3 * i], s.points[i].x);
    EXPECT_EQ(displacement[3 * i + 1], s.displacement[i].y);
    EXPECT_EQ(force[3 * i + 1], -1.0 / 3.0);
  }
  EXPECT_EQ(vtk_array<double>(vtu, "PointData", "velocity")[47], 1.0);
  EXPECT_EQ(vtk_array<std::uint8_t>(vtu, "PointData", "fixed")[0], 7);
  const auto masters = vtk_array<std::int32_t>(vtu, "PointData", "masters");
  ASSERT_EQ(masters.size(), 64u);
  EXPECT_EQ(std::vector<std::int32_t>(masters.begin() + 12, masters.begin() + 16),
            (std::vector<std::int32_t>{0, 1, -1, -1}));
  // VTK numbers the corners of a hexahedron around the bottom, then around the top.
  EXPECT_EQ(vtk_array<std::int32_t>(vtu, "Cells", "connectivity"),
            (std::vector<std::int32_t>{0, 1, 3, 2, 4, 5, 7, 6, 8, 9, 11, 10, 12, 13, 15, 14}));
  EXPECT_EQ(vtk_array<std::int64_t>(vtu, "Cells", "offsets"), (std::vector<std::int64_t>{8, 16}));
  EXPECT_EQ(vtk_array<std::uint8_t>(vtu, "Cells", "types"), (std::vector<std::uint8_t>{12, 12}));
  EXPECT_EQ(vtk_array<std::uint8_t>(vtu, "CellData", "level"), (std::vector<std::uint8_t>{0, 0}));
  EXPECT_EQ(vtk_array<std::int32_t>(vtu, "CellData", "piece"), (std::vector<std::int32_t>{0, 1}));
  EXPECT_EQ(vtk_array<double>(vtu, "CellData", "youngs_modulus"),
            (std::vector<double>{1e4, 1e4 + 1}));
  EXPECT_EQ(vtk_array<double>(vtu, "CellData", "poissons_ratio")[1], 0.4);
  EXPECT_EQ(vtk_array<double>(vtu, "CellData", "density")[0], 1000);
  const auto rotation = vtk_array<double>(vtu, "CellData", "rotation");
  ASSERT_EQ(rotation.size(), 18u);
  EXPECT_EQ(rotation[13], 1.0);
}

TEST_F(ResultsTest, SummaryHasTheAgreedKeys) {
  Summary summary;
  summary.cells = 8;
  summary.bytes = 64;
  summary.state_hash = 0xabcULL;
  summary.level_cells = {8, 1};
  summary.level_vertices = {27, 8};
  summary.surface = SurfaceMethod::splitting_cubes;
  summary.surface_points = 12;
  summary.surface_triangles = 20;
  summary.seconds = {{"solve", 1.5}};
  summary.warnings = {"w"};
  StepReport step;
  step.step = 1;
  step.cycles = 9;
  step.residual = std::numeric_limits<double>::quiet_NaN();
  CutEvent event;
  event.cut_id = 1;
  event.links_hit = 4;
  event.disconnected = {1, 2, 3};
  step.cuts = {event};
  summary.steps = {step};

  const auto json = nlohmann::json::parse(to_json(summary));

  for (const char* key :
       {"scene",     "cells",    "cells_before_cuts", "vertices", "unknowns",   "hanging",
        "levels",    "pieces",   "seconds",           "steps",    "peak_bytes", "bytes_per_cell",
        "backend",   "threads",  "precision",         "version",  "commit",     "state_hash",
        "links_cut", "warnings", "instruction_set"})
    EXPECT_TRUE(json.contains(key)) << key;
  EXPECT_EQ(json["state_hash"], "0000000000000abc");
  EXPECT_EQ(json["levels"], 2);
  EXPECT_EQ(json["surface"]["method"], "splitting-cubes");
  EXPECT_EQ(json["surface"]["points"], 12);
  EXPECT_EQ(json["surface"]["triangles"], 20);
  EXPECT_EQ(nlohmann::json::parse(to_json({}))["surface"]["method"], "none");
  EXPECT_EQ(json["bytes_per_cell"], 8.0);
  EXPECT_EQ(json["seconds"]["solve"], 1.5);
  EXPECT_EQ(json["steps"][0]["cycles"], 9);
  EXPECT_TRUE(json["steps"][0]["residual"].is_null()) << "not a number has no place in JSON";
  EXPECT_EQ(json["steps"][0]["cuts"][0]["links_cut"], 3);
  EXPECT_FALSE(json["version"].get<std::string>().empty());
}

TEST_F(ResultsTest, CommitGivesNamesAndTheSeries) {
  const fs::path out = root_ / "a" / "b";
  {
    ResultsFolder results(out, {});
    results.add_snapshot(0, 0.0, two_cut_cells());
    results.add_snapshot(12, 0.25, two_cut_cells());
    EXPECT_EQ(results.add_surface(12, 0.25, test::two_tetrahedra()), "");
    for (const auto& name : names(out)) EXPECT_EQ(name.front(), '.') << "not finished: " << name;
    results.commit({});
  }
  EXPECT_EQ(names(out),
            (std::vector<std::string>{"body.pvd", "body_0000.vtu", "body_0012.vtu", "summary.json",
                                      "surface.pvd", "surface_0012.vtp"}));
  const std::string pvd = read_all(out / "body.pvd");
  EXPECT_NE(pvd.find("timestep=\"0.25\" part=\"0\" file=\"body_0012.vtu\""), std::string::npos);
  const std::string surfaces = read_all(out / "surface.pvd");
  EXPECT_NE(surfaces.find("timestep=\"0.25\" part=\"0\" file=\"surface_0012.vtp\""),
            std::string::npos);
  EXPECT_EQ(surfaces.find("body_"), std::string::npos);
}

/// All formats of surfaces and figures, none of bodies.
OutputSettings surfaces_and_figures() {
  OutputSettings settings;
  settings.vtu = settings.pvd = false;
  settings.ply = settings.glb = settings.levels = settings.links = true;
  return settings;
}

TEST_F(ResultsTest, SurfacesAndFiguresHaveTheirNames) {
  const LinkedOctree body = test::scene("half_cut");
  Hierarchy hierarchy;
  hierarchy.levels.push_back(finest_level(body));
  build_coarse_levels(hierarchy, {.coarsest_vertices = 1, .max_levels = 2});
  const std::vector<Vec3d> corners(8 * body.leaf_count());
  ResultsFolder results(root_, surfaces_and_figures());

  results.add_snapshot(3, 0.1, two_cut_cells());
  EXPECT_EQ(results.add_surface(3, 0.1, test::two_tetrahedra()), "");
  results.add_figures(3, body, hierarchy, corners);
  results.commit({});

  EXPECT_EQ(names(root_),
            (std::vector<std::string>{"level_0_0003.vtu", "level_1_0003.vtu", "links_0003.vtp",
                                      "summary.json", "surface_0003.glb", "surface_0003.ply",
                                      "surface_0003.vtp"}));
}

TEST_F(ResultsTest, ASurfaceBeyondSinglePrecisionIsKeptWithoutItsGlb) {
  SurfaceMesh surface = test::two_tetrahedra();
  surface.displacement[0].x = std::numeric_limits<double>::infinity();
  ResultsFolder results(root_, surfaces_and_figures());

  EXPECT_EQ(results.add_surface(3, 0.1, surface), "no surface_0003.glb: the body reaches too far");
  results.commit({});

  EXPECT_EQ(names(root_),
            (std::vector<std::string>{"summary.json", "surface_0003.ply", "surface_0003.vtp"}));
}

TEST_F(ResultsTest, WithoutCommitNothingRemains) {
  const fs::path out = root_ / "a" / "b";
  { ResultsFolder(out, {}).add_snapshot(0, 0.0, two_cut_cells()); }
  EXPECT_TRUE(names(root_).empty()) << "folders that were created go too";

  touch(root_ / "mine.txt");
  { ResultsFolder(root_, {}).add_snapshot(0, 0.0, two_cut_cells()); }
  EXPECT_EQ(names(root_), (std::vector<std::string>{"mine.txt"}));
}

TEST_F(ResultsTest, WithoutCommitAnEarlierRunStays) {
  ResultsFolder(root_, {}).commit({});
  touch(root_ / "body_0001.vtu");
  const auto before = names(root_);
  { ResultsFolder(root_, {}).add_snapshot(1, 0.0, two_cut_cells()); }
  EXPECT_EQ(names(root_), before);
  EXPECT_EQ(read_all(root_ / "body_0001.vtu"), "x");
}

TEST_F(ResultsTest, StaleFilesOfOursGoOthersStay) {
  ResultsFolder(root_, {}).commit({});  // an earlier run was here
  for (const char* name :
       {"body_0007.vtu", ".body_0009.vtu.partial", "preview.png", "surface_0003.vtp",
        "surface_0003.ply", "surface_12345.glb", ".surface_0004.glb.partial", "level_0_0003.vtu",
        "level_12_0003.vtu", ".level_1_0003.vtu.partial", "links_0000.vtp", "frame_0001.png"})
    touch(root_ / name);
  const std::vector<std::string> others = {
      "body_12.vtu",      "body_x.vtu",      "frame_1.png",      "frame_0001.jpg",
      "level_0003.vtu",   "level__0003.vtu", "level_a_0003.vtu", "links_0000.vtu",
      "my_body_0001.vtu", "notes.txt",       "surface_.vtp",     "surface_0003.obj"};
  for (const auto& name : others) touch(root_ / name);

  ResultsFolder results(root_, {});
  results.add_snapshot(0, 0.0, two_cut_cells());
  results.commit({});

  std::vector<std::string> expected = others;
  for (const char* name : {"body.pvd", "body_0000.vtu", "summary.json", "surface.pvd"})
    expected.push_back(name);
  std::sort(expected.begin(), expected.end());
  EXPECT_EQ(names(root_), expected);
}

TEST_F(ResultsTest, TheSeriesOfAnEarlierRunGoes) {
  ResultsFolder(root_, {}).commit({});
  ASSERT_TRUE(fs::exists(root_ / "surface.pvd"));
  OutputSettings bodies;
  bodies.vtp = false;
  ResultsFolder(root_, bodies).commit({});
  EXPECT_EQ(names(root_), (std::vector<std::string>{"body.pvd", "summary.json"}));
}

TEST_F(ResultsTest, WhereNoRunWasNothingGoes) {
  touch(root_ / "body_0042.vtu");
  touch(root_ / "preview.png");
  ResultsFolder results(root_, {});
  results.add_snapshot(0, 0.0, two_cut_cells());
  results.commit({});
  EXPECT_EQ(names(root_), (std::vector<std::string>{"body.pvd", "body_0000.vtu", "body_0042.vtu",
                                                    "preview.png", "summary.json", "surface.pvd"}));
}

TEST_F(ResultsTest, FolderInPlaceOfAFileChangesNothing) {
  ResultsFolder(root_, {}).commit({});
  const std::string summary = read_all(root_ / "summary.json");
  fs::create_directories(root_ / "body_0001.vtu" / "inside");
  ResultsFolder results(root_, {});
  results.add_snapshot(0, 0.0, two_cut_cells());
  results.add_snapshot(1, 0.1, two_cut_cells());
  EXPECT_THROW(results.commit({}), Error);
  EXPECT_FALSE(fs::exists(root_ / "body_0000.vtu"));
  EXPECT_EQ(read_all(root_ / "summary.json"), summary);
}

TEST_F(ResultsTest, FileInPlaceOfTheFolderIsAnError) {
  touch(root_ / "taken");
  for (const fs::path& path : {root_ / "taken", root_ / "taken" / "inner"}) {
    try {
      ResultsFolder results(path, {});
      FAIL() << path;
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::bad_input);
      EXPECT_NE(std::string(error.what()).find(path.string()), std::string::npos);
    }
  }
}

TEST(Progress, LineFitsAndSaysWhatCounts) {
  ProgressState state;
  state.step = 5;
  state.steps = 10;
  state.time = 0.1;
  state.seconds_per_step = 0.5;
  state.cycles = 12;
  state.residual = 3e-7;
  state.seconds_left = 125;
  const std::string line = progress_line(state, 200);
  for (const char* part :
       {"[##########----------]", "5/10", "0.50 s/step", "12 cycles", "3.0e-07", "2:05 min left"})
    EXPECT_NE(line.find(part), std::string::npos) << part << " not in " << line;
  EXPECT_EQ(progress_line(state, 30).size(), 30u);
}

TEST(Progress, FramesHaveNoTimeOfTheirOwn) {
  ProgressState state;
  state.step = 3;
  state.steps = 12;
  state.time = -1;
  state.unit = "frame";
  state.seconds_per_step = 1.25;
  state.seconds_left = 11;
  EXPECT_EQ(progress_line(state, 200), "[#####---------------] 3/12  1.25 s/frame  11 s left");
}

}  // namespace
}  // namespace kerf
