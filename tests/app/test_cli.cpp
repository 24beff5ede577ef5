// SPDX-License-Identifier: MIT
//
// The kerf command from outside: exit status, messages, and what lies in the folder afterwards.
#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>

#include "tests/support/kerf_command.hpp"

namespace kerf::test {
namespace {

/// A blade across x = `x` from below the block to y = `top`.
std::string cut_at(double x, double top, const std::string& more = "") {
  const auto point = [&](double y, double z) {
    return "[" + std::to_string(x) + "," + std::to_string(y) + "," + std::to_string(z) + "]";
  };
  return "[[cut]]\n" + more + "lines = [[" + point(-0.05, -1) + "," + point(-0.05, 1) + "],[" +
         point(top, -1) + "," + point(top, 1) + "]]\n";
}

TEST_F(KerfCommand, RunsAndLeavesItsFiles) {
  const Outcome outcome = run_scene(kBlock + cut_at(0.035, 0.011), "--set output.every=2");

  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "") << "no progress bar in a pipe";
  EXPECT_EQ(names(root_ / "out"),
            (std::vector<std::string>{"body.pvd", "body_0000.vtu", "body_0002.vtu", "body_0003.vtu",
                                      "summary.json", "surface.pvd", "surface_0000.vtp",
                                      "surface_0002.vtp", "surface_0003.vtp"}));
  for (const char* part : {"folder     out", "cells      54", "steps      3", "links cut  3"})
    EXPECT_NE(outcome.out.find(part), std::string::npos) << part << " not in " << outcome.out;
  const auto json = summary();
  EXPECT_EQ(json["steps"].size(), 3u);
  EXPECT_EQ(json["title"], "block");
  EXPECT_EQ(json["links_cut"], 3);
  EXPECT_EQ(json["threads"], 1);
}

TEST_F(KerfCommand, WritesTheFormatsThatAreAskedFor) {
  const std::string formats =
      "--set 'output.formats=[\"ply\", \"glb\", \"levels\", \"links\"]' --set output.every=3 "
      "--set output.surface=splitting-cubes --set solver.coarsest_vertices=50";
  const Outcome outcome = run_scene(kBlock + cut_at(0.035, 0.011), formats);

  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(names(root_ / "out"),
            (std::vector<std::string>{"level_0_0000.vtu", "level_0_0003.vtu", "level_1_0000.vtu",
                                      "level_1_0003.vtu", "links_0000.vtp", "links_0003.vtp",
                                      "summary.json", "surface_0000.glb", "surface_0000.ply",
                                      "surface_0003.glb", "surface_0003.ply"}));
  EXPECT_EQ(summary()["surface"]["method"], "splitting-cubes");
}

TEST_F(KerfCommand, WithoutASurfaceWritesBodiesAlone) {
  const Outcome outcome = run_scene(kBlock, "--set output.surface=none --set time.duration=0.01");
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(names(root_ / "out"), (std::vector<std::string>{"body.pvd", "body_0000.vtu",
                                                            "body_0001.vtu", "summary.json"}));
  EXPECT_EQ(summary()["surface"],
            nlohmann::json({{"method", "none"}, {"points", 0}, {"triangles", 0}}));
}

TEST_F(KerfCommand, TheSummaryCountsTheSurfaceOfTheLastState) {
  run_scene(kBlock + cut_at(0.035, 0.011));
  const std::string vtp = read_all(root_ / "out/surface_0003.vtp");
  const auto surface = summary()["surface"];
  for (const auto& [key, name] : {std::pair{"points", "Points"}, {"triangles", "Polys"}})
    EXPECT_NE(vtp.find(std::string("NumberOf") + name + "=\"" + surface[key].dump() + "\""),
              std::string::npos)
        << surface.dump();
}

TEST_F(KerfCommand, SameSceneGivesTheSameHash) {
  run_scene(kBlock + cut_at(0.035, 0.011));
  const auto first = summary()["state_hash"];
  EXPECT_EQ(run_scene(kBlock + cut_at(0.035, 0.011), "--quiet --set solver.threads=2").out, "");
  EXPECT_EQ(summary()["state_hash"], first);
}

TEST_F(KerfCommand, DrawsAPictureWhereItCan) {
  const bool ready = kerf("info").out.find("preview   ready") != std::string::npos;
  const Outcome outcome = run_scene(kBlock, "--set output.preview=true");
  EXPECT_EQ(outcome.status, 0);
  EXPECT_EQ(fs::exists(root_ / "out/preview.png"), ready);
  EXPECT_EQ(outcome.err.find("KERF_PREVIEW") == std::string::npos, ready) << outcome.err;
}

TEST_F(KerfCommand, SaysWhyThereIsNoPictureWithoutASurface) {
  const std::string brief = "--set output.surface=none --set time.duration=0.01";
  const Outcome outcome = run_scene(kBlock, "--set output.preview=true " + brief);
  EXPECT_EQ(outcome.status, 0);
  const std::string warning = "no preview.png: output.surface is \"none\"";
  EXPECT_EQ(outcome.err, "kerf: warning: " + warning + "\n");
  EXPECT_EQ(summary()["warnings"], nlohmann::json({warning}));
  EXPECT_FALSE(fs::exists(root_ / "out/preview.png"));
}

TEST_F(KerfCommand, SaysWhenAPieceComesOff) {
  const Outcome outcome = run_scene(kBlock + cut_at(0.035, 0.05, "start = 0.015\n"));
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("t = 0.02 s: 2 pieces (was 1)\n"), std::string::npos) << outcome.out;
}

