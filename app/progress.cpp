// SPDX-License-Identifier: MIT
#include "app/progress.hpp"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace kerf {
namespace {

constexpr double kRedrawSeconds = 0.1;
constexpr int kBarWidth = 20;

int terminal_width() {
  winsize size{};
  if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0) return size.ws_col;
  return 80;
}

std::string duration_text(double seconds) {
  if (seconds < 60) return fmt::format("{:.0f} s", std::ceil(seconds));
  const auto whole = static_cast<long>(std::llround(seconds));
  if (whole < 3600) return fmt::format("{}:{:02} min", whole / 60, whole % 60);
  return fmt::format("{}:{:02} h", whole / 3600, whole / 60 % 60);
}

}  // namespace

std::string progress_line(const ProgressState& s, int width) {
  const double part = s.steps > 0 ? std::min(1.0, static_cast<double>(s.step) / s.steps) : 0.0;
  const auto full = static_cast<std::size_t>(std::lround(part * kBarWidth));
  std::string line = fmt::format("[{}{}] {}/{}", std::string(full, '#'),
                                 std::string(kBarWidth - full, '-'), s.step, s.steps);
  if (s.time >= 0) line += fmt::format("  t {:.3f} s", s.time);
  if (s.seconds_per_step > 0) line += fmt::format("  {:.2f} s/{}", s.seconds_per_step, s.unit);
  if (s.cycles > 0) line += fmt::format("  {} cycles  res {:.1e}", s.cycles, s.residual);
  if (s.seconds_left >= 0) line += fmt::format("  {} left", duration_text(s.seconds_left));
  if (!s.phase.empty()) line += "  " + s.phase;
  if (static_cast<int>(line.size()) > width)
    line.resize(static_cast<std::size_t>(std::max(0, width)));
  return line;
}

ProgressBar::ProgressBar(bool enabled) : enabled_(enabled && isatty(STDERR_FILENO) == 1) {}

void ProgressBar::start(int steps) {
  state_.steps = steps;
  begin_ = Clock::now();
  draw();
}

void ProgressBar::start_frames(int frames) {
  state_.time = -1;
  state_.unit = "frame";
  start(frames);
}

void ProgressBar::phase(const char* name, int cycles, double residual) {
  if (!enabled_) return;
  state_.phase = name;
  state_.cycles = cycles;
  state_.residual = residual;
  if (std::chrono::duration<double>(Clock::now() - drawn_).count() >= kRedrawSeconds) draw();
}

void ProgressBar::finished(const StepReport& step) {
  if (!enabled_) return;
  state_.time = step.time;
  state_.cycles = step.cycles;
  state_.residual = step.linear_residual;
  advance(step.seconds);
}

void ProgressBar::finished_frame(double seconds) {
  if (enabled_) advance(seconds);
}

void ProgressBar::advance(double seconds) {
  state_.step = std::min(state_.step + 1, std::max(state_.steps, 1));
  state_.seconds_per_step = seconds;
  state_.phase.clear();
  const double spent = std::chrono::duration<double>(Clock::now() - begin_).count();
  state_.seconds_left = spent / state_.step * std::max(0, state_.steps - state_.step);
  draw();
}

void ProgressBar::draw() {
  if (!enabled_) return;
  drawn_ = Clock::now();
  // Carriage return, text, erase to the end of the line; one column stays free against wrapping.
  std::fprintf(stderr, "\r%s\033[K", progress_line(state_, terminal_width() - 1).c_str());
  std::fflush(stderr);
  shown_ = true;
}

void ProgressBar::clear() {
  if (!shown_) return;
  std::fprintf(stderr, "\r\033[K");
  std::fflush(stderr);
  shown_ = false;
}

}  // namespace kerf
