// SPDX-License-Identifier: MIT
//
// Ctrl-C as a request that a long command answers at its next good moment, and writes that fail
// instead of ending the program.
#pragma once

#include <array>
#include <csignal>
#include <string>

namespace kerf {

/// While it lives, an interrupt, a request to terminate or a terminal that hangs up is noted, and
/// the command is to stop when it next asks; a second one ends it at once. What the caller of the
/// program had ignored stays so. One at a time.
class InterruptGuard {
 public:
  /// `answer`: what a terminal shows at once.
  explicit InterruptGuard(const std::string& answer);
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;
  static bool asked();

 private:
  static constexpr std::array kSignals = {SIGINT, SIGTERM, SIGHUP};
  std::array<struct sigaction, kSignals.size()> before_{};
};

/// A reader that went away and a file that may not grow are errors of a write from now on: the
/// output of a run is worth more than its chatter.
void let_writes_fail();

}  // namespace kerf