TEST_F(KerfCommand, ReplacesAnEarlierRunAndNothingElse) {
  run_scene(kBlock);
  std::ofstream(root_ / "out/notes.txt") << "mine";
  EXPECT_EQ(run_scene(kBlock, "--set time.duration=0.02").status, 0);
  EXPECT_EQ(names(root_ / "out"),
            (std::vector<std::string>{"body.pvd", "body_0000.vtu", "body_0001.vtu", "body_0002.vtu",
                                      "notes.txt", "summary.json", "surface.pvd",
                                      "surface_0000.vtp", "surface_0001.vtp", "surface_0002.vtp"}));
}

TEST_F(KerfCommand, RefusesBadScenes) {
  expect_refused(kerf("run none.toml --out out"), 2, {"none.toml"});
  expect_refused(run_scene(kBlock + "[materail]\n"), 2, {"scene.toml:", "'material'"});
  expect_refused(run_scene(kBlock, "--set material.poisson=0.5"), 2,
                 {"--set material.poisson=0.5: ", "0.5"});
  expect_refused(run_scene(kBlock, "--set material.young=nan"), 2, {"finite"});
  expect_refused(run_scene(kBlock, "--set time.step=0"), 2, {"--set time.step=0"});
  expect_refused(run_scene(kBlock, "--set solver.precision=single"), 2,
                 {"--set solver.precision=single: ", "tolerance", "\"double\"", "\"mixed\""});
  expect_refused(
      run_scene(kBlock, "--set solver.precision=mixed --set solver.smoother=gauss-seidel"), 2,
      {"--set solver.precision=mixed: ", "chebyshev"});
  expect_refused(run_scene("[body]\nshape = \"box\"\nsize = [1,1,1]\n[time]\nmode = \"static\"\n"),
                 2, {"scene.toml:5: ", "[[support]]"});
  expect_refused(run_scene(kBlock + cut_at(0.5, 0.1, "state = \"reference\"\n")), 2,
                 {"scene.toml:", "misses"});
}

TEST_F(KerfCommand, RefusesBadMeshes) {
  const auto with_mesh = [&](const std::string& name, const std::string& content) {
    std::ofstream(root_ / name) << content;
    return run_scene("[body]\nmesh = \"" + name + "\"\nresolution = 8\n");
  };
  expect_refused(run_scene("[body]\nmesh = \"none.off\"\n"), 2, {"scene.toml:2: ", "none.off"});
  expect_refused(with_mesh("empty.off", ""), 2, {"scene.toml:2: ", "empty.off"});
  expect_refused(with_mesh("broken.off", "OFF\n4 4 0\n0 0"), 2, {"broken.off"});
  expect_refused(with_mesh("text.off", "not a mesh"), 2, {"text.off"});
  // One triangle encloses nothing.
  expect_refused(with_mesh("flat.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"), 2,
                 {"flat.off"});
}

TEST_F(KerfCommand, RefusesABodyBeyondTheMemoryBeforeAllocating) {
  const Outcome outcome = run_scene(kBlock, "--set body.resolution=16384");
  expect_refused(outcome, 4, {"scene.toml: ", "resolution", " of memory"});
}

TEST_F(KerfCommand, RefusesABackendThatIsNotThere) {
  if (kerf("info").out.find("cuda      not there") == std::string::npos)
    GTEST_SKIP() << "there is a GPU";
  expect_refused(run_scene(kBlock, "--set solver.backend=cuda"), 4, {"no CUDA backend", "cpu"});
}

TEST_F(KerfCommand, SaysItsInstructionSetAndRefusesAWordThatIsNone) {
  ASSERT_EQ(run_scene(kBlock).status, 0);
  const std::string chosen = summary()["instruction_set"];
  EXPECT_NE(kerf("info").out.find("mixed precision, " + chosen), std::string::npos);
  fs::remove_all(root_ / "out");

  ASSERT_EQ(setenv("KERF_INSTRUCTION_SET", "abacus", 1), 0);
  const Outcome outcome = run_scene(kBlock);
  unsetenv("KERF_INSTRUCTION_SET");

  expect_refused(outcome, 2, {"KERF_INSTRUCTION_SET", "abacus", chosen});
}

