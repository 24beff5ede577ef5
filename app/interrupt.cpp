// SPDX-License-Identifier: MIT
#include "app/interrupt.hpp"

namespace kerf {
namespace {

volatile std::sig_atomic_t interrupt_asked = 0;

}  // namespace

InterruptGuard::InterruptGuard() {
  interrupt_asked = 0;
  struct sigaction action {};
  action.sa_handler = [](int) { interrupt_asked = 1; };
  action.sa_flags = static_cast<int>(SA_RESETHAND);
  sigaction(SIGINT, &action, &before_);
  sigaction(SIGTERM, &action, &before_terminate_);
}

InterruptGuard::~InterruptGuard() {
  sigaction(SIGINT, &before_, nullptr);
  sigaction(SIGTERM, &before_terminate_, nullptr);
}

bool InterruptGuard::asked() { return interrupt_asked != 0; }

}  // namespace kerf
