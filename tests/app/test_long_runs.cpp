// SPDX-License-Identifier: MIT
//
// A run that goes on for long, and what happens to it meanwhile: signals, another run, no reader.
#include <gtest/gtest.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <functional>
#include <stdexcept>
#include <thread>

#include "tests/support/kerf_command.hpp"

namespace kerf::test {
namespace {

class LongRun : public KerfCommand {
 protected:
  void TearDown() override {
    if (child_ > 0) {
      kill(child_, SIGKILL);
      waitpid(child_, nullptr, 0);
    }
    KerfCommand::TearDown();
  }

  /// Runs kBlock until it is asked to end, after `prepare` in the new process.
  void start(
      const std::vector<std::string>& arguments = {},
      const std::function<void()>& prepare = [] {}) {
    std::ofstream(root_ / "scene.toml") << kBlock;
    const std::string scene = root_ / "scene.toml", out = root_ / "out";
    std::vector<const char*> all = {"kerf",
                                    "run",
                                    scene.c_str(),
                                    "--out",
                                    out.c_str(),
                                    "--set",
                                    "time.duration=1e4",
                                    "--set",
                                    "output.every=1000000"};
    for (const auto& argument : arguments) all.push_back(argument.c_str());
    all.push_back(nullptr);
    std::fflush(nullptr);  // or the new process says it again
    child_ = fork();
    if (child_ < 0) throw std::runtime_error("fork failed");
    if (child_ > 0) return;
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGPIPE, SIGXFSZ})
      std::signal(signal, SIG_DFL);  // whatever the caller of the tests ignores
    std::freopen((root_ / "said").c_str(), "w", stdout);
    std::freopen((root_ / "complained").c_str(), "w", stderr);
    prepare();
    execv(KERF_COMMAND, const_cast<char* const*>(all.data()));
    _exit(127);
  }
  /// Until something holds, at most for half a minute.
  template <class Holds>
  static bool wait_until(const Holds& holds) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while (!holds()) {
      if (std::chrono::steady_clock::now() > deadline) return false;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return true;
  }
  /// The first file of a body shows that the run has begun and listens.
  void wait_for_begin() const {
    EXPECT_TRUE(wait_until([&] { return fs::exists(root_ / "out/.body_0000.vtu.partial"); }));
  }
  void ask(int signal) const { ASSERT_EQ(kill(child_, signal), 0); }
  /// The status with which it exits, or minus the signal that ended it.
  int wait_for_end() {
    int status = 0;
    const bool ended = wait_until([&] { return waitpid(child_, &status, WNOHANG) == child_; });
    EXPECT_TRUE(ended) << "it goes on";
    if (!ended) return -1000;
    child_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }

  pid_t child_ = -1;
};

TEST_F(LongRun, KeepsItsStepsSoFarButDrawsNothingWhenItIsAskedToEnd) {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    fs::remove_all(root_ / "out");
    start({"--set", "output.preview=true"});
    wait_for_begin();
    ask(signal);

    EXPECT_EQ(wait_for_end(), 130) << signal;
    EXPECT_EQ(summary()["interrupted"], true);
    EXPECT_TRUE(fs::exists(root_ / "out/body_0000.vtu"));
    EXPECT_FALSE(fs::exists(root_ / "out/preview.png"));
    EXPECT_NE(read_all(root_ / "complained").find("no preview.png: interrupted"),
              std::string::npos);
  }
}

// A shell whose terminal is gone hangs up, and so does the kernel; `timeout` asks a run and its
// group.
TEST_F(LongRun, IsAskedTwiceFromOneCause) {
  for (const int signal : {SIGTERM, SIGHUP}) {
    fs::remove_all(root_ / "out");
    start({"--set", "output.preview=true"});
    wait_for_begin();
    for (int times = 0; times < 5; ++times) {
      kill(child_, signal);  // which may have ended
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }

    EXPECT_EQ(wait_for_end(), 130) << signal;
    EXPECT_EQ(summary()["interrupted"], true);
  }
}

TEST_F(LongRun, EndsAtOnceAtASecondInterrupt) {
  start({"--set", "solver.cycles=100000000", "--set", "solver.rotation_updates=1"});  // one step
  wait_for_begin();
  ask(SIGINT);
  std::this_thread::sleep_for(std::chrono::milliseconds(20));  // two at once are one
  ask(SIGINT);

  EXPECT_EQ(wait_for_end(), -SIGINT);
  EXPECT_FALSE(fs::exists(root_ / "out/summary.json"));
}

// Another one has the name since: neither may touch what the other one wrote.
TEST_F(LongRun, LeavesAFolderThatWasMadeInPlaceOfItsOwn) {
  start({"--quiet"});
  wait_for_begin();
  fs::rename(root_ / "out", root_ / "moved");
  fs::create_directory(root_ / "out");
  write_all(root_ / "out/.body_0000.vtu.partial", "of another run");
  ask(SIGTERM);

  EXPECT_EQ(wait_for_end(), 2);
  EXPECT_NE(read_all(root_ / "complained").find("was moved or removed"), std::string::npos);
  EXPECT_EQ(names(root_ / "out"), (std::vector<std::string>{".body_0000.vtu.partial"}));
  EXPECT_EQ(read_all(root_ / "out/.body_0000.vtu.partial"), "of another run");
}

// As behind `nohup`, or `&` in a script.
TEST_F(LongRun, IgnoresWhatItsCallerIgnored) {
  start({"--quiet"}, [] {
    std::signal(SIGHUP, SIG_IGN);
    std::signal(SIGINT, SIG_IGN);
  });
  wait_for_begin();
  ask(SIGHUP);
  ask(SIGINT);
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  EXPECT_EQ(waitpid(child_, nullptr, WNOHANG), 0) << "it ended";
  ask(SIGTERM);

  EXPECT_EQ(wait_for_end(), 130);
}

TEST_F(LongRun, HasItsFolderToItself) {
  start({"--quiet"});
  wait_for_begin();

  const Outcome other = kerf("run scene.toml --out out");

  EXPECT_EQ(other.status, 2);
  EXPECT_NE(other.err.find("kerf: error: out: another kerf writes"), std::string::npos)
      << other.err;
  ask(SIGINT);
  EXPECT_EQ(wait_for_end(), 130);
  EXPECT_EQ(summary()["interrupted"], true);
}

TEST_F(LongRun, GoesOnWithoutAReader) {
  start({"--set", "time.duration=0.02"}, [] {
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
    ask(SIGTERM);
    EXPECT_EQ(wait_for_end(), 130);
    fs::remove_all(root_ / "out");
    return found;
  };
  EXPECT_NE(environment_with(nullptr, nullptr).find("GOMP_SPINCOUNT=10000"), std::string::npos);
  EXPECT_NE(environment_with("GOMP_SPINCOUNT", "7").find("GOMP_SPINCOUNT=7"), std::string::npos);
  EXPECT_EQ(environment_with("OMP_WAIT_POLICY", "passive").find("GOMP_SPINCOUNT"),
            std::string::npos);
}

TEST_F(LongRun, MayBeStartedThroughALoader) {
  const std::string loader = "/lib64/ld-linux-x86-64.so.2";
  if (!fs::exists(loader)) GTEST_SKIP() << "no " << loader;
  const std::string command =
      "unset GOMP_SPINCOUNT OMP_WAIT_POLICY; " + loader + " '" KERF_COMMAND "' info >/dev/null";
  EXPECT_EQ(std::system(command.c_str()), 0);
}

}  // namespace
}  // namespace kerf::test
