// SPDX-License-Identifier: MIT
#include <cmath>

#include "bench/phase_parts.hpp"

namespace kerf::bench {
namespace {

// operator, by modes or dense

void prepare_operator(Trial& t) {
  t.backend().copy(0, t.machine.bent, kSolution);
  t.backend().mask(0, kSolution);
  if (t.candidate.name != "dense24" || t.dense) return;
  std::vector<double> rotations(4 * t.body.cells());
  t.backend().read_rotations(rotations);
  t.dense.emplace(t.body.hierarchy(), rotations, t.backend().threads());
  t.dense_in = t.read(0, kSolution);
  t.dense_out.resize(t.dense_in.size());
}

void run_operator(Trial& t) {
  if (t.dense)
    t.dense->apply(t.dense_in, t.dense_out);
  else
    t.backend().apply(0, kSolution, kScratch);
}

Outcome outcome_operator(Trial& t) {
  return t.dense ? Outcome{t.dense_out} : vector_of(t, 0, kScratch);
}

// residual

void prepare_residual(Trial& t) {
  prepare_operator(t);
  t.backend().copy(0, t.machine.load_vector, kRight);
}

// smooth: A u = 0 from noise; the residual column says what one sweep left of the residual

void prepare_smooth(Trial& t, SmootherType type) {
  t.use_smoother(type);
  t.backend().zero(0, kRight);
  write_noise(t, 0, kSolution);
}

Outcome outcome_smooth(Trial& t) {
  Outcome out = vector_of(t, 0, kSolution);
  const double after = t.backend().residual(0);
  write_noise(t, 0, kSolution);
  out.residual = after / t.backend().residual(0);
  return out;
}

// cycle, from zero, as a preconditioner runs it

void prepare_cycle(Trial& t) {
  t.use_smoother(t.candidate.solver.smoother);
  t.backend().copy(0, t.machine.load_vector, kRight);
  t.backend().zero(0, kSolution);
}

Outcome outcome_cycle(Trial& t) {
  Outcome out = vector_of(t, 0, kSolution);
  Backend& b = t.backend();
  out.residual = b.residual(0) / std::sqrt(b.dot(0, t.machine.load_vector, t.machine.load_vector));
  return out;
}

// transfer

void prepare_prolong(Trial& t) {
  t.backend().zero(0, kSolution);
  write_noise(t, 1, kSolution);
}

}  // namespace

Work work_cycle(const Trial& t) {
  if (t.is_paper()) return counts::kCyclePaper;
  return t.is_jacobi() ? counts::kCycleJacobi : counts::kCycle;
}

std::vector<Phase> product_phases() {
  return {
      {"operator", "A u on level 0", prepare_operator, run_operator, outcome_operator,
       [](const Trial& t) { return t.dense ? counts::kOperatorDense : counts::kOperator; }},
      {"residual", "f - A u and its norm, level 0", prepare_residual,
       [](Trial& t) { t.number = t.backend().residual(0); },
       [](Trial& t) { return vector_of(t, 0, kResidual); }, always(counts::kResidual)},
      {"smooth-chebyshev", "one sweep of degree 2 (cpu-degree1: 1), level 0",
       [](Trial& t) { prepare_smooth(t, SmootherType::chebyshev); },
       [](Trial& t) { t.backend().smooth(0, SweepOrder::forward, 1); }, outcome_smooth,
       [](const Trial& t) { return t.is_jacobi() ? counts::kDampedStep : counts::kChebyshev; }},
      {"smooth-gauss-seidel", "one sweep over all colours, level 0",
       [](Trial& t) { prepare_smooth(t, SmootherType::gauss_seidel); },
       [](Trial& t) { t.backend().smooth(0, SweepOrder::forward, 1); }, outcome_smooth,
       always(counts::kGaussSeidel)},
      {"restrict", "the residual of level 0 to level 1",
       [](Trial& t) { write_noise(t, 0, kResidual); },
       [](Trial& t) { t.backend().restrict_residual(0); },
       [](Trial& t) { return vector_of(t, 1, kRight); }, always(counts::kRestrict), 2},
      {"prolong", "the correction of level 1 to level 0", prepare_prolong,
       [](Trial& t) { t.backend().prolong_correction(0); },
       [](Trial& t) { return vector_of(t, 0, kSolution); }, always(counts::kProlong), 2},
      {"coarsest", "solution on the coarsest level", prepare_coarsest,
       [](Trial& t) { t.backend().solve_coarsest(); }, outcome_coarsest, always({})},
      {"cycle", "one cycle from zero", prepare_cycle, [](Trial& t) { t.cycle().run(); },
       outcome_cycle, work_cycle, 2},
  };
}

}  // namespace kerf::bench
