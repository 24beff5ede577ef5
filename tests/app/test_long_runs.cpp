// SPDX-License-Identifier: MIT
//
// A run that goes on for long, and what happens to it meanwhile: signals, another run, no reader.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <functional>
#include <thread>

#include "tests/support/kerf_command.hpp"

namespace kerf::test {
namespace {

// Ends when it is asked to.
const std::string kEndless = R"(
[body]
shape = "box"
size = [0.06, 0.03, 0.03]
resolution = 6
[material]
young = 1e5
[[support]]
box = [[-1, -1, -1], [0.001, 1, 1]]
[time]
step = 0.01
duration = 1e4
[solver]
threads = 1
[output]
every = 1000000
)";

class LongRun : public KerfCommand {
 protected:
  void TearDown() override {
    if (child_ > 0) {
      kill(child_, SIGKILL);
      waitpid(child_, nullptr, 0);
    }
    KerfCommand::TearDown();
  }

  /// Runs kEndless, after `prepare` in the new process.
  void start(
      const std::vector<std::string>& arguments = {},
      const std::function<void()>& prepare = [] {}) {
    std::ofstream(root_ / "endless.toml") << kEndless;
    const std::string scene = root_ / "endless.toml", out = root_ / "out";
    std::vector<const char*> all = {"kerf", "run", scene.c_str(), "--out", out.c_str()};
    for (const auto& argument : arguments) all.push_back(argument.c_str());
    all.push_back(nullptr);
    child_ = fork();
    ASSERT_GE(child_, 0);
    if (child_ > 0) return;
    std::freopen((root_ / "said").c_str(), "w", stdout);
    std::freopen((root_ / "complained").c_str(), "w", stderr);
    prepare();
    execv(KERF_COMMAND, const_cast<char* const*>(all.data()));
    _exit(127);
  }
  /// The first file of a body shows that the run has begun and listens.
  void wait_for_begin() const {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while (!fs::exists(root_ / "out/.body_0000.vtu.partial") &&
           std::chrono::steady_clock::now() < deadline)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  /// The status with which it exits, or minus the signal that ended it.
  int wait_for_end() {
    int status = 0;
    EXPECT_EQ(waitpid(child_, &status, 0), child_);
    child_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }

  pid_t child_ = -1;
};

TEST_F(LongRun, KeepsItsStepsSoFarButDrawsNothingWhenItIsAskedToEnd) {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    fs::remove_all(root_ / "out");
    start();
    wait_for_begin();
    kill(child_, signal);

    EXPECT_EQ(wait_for_end(), 130) << signal;
    EXPECT_EQ(summary()["interrupted"], true);
    EXPECT_TRUE(fs::exists(root_ / "out/body_0000.vtu"));
    EXPECT_FALSE(fs::exists(root_ / "out/preview.png"));
    EXPECT_NE(read_all(root_ / "complained").find("no preview.png: interrupted"),
              std::string::npos);
  }
}

// As behind `nohup`, or `&` in a script.
TEST_F(LongRun, IgnoresWhatItsCallerIgnored) {
  start({"--quiet"}, [] {
    std::signal(SIGHUP, SIG_IGN);
    std::signal(SIGINT, SIG_IGN);
  });
  wait_for_begin();
  kill(child_, SIGHUP);
  kill(child_, SIGINT);
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  EXPECT_EQ(waitpid(child_, nullptr, WNOHANG), 0) << "it ended";
  kill(child_, SIGTERM);

  EXPECT_EQ(wait_for_end(), 130);
}

TEST_F(LongRun, HasItsFolderToItself) {
  start({"--quiet"});
  wait_for_begin();

  const Outcome other = kerf("run endless.toml --out out --set time.duration=0.01");

  EXPECT_EQ(other.status, 2);
  EXPECT_NE(other.err.find("kerf: error: out: another kerf writes"), std::string::npos)
      << other.err;
  kill(child_, SIGINT);
  EXPECT_EQ(wait_for_end(), 130);
  EXPECT_EQ(summary()["interrupted"], true);
}

TEST_F(LongRun, GoesOnWithoutAReader) {
  start({"--set", "time.duration=0.02", "--set", "output.preview=false"}, [] {
    int pipe_ends[2];
    if (pipe(pipe_ends) != 0 || dup2(pipe_ends[1], STDOUT_FILENO) < 0) _exit(126);
    close(pipe_ends[0]);
    close(pipe_ends[1]);
  });

  EXPECT_EQ(wait_for_end(), 0);
  EXPECT_EQ(summary()["steps"].size(), 2u);
}

TEST_F(LongRun, SaysThatAFileMayNotGrow) {
  start({}, [] {
    const rlimit limit{2048, 2048};
    setrlimit(RLIMIT_FSIZE, &limit);
  });

  EXPECT_EQ(wait_for_end(), 2);
  EXPECT_NE(read_all(root_ / "complained").find("cannot be written"), std::string::npos);
  EXPECT_FALSE(fs::exists(root_ / "out"));
}

TEST_F(LongRun, WaitsForThreadsForABoundedTimeUnlessItIsToldHow) {
  const auto environment_with = [&](const char* name, const char* value) {
    start({"--quiet"}, [&] {
      unsetenv("GOMP_SPINCOUNT");
      unsetenv("OMP_WAIT_POLICY");
      if (name != nullptr) setenv(name, value, 1);
    });
    wait_for_begin();
    const std::string found = read_all("/proc/" + std::to_string(child_) + "/environ");
    kill(child_, SIGTERM);
    EXPECT_EQ(wait_for_end(), 130);
    fs::remove_all(root_ / "out");
    return found;
  };
  EXPECT_NE(environment_with(nullptr, nullptr).find("GOMP_SPINCOUNT=10000"), std::string::npos);
  EXPECT_NE(environment_with("GOMP_SPINCOUNT", "7").find("GOMP_SPINCOUNT=7"), std::string::npos);
  EXPECT_EQ(environment_with("OMP_WAIT_POLICY", "passive").find("GOMP_SPINCOUNT"),
            std::string::npos);
}

}  // namespace
}  // namespace kerf::test
