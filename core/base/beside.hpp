// SPDX-License-Identifier: MIT
//
// Two pieces of serial work at once.
#pragma once

#include <exception>
#include <system_error>
#include <thread>

namespace kerf {

/// Runs `aside` on a thread of its own while `here` runs on this one; or before it, if `beside` is
/// false or there is no thread to be had. Both have ended when this does. What they throw is thrown
/// here: that of `here` if both do.
/// Needs  that neither writes what the other reads.
template <class Aside, class Here>
void run_beside(bool beside, const Aside& aside, const Here& here) {
  std::exception_ptr error;
  const auto guarded = [&] {
    try {
      aside();
    } catch (...) {
      error = std::current_exception();
    }
  };
  {
    std::jthread thread;
    try {
      if (beside) thread = std::jthread(guarded);
    } catch (const std::system_error&) {  // the machine has too many threads
    }
    if (!thread.joinable()) guarded();
    here();
  }
  if (error) std::rethrow_exception(error);
}

}  // namespace kerf
