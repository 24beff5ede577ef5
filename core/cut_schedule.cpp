// SPDX-License-Identifier: MIT
#include "core/cut_schedule.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace kerf {
namespace {

// Steps are counted, so that a sum of 0.02 does not lose the last one.
constexpr double kSlack = 1e-9;

}  // namespace

CutSchedule::CutSchedule(const std::vector<CutSetup>& cuts, const TimeSetup& time)
    : cuts_(&cuts), time_(time) {
  if (time.mode == TimeMode::dynamic) {
    steps_ = std::max(1, static_cast<int>(std::ceil(time.duration / time.step - kSlack)));
    return;
  }
  std::vector<std::size_t> order(cuts.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return cuts[a].start < cuts[b].start; });
  for (std::size_t i = 0; i < order.size();) {
    std::vector<std::size_t> group;
    bool deformed = false;
    const double start = cuts[order[i]].start;
    for (; i < order.size() && cuts[order[i]].start == start; ++i) {
      group.push_back(order[i]);
      deformed = deformed || cuts[order[i]].deformed;
    }
    if (groups_.empty() && deformed) groups_.emplace_back();
    groups_.push_back(std::move(group));
  }
  if (groups_.empty()) groups_.emplace_back();
  steps_ = static_cast<int>(groups_.size());
}

DueCut CutSchedule::whole(std::size_t index) const {
  const CutSetup& cut = (*cuts_)[index];
  return {cut.lines.empty() ? cut.mesh : sweep(cut.lines), cut.deformed,
          static_cast<std::int32_t>(index) + 1};
}

std::vector<DueCut> CutSchedule::due(int step) const {
  std::vector<DueCut> out;
  if (time_.mode == TimeMode::statics) {
    if (step < steps_)
      for (const std::size_t index : groups_[static_cast<std::size_t>(step)])
        out.push_back(whole(index));
    return out;
  }
  const double from = step * time_.step, to = (step + 1) * time_.step;
  const double slack = kSlack * time_.step;
  for (std::size_t i = 0; i < cuts_->size(); ++i) {
    const CutSetup& cut = (*cuts_)[i];
    if (!cut.end) {
      if (cut.start >= from - slack && cut.start < to - slack) out.push_back(whole(i));
      continue;
    }
    const double length = *cut.end - cut.start;
    // Each step begins where the last one ended, to the bit; slivers of rounding at the ends of the
    // path belong to the step beside them.
    const auto place = [&](double at) {
      const double t = (at - cut.start) / length, sliver = slack / length;
      return t < sliver ? 0.0 : t > 1 - sliver ? 1.0 : t;
    };
    const double t0 = place(from), t1 = place(to);
    if (t0 < t1)
      out.push_back(
          {sweep_between(cut.lines, t0, t1), cut.deformed, static_cast<std::int32_t>(i) + 1});
  }
  return out;
}

}  // namespace kerf
