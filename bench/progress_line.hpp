// SPDX-License-Identifier: MIT
#pragma once

#include <unistd.h>

#include <cstdio>
#include <string>

namespace kerf::bench {

/// On a terminal, one line on standard error that says what runs; elsewhere nothing.
class ProgressLine {
 public:
  ProgressLine() : terminal_(isatty(STDERR_FILENO) == 1) {}
  ~ProgressLine() { clear(); }
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  void show(const std::string& line) {
    if (!terminal_) return;
    constexpr int kWidth = 79;
    std::fprintf(stderr, "\r%.*s\033[K", kWidth, line.c_str());
    std::fflush(stderr);
    shown_ = true;
  }
  /// Before anything else is written.
  void clear() {
    if (shown_) std::fprintf(stderr, "\r\033[K");
    shown_ = false;
  }

 private:
  bool terminal_, shown_ = false;
};

}  // namespace kerf::bench
