// SPDX-License-Identifier: MIT
//
// Two pieces of work at once: both end, and neither takes the other's errors away.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <latch>
#include <stdexcept>
#include <string>
#include <thread>

#include "core/base/beside.hpp"

namespace kerf {
namespace {

class BesideWays : public testing::TestWithParam<bool> {};

TEST_P(BesideWays, BothHaveEnded) {
  bool aside = false, here = false;
  std::thread::id thread;

  run_beside(
      GetParam(),
      [&] {
        aside = true;
        thread = std::this_thread::get_id();
      },
      [&] { here = true; });

  EXPECT_TRUE(aside);
  EXPECT_TRUE(here);
  EXPECT_EQ(thread != std::this_thread::get_id(), GetParam());
}

// Each waits for the other: one after the other would never end.
TEST(Beside, BothAreUnderWayAtOnce) {
  std::latch both(2);

  run_beside(
      true, [&] { both.arrive_and_wait(); }, [&] { both.arrive_and_wait(); });

  EXPECT_TRUE(both.try_wait());
}

TEST_P(BesideWays, AnErrorOfOneComesWhenTheOtherHasEnded) {
  std::atomic<int> ended = 0;
  const auto fail = [](const char* what) { throw std::runtime_error(what); };
  const auto what_of = [&](const auto& aside, const auto& here) -> std::string {
    try {
      run_beside(GetParam(), aside, here);
    } catch (const std::runtime_error& e) {
      return e.what();
    }
    return "nothing";
  };

  EXPECT_EQ(what_of([&] { fail("aside"); }, [&] { ++ended; }), "aside");
  EXPECT_EQ(ended, 1);
  const auto late = [&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    ++ended;
  };
  EXPECT_EQ(what_of(late, [&] { fail("here"); }), "here");
  EXPECT_EQ(ended, 2);
  EXPECT_EQ(what_of([&] { fail("aside"); }, [&] { fail("here"); }), "here");
}

INSTANTIATE_TEST_SUITE_P(Beside, BesideWays, testing::Bool(), [](const auto& way) {
  return way.param ? "OnAThreadOfItsOwn" : "OneAfterTheOther";
});

}  // namespace
}  // namespace kerf
