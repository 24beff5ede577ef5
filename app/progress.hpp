// SPDX-License-Identifier: MIT
//
// One line on a terminal that says how far a run or a series of pictures is. Silent in a pipe.
#pragma once

#include <chrono>
#include <string>

#include "core/simulation.hpp"

namespace kerf {

/// The line for a finished or running step; at most `width` columns.
struct ProgressState {
  int step = 0, steps = 0;      ///< finished and planned
  double time = 0;              ///< s, of the simulation; negative: there is none
  double seconds_per_step = 0;  ///< of the last step
  double seconds_left = -1;     ///< estimate; negative: not known yet
  int cycles = 0;
  double residual = 0;
  std::string phase;          ///< of the running step; empty between steps
  std::string unit = "step";  ///< or "frame"
};
std::string progress_line(const ProgressState& state, int width);

class ProgressBar {
 public:
  /// `enabled` false, or standard error no terminal: nothing is ever shown.
  explicit ProgressBar(bool enabled);
  ~ProgressBar() { clear(); }
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  void start(int steps);
  void start_frames(int frames);  ///< of a film, instead of steps
  void phase(const char* name, int cycles, double residual);
  void finished(const StepReport& step);
  void finished_frame(double seconds);
  void clear();  ///< takes the line away, before something else is printed

 private:
  using Clock = std::chrono::steady_clock;
  void advance(double seconds);
  void draw();

  bool enabled_;
  bool shown_ = false;
  ProgressState state_;
  Clock::time_point begin_{}, drawn_{};
};

}  // namespace kerf
