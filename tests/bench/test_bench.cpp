// SPDX-License-Identifier: MIT
//
// The bench at its smallest sizes: every phase of every scene runs, and its numbers mean something.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <iterator>
#include <map>

#include "bench/compare.hpp"
#include "bench/machine_name.hpp"
#include "bench/measure.hpp"
#include "bench/phases.hpp"
#include "bench/plot.hpp"
#include "core/base/error.hpp"
#include "tests/support/files.hpp"
#include "tests/support/real_mesh.hpp"

namespace kerf::bench {
namespace {

constexpr double kRounding = 1e-12;  // of a product of 24 terms, and of rotations by other formulas

Options options(std::vector<const char*> more) {
  // One run each, which is the one that warms up.
  std::vector<const char*> all{"kerf_bench", "--size", "small", "--seconds", "1e-9"};
  all.insert(all.end(), more.begin(), more.end());
  return parse_options(static_cast<int>(all.size()), all.data());
}

struct BenchRun {
  std::vector<Row> rows;
  std::string notes;
};

BenchRun run(const Options& options) {
  BenchRun out;
  const Listener listener{[](const Row&) {},
                          [&](const std::string& note) { out.notes += note + "\n"; },
                          [](const std::string&) {}};
  Ceilings ceilings(options.threads, true);
  ceilings.measure();
  out.rows = measure_scene(options.scenes.at(0), options, ceilings, listener);
  return out;
}

class BenchScenes : public testing::TestWithParam<SceneInfo> {};

TEST_P(BenchScenes, RunEveryPhase) {
  const BenchRun bench = run(options({"--scene", GetParam().name, "--threads", "1"}));
  if (bench.notes.find("there is no") != std::string::npos) GTEST_SKIP() << bench.notes;

  // Gauss-Seidel has its row with the reference backend.
  EXPECT_EQ(bench.rows.size(), GetParam().solve_only ? 1 : phases().size() - 1) << bench.notes;
  for (const Row& row : bench.rows) {
    SCOPED_TRACE(row.phase);
    EXPECT_GT(row.ms_min, 0);
    EXPECT_LE(row.ms_min, row.ms_median);
    EXPECT_GT(row.cells, 0);
    EXPECT_GE(row.levels, 2);
    EXPECT_NE(row.state_hash, std::string(16, '0'));
    EXPECT_GT(row.peak_bytes, 0);
    if (row.phase == "solve") {
      EXPECT_LE(row.residual, 1e-8);
    }
    if (row.phase == "step") {
      EXPECT_LT(row.residual, 0.9);
    }
    if (row.phase.rfind("smooth", 0) == 0) {
      EXPECT_LT(row.residual, 0.9);
    }
    if (row.phase == "operator") {
      EXPECT_EQ(row.residual, 0);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, BenchScenes, testing::ValuesIn(scenes()), [](const auto& scene) {
  std::string name = scene.param.name;
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
});

TEST(Bench, BaselinesFindTheSameResults) {
  const BenchRun bench = run(options({"--scene", "box192", "--backend", "all", "--threads", "1",
                                      "--phase", "operator,solve,step"}));

  std::map<std::string, double> residual;
  for (const Row& row : bench.rows) residual[row.phase + "/" + row.backend] = row.residual;
  EXPECT_EQ(residual.size(), 13u);
  EXPECT_LE(residual.at("operator/dense24"), kRounding);
  EXPECT_LE(residual.at("operator/reference"), kRounding);
  for (const char* name :
       {"solve/cpu", "solve/cpu-degree1", "solve/paper", "solve/cg-jacobi", "solve/cholesky"})
    EXPECT_LE(residual.at(name), 1e-8) << name;
  EXPECT_LT(residual.at("step/cpu"), residual.at("step/cpu-degree1"));
  EXPECT_LT(residual.at("step/cpu"), residual.at("step/paper"));
  EXPECT_LT(residual.at("step/cpu-degree1"), 0.0145);  // the cube of [DGW11], table 2
}

TEST(Bench, HashesDoNotDependOnThreads) {
  const BenchRun bench = run(options({"--scene", "box192", "--threads", "1,2"}));

  std::map<std::string, std::string> hash;
  for (const Row& row : bench.rows) {
    const auto [found, first] = hash.emplace(row.phase, row.state_hash);
    if (!first) {
      EXPECT_EQ(found->second, row.state_hash) << row.phase;
    }
  }
  EXPECT_EQ(bench.rows.size(), 2 * hash.size());
}

// No scene without a real mesh has hanging corners.
TEST(Bench, DenseProductFoldsHangingCorners) {
  std::string missing;
  SimulationSetup setup = *make_scene("box64", Size::small, {}, missing);
  setup.body = {make_ellipsoid({0.5, 0.5, 0.5}, {0.5, 0.5, 0.5}), 14, 2};
  setup.supports[0].box.hi.y = 0.1;
  Body body(setup);
  body.build();
  bool hangs = false;
  for (const std::uint16_t fold : body.finest().fold) hangs = hangs || (fold & 255) != 0;
  ASSERT_TRUE(hangs);
  setup.solver.backend = "reference";
  Machine machine(body, setup.solver);
  machine.load();
  const Phase& product = phases().front();
  std::vector<double> exact;
  std::map<std::string, std::vector<double>> result;
  for (const Candidate& candidate : candidates()) {
    if (candidate.name != "cpu" && candidate.name != "dense24") continue;
    Trial trial(body, machine, candidate, exact);
    product.prepare(trial);
    product.run(trial);
    result[candidate.name] = product.outcome(trial).values;
  }

  const std::vector<double>&a = result.at("cpu"), &b = result.at("dense24");
  double most = 0, difference = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    most = std::max(most, std::abs(a[i]));
    difference = std::max(difference, std::abs(a[i] - b[i]));
  }
  EXPECT_GT(most, 0);
  EXPECT_LE(difference, kRounding * most);
}

TEST(Bench, LongSolvesAreGivenUp) {
  const BenchRun bench = run(options(
      {"--scene", "box192", "--threads", "1", "--phase", "operator,solve", "--give-up", "1e-9"}));

  EXPECT_EQ(bench.rows.size(), 1u);
  EXPECT_NE(bench.notes.find("gave up solve of box192 by cpu"), std::string::npos) << bench.notes;
}

TEST(Bench, MissingMeshesAreSkippedWithALine) {
  const BenchRun bench = run(options({"--scene", "bunny", "--meshes", "/nowhere"}));

  EXPECT_TRUE(bench.rows.empty());
  EXPECT_EQ(bench.notes,
            "skipped bunny: there is no bunny00.off; name its folder by --meshes or KERF_MESHES\n");
}

std::string refusal(std::vector<const char*> arguments) {
  try {
    options(std::move(arguments));
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::bad_input);
    return error.what();
  }
  return "";
}

TEST(BenchCompare, PairsTheFastestRowsOfTheSameWork) {
  const auto row = [](const char* backend, int threads, const char* phase, double ms) {
    Row out;
    out.scene = "box64";
    out.backend = backend;
    out.threads = threads;
    out.precision = "double";
    out.phase = phase;
    out.ms_min = ms;
    return out;
  };
  const std::string table = comparison({row("cpu", 1, "operator", 8), row("cpu", 2, "operator", 4),
                                        row("cuda", 1, "operator", 0.5), row("cpu", 1, "solve", 3)},
                                       "cpu", "cuda");

  EXPECT_EQ(std::count(table.begin(), table.end(), '\n'), 2) << table;  // a head and one line
  EXPECT_NE(table.find("       8\n"), std::string::npos) << table;      // 4 over 0.5
  EXPECT_EQ(table.find("solve"), std::string::npos) << table;
}

TEST(BenchOptions, CompareNamesTwoBackends) {
  EXPECT_EQ(options({"--scene", "box64", "--compare", "reference,cpu"}).compare,
            (std::vector<std::string>{"reference", "cpu"}));
  EXPECT_THROW(options({"--scene", "box64", "--compare", "cpu"}), Error);
}

TEST(BenchOptions, UnknownNamesNameTheNearest) {
  EXPECT_EQ(refusal({"--scene", "box64,buny"}), "--scene: no scene 'buny'; did you mean 'bunny'?");
  EXPECT_EQ(refusal({"--scene", "box64", "--phase", "operater"}),
            "--phase: no phase 'operater'; did you mean 'operator'?");
  EXPECT_EQ(refusal({"--secne", "box64"}), "no option '--secne'; did you mean '--scene'?");
  EXPECT_EQ(
      refusal({"--scene", "box64", "--backend", "opencl"}),
      "--backend: no backend 'opencl'; there are: cpu, reference, cpu-degree1, cuda, cuda-degree1, "
      "cuda-records, dense24, "
      "paper, cg-jacobi, cholesky");
}

TEST(BenchOptions, ValuesAreChecked) {
  EXPECT_EQ(refusal({"--scene", "box64", "--threads", "1,x"}),
            "--threads must be a number from 1 to 1024, not 'x'");
  EXPECT_EQ(refusal({"--scene"}), "--scene needs a value");
  EXPECT_EQ(refusal({"--plot", "a.csv"}), "--plot FILE.csv and --svg FILE.svg go together");
  EXPECT_NE(refusal({}), "");
}

TEST(BenchOptions, AllStandsForEveryName) {
  const Options all = options({"--scene", "all", "--phase", "all", "--backend", "all"});

  EXPECT_EQ(all.scenes.size(), scenes().size() + 1);  // and the machine itself
  EXPECT_EQ(all.phases.size(), phases().size());
  EXPECT_EQ(all.backends.size(), candidates().size());
}

TEST(BenchOptions, BackendsAskedForByNameMustBeThere) {
  EXPECT_THROW(run(options({"--scene", "box64", "--precision", "single"})), Error);
}

class BenchFiles : public test::FolderTest {};

TEST_F(BenchFiles, TablesAreReadBack) {
  Row row;
  row.scene = "box64";
  row.backend = "cpu";
  row.precision = "double";
  row.cells = 262144;
  row.vertices = 274625;
  row.levels = 4;
  row.phase = "operator";
  row.threads = 2;
  row.ms_min = row.ms_median = 26.2144;
  row.ns_per_cell = 100;
  row.state_hash = "0123456789abcdef";
  write_csv(root_ / "table.csv", {row}, {"c0ffee", "release", "epyc"});
  std::ifstream in(root_ / "table.csv");
  const std::string file{std::istreambuf_iterator<char>(in), {}};

  EXPECT_EQ(file,
            "scene,backend,threads,precision,cells,vertices,levels,phase,ms_min,ms_median,"
            "ns_per_cell,gb_per_s,residual,state_hash,commit,build,machine,of_ceiling,peak_bytes,"
            "launches,bytes_copied\n"
            "box64,cpu,2,double,262144,274625,4,operator,26.2144,26.2144,100,,,0123456789abcdef,"
            "c0ffee,release,epyc,,,,\n");
  const std::vector<Row> back = read_csv(root_ / "table.csv");
  ASSERT_EQ(back.size(), 1u);
  EXPECT_EQ(back[0].phase, "operator");
  EXPECT_EQ(back[0].cells, 262144);
  EXPECT_EQ(back[0].threads, 2);
}

TEST_F(BenchFiles, DamagedTablesAreRefusedByLine) {
  std::ofstream(root_ / "bad.csv")
      << "scene,backend,threads,precision,cells,phase,ns_per_cell\nbox64,cpu,2,double,x,dot,1\n";

  try {
    read_csv(root_ / "bad.csv");
    ADD_FAILURE() << "was read";
  } catch (const Error& error) {
    EXPECT_EQ(error.what(), (root_ / "bad.csv").string() + ":2: cells is no number: 'x'");
  }
}

TEST(BenchPlot, HasAPanelForEachPhaseAndNamesForAll) {
  std::vector<Row> rows(3);
  const char* phases[] = {"operator", "operator", "dot"};
  const char* names[] = {"box64", "bunny", "box64"};
  for (std::size_t i = 0; i < 3; ++i) {
    rows[i].scene = names[i];
    rows[i].backend = "cpu";
    rows[i].precision = "double";
    rows[i].phase = phases[i];
    rows[i].cells = 1000.0 * static_cast<double>(i + 1);
    rows[i].ns_per_cell = 10;
  }
  const std::string svg = plot_svg(rows);

  std::size_t panels = 0;
  for (std::size_t at = 0;
       (at = svg.find("fill=\"none\" stroke=\"#888\"", at)) != std::string::npos; ++at)
    ++panels;
  EXPECT_EQ(panels, 2u);
  for (const char* word : {">operator<", ">dot<", ">box64<", ">bunny<", ">cpu, 1 thread<"})
    EXPECT_NE(svg.find(word), std::string::npos) << word;
  EXPECT_THROW(plot_svg({}), Error);
}

TEST(BenchMachine, NamesAreShort) {
  EXPECT_EQ(short_processor_name("AMD EPYC Processor"), "epyc");
  EXPECT_EQ(short_processor_name("Intel(R) Xeon(R) Platinum 8481C CPU @ 2.70GHz"),
            "xeon-platinum-8481c");
  EXPECT_EQ(short_processor_name(""), "unknown");
}

}  // namespace
}  // namespace kerf::bench
