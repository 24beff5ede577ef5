// SPDX-License-Identifier: MIT
//
// What a device backend does within a cycle, and the cycle itself: as core/solve/cycle.cpp, but no
// number of it comes to the host. It is recorded once after each cut and then replayed, so that the
// host spends one call on it. Numbers that change without a cut (factors of the smoother, scale of
// the operator) are read from the device by those who need them.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "gpu/device_backend.hpp"

namespace kerf::gpu {

/// then(level, vertex, sum) with the sum of what the cells of a level add, by records.
template <class Device, class S>
template <class T, class Cells, class Then>
void DeviceBackend<Device, S>::gather_by_records(int level, const Cells& cells,
                                                 const Then& then) const {
  const LevelView view = levels_[at(level)].view();
  run(view.cells, RecordCell<T, Cells>{view, cells, records<T>()});
  run(view.vertices, GatherVertex<T, Then>{view, records<T>(), then});
}

/// The same of level 0.
template <class Device, class S>
template <class T, class Cells, class Then>
void DeviceBackend<Device, S>::gather_finest(const Cells& cells, const Then& then) const {
  if (!in_blocks()) return gather_by_records<T>(0, cells, then);
  ensures(program_ == nullptr, "level 0 is no part of a program");
  device_->launch_blocks(
      blocks_.count(), BlockGather<T, Cells, Then>{levels_[0].view(), blocks_.view(), cells, then});
}

/// The same of the product with u.
template <class Device, class S>
template <class T, class Then>
void DeviceBackend<Device, S>::multiply(int level, const T* u, const Then& then) const {
  if (level == 0)
    gather_finest<T>(FinestCells<T>{finest_view<T>(scales_.data()), u}, then);
  else if constexpr (std::is_same_v<T, S>)
    gather_by_records<S>(level, StoredCells<S>{levels_[at(level)].matrices.data(), u}, then);
}

template <class Device, class S>
void DeviceBackend<Device, S>::apply(int level, int in, int out) {
  ensures(in != out && vector_at(level, in).is_exact == vector_at(level, out).is_exact,
          "apply asks for two vectors of one precision");
  with(level, in, out, [&](const auto* from, auto* to) {
    using T = std::decay_t<decltype(*to)>;
    if constexpr (std::is_same_v<std::decay_t<decltype(*from)>, T>)
      multiply<T>(level, from, SumTo<T>{to, true});
  });
  changed(level, out);
}

template <class Device, class S>
void DeviceBackend<Device, S>::apply_scaled(const OperatorScale& scale, int in, int out) {
  ensures(in != out, "apply_scaled asks for two vectors");
  const Scale on_device{scale.stiffness, scale.mass};
  scales_.write(1, {&on_device, 1});
  gather_finest<double>(
      FinestCells<double>{finest_view<double>(scales_.data() + 1), exact_vector(in)},
      SumTo<double>{exact_vector(out), false});
  changed(0, out);
}

template <class Device, class S>
void DeviceBackend<Device, S>::elastic_force(int displacement, int out) {
  ensures(displacement != out, "elastic_force asks for two vectors");
  gather_finest<double>(
      ElasticCells{finest_view<double>(scales_.data()), exact_vector(displacement)},
      SumTo<double>{exact_vector(out), false});
  changed(0, out);
}

template <class Device, class S>
void DeviceBackend<Device, S>::precondition_jacobi(int level, int in, int out) {
  const Sym3<S>* const inverse = level_at(level).inverse_diagonal.data();
  with(level, in, out, [&](const auto* from, auto* to) {
    run(level_at(level).vertices(),
        JacobiBody<S, std::decay_t<decltype(*from)>, std::decay_t<decltype(*to)>>{inverse, from,
                                                                                  to});
  });
  changed(level, out);
}

template <class Device, class S>
void DeviceBackend<Device, S>::compute_residual(int level) {
  const DeviceLevel<Device, S>& l = level_at(level);
  if (l.solution_is_zero) {
    copy(level, kRight, kResidual);
    return;
  }
  multiply<S>(level, cycle_vector(level, kSolution),
              ResidualTo<S>{cycle_vector(level, kRight), cycle_vector(level, kResidual)});
}

template <class Device, class S>
double DeviceBackend<Device, S>::residual(int level) {
  compute_residual(level);
  return std::sqrt(dot(level, kResidual, kResidual));
}

template <class Device, class S>
void DeviceBackend<Device, S>::smooth(int level, SweepOrder order, int count) {
  for (int i = 0; i < count; ++i) {
    if (smoother_.chebyshev)
      chebyshev(level);
    else
      gauss_seidel(level, order);
  }
}

/// In blocks a step may not write the u that other blocks still read, so steps go to and fro
/// between u and kKrylovX, which level 0 has no other use for.
template <class Device, class S>
void DeviceBackend<Device, S>::chebyshev(int level) {
  DeviceLevel<Device, S>& l = level_at(level);
  S* const u = cycle_vector(level, kSolution);
  S* const other = level == 0 && in_blocks() ? cycle_vector(level, kKrylovX) : u;
  const bool from_zero = l.solution_is_zero;
  int left = smoother_.degree - (from_zero ? 1 : 0);  // products
  S* at = from_zero ? nullptr : u;
  for (int step = 0; step < smoother_.degree; ++step) {
    const bool is_first = step == 0 && from_zero;
    if (!is_first) --left;
    S* const to = is_first ? (left % 2 == 0 ? u : other) : (at == u ? other : u);
    const ChebyshevTo<S> then{l.inverse_diagonal.data(),
                              l.factors.data() + 2 * step,
                              cycle_vector(level, kRight),
                              cycle_vector(level, kDirection),
                              at,
                              to};
    if (is_first)
      run(l.vertices(), EachVertex<S, ChebyshevTo<S>>{l.view(), then});
    else
      multiply<S>(level, at, then);
    at = to;
  }
  if (at != u) run(l.scalars(), CopyBody<S, S>{at, u});
  l.solution_is_zero = false;
}

template <class Device, class S>
void DeviceBackend<Device, S>::colour_level(int level) {
  DeviceLevel<Device, S>& l = level_at(level);
  if (!l.colours.order.empty()) return;
  l.colours = colour_vertices(hierarchy_->levels[at(level)]);
  l.colour_order.upload(l.colours.order);
}

template <class Device, class S>
void DeviceBackend<Device, S>::gauss_seidel(int level, SweepOrder order) {
  DeviceLevel<Device, S>& l = level_at(level);
  colour_level(level);
  const auto relax = [&](auto body) {
    const int colours = l.colours.count();
    for (int step = 0; step < colours; ++step) {
      const int colour = order == SweepOrder::forward ? step : colours - 1 - step;
      const std::int32_t begin = l.colours.begin[at(colour)];
      body.vertices = l.colour_order.data() + begin;
      run(l.colours.begin[at(colour + 1)] - begin, body);
    }
  };
  const LevelView view = l.view();
  const S* const f = cycle_vector(level, kRight);
  S* const u = cycle_vector(level, kSolution);
  const auto omega = static_cast<S>(smoother_.omega);
  const FinestView<S> finest = finest_view<S>(scales_.data());
  const Sym3<S>* const inverse = l.inverse_diagonal.data();
  if (level == 0)
    relax(RelaxVertex<S, true>{view, finest, nullptr, inverse, nullptr, omega, f, u});
  else
    relax(RelaxVertex<S, false>{view, finest, l.matrices.data(), inverse, nullptr, omega, f, u});
  l.solution_is_zero = false;
}

template <class Device, class S>
void DeviceBackend<Device, S>::restrict_residual(int fine) {
  const LevelView from = level_at(fine).view(), to = level_at(fine + 1).view();
  run(to.cells, RestrictCell<S>{from, to, level_at(fine).first_slots.data(),
                                cycle_vector(fine, kResidual), records<S>()});
  const SumTo<S> right{cycle_vector(fine + 1, kRight), true};
  run(to.vertices, GatherVertex<S, SumTo<S>>{to, records<S>(), right});
  zero(fine + 1, kSolution);
}

template <class Device, class S>
void DeviceBackend<Device, S>::prolong_correction(int fine) {
  const LevelView to = level_at(fine).view(), from = level_at(fine + 1).view();
  run(to.vertices,
      ProlongVertex<S>{to, from, level_at(fine).first.data(), cycle_vector(fine + 1, kSolution),
                       cycle_vector(fine, kSolution)});
  changed(fine, kSolution);
}

template <class Device, class S>
void DeviceBackend<Device, S>::solve_coarsest() {
  const int level = last_level();
  const std::int32_t n = coarsest_.unknowns;
  S* const slices = coarsest_.slices.data();
  run(kSlices * n, DenseSlice<S>{n, coarsest_.data(), cycle_vector(level, kRight), slices});
  run(n, DenseSum<S>{n, level_at(level).view().fixed, slices, cycle_vector(level, kSolution)});
  changed(level, kSolution);
}

// ---- the cycle -----------------------------------------------------------------------------

template <class Device, class S>
bool DeviceBackend<Device, S>::run_cycle(const CycleOptions& options) {
  const bool from_zero = levels_[0].solution_is_zero;
  if (!cycle_ || cycle_->options != options || cycle_->from_zero != from_zero) {
    cycle_.reset();
    // Memory that it needs is there before: nothing is allocated while it is recorded.
    if (!smoother_.chebyshev)
      for (int l = 0; l < last_level(); ++l) colour_level(l);
    touch_vectors(options);
    write_program(options);
    device_->begin_recording();
    try {
      descend(0, options);
    } catch (...) {
      device_->abandon_recording();
      throw;
    }
    cycle_ = RecordedCycle{options, from_zero, device_->end_recording()};
  }
  device_->replay(cycle_->graph);
  for (DeviceLevel<Device, S>& level : levels_) level.solution_is_zero = false;
  return true;
}

/// Memory for all vectors that a cycle uses.
template <class Device, class S>
void DeviceBackend<Device, S>::touch_vectors(const CycleOptions& options) {
  for (int l = 0; l <= last_level(); ++l) {
    for (const int x : {kSolution, kRight}) vector_at(l, x);
    if (l == last_level()) break;
    for (const int x : {kResidual, kDirection}) vector_at(l, x);
    if (l == 0 && in_blocks()) vector_at(l, kKrylovX);
    if (l == 0 || options.type != CycleType::k || options.is_once(l)) continue;
    for (const int x : {kKrylovX, kKrylovV, kScratch}) vector_at(l, x);
  }
}

/// What solve_coarse does from the first level on that cannot fill a device. Its solution is zero
/// there whenever it is called.
template <class Device, class S>
void DeviceBackend<Device, S>::write_program(const CycleOptions& options) {
  small_level_ = -1;
  int level = 1;
  while (level < last_level() && level_at(level).cells() > kSmallCells) ++level;
  if (level >= last_level()) return;  // the coarsest alone is two launches
  std::vector<ProgramEntry> entries;
  level_at(level).solution_is_zero = true;
  program_ = &entries;
  solve_coarse(level, options);
  program_ = nullptr;
  most_threads_ = 0;
  for (const ProgramEntry& entry : entries) most_threads_ = std::max(most_threads_, entry.count);
  entries_.upload(entries);
  small_level_ = level;
}

template <class Device, class S>
void DeviceBackend<Device, S>::descend(int level, const CycleOptions& options) {
  if (level == last_level()) {
    solve_coarsest();
    return;
  }
  smooth(level, SweepOrder::forward, options.pre_sweeps);
  compute_residual(level);
  restrict_residual(level);
  solve_coarse(level + 1, options);
  prolong_correction(level);
  smooth(level, options.symmetric ? SweepOrder::backward : SweepOrder::forward,
         options.post_sweeps);
}

template <class Device, class S>
void DeviceBackend<Device, S>::solve_coarse(int level, const CycleOptions& options) {
  if (level == small_level_) {
    device_->template launch_program<CycleBodies<S>>(
        entries_.data(), static_cast<std::int32_t>(entries_.size()), most_threads_);
    level_at(level).solution_is_zero = false;
    return;
  }
  if (level == last_level() || options.is_once(level)) {
    descend(level, options);
  } else if (options.type == CycleType::w) {
    descend(level, options);
    descend(level, options);
  } else {
    krylov_step(level, options);
  }
}

/// Two steps of flexible conjugate gradients with the cycle below as preconditioner, as
/// Cycle::k_step; always two, since whether the first is enough is known to the device alone.
template <class Device, class S>
void DeviceBackend<Device, S>::krylov_step(int level, const CycleOptions& options) {
  KrylovScalars* const s = krylov_.data() + level;
  const std::int32_t size = level_at(level).scalars();
  S *u = cycle_vector(level, kSolution), *f = cycle_vector(level, kRight);
  S *x = cycle_vector(level, kKrylovX), *v = cycle_vector(level, kKrylovV);

  descend(level, options);
  copy(level, kSolution, kKrylovX);
  apply(level, kKrylovX, kKrylovV);
  sum(size, TwoDotTerms<S, S>{x, v, f}, KrylovFirst{s});
  run(size, CombineBody<S, S>{{0, &s->minus_step}, {1}, v, f});

  zero(level, kSolution);
  descend(level, options);
  apply(level, kSolution, kScratch);
  sum(size, ThreeDotTerms<S>{u, v, cycle_vector(level, kScratch), f}, KrylovSecond{s});
  run(size, CombineBody<S, S>{{0, &s->first}, {0, &s->second}, x, u});
}

}  // namespace kerf::gpu
