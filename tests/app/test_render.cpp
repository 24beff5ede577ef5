// SPDX-License-Identifier: MIT
//
// `kerf render` from outside, on surface files as a run leaves them.
#include <chrono>
#include <csignal>
#include <cstdio>
#include <thread>

#include "app/preview.hpp"
#include "app/vtp.hpp"
#include "tests/support/kerf_command.hpp"
#include "tests/support/solids.hpp"

namespace kerf::test {
namespace {

const std::string kSmall = " --size 64x48";
const std::string kQuick = kSmall + " --view 30,20";  // nothing to search

class RenderCommand : public KerfCommand {
 protected:
  /// A body of which a part with a red side moves away: surface_0000, 0005 and 0012.
  void write_series(const fs::path& folder) {
    fs::create_directories(folder);
    const SurfaceMesh still = make_box_surface({0, 0, 0}, {1, 1, 1});
    for (const int step : {0, 5, 12}) {
      SurfaceMesh mesh = still;
      const SurfaceMesh part = make_box_surface({1, 0, 0}, {2, 1, 1}, {1, 0, 0, 0, 0, 0});
      add_part(mesh, moved(part, {0.1 * step, 0, 0}), 1);
      char name[32];
      std::snprintf(name, sizeof name, "surface_%04d.vtp", step);
      write_vtp(folder / name, mesh);
    }
  }
  /// Where there is no Embree, the command says so and does nothing else.
  bool drawing_is_refused() {
    if (can_draw_preview()) return false;
    expect_refused(kerf("render . --out out"), 4, {"cannot draw", "KERF_PREVIEW"});
    return true;
  }
};

TEST_F(RenderCommand, DrawsTheLastSurface) {
  if (drawing_is_refused()) return;
  write_series(root_ / "run");
  const Outcome outcome = kerf("render run" + kSmall);
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(outcome.out, "picture    run/preview.png\n");
  EXPECT_EQ(outcome.err, "");
  PreviewOptions options;
  options.width = 64;
  options.height = 48;
  draw_preview(root_ / "mine.png", read_vtp(root_ / "run/surface_0012.vtp"), options);
  EXPECT_EQ(read_all(root_ / "run/preview.png"), read_all(root_ / "mine.png"));
}

TEST_F(RenderCommand, DrawsTheSeriesAndSaysHowToMakeAFilm) {
  if (drawing_is_refused()) return;
  write_series(root_ / "run");
  const Outcome outcome = kerf("render run --frames --out film/small" + kSmall);
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "") << "no progress bar in a pipe";
  EXPECT_EQ(names(root_ / "film/small"),
            (std::vector<std::string>{"frame_0000.png", "frame_0005.png", "frame_0012.png"}));
  for (const char* part : {"frames     3 in film/small, frame_0000.png to frame_0012.png\n",
                           "film       ffmpeg ", "-pattern_type glob -i 'film/small/frame_*.png'"})
    EXPECT_NE(outcome.out.find(part), std::string::npos) << part << " not in " << outcome.out;
  EXPECT_EQ(names(root_ / "run").size(), 3u) << "nothing is written beside the surfaces";
  EXPECT_EQ(kerf("render run --frames -q" + kSmall).out, "");
  for (const char* name : {"frame_0000.png", "frame_0005.png", "frame_0012.png"})
    EXPECT_EQ(read_all(root_ / "run" / name), read_all(root_ / "film/small" / name)) << name;
}

TEST_F(RenderCommand, NamesSortAsTheFramesDo) {
  if (drawing_is_refused()) return;
  const SurfaceMesh mesh = make_box_surface({0, 0, 0}, {1, 1, 1});
  write_vtp(root_ / "surface_9990.vtp", mesh);
  write_vtp(root_ / "surface_10000.vtp", mesh);
  EXPECT_EQ(kerf("render . --frames --out out" + kQuick).status, 0);
  EXPECT_EQ(names(root_ / "out"), (std::vector<std::string>{"frame_09990.png", "frame_10000.png"}));
}

TEST_F(RenderCommand, ViewAndUpChangeThePicture) {
  if (drawing_is_refused()) return;
  write_series(root_);
  std::vector<std::string> pictures;
  for (const char* arguments :
       {"", "--view -30,20", "--view 150,20", "--view=-30,20 --up 0,0,-1"}) {
    const Outcome outcome = kerf("render . " + std::string(arguments) + kSmall);
    EXPECT_EQ(outcome.status, 0) << arguments << ": " << outcome.err;
    pictures.push_back(read_all(root_ / "preview.png"));
  }
  std::sort(pictures.begin(), pictures.end());
  EXPECT_EQ(std::unique(pictures.begin(), pictures.end()), pictures.end());
}

TEST_F(RenderCommand, OnlyAFolderOfARunIsTidied) {
  if (drawing_is_refused()) return;
  write_series(root_ / "run");
  const std::vector<std::string> foreign{"frame_1.png", "frame_0004.jpg", "my_frame_0004.png"};
  const std::vector<std::string> stale{"frame_0004.png", ".frame_0007.png.partial"};
  for (const auto& list : {foreign, stale})
    for (const auto& name : list) std::ofstream(root_ / "run" / name) << "x";

  const Outcome warned = kerf("render run --frames" + kQuick);
  EXPECT_EQ(warned.status, 0);
  for (const char* part : {"kerf: warning: run also holds ", "frame_0007", " and 1 more"})
    EXPECT_NE(warned.err.find(part), std::string::npos) << part << " not in " << warned.err;
  for (const auto& name : stale) EXPECT_TRUE(fs::exists(root_ / "run" / name)) << name;

  std::ofstream(root_ / "run/summary.json") << "{}";
  EXPECT_EQ(kerf("render run --frames" + kQuick).err, "");
  for (const auto& name : stale) EXPECT_FALSE(fs::exists(root_ / "run" / name)) << name;
  for (const auto& name : foreign) EXPECT_TRUE(fs::exists(root_ / "run" / name)) << name;
}

TEST_F(RenderCommand, RefusesWhatIsNotThereOrDamaged) {
  if (drawing_is_refused()) return;
  expect_refused(kerf("render none --out out"), 2, {"none: no such folder"});
  fs::create_directories(root_ / "run");
  std::ofstream(root_ / "run/surface_12.vtp") << "another's";
  expect_refused(kerf("render run --frames --out out"), 2, {"run: holds no surface", "\"vtp\""});
  write_series(root_ / "run");
  std::ofstream(root_ / "run/surface_0005.vtp") << "<VTKFile";
  expect_refused(kerf("render run --frames --out out"), 2, {"surface_0005.vtp"});
  write_vtp(root_ / "run/surface_0005.vtp", {});
  expect_refused(kerf("render run --frames --out out"), 2, {"surface_0005.vtp", "no surface"});
  EXPECT_EQ(kerf("render run --out out" + kQuick).status, 0) << "the last one is sound";
}

TEST_F(RenderCommand, RefusesAFolderThatCannotBeWritten) {
  if (drawing_is_refused()) return;
  write_series(root_);
  std::ofstream(root_ / "taken") << "x";
  expect_refused(kerf("render . --out taken" + kQuick), 2, {"taken"});
  expect_refused(kerf("render . --out taken/inner" + kQuick), 2, {"taken/inner"});
  fs::create_directories(root_ / "blocked/preview.png/inside");
  expect_refused(kerf("render . --out blocked" + kQuick), 2, {"blocked/preview.png"});
  EXPECT_EQ(names(root_ / "blocked"), (std::vector<std::string>{"preview.png"}));
}

TEST_F(RenderCommand, RefusesBadNumbers) {
  if (drawing_is_refused()) return;
  write_series(root_);
  for (const char* size : {"12", "12x", "x12", "64x48x", "64x48x3", "64,48", "15x64", "64x9000",
                           "64.5x48", "-64x48", "nanxnan"})
    expect_refused(kerf(std::string("render . --out out --size=") + size), 2,
                   {std::string("--size ") + size, "1200x900"});
  for (const char* view : {"12", "12,91", "12,-91", "inf,0", "1,2,3", "a,b", ",", "1, 2"})
    expect_refused(kerf(std::string("render . --out out '--view=") + view + "'"), 2,
                   {std::string("--view ") + view});
  for (const char* up : {"0,0,0", "1,0", "0,1,0,0", "0,1,nan"})
    expect_refused(kerf(std::string("render . --out out --up=") + up), 2,
                   {std::string("--up ") + up});
  for (const char* arguments : {"render", "render . --samples 0", "render . --samples 17",
                                "render . --out ''", "render . --frame"})
    EXPECT_EQ(kerf(arguments).status, 2) << arguments;
}

// How many frames there are by then is up to the machine; what is said of them must be what is
// there.
TEST_F(RenderCommand, AnInterruptLeavesWholeFramesOnly) {
  if (drawing_is_refused()) return;
  write_series(root_);
  const std::string folder = root_.string(), out = (root_ / "out").string();
  const std::string said = (root_ / "said").string();
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    if (std::freopen(said.c_str(), "w", stderr) == nullptr) _exit(126);
    execl(KERF_COMMAND, "kerf", "render", folder.c_str(), "--out", out.c_str(), "--frames", "-q",
          "--size", "400x300", "--view", "30,20", nullptr);
    _exit(127);
  }
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (!fs::exists(root_ / "out") && std::chrono::steady_clock::now() < deadline)
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  kill(child, SIGINT);
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 130);

  const std::vector<std::string> found = names(root_ / "out");
  ASSERT_LT(found.size(), 3u);
  EXPECT_EQ(read_all(said), "kerf: interrupted after frame " + std::to_string(found.size()) +
                                " of 3; frames so far are kept\n");
  ASSERT_EQ(kerf("render . --out whole --frames -q --size 400x300 --view 30,20").status, 0);
  const std::vector<std::string> whole = names(root_ / "whole");
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i], whole[i]);
    EXPECT_EQ(read_all(root_ / "out" / found[i]), read_all(root_ / "whole" / whole[i]));
  }
}

}  // namespace
}  // namespace kerf::test
