// SPDX-License-Identifier: MIT
#include "app/interrupt.hpp"

#include <unistd.h>

#include <cerrno>

namespace kerf {
namespace {

volatile std::sig_atomic_t interrupt_asked = 0;
volatile std::sig_atomic_t answer_size = 0;
char answer_of_now[200];  // no string, which the end of the program destroys

void note_interrupt(int) {
  const int reason = errno;
  interrupt_asked = 1;
  // A terminal that is gone needs no answer.
  [[maybe_unused]] const auto said =
      write(STDERR_FILENO, answer_of_now, static_cast<std::size_t>(answer_size));
  errno = reason;
}

}  // namespace

InterruptGuard::InterruptGuard(const std::string& answer) {
  interrupt_asked = 0;
  if (isatty(STDERR_FILENO)) {
    const std::string line = "\r\033[Kkerf: " + answer + "\n";
    answer_size = static_cast<std::sig_atomic_t>(line.copy(answer_of_now, sizeof answer_of_now));
  }
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    sigaction(kSignals[i], nullptr, &before_[i]);
    handle(i, kSignals[i] == SIGINT ? static_cast<int>(SA_RESETHAND) : 0);
  }
}

void InterruptGuard::handle(std::size_t i, int flags) const {
  if (before_[i].sa_handler == SIG_IGN) return;
  struct sigaction action {};
  action.sa_handler = note_interrupt;
  action.sa_flags = flags | SA_RESTART;
  sigaction(kSignals[i], &action, nullptr);
}

void InterruptGuard::hold_on() const {
  for (std::size_t i = 0; i < kSignals.size(); ++i) handle(i, 0);
}

InterruptGuard::~InterruptGuard() {
  answer_size = 0;
  if (asked())
    hold_on();
  else
    for (std::size_t i = 0; i < kSignals.size(); ++i) sigaction(kSignals[i], &before_[i], nullptr);
}

bool InterruptGuard::asked() { return interrupt_asked != 0; }

void let_writes_fail() {
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
}

}  // namespace kerf
