// SPDX-License-Identifier: MIT
//
// What the phases share.
#pragma once

#include "bench/noise.hpp"
#include "bench/phases.hpp"

namespace kerf::bench {

inline Outcome vector_of(Trial& t, int level, int x) { return {t.read(level, x)}; }

inline void nothing(Trial&) {}

/// Noise that respects the supports.
inline void write_noise(Trial& t, int level, int x) {
  t.backend().write(level, x, noise(3 * t.body.hierarchy().levels[level].point.size()));
  t.backend().mask(level, x);
}

inline void prepare_coarsest(Trial& t) { write_noise(t, t.machine.levels() - 1, kRight); }

inline Outcome outcome_coarsest(Trial& t) {
  return vector_of(t, t.machine.levels() - 1, kSolution);
}

}  // namespace kerf::bench
