// SPDX-License-Identifier: MIT
//
// The experiments of kerf_papers at their smallest sizes, its files, and its verdicts.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "bench/papers/criteria.hpp"
#include "bench/papers/experiments.hpp"
#include "bench/papers/options.hpp"
#include "bench/papers/report.hpp"
#include "core/base/error.hpp"
#include "tests/support/files.hpp"

namespace kerf::papers {
namespace {

struct Ran {
  Results results;
  std::string notes;
};

Ran run_small(const Experiment& experiment) {
  Ran out;
  Context context;
  context.size = bench::Size::small;
  context.folders = bench::mesh_folders("");
  context.repeat = 1;
  context.give_up = 0.3;
  context.doing = [](const std::string&) {};
  context.note = [&](const std::string& note) { out.notes += note + "\n"; };
  run(context, experiment);
  out.results = std::move(context.results);
  return out;
}

// Without duplicated cells the coarse levels join what blades parted.
void expect_duplication_to_help(const Results& results) {
  const auto rate = [&](const char* body) {
    return results.ours("figure10", body, kPaperMethod, "rate");
  };
  EXPECT_LT(rate("uncut"), 0.75);
  EXPECT_LT(rate("aligned cut") + 0.1, rate("aligned cut merged by place"));
  EXPECT_LT(rate("rotated cut") + 0.05, rate("rotated cut merged by place"));
}

class PaperExperiments : public testing::TestWithParam<Experiment> {};

// Bodies on meshes that are not there are left out with a note, and so are slow solvers.
TEST_P(PaperExperiments, GiveFiguresThatMeanSomething) {
  const Ran ran = run_small(GetParam());
  if (ran.results.figures.empty()) GTEST_SKIP() << ran.notes;
  for (const Figure& f : ran.results.figures) {
    SCOPED_TRACE(f.body + ", " + f.method + ", " + f.quantity);
    EXPECT_EQ(f.experiment, GetParam().name);
    EXPECT_TRUE(std::isnan(f.printed)) << "small bodies are not those of the paper";
    if (std::isnan(f.ours)) {
      EXPECT_TRUE(f.quantity.starts_with("to an error") || f.quantity.find("CG") == 0 ||
                  f.quantity.find("of CG") != std::string::npos);
      continue;
    }
    if (f.unit == "s" || f.unit == "ms") {
      EXPECT_GE(f.ours, 0);
    }
    if (f.quantity == "rate") {
      EXPECT_GT(f.ours, 0);
      EXPECT_LE(f.ours, 1);
    }
    if (f.quantity.find("after three cycles") != std::string::npos ||
        f.quantity.find("after two cycles") != std::string::npos) {
      EXPECT_LT(f.ours, 1);
    }
  }
  for (const Criterion& c : criteria(ran.results)) EXPECT_FALSE(c.met.has_value()) << c.statement;
  EXPECT_NE(markdown(ran.results).find(GetParam().what), std::string::npos);
  if (std::string(GetParam().name) == "figure10") expect_duplication_to_help(ran.results);
}

INSTANTIATE_TEST_SUITE_P(All, PaperExperiments, testing::ValuesIn(experiments()),
                         [](const auto& one) { return std::string(one.param.name); });

// The cubes have as many cells as the paper prints, to its last digit.
TEST(Papers, CubesHaveThePrintedCells) {
  std::string missing;
  const auto cells = [&](const char* name, Grid grid) {
    const std::optional<SimulationSetup> setup =
        make_setup(body(name), grid, bench::Size::full, {}, missing);
    const Problem problem(*setup);
    return std::pair(problem.cells_before(), problem.cells());
  };
  const auto [before, after] = cells("Cube", Grid::adaptive);
  EXPECT_EQ(before, 83299u);
  EXPECT_NEAR(static_cast<double>(after), 230e3, 2e3);
  EXPECT_NEAR(static_cast<double>(cells("Cube with thick rods", Grid::adaptive).second), 204e3,
              1e3);
}

TEST(Papers, AMissingMeshIsLeftOutWithANote) {
  std::string note;
  Context context;
  context.note = [&](const std::string& text) { note = text; };
  EXPECT_FALSE(setup_of(context, body("Armadillo"), Grid::adaptive).has_value());
  EXPECT_NE(note.find("armadillo"), std::string::npos) << note;
}

TEST(Papers, ACourseHasTheErrorOfItsLastCycle) {
  Course course;
  course.samples = {{0.5, 1, 0}, {1, 1, 0}, {2, 0.1, 1}, {4, 0.001, 2}};
  EXPECT_EQ(course.error_at(0.4), 1);
  EXPECT_EQ(course.error_at(3), 0.1);
  EXPECT_TRUE(std::isnan(course.error_at(5)));
  EXPECT_EQ(course.seconds_to(0.05), 4);  // nothing is had before a cycle ends
  EXPECT_TRUE(std::isnan(course.seconds_to(1e-6)));
  EXPECT_NEAR(course.rate(1e-9), 0.01, 1e-12);
}

Results some_results() {
  Results out;
  out.add({"figure10", "uncut", kPaperMethod, "rate", "1", 0.66, 0.69});
  out.add({"figure10", "aligned cut", kPaperMethod, "rate", "1", 0.75, 0.74});
  out.add({"figure10", "rotated cut", kPaperMethod, "rate", "1", 0.75, 0.85});
  out.add({"table1", "Cube", "", "cells after the cut", "1", 230e3, 229368});
  out.add({"table1", "Cube", kPaperMethod, "step", "s", 3.13, 1.5});
  out.points = {{"figure10", "cube", "uncut", 0, 1, false},
                {"figure10", "cube", "uncut", 1, 0.7, false},
                {"figure12", "Cube", "Cholesky", 0.5, 1, true},
                {"figure12", "Cube", "Cholesky", 1.5, 1e-12, false}};
  return out;
}

class PaperFiles : public test::FolderTest {};

TEST_F(PaperFiles, HoldWhatWasWritten) {
  const Results before = some_results();
  write_results(root_, before, {"abc", "release", "here"});
  const Results after = read_results(root_);
  ASSERT_EQ(after.figures.size(), before.figures.size());
  ASSERT_EQ(after.points.size(), before.points.size());
  EXPECT_EQ(after.figures[2].ours, 0.85);
  EXPECT_EQ(after.figures[4].method, kPaperMethod);
  EXPECT_TRUE(after.points[2].mark);

  write_report(root_, after);
  for (const char* name : {"papers.md", "figure10.svg", "figure12.svg", "cost.svg"})
    EXPECT_TRUE(std::filesystem::exists(root_ / name)) << name;

  std::ofstream(root_ / kFiguresFile, std::ios::app) << "a,b\n";
  try {
    read_results(root_);
    FAIL() << "a short line was read";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::bad_input);
    EXPECT_NE(std::string(error.what()).find("papers.csv:7"), std::string::npos) << error.what();
  }
}

TEST(Papers, VerdictsFollowTheFigures) {
  Results results = some_results();
  const auto verdict = [&](const std::string& id, std::size_t which) {
    std::size_t seen = 0;
    for (const Criterion& c : criteria(results))
      if (c.id == id && seen++ == which) return c.met;
    return std::optional<bool>();
  };
  EXPECT_EQ(verdict("E5", 0), true);
  EXPECT_EQ(verdict("E6", 0), false);  // 0.85
  EXPECT_EQ(verdict("E6", 1), false);  // 0.11 apart
  EXPECT_EQ(verdict("E8", 0), std::nullopt);
  results.figures[2].ours = 0.76;
  EXPECT_EQ(verdict("E6", 0), true);
  EXPECT_EQ(verdict("E6", 1), true);
}

// With the paper's own figures in place of ours, what it claims holds, but for what it contradicts.
TEST(Papers, ThePaperMeetsItsOwnCriteria) {
  Results results;
  for (const BodyInfo& info : bodies()) {
    const Printed& p = info.printed;
    if (!info.in_tables || !(p.cells > 0)) continue;
    const auto add = [&](const char* table, const char* method, const char* quantity,
                         double value) {
      results.add({table, info.name, method, quantity, "", value, value});
    };
    add("table1", "", "cells", p.cells);
    add("table1", "", "cells after the cut", p.cut_cells);
    add("table1", "", "cells of the uniform grid", p.uniform_cells);
    for (const char* method : {kPaperMethod, kKerfMethod}) {
      add("table1", method, "step", p.step);
      add("table1", method, "step on the uniform grid", p.uniform_step);
      add("table2", method, "multigrid", p.multigrid);
      add("table2", method, "error after three cycles", p.multigrid_error);
      add("table2", method, "error of CG in that time", p.cg_error);
      add("table2", method, "CG to the same error", p.cg);
    }
  }
  for (const auto& [name, rate] :
       {std::pair("uncut", 0.66), {"aligned cut", 0.75}, {"rotated cut", 0.75}})
    results.add({"figure10", name, kPaperMethod, "rate", "1", rate, rate});
  int met = 0;
  for (const Criterion& c : criteria(results))
    if (c.met) {
      EXPECT_TRUE(*c.met) << c.id << ": " << c.statement << ": " << c.seen;
      ++met;
    }
  EXPECT_EQ(met, 17);

  // A body that was not run leaves what is asked of all bodies open.
  std::erase_if(results.figures, [](const Figure& f) { return f.body == "Bunny 2"; });
  for (const Criterion& c : criteria(results))
    if (c.id == "E4") {
      EXPECT_EQ(c.met, std::nullopt) << c.seen;
    }
}

TEST(Papers, OptionsAreChecked) {
  const auto fails = [](std::vector<const char*> more, const char* says) {
    more.insert(more.begin(), "kerf_papers");
    try {
      parse_options(static_cast<int>(more.size()), more.data());
      ADD_FAILURE() << says;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find(says), std::string::npos) << error.what();
    }
  };
  fails({}, "--experiment");
  fails({"--experiment", "table3", "--out", "x"}, "table");
  fails({"--experiment", "table1"}, "--out");
  fails({"--experiment", "table1", "--out", "x", "--size", "huge"}, "--size");
  fails({"--experiment", "table1", "--out", "x", "--threads", "0"}, "--threads");
  const char* good[] = {"kerf_papers", "--experiment", "all", "--out", "x"};
  EXPECT_EQ(parse_options(5, good).experiments.size(), experiments().size());
}

}  // namespace
}  // namespace kerf::papers
