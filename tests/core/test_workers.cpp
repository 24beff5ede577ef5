// SPDX-License-Identifier: MIT
//
// Work that is shared out: all of it is done once, pieces are under way at once, and neither takes
// the other's errors away.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <latch>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "core/base/workers.hpp"
#include "tests/support/threads.hpp"

namespace kerf {
namespace {

class WorkersWays : public testing::TestWithParam<bool> {
 public:
  Workers workers() const { return GetParam() ? test::thread_workers(2) : Workers(); }
};

TEST(Workers, ShareEachNumberOnce) {
  for (const int threads : {1, 2, 3, 7})
    for (const std::size_t count : {0u, 1u, 1024u, 3000u, 10001u}) {
      const Workers workers = threads == 1 ? Workers() : test::thread_workers(threads);
      const std::size_t parts = workers.parts_of(count);
      EXPECT_GE(parts, 1u);
      EXPECT_LE(parts, static_cast<std::size_t>(threads));
      std::vector<std::pair<std::size_t, std::size_t>> of(parts);
      workers.share(count, [&](std::size_t part, std::size_t begin, std::size_t end) {
        of[part] = {begin, end};
      });
      std::size_t next = 0;
      for (const auto& [begin, end] : of) {
        EXPECT_EQ(begin, next);
        EXPECT_LE(begin, end);
        next = end;
      }
      EXPECT_EQ(next, count) << threads << " threads";
    }
}

TEST(Workers, PassOnWhatAPartThrows) {
  const auto fail = [](std::size_t part, std::size_t, std::size_t) {
    if (part == 1) throw std::runtime_error("part");
  };
  EXPECT_THROW(test::thread_workers(3).share(5000, fail), std::runtime_error);
}

TEST_P(WorkersWays, BothHaveEnded) {
  bool aside = false, here = false;

  workers().both([&] { aside = true; }, [&] { here = true; });

  EXPECT_TRUE(aside);
  EXPECT_TRUE(here);
}

// Each waits for the other: one after the other would never end.
TEST(Workers, BothAreUnderWayAtOnce) {
  std::latch both(2);

  test::thread_workers(2).both([&] { both.arrive_and_wait(); }, [&] { both.arrive_and_wait(); });

  EXPECT_TRUE(both.try_wait());
}

TEST_P(WorkersWays, AnErrorOfOneComesWhenTheOtherHasEnded) {
  std::atomic<int> ended = 0;
  const auto fail = [](const char* what) { throw std::runtime_error(what); };
  const auto what_of = [&](const auto& aside, const auto& here) -> std::string {
    try {
      workers().both(aside, here);
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

INSTANTIATE_TEST_SUITE_P(Workers, WorkersWays, testing::Bool(), [](const auto& way) {
  return way.param ? "OnThreads" : "OneAfterTheOther";
});

}  // namespace
}  // namespace kerf
