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
/// the command is to stop when it next asks. A second interrupt ends it at once; the others come
/// twice from one cause. What the caller of the program had ignored stays so. One at a time; after
/// one that was asked all are only noted, for the program is about to end.
class InterruptGuard {
 public:
  /// `answer`: what a terminal shows at once.
  explicit InterruptGuard(const std::string& answer);
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;
  static bool asked();
  /// A second interrupt is only noted too, from now on: for what takes no time and must be whole.
  void hold_on() const;

 private:
  void handle(std::size_t i, int flags) const;

  static constexpr std::array kSignals = {SIGINT, SIGTERM, SIGHUP};
  std::array<struct sigaction, kSignals.size()> before_{};
};

/// A reader that went away and a file that may not grow are errors of a write from now on: the
/// output of a run is worth more than its chatter.
void let_writes_fail();

}  // namespace kerf
