// SPDX-License-Identifier: MIT
//
// Counts what a program allocates with new. For a test program of its own: it replaces the
// operators.
#pragma once

#include <cstddef>

namespace kerf::test {

/// Starts to count at zero.
void count_allocations();
/// Stops, and gives the bytes that were asked for on all threads meanwhile.
std::size_t allocated_bytes();

}  // namespace kerf::test
