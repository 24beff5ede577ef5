// SPDX-License-Identifier: MIT
#include "app/interrupt.hpp"

#include <unistd.h>

namespace kerf {
namespace {

volatile std::sig_atomic_t interrupt_asked = 0;
std::string answer_of_now;  // not changed while a handler may read it

void note_interrupt(int) {
  interrupt_asked = 1;
  if (!answer_of_now.empty() &&
      write(STDERR_FILENO, answer_of_now.data(), answer_of_now.size()) < 0) {
    // A terminal that is gone needs no answer.
  }
}

}  // namespace

InterruptGuard::InterruptGuard(const std::string& answer) {
  interrupt_asked = 0;
  answer_of_now = isatty(STDERR_FILENO) ? "\r\033[Kkerf: " + answer + "\n" : std::string();
  struct sigaction action {};
  action.sa_handler = note_interrupt;
  action.sa_flags = static_cast<int>(SA_RESETHAND | SA_RESTART);
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    sigaction(kSignals[i], nullptr, &before_[i]);
    if (before_[i].sa_handler != SIG_IGN) sigaction(kSignals[i], &action, nullptr);
  }
}

InterruptGuard::~InterruptGuard() {
  for (std::size_t i = 0; i < kSignals.size(); ++i) sigaction(kSignals[i], &before_[i], nullptr);
  answer_of_now.clear();
}

bool InterruptGuard::asked() { return interrupt_asked != 0; }

void let_writes_fail() {
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
}

}  // namespace kerf
