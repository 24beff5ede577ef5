// SPDX-License-Identifier: MIT
//
// The kerf command from outside: exit status, messages, and what lies in its folder afterwards.
// Needs KERF_COMMAND, the path of the program.
#pragma once

#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/files.hpp"

namespace kerf::test {

namespace fs = std::filesystem;

/// A block of 6 x 3 x 3 cells that stands on its low end and takes three steps.
inline const std::string kBlock = R"(
title = "block"
[body]
shape = "box"
size = [0.06, 0.03, 0.03]
resolution = 6
[material]
young = 1e5
damping = [0, 0.01]
[[support]]
box = [[-1, -1, -1], [0.001, 1, 1]]
[[load]]
gravity = [0, -9.81, 0]
[time]
step = 0.01
duration = 0.03
[solver]
threads = 1
[output]
preview = false
)";

struct Outcome {
  int status;
  std::string out, err;
};

class KerfCommand : public FolderTest {
 protected:
  /// Runs `kerf ARGUMENTS` in the test's folder.
  Outcome kerf(const std::string& arguments) {
    const std::string command = "cd '" + root_.string() + "' && '" KERF_COMMAND "' " + arguments +
                                " >stdout.txt 2>stderr.txt </dev/null";
    const int status = std::system(command.c_str());
    Outcome outcome{WIFEXITED(status) ? WEXITSTATUS(status) : -1, read_all(root_ / "stdout.txt"),
                    read_all(root_ / "stderr.txt")};
    fs::remove(root_ / "stdout.txt");
    fs::remove(root_ / "stderr.txt");
    return outcome;
  }
  Outcome run_scene(const std::string& toml, const std::string& arguments = "") {
    std::ofstream(root_ / "scene.toml") << toml;
    return kerf("run scene.toml --out out " + arguments);
  }
  /// One message, this status, and no folder.
  void expect_refused(const Outcome& outcome, int status, const std::vector<std::string>& parts) {
    EXPECT_EQ(outcome.status, status) << outcome.err;
    EXPECT_EQ(outcome.err.rfind("kerf: error: ", 0), 0u) << outcome.err;
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    for (const auto& part : parts)
      EXPECT_NE(outcome.err.find(part), std::string::npos) << part << " not in " << outcome.err;
    EXPECT_FALSE(fs::exists(root_ / "out")) << "something was left behind";
  }
  nlohmann::json summary() { return nlohmann::json::parse(read_all(root_ / "out/summary.json")); }
};

}  // namespace kerf::test
