// SPDX-License-Identifier: MIT
//
// Numbers too small for a type taken for zero.
//
// On processors that handle subnormal numbers in microcode an operation with one takes a hundred
// times as long, and what rounding leaves of a rotation that should be zero is small enough for
// that, squared in single precision. Nothing that such numbers change is ever seen.
#pragma once

#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

namespace kerf::cpu {

/// While it lives, this thread takes results and operands below the least normal number for zero.
/// Every thread of a loop has one, so that the bits do not depend on which one does what. Flags of
/// exceptions that were raised meanwhile are lost. No effect but on x86.
class FlushToZero {
 public:
#if defined(__SSE2__)
  FlushToZero() : before_(_mm_getcsr()) {
    constexpr unsigned kResults = 0x8000, kOperands = 0x0040;
    _mm_setcsr(before_ | kResults | kOperands);
  }
  ~FlushToZero() { _mm_setcsr(before_); }
#else
  FlushToZero() {}
#endif
  FlushToZero(const FlushToZero&) = delete;
  FlushToZero& operator=(const FlushToZero&) = delete;

 private:
  [[maybe_unused]] unsigned before_ = 0;
};

}  // namespace kerf::cpu
