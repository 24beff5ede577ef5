// SPDX-License-Identifier: MIT
//
// The cells of the levels and the links, as figures show them: a case by hand, then counts against
// the octree itself.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "app/figures.hpp"
#include "core/body/pieces.hpp"
#include "tests/support/files.hpp"
#include "tests/support/scenes.hpp"

namespace kerf {
namespace {

using test::vtk_array;

constexpr double kRounding = 1e-12;  // of places of size 1 m
constexpr double kDistance = 1e-7;   // of distances of size 0.1 m that records keep as float

Hierarchy hierarchy_of(const LinkedOctree& body, int levels) {
  Hierarchy h;
  h.spacing = body.lattice().spacing;
  h.levels.push_back(finest_level(body));
  build_coarse_levels(h, {.coarsest_vertices = 1, .max_levels = levels, .duplicate_cells = true});
  return h;
}

/// Places of all corners of the leaves, moved by `shift`.
std::vector<Vec3d> moved_corners(const LinkedOctree& body, const Vec3d& shift) {
  std::vector<Vec3d> out;
  for (const std::int32_t i : body.leaves()) {
    const auto& leaf = body.nodes()[static_cast<std::size_t>(i)];
    for (int k = 0; k < 8; ++k) {
      Vec3i p = leaf.corner;
      for (std::size_t d = 0; d < 3; ++d) p[d] += (k >> d & 1) << leaf.size_log2;
      out.push_back(body.lattice().point(p) + shift);
    }
  }
  return out;
}

/// A box of 2 x 2 x 2 cells, cut in two halves across x.
LinkedOctree halved_box() {
  LinkedOctree body(test::box_body({2, 2, 2}), 0);
  for (int y = 0; y < 2; ++y)
    for (int z = 0; z < 2; ++z) test::disconnect(body, {0, y, z}, 0);
  return body;
}

TEST(LevelFigure, TwoHalvesOfABlockAreTwoDuplicatesHalfFull) {
  const LinkedOctree body = halved_box();
  const Hierarchy hierarchy = hierarchy_of(body, 2);
  ASSERT_EQ(hierarchy.levels.size(), 2u);

  const Vec3d shift{0.01, 0, -0.02};
  const LevelFigure fine = level_figure(body, hierarchy, 0, moved_corners(body, shift));
  const LevelFigure coarse = level_figure(body, hierarchy, 1, {});

  EXPECT_EQ(fine.size, std::vector<std::int32_t>(8, 1));
  EXPECT_EQ(fine.copies, std::vector<std::int32_t>(8, 1));
  EXPECT_EQ(fine.copy, std::vector<std::int32_t>(8, 0));
  EXPECT_EQ(fine.fill, std::vector<double>(8, 1.0));
  EXPECT_EQ(fine.piece, (std::vector<std::int32_t>{0, 1, 0, 1, 0, 1, 0, 1}));
  ASSERT_EQ(fine.displacement.size(), 64u);
  for (const Vec3d& u : fine.displacement) EXPECT_LT(norm(u - shift), kRounding);

  EXPECT_EQ(coarse.size, (std::vector<std::int32_t>{2, 2}));
  EXPECT_EQ(coarse.copies, (std::vector<std::int32_t>{2, 2}));
  EXPECT_EQ(coarse.copy, (std::vector<std::int32_t>{0, 1}));
  EXPECT_EQ(coarse.fill, (std::vector<double>{0.5, 0.5}));
  EXPECT_EQ(coarse.piece, (std::vector<std::int32_t>{0, 1}));
  EXPECT_TRUE(coarse.displacement.empty());
  ASSERT_EQ(coarse.points.size(), 16u);
  const Lattice& lattice = body.lattice();
  for (std::size_t copy = 0; copy < 2; ++copy) {
    EXPECT_EQ(coarse.points[8 * copy], lattice.point({0, 0, 0}));
    EXPECT_EQ(coarse.points[8 * copy + 1], lattice.point({2, 0, 0}));
    EXPECT_EQ(coarse.points[8 * copy + 6], lattice.point({0, 2, 2}));
  }
}

class FigureScene : public testing::TestWithParam<const char*> {};

TEST_P(FigureScene, EveryLevelHoldsTheWholeBodyAndCountsItsDuplicates) {
  const LinkedOctree body = test::scene(GetParam());
  const Hierarchy hierarchy = hierarchy_of(body, 4);
  double volume = 0;
  for (const std::int32_t i : body.leaves())
    volume += 1 << (3 * body.nodes()[static_cast<std::size_t>(i)].size_log2);

  for (std::size_t l = 0; l < hierarchy.levels.size(); ++l) {
    const LevelFigure figure = level_figure(body, hierarchy, l, moved_corners(body, {0, 0, 0}));
    double filled = 0;
    std::map<std::array<double, 4>, std::vector<std::size_t>> at;  // by place
    for (std::size_t c = 0; c < figure.size.size(); ++c) {
      const double side = figure.size[c];
      filled += figure.fill[c] * side * side * side;
      const Vec3d& p = figure.points[8 * c];
      at[{p.x, p.y, p.z, side}].push_back(c);
    }
    EXPECT_EQ(filled, volume) << "level " << l << ": small powers of two are exact";
    for (const auto& [place, cells] : at) {
      double full = 0;
      for (std::size_t i = 0; i < cells.size(); ++i) {
        EXPECT_EQ(figure.copies[cells[i]], static_cast<std::int32_t>(cells.size()));
        EXPECT_EQ(figure.copy[cells[i]], static_cast<std::int32_t>(i));
        full += figure.fill[cells[i]];
      }
      EXPECT_LE(full, 1);
    }
  }
}

TEST_P(FigureScene, LinksAreThoseOfTheOctreeByState) {
  const LinkedOctree body = test::scene(GetParam());
  std::size_t cut = 0, surface = 0;
  for (const auto& [key, link] : body.records()) {
    Vec3i cell = body.lattice().link_lower(key);
    for (const auto& end : link.end) {
      if (body.leaf_at(cell) >= 0) ++(end.cut_id > 0 ? cut : surface);
      ++cell[static_cast<std::size_t>(Lattice::link_axis(key))];
    }
  }

  const LinksFigure figure = links_figure(body);

  const auto count = [&](LinkState state) {
    return static_cast<std::size_t>(std::count(figure.state.begin(), figure.state.end(), state));
  };
  EXPECT_EQ(figure.segments.size(), figure.state.size());
  EXPECT_EQ(figure.segments.size(), figure.cut_id.size());
  EXPECT_EQ(count(LinkState::connected), leaf_links(body).size());
  EXPECT_EQ(count(LinkState::cut), cut);
  EXPECT_EQ(count(LinkState::surface), surface);
  EXPECT_GT(surface, 0u);
}

INSTANTIATE_TEST_SUITE_P(Figures, FigureScene,
                         testing::Values("one_cell", "octree2", "limbs", "floating", "half_cut",
                                         "crossed", "arc"),
                         [](const auto& scene) { return std::string(scene.param); });

TEST(LinksFigure, DisconnectedLinksEndWhereTheyAreCut) {
  LinkedOctree body(test::box_body({2, 1, 1}), 0);
  const auto spacing = static_cast<float>(body.lattice().spacing);
  LinkCut link;
  link.end[0] = {0.25f * spacing, {1, 0, 0}, 3};
  link.end[1] = {0.5f * spacing, {1, 0, 0}, 4};  // two blades, a gap between them
  body.disconnect({0, 0, 0}, 0, link);

  const LinksFigure figure = links_figure(body);

  ASSERT_EQ(figure.segments.size(), 12u) << "two ends, and five faces of each cell outside";
  const Vec3d low = body.lattice().center({0, 0, 0}), high = body.lattice().center({1, 0, 0});
  std::size_t cut = 0;
  for (std::size_t i = 0; i < figure.segments.size(); ++i) {
    const auto& [from, to] = figure.segments[i];
    EXPECT_TRUE(from == low || from == high);
    if (figure.state[i] != LinkState::cut) {
      EXPECT_EQ(figure.state[i], LinkState::surface);
      EXPECT_EQ(figure.cut_id[i], 0);
      EXPECT_NEAR(norm(to - from), 0.5 * spacing, kDistance);
      continue;
    }
    ++cut;
    const bool lower = from == low;
    EXPECT_EQ(figure.cut_id[i], lower ? 3 : 4);
    const Vec3d step{lower ? 0.25 * spacing : -0.5 * spacing, 0, 0};
    EXPECT_LT(norm(to - from - step), kDistance);
  }
  EXPECT_EQ(cut, 2u);
}

TEST(LinksFigure, ConnectedLinksJoinTheCentresOfLeavesOfAnySize) {
  const LinkedOctree body = test::scene("octree2");
  const LinksFigure figure = links_figure(body);
  std::map<double, std::size_t> lengths;  // in finest cells
  for (std::size_t i = 0; i < figure.segments.size(); ++i)
    if (figure.state[i] == LinkState::connected) {
      const auto& [a, b] = figure.segments[i];
      ++lengths[std::round(1e6 * norm(b - a) / body.lattice().spacing) / 1e6];
    }
  EXPECT_GT(lengths[1], 0u) << "between finest cells";
  EXPECT_GT(lengths[2], 0u) << "between cells of two";
  // From a cell of two to a finest one beside it: 1.5 along the link, half a cell across, twice.
  EXPECT_GT(lengths[std::round(1e6 * std::sqrt(2.75)) / 1e6], 0u);
}

class FigureFiles : public test::FolderTest {};

TEST_F(FigureFiles, ALevelHasEightPointsOfItsOwnPerCell) {
  const LinkedOctree body = halved_box();
  write_level(root_ / "level.vtu", level_figure(body, hierarchy_of(body, 2), 1, {}));
  const std::string vtu = test::read_all(root_ / "level.vtu");

  EXPECT_NE(vtu.find("NumberOfPoints=\"16\" NumberOfCells=\"2\""), std::string::npos);
  EXPECT_EQ(vtu.find("displacement"), std::string::npos);
  EXPECT_EQ(vtk_array<std::int32_t>(vtu, "Cells", "connectivity"),
            (std::vector<std::int32_t>{0, 1, 3, 2, 4, 5, 7, 6, 8, 9, 11, 10, 12, 13, 15, 14}));
  EXPECT_EQ(vtk_array<double>(vtu, "Points", "Points").size(), 48u);
  EXPECT_EQ(vtk_array<std::int32_t>(vtu, "CellData", "size"), (std::vector<std::int32_t>{2, 2}));
  EXPECT_EQ(vtk_array<std::int32_t>(vtu, "CellData", "duplicates"),
            (std::vector<std::int32_t>{2, 2}));
  EXPECT_EQ(vtk_array<std::int32_t>(vtu, "CellData", "copy"), (std::vector<std::int32_t>{0, 1}));
  EXPECT_EQ(vtk_array<std::int32_t>(vtu, "CellData", "piece"), (std::vector<std::int32_t>{0, 1}));
  EXPECT_EQ(vtk_array<double>(vtu, "CellData", "fill"), (std::vector<double>{0.5, 0.5}));
}

TEST_F(FigureFiles, TheFinestLevelHasDisplacements) {
  const LinkedOctree body = halved_box();
  write_level(root_ / "level.vtu",
              level_figure(body, hierarchy_of(body, 2), 0, moved_corners(body, {0.5, 0, 0})));
  const std::string vtu = test::read_all(root_ / "level.vtu");
  const auto u = vtk_array<double>(vtu, "PointData", "displacement");
  ASSERT_EQ(u.size(), 192u);
  EXPECT_NEAR(u[189], 0.5, kRounding);
}

TEST_F(FigureFiles, LinksAreLinesWithTheirState) {
  const LinksFigure figure = links_figure(halved_box());
  write_links(root_ / "links.vtp", figure);
  const std::string vtp = test::read_all(root_ / "links.vtp");

  // 8 connected ones, 4 that are cut at both ends, 24 faces outside.
  EXPECT_NE(vtp.find("NumberOfPoints=\"80\""), std::string::npos);
  EXPECT_NE(vtp.find("NumberOfLines=\"40\""), std::string::npos);
  const auto state = vtk_array<std::uint8_t>(vtp, "CellData", "state");
  EXPECT_EQ(std::count(state.begin(), state.end(), 0), 8);
  EXPECT_EQ(std::count(state.begin(), state.end(), 1), 8);
  EXPECT_EQ(std::count(state.begin(), state.end(), 2), 24);
  EXPECT_EQ(vtk_array<std::int32_t>(vtp, "CellData", "cut_id"), figure.cut_id);
  EXPECT_EQ(vtk_array<std::int32_t>(vtp, "Lines", "connectivity").back(), 79);
  EXPECT_EQ(vtk_array<std::int64_t>(vtp, "Lines", "offsets").back(), 80);
  EXPECT_EQ(vtk_array<double>(vtp, "Points", "Points").size(), 240u);
}

}  // namespace
}  // namespace kerf