TEST_F(KerfCommand, AutoSaysWhyItTakesTheCpu) {
  const Outcome outcome = run_scene(kBlock, "--set solver.backend=auto");
  EXPECT_EQ(outcome.status, 0);
  EXPECT_NE(outcome.out.find("chosen by auto"), std::string::npos) << outcome.out;
  if (kerf("info").out.find("cuda      not there: ") == std::string::npos)
    GTEST_SKIP() << "there is a GPU";
  EXPECT_NE(outcome.out.find("; cuda: "), std::string::npos) << outcome.out;
}

TEST_F(KerfCommand, RefusesAFolderThatCannotBeWritten) {
  std::ofstream(root_ / "scene.toml") << kBlock;
  std::ofstream(root_ / "taken") << "x";
  expect_refused(kerf("run scene.toml --out taken"), 2, {"taken", "file"});
  expect_refused(kerf("run scene.toml --out taken/inner"), 2, {"taken/inner"});
  expect_refused(kerf("run scene.toml --out /proc/kerf"), 2, {"/proc/kerf"});
  EXPECT_EQ(read_all(root_ / "taken"), "x");
}

TEST_F(KerfCommand, LeavesNothingWhenTheRunItselfFails) {
  // In static mode the piece that the blade takes off is held by nothing.
  const Outcome outcome = run_scene(kBlock + cut_at(0.035, 0.05), "--set time.mode=static --quiet");
  expect_refused(outcome, 2, {"piece"});
}

TEST_F(KerfCommand, KeepsResultsWhenABladeMissed) {
  const Outcome outcome = run_scene(kBlock + cut_at(0.5, 0.1));
  EXPECT_EQ(outcome.status, 2);
  EXPECT_TRUE(fs::exists(root_ / "out/summary.json"));
  for (const char* part : {"kerf: error: scene.toml:21: cut 1 ", " 0.439", "m apart"})
    EXPECT_NE(outcome.err.find(part), std::string::npos) << part << " not in " << outcome.err;
}

TEST_F(KerfCommand, KeepsResultsWhenNotConverged) {
  const Outcome outcome =
      run_scene(kBlock,
                "--set solver.method=multigrid --set solver.max_cycles=1 "
                "--set solver.tolerance=1e-14 --set solver.coarsest_vertices=30");
  EXPECT_EQ(outcome.status, 3) << outcome.err;
  EXPECT_NE(outcome.err.find("kerf: error: not converged in 3 of 3 steps"), std::string::npos)
      << outcome.err;
  EXPECT_EQ(summary()["converged"], false);
}

TEST_F(KerfCommand, CommandLineErrorsAreBadInput) {
  for (const char* arguments : {"", "walk", "run", "run scene.toml", "run scene.toml --out",
                                "run scene.toml --out out --fast", "check"}) {
    const Outcome outcome = kerf(arguments);
    EXPECT_EQ(outcome.status, 2) << arguments;
    EXPECT_NE(outcome.err, "") << arguments;
  }
  EXPECT_EQ(kerf("--help").status, 0);
  EXPECT_EQ(kerf("run --help").status, 0);
  EXPECT_EQ(kerf("--version").out.rfind("kerf ", 0), 0u);
}

TEST_F(KerfCommand, CheckSaysWhatARunNeedsAndWritesNothing) {
  std::ofstream(root_ / "scene.toml") << kBlock;
  const Outcome outcome = kerf("check scene.toml --set body.size=[0.06,0.03,0.06]");
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  for (const char* part : {"6 x 3 x 6 finest cells", "108", "bytes a cell", "3 steps, 0 cuts"})
    EXPECT_NE(outcome.out.find(part), std::string::npos) << part << " not in " << outcome.out;
  EXPECT_EQ(names(root_), (std::vector<std::string>{"scene.toml"}));
  EXPECT_EQ(kerf("check scene.toml --set body.shape=blob").status, 2);
}

TEST_F(KerfCommand, SaysThatAMeshIsNoScene) {
  std::ofstream(root_ / "bunny.off") << "OFF\n0 0 0\n";
  expect_refused(kerf("run bunny.off --out out"), 2, {"bunny.off: is a mesh, not a scene"});
}

TEST_F(KerfCommand, FailsWhereNothingCanBeSaid) {
  const std::string full = " >/dev/full 2>/dev/null #";  // and no other redirection behind it
  EXPECT_EQ(kerf("info" + full).status, 2);
  std::ofstream(root_ / "scene.toml") << kBlock;
  EXPECT_EQ(kerf("check scene.toml" + full).status, 2);
}

TEST_F(KerfCommand, InfoNamesVersionAndBackends) {
  const Outcome outcome = kerf("info");
  EXPECT_EQ(outcome.status, 0);
  for (const char* part : {"kerf      ", "commit", "cpu       ready", "cuda ", "toml++"})
    EXPECT_NE(outcome.out.find(part), std::string::npos) << part << " not in " << outcome.out;
}

}  // namespace
}  // namespace kerf::test
