// SPDX-License-Identifier: MIT
#include <span>

#include "bench/phase_parts.hpp"

namespace kerf::bench {
namespace {

// values: rotations, coarse matrices, diagonals, bound, factor

Outcome outcome_rotate(Trial& t) {
  Outcome out;
  out.values.resize(4 * t.body.cells());
  t.backend().read_rotations(out.values);
  return out;
}

void run_coarsen(Trial& t) {
  for (int level = 0; level + 1 < t.machine.levels(); ++level) t.backend().coarsen(level);
}

// The matrices of the coarsest level depend on all others.
Outcome outcome_coarsen(Trial& t) {
  constexpr std::size_t kEntries = 300;  // kernels/layout.hpp
  const int coarsest = t.machine.levels() - 1;
  const std::int32_t cells = t.body.hierarchy().levels[coarsest].cells();
  Outcome out;
  out.values.resize(kEntries * static_cast<std::size_t>(cells));
  const std::span<double> all(out.values);
  for (std::int32_t c = 0; c < cells; ++c)
    t.backend().read_cell_matrix(coarsest, c,
                                 all.subspan(kEntries * static_cast<std::size_t>(c), kEntries));
  return out;
}

void run_prepare(Trial& t) {
  for (int level = 0; level < t.machine.levels(); ++level) t.backend().prepare(level);
}

Outcome outcome_prepare(Trial& t) {
  write_noise(t, 0, kResidual);
  t.backend().precondition_jacobi(0, kResidual, kScratch);
  return vector_of(t, 0, kScratch);
}

// Another operator makes a backend forget its bounds.
void prepare_bound(Trial& t) {
  t.backend().set_operator({2, 0});
  t.backend().set_operator({});
}

Outcome outcome_bound(Trial& t) {
  Outcome out;
  for (int level = 0; level + 1 < t.machine.levels(); ++level)
    out.values.push_back(t.backend().spectral_bound(level));
  return out;
}

Outcome outcome_factor(Trial& t) {
  prepare_coarsest(t);
  t.backend().solve_coarsest();
  return outcome_coarsest(t);
}

}  // namespace

std::vector<Phase> value_phases() {
  return {
      {"rotate", "rotations of all cells, a tenth of the way on",
       [](Trial& t) { t.backend().write_rotations(t.machine.rotations_before); },
       [](Trial& t) { t.backend().rotate_cells(t.machine.bent); }, outcome_rotate,
       always(counts::kRotate)},
      {"coarsen", "matrices of all coarse levels", nothing, run_coarsen, outcome_coarsen,
       always(counts::kCoarsen), 2},
      {"prepare", "diagonal blocks of all levels", nothing, run_prepare, outcome_prepare,
       always(counts::kPrepare)},
      {"bound", "the same with the bounds for Chebyshev, as after a cut", prepare_bound,
       run_prepare, outcome_bound, always(counts::kBound), 2},
      {"factor", "factor of the coarsest level", nothing,
       [](Trial& t) { t.backend().factor_coarsest(); }, outcome_factor, always({})},
      {"force", "elastic force of the bent state", nothing,
       [](Trial& t) { t.backend().elastic_force(t.machine.bent, t.machine.solution); },
       [](Trial& t) { return vector_of(t, 0, t.machine.solution); }, always(counts::kForce)},
      {"jacobi", "D^-1 r on level 0", [](Trial& t) { write_noise(t, 0, kResidual); },
       [](Trial& t) { t.backend().precondition_jacobi(0, kResidual, kScratch); },
       [](Trial& t) { return vector_of(t, 0, kScratch); }, always(counts::kJacobi)},
      {"dot", "a scalar product on level 0", nothing,
       [](Trial& t) { t.number = t.backend().dot(0, t.machine.bent, t.machine.load_vector); },
       [](Trial& t) { return Outcome{{t.number}}; }, always(counts::kDot)},
      {"combine", "y = a x + b y on level 0",
       [](Trial& t) { t.backend().copy(0, t.machine.bent, kScratch); },
       [](Trial& t) { t.backend().combine(0, 0.5, t.machine.load_vector, 0.25, kScratch); },
       [](Trial& t) { return vector_of(t, 0, kScratch); }, always(counts::kCombine)},
  };
}

}  // namespace kerf::bench
