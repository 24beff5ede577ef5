// SPDX-License-Identifier: MIT
//
// Which blade sweeps before which step.
#pragma once

#include <vector>

#include "core/setup.hpp"

namespace kerf {

/// A blade that is due before a step.
struct DueCut {
  TriangleMesh blade;
  bool deformed = true;
  std::int32_t cut_id = 0;  ///< 1 + index of the cut in the setup; all its strips share it
};

class CutSchedule {
 public:
  CutSchedule(const std::vector<CutSetup>& cuts, const TimeSetup& time);

  int steps() const { return steps_; }
  /// Dynamic: the fronts swept during [step, step + 1) * dt. Static: all cuts of one start time,
  /// whole; the first equilibrium comes before a cut that asks for the deformed state.
  /// Later steps have none.
  std::vector<DueCut> due(int step) const;

 private:
  DueCut whole(std::size_t index) const;

  const std::vector<CutSetup>* cuts_;
  TimeSetup time_;
  int steps_ = 0;
  std::vector<std::vector<std::size_t>> groups_;  // static mode: cuts by step
};

}  // namespace kerf
