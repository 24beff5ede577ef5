// SPDX-License-Identifier: MIT
//
// The commands of `kerf`. Each returns the exit status, or throws what main turns into one.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace kerf {

enum ExitStatus : int {
  kDone = 0,
  kInternal = 1,
  kBadInput = 2,
  kNotConverged = 3,   ///< results are kept
  kUnavailable = 4,    ///< no such backend, or out of memory
  kInterrupted = 130,  ///< results so far are kept
};

struct RunOptions {
  std::filesystem::path scene;
  std::filesystem::path out;
  std::vector<std::string> overrides;
  bool quiet = false;
};

struct RenderOptions {
  std::filesystem::path folder;
  std::filesystem::path out;   ///< empty: folder
  bool frames = false;         ///< the series; else its last picture only
  std::string size, view, up;  ///< as given, such as "1200x900", "35,22", "0,1,0"; empty: not given
  int samples = 4;
  bool quiet = false;
};

int run_command(const RunOptions& options);
/// Pictures of the surface files that a run left.
int render_command(const RenderOptions& options);
/// Everything that `run` does before its first step, and what it would need.
int check_command(const std::filesystem::path& scene, const std::vector<std::string>& overrides);
int info_command();

/// Runs `command`; prints what it throws as one message on standard error.
int guarded(const std::function<int()>& command);

}  // namespace kerf
