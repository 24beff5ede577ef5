// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "cpu/flush.hpp"
#include "cpu/parallel_errors.hpp"

namespace kerf {
namespace {

/// The square of a number whose square is subnormal, taken at run time.
float small_square() {
  volatile float small = 1e-20F;
  return small * small;
}

#if defined(__SSE2__)
TEST(FlushToZero, LastsAsLongAsItLives) {
  ASSERT_GT(small_square(), 0.0F);
  {
    const cpu::FlushToZero outer;
    EXPECT_EQ(small_square(), 0.0F);
    { const cpu::FlushToZero inner; }
    EXPECT_EQ(small_square(), 0.0F);
    volatile float least = std::numeric_limits<float>::denorm_min();
    EXPECT_EQ(least * 1e30F, 0.0F) << "an operand";
  }
  EXPECT_GT(small_square(), 0.0F);
}

// And not in what the host lends its threads to.
TEST(FlushToZero, HoldsInPatches) {
  for (const int threads : {1, 2, 3}) {
    float of[8];
    cpu::for_patches(0, 8, threads, [&](std::int32_t i) { of[i] = small_square(); });
    for (const float square : of) EXPECT_EQ(square, 0.0F);
    cpu::workers_of(threads).share(8192, [&](std::size_t part, std::size_t, std::size_t end) {
      of[part] = small_square();
      if (end == 8192) std::fill(of + part, of + 8, of[part]);
    });
    for (const float square : of) EXPECT_GT(square, 0.0F);
  }
  EXPECT_GT(small_square(), 0.0F);
}
#endif

}  // namespace
}  // namespace kerf
