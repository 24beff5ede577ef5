// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include "core/cut_schedule.hpp"
#include "tests/support/physics.hpp"

namespace kerf {
namespace {

CutSetup progressive(double start, double end) {
  CutSetup cut;
  cut.start = start;
  cut.end = end;
  cut.lines = test::straight_cut({0, 0, 0}, {1, 0, 0}, {0, 0, 1});
  return cut;
}

CutSetup at_once(double start, bool deformed) {
  CutSetup cut = progressive(start, start + 1);
  cut.end.reset();
  cut.deformed = deformed;
  return cut;
}

/// The parts of a sweep from x = 0 to x = 1 that each step does: [from, to], empty for none.
std::vector<std::pair<double, double>> parts_of(const CutSetup& cut, const TimeSetup& time) {
  const std::vector<CutSetup> cuts{cut};
  const CutSchedule schedule(cuts, time);
  std::vector<std::pair<double, double>> out;
  for (int step = 0; step < schedule.steps(); ++step)
    for (const DueCut& due : schedule.due(step)) {
      EXPECT_EQ(due.cut_id, 1);
      const Box3 box = due.blade.bounds();
      out.emplace_back(box.lo.x, box.hi.x);
    }
  return out;
}

TEST(CutSchedule, CoversASweepWithoutGapAndWithoutOverlap) {
  const std::pair<double, double> spans[] = {
      {0.1, 0.5}, {0, 1}, {0.1, 0.3}, {0.033, 0.4711}, {0.05, 0.0500001}, {0.3, 0.3 + 1e-12}};
  for (const double dt : {0.02, 0.1, 0.007, 1.0 / 3})
    for (const auto& [start, end] : spans) {
      TimeSetup time;
      time.step = dt;

      const auto parts = parts_of(progressive(start, end), time);

      SCOPED_TRACE(testing::Message() << "step " << dt << ", " << start << " to " << end);
      ASSERT_FALSE(parts.empty());
      EXPECT_EQ(parts.front().first, 0);
      EXPECT_EQ(parts.back().second, 1);
      for (std::size_t i = 1; i < parts.size(); ++i)
        EXPECT_EQ(parts[i].first, parts[i - 1].second) << i;            // to the bit
      for (const auto& [from, to] : parts) EXPECT_GT(to - from, 1e-9);  // no slivers
    }
}

TEST(CutSchedule, SweepsOnlyBetweenStartAndEnd) {
  TimeSetup time;
  time.step = 0.1;
  const std::vector<CutSetup> cuts{progressive(0.2, 0.4)};
  const CutSchedule schedule(cuts, time);

  EXPECT_EQ(schedule.steps(), 10);
  for (int step = 0; step < 10; ++step)
    EXPECT_EQ(schedule.due(step).size(), step == 2 || step == 3 ? 1u : 0u) << step;
}

TEST(CutSchedule, MakesACutWithoutEndOnceWhereverItStarts) {
  for (const double start : {0.0, 0.1, 0.3, 0.7, 0.05, 0.95}) {
    TimeSetup time;
    time.step = 0.1;  // 3 * 0.1 is not 0.3 in binary
    const std::vector<CutSetup> cuts{at_once(start, true)};
    const CutSchedule schedule(cuts, time);
    std::vector<int> steps;
    for (int step = 0; step < schedule.steps(); ++step)
      if (!schedule.due(step).empty()) steps.push_back(step);

    EXPECT_EQ(steps, std::vector<int>{static_cast<int>(start / 0.1 + 1e-6)}) << start;
  }
}

TEST(CutSchedule, CountsAStepThatADurationFillsButForRounding) {
  TimeSetup time;
  time.step = 0.02;
  time.duration = 0.06;  // 2.9999999999999996 steps
  EXPECT_EQ(CutSchedule({}, time).steps(), 3);
  time.duration = 0.061;
  EXPECT_EQ(CutSchedule({}, time).steps(), 4);
  time.duration = 0.001;
  EXPECT_EQ(CutSchedule({}, time).steps(), 1);
}

TEST(CutSchedule, OfStaticsTakesCutsByStartAndFindsRestBeforeADeformedOne) {
  TimeSetup time;
  time.mode = TimeMode::statics;
  const std::vector<CutSetup> cuts{at_once(2, false), at_once(1, true), at_once(2, true)};
  const CutSchedule schedule(cuts, time);

  ASSERT_EQ(schedule.steps(), 3);
  EXPECT_TRUE(schedule.due(0).empty());
  ASSERT_EQ(schedule.due(1).size(), 1u);
  EXPECT_EQ(schedule.due(1)[0].cut_id, 2);
  ASSERT_EQ(schedule.due(2).size(), 2u);
  EXPECT_EQ(schedule.due(2)[0].cut_id, 1);
  EXPECT_EQ(schedule.due(2)[1].cut_id, 3);
  EXPECT_TRUE(schedule.due(3).empty());  // an equilibrium may be asked for again

  const std::vector<CutSetup> reference{at_once(0, false)};
  EXPECT_EQ(CutSchedule(reference, time).steps(), 1);
  EXPECT_EQ(CutSchedule({}, time).steps(), 1);
}

}  // namespace
}  // namespace kerf
