// SPDX-License-Identifier: MIT
//
// Tables of kerf_convergence at their smallest sizes, against what theory and the purpose of each
// method say; the file, the tables, the picture and the command line.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "bench/convergence/figures.hpp"
#include "bench/convergence/options.hpp"
#include "bench/convergence/tables.hpp"
#include "core/base/error.hpp"
#include "tests/support/files.hpp"

namespace kerf::convergence {
namespace {

constexpr int kThreads = 1;

/// One case of a table at the smallest size.
Record run(const char* table, const std::string& label) {
  const Table& found = find_table(table);
  for (const Case& one : found.cases(Size::small))
    if (one.label == label) return run_case(found, one, kThreads);
  throw Error(ErrorKind::bad_input, label);
}

TEST(ConvergenceTables, HaveUniqueCasesAtBothSizes) {
  for (const Table& table : tables())
    for (const Size size : {Size::full, Size::small}) {
      std::vector<std::string> labels;
      for (const Case& one : table.cases(size)) labels.push_back(one.label);
      EXPECT_GE(labels.size(), 3u) << table.name;
      std::sort(labels.begin(), labels.end());
      EXPECT_EQ(std::unique(labels.begin(), labels.end()), labels.end()) << table.name;
    }
}

TEST(ConvergenceCube, ChebyshevBeatsGaussSeidel) {
  const Record chebyshev = run("cube", "16^3, V(1,1) Chebyshev 2");
  const Record relaxed = run("cube", "16^3, V(1,1) Gauss-Seidel");

  EXPECT_LT(chebyshev.factor, relaxed.factor);
  EXPECT_LE(chebyshev.cg_1e10, relaxed.cg_1e10);
  EXPECT_LE(chebyshev.cg_1e6, chebyshev.cg_1e10);
  EXPECT_EQ(chebyshev.levels(), 3);
  EXPECT_EQ(chebyshev.cycle, "V");
  EXPECT_TRUE(std::isnan(chebyshev.omega));
  EXPECT_EQ(relaxed.omega, 1);
}

TEST(ConvergenceCube, DegreeOneTakesMoreCyclesButNotTwice) {
  const Record one = run("cube", "16^3, V(1,1) Chebyshev 1");
  const Record two = run("cube", "16^3, V(1,1) Chebyshev 2");

  EXPECT_EQ(one.smoother, "Chebyshev 1");
  EXPECT_GT(one.factor, two.factor);
  EXPECT_LT(one.factor, 0.7);
  EXPECT_GT(one.cg_1e10, two.cg_1e10);
  EXPECT_LE(one.cg_1e10, 2 * two.cg_1e10);
}

// K-cycles keep the factor of two levels, V-cycles lose some. A hundredth: what the last cycles of
// a factor differ by.
TEST(ConvergenceDepth, KIsNoWorseThanVAndDoesNotGrow) {
  const Record two = run("depth", "2, K");
  const Record v = run("depth", "4, V");
  const Record k = run("depth", "4, K");

  EXPECT_EQ(k.levels(), 4);
  EXPECT_LT(k.factor, v.factor);
  EXPECT_LE(k.factor, two.factor + 0.01);
  EXPECT_LT(k.three_cycles, v.three_cycles);
}

// Elements of displacements lock, and smoothers with them: nearly incompressible modes are neither
// smooth nor seen by a sweep.
TEST(ConvergencePoisson, TheFactorGrowsTowardsIncompressible) {
  for (const char* body : {"cube, default, ", "cube, V(1,1) Gauss-Seidel, "}) {
    double before = 0;
    for (const char* nu : {"0.20", "0.30", "0.40", "0.45", "0.49"}) {
      const Record r = run("poisson", std::string(body) + nu);
      EXPECT_GT(r.factor, before) << body << nu;
      EXPECT_LT(r.factor, 1) << body << nu;
      before = r.factor;
    }
  }
}

// A mass term adds about the same to all eigenvalues, so that nothing is left for coarse levels to
// do.
TEST(ConvergenceMass, HeavierIsFaster) {
  for (const char* solver : {"default, ", "V, "}) {
    const Record heavy = run("mass", std::string(solver) + "0.1");
    const Record light = run("mass", std::string(solver) + "3");
    const Record still = run("mass", std::string(solver) + "static");
    EXPECT_LT(heavy.factor, 0.5 * light.factor);
    EXPECT_LT(light.factor, still.factor);
    EXPECT_LT(heavy.cg_1e10, light.cg_1e10);
    EXPECT_LT(light.cg_1e10, still.cg_1e10);
    EXPECT_TRUE(std::isnan(still.courant));
  }
}

// Sweeps that overshoot cannot gain where one sweep is nearly exact.
TEST(ConvergenceMass, OverRelaxationCostsOnHeavyBodies) {
  const Record plain = run("mass", "V(1,1) Gauss-Seidel 1.00 alone, 0.1");
  const Record paper = run("mass", "V(1,1) Gauss-Seidel 1.70 alone, 0.1");

  EXPECT_LT(plain.factor, 0.5 * paper.factor);
  EXPECT_EQ(paper.sweeps, "forward");
  EXPECT_TRUE(std::isnan(paper.cg_1e6));
  EXPECT_GT(paper.three_cycles, plain.three_cycles);
}

TEST(ConvergenceOmega, OneIsBestOnTheCube) {
  const Record one = run("omega", "cube, symmetric, 1.00");
  const Record paper = run("omega", "cube, symmetric, 1.70");

  EXPECT_LT(one.factor, paper.factor);
  EXPECT_LT(one.cg_1e10, paper.cg_1e10);
}

// In one order the second sweep does not undo what the first one did.
TEST(ConvergenceOmega, ForwardAloneBeatsSymmetricAlone) {
  EXPECT_LT(run("omega", "comb, forward, 1.30").factor,
            run("omega", "comb, symmetric, 1.30").factor);
}

TEST(ConvergenceComb, DuplicatedCellsBeatMergingByPlace) {
  const Record duplicated = run("comb", "aligned, static, duplicated, K");
  const Record merged = run("comb", "aligned, static, by place, K");

  EXPECT_GT(merged.cg_1e6, 2 * duplicated.cg_1e6);
  EXPECT_GT(1 - duplicated.factor, 5 * (1 - merged.factor));
  EXPECT_EQ(merged.hierarchy, "by place");
  EXPECT_EQ(merged.vertices[0], duplicated.vertices[0]);
  EXPECT_LT(merged.vertices[1], duplicated.vertices[1]);
}

TEST(ConvergenceLevels, CyclesThatDoMoreLoseLess) {
  const Record v = run("levels", "4, V");
  const Record w = run("levels", "4, W");
  const Record k = run("levels", "4, K");

  EXPECT_LT(w.factor, v.factor);
  EXPECT_LT(k.factor, w.factor);
  EXPECT_LE(k.cg_1e10, v.cg_1e10);
}

TEST(ConvergenceRotated, TheDefaultIsKOnCutBodies) {
  const Record k = run("rotated", "10^3, default");
  const Record v = run("rotated", "10^3, V");

  EXPECT_EQ(k.cycle, "K");
  EXPECT_LT(k.factor, v.factor);
  EXPECT_LT(k.cg_1e6, v.cg_1e6);
}

// ---- files and command line

Record example() {
  Record r;
  r.table = "mass";
  r.label = "V, \"static\"";
  r.body = "comb-rotated";
  r.cells = 32;
  r.vertices = {41761, 7345};
  r.hierarchy = "by place";
  r.cycle = "V";
  r.smoother = "Gauss-Seidel";
  r.sweeps = "forward";
  r.omega = 1.7;
  r.poisson = 0.3;
  r.factor = 0.75;
  r.three_cycles = 0.0125;
  r.seconds_per_cycle = 0.5;
  return r;
}

class ConvergenceFiles : public test::FolderTest {};

TEST_F(ConvergenceFiles, TablesAreReadBack) {
  write_csv(root_ / "a.csv", {example()}, {"c0ffee", "release", "epyc"});

  EXPECT_EQ(test::read_all(root_ / "a.csv"),
            "table,case,body,cells,levels,vertices,hierarchy,cycle,smoother,sweeps,omega,poisson,"
            "courant,factor,cg_1e6,cg_1e10,three_cycles,seconds_per_cycle,commit,build,machine\n"
            "mass,\"V, \"\"static\"\"\",comb-rotated,32,2,41761/7345,by place,V,Gauss-Seidel,"
            "forward,1.7,0.3,,0.75,,,0.0125,0.5,c0ffee,release,epyc\n");
  const std::vector<Record> back = read_csv(root_ / "a.csv");
  ASSERT_EQ(back.size(), 1u);
  EXPECT_EQ(back[0].label, example().label);
  EXPECT_EQ(back[0].vertices, example().vertices);
  EXPECT_EQ(back[0].factor, 0.75);
  EXPECT_TRUE(std::isnan(back[0].courant));
  EXPECT_TRUE(std::isnan(back[0].cg_1e6));
}

TEST_F(ConvergenceFiles, DamagedTablesAreRefusedByLine) {
  const std::string head = "table,case,body,cells,vertices,factor\n";
  const std::pair<const char*, const char*> damaged[] = {
      {"mass,a,cube,x,1/2,0.5\n", ":2: cells is no number: 'x'"},
      {"mass,a,cube,,1/2,0.5\n", ":2: cells is missing"},
      {"mass,a,cube,8,1;2,0.5\n", ":2: vertices are no numbers with / between: '1;2'"},
      {"", ": has no row"}};
  const auto file = root_ / "bad.csv";
  for (const auto& [line, words] : damaged) {
    test::write_all(file, head + line);
    try {
      read_csv(file);
      ADD_FAILURE() << "was read: " << line;
    } catch (const Error& error) {
      EXPECT_EQ(error.what(), file.string() + words);
    }
  }
}

TEST(ConvergenceFigures, TablesNameTheSizeThatAllRowsShare) {
  Record other = example();
  other.label = "V, 1";
  const std::string same = markdown_tables({example(), other});
  other.cells = 48;
  const std::string mixed = markdown_tables({example(), other});
  other.table = "mas";

  EXPECT_NE(same.find("### From heavy to static: rotated comb, nu 0.3, 32^3\n"), std::string::npos);
  EXPECT_NE(same.find("| V, 1 | 0.750 | - | - | 0.013 | 41761 / 7345 |\n"), std::string::npos);
  EXPECT_NE(mixed.find("### From heavy to static: rotated comb, nu 0.3\n"), std::string::npos);
  EXPECT_THROW(markdown_tables({other}), Error);
}

TEST(ConvergenceFigures, CurvesHaveTwoPanelsAndStaticCasesACross) {
  std::vector<Record> records(3, example());
  for (int i = 0; i < 2; ++i) records[static_cast<std::size_t>(i)].courant = i + 1;
  const std::string svg = plot_svg(records);

  for (const char* words : {">mass: factor<", ">mass: CG iterations to 1e-6<",
                            ">comb-rotated, V, Gauss-Seidel 1.7, alone<"})
    EXPECT_NE(svg.find(words), std::string::npos) << words;
  EXPECT_NE(svg.find("stroke-width=\"2.0\""), std::string::npos);
  records[0].table = "comb";
  EXPECT_THROW(plot_svg({records[0]}), Error);  // no curve
}

std::string refusal(std::vector<const char*> arguments) {
  arguments.insert(arguments.begin(), "kerf_convergence");
  try {
    parse_options(static_cast<int>(arguments.size()), arguments.data());
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(ConvergenceOptions, NamesAndValuesAreChecked) {
  EXPECT_EQ(refusal({"--table", "cubes"}), "--table: no table 'cubes'; did you mean 'cube'?");
  EXPECT_EQ(refusal({"--tabel", "cube"}), "no option '--tabel'; did you mean '--table'?");
  EXPECT_EQ(refusal({"--table", "cube", "--size", "tiny"}),
            "--size: no size 'tiny'; there are: full, small");
  EXPECT_EQ(refusal({"--plot", "a.csv"}), "--plot FILE.csv and --svg FILE.svg go together");
  EXPECT_EQ(refusal({"--table", "all"}), "");
  EXPECT_NE(refusal({"--table", "all", "--markdown", "a.csv"}), "");
  EXPECT_NE(refusal({}), "");
}

}  // namespace
}  // namespace kerf::convergence
