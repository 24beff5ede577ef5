// SPDX-License-Identifier: MIT
//
// Ctrl-C as a request that a long command answers at its next good moment.
#pragma once

#include <csignal>

namespace kerf {

/// While it lives, an interrupt (or a request to terminate) is noted, and the command is to stop
/// when it next asks; a second one ends it at once. One at a time.
class InterruptGuard {
 public:
  InterruptGuard();
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;
  static bool asked();

 private:
  struct sigaction before_ {};
  struct sigaction before_terminate_ {};
};

}  // namespace kerf
