// SPDX-License-Identifier: MIT
//
// How long the threads of a loop wait for each other before they let others have the processor.
#pragma once

namespace kerf {

/// GCC's OpenMP spins for some ten milliseconds. Where other work has a part of the processors, a
/// thread that waits so keeps the one it waits for from running: loops take ten times as long and
/// more (docs/decisions/0027-waiting.md). The bound is an environment variable that is read before
/// main, so the program starts anew with it, unless the environment says how to wait already.
void bound_waiting(char** argv);

}  // namespace kerf
