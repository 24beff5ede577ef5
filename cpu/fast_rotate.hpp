// SPDX-License-Identifier: MIT
//
// Rotations of groups of cells from their displacements, warm-started: no threads.
//
// Each operation of a Newton step waits for the one before, so several groups take theirs in turn.
// All but the last step is in single precision.
#pragma once

#include <algorithm>

#include "cpu/fast_kernels.hpp"
#include "cpu/finest_values.hpp"
#include "cpu/twin.hpp"
#include "kernels/rotation.hpp"

namespace kerf::cpu {

/// The work of some groups.
struct RotationBatch {
  static constexpr int kGroups = 4;
  static constexpr int kPacks = kGroup / Pack<double>::kLanes;  // of a group
  static_assert(kPacks % 2 == 0 && Pack<float>::kLanes == 2 * Pack<double>::kLanes);

  kernels::Mat3<Pack<double>> gradient[kGroups * kPacks];  // F of kernels/rotation.hpp
  kernels::Quat<Pack<float>> near[kGroups * kPacks / 2];   // rotations to some 1e-7
};

inline void gather_gradients(const PatchedLevel& level, std::size_t group, const double* x,
                             kernels::Mat3<Pack<double>>* F) {
  using P = Pack<double>;
  const P side = P(level.kinds[level.kind[group]].side);
  for_corners<double>(level, group,
                      [&](const std::uint16_t* points, auto row, int first) KERF_FLATTEN {
                        kernels::Vec3<P> corners[8];
                        gather_corners<row()>(points, x, corners);
                        F[first / P::kLanes] = kernels::mean_gradient(corners, side);
                      });
}

/// Of the square of a step in double, radians: what follows one of 1e-6 is at most its square.
inline constexpr double kLastStep2 = 1e-12;

/// q where the mask holds, else next.
template <class T>
kernels::Quat<T> held(const typename T::Mask& mask, const kernels::Quat<T>& q,
                      const kernels::Quat<T>& next) {
  return {select(mask, q.w, next.w), select(mask, q.x, next.x), select(mask, q.y, next.y),
          select(mask, q.z, next.z)};
}

/// Newton's iteration in single precision, from and to batch.near. A lane that it does not lead
/// anywhere is left to turn_on; where F is too large for single precision it gets the identity,
/// from numbers that normalised() finds unusable.
KERF_FLATTEN inline void turn_nearly(RotationBatch& batch, int packs) {
  using P = Pack<float>;
  using T = Twin<P>;
  constexpr int kMost = RotationBatch::kGroups * RotationBatch::kPacks / 2, kIterations = 8;
  static_assert(kMost % 2 == 0);
  const T near2 = T(1e-6F);  // behind a step of 1e-3 radians is one of 1e-6, or of rounding
  for (int n = 0; n < packs; n += 2) {
    kernels::Mat3<T> F;
    const auto* const from = batch.gradient + 2 * n;
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b)
        F[a][b] = {joined(from[0][a][b], from[1][a][b]), joined(from[2][a][b], from[3][a][b])};
    kernels::Quat<P>*const first = batch.near + n, *const second = first + 1;
    kernels::Quat<T> q{
        {first->w, second->w}, {first->x, second->x}, {first->y, second->y}, {first->z, second->z}};
    auto done = T(1) < T(0);  // such lanes stay, so that no lane depends on others
    for (int i = 0; i < kIterations && !all(done); ++i) {
      kernels::RotationStep<T> step;
      kernels::rotation_step(F, q, step);
      q = held(done, q, step.next);
      done = done || !step.ascent || step.length2 <= near2;
    }
    q = kernels::normalised(q);
    *first = {q.w.a, q.x.a, q.y.a, q.z.a};
    *second = {q.w.b, q.x.b, q.y.b, q.z.b};
  }
}

/// More steps of the lanes of a pack that are not done. Where Newton proves nothing within its
/// steps, a lane goes the way of the reference, from `start`.
[[gnu::noinline, gnu::cold]] inline void turn_on(const kernels::Mat3<Pack<double>>& F,
                                                 const kernels::Quat<Pack<double>>& start,
                                                 const PackMask<double>& done,
                                                 kernels::Quat<Pack<double>>& q) {
  using P = Pack<double>;
  constexpr int kIterations = 8;
  const P small2 = P(kLastStep2);
  PackMask<double> proven = done, lost{P(1).v < P(0).v};
  for (int i = 0; i < kIterations && !all(proven || lost); ++i) {
    kernels::RotationStep<P> step;
    kernels::rotation_step(F, q, step);
    lost = lost || !(step.ascent || proven);
    q = held(proven, q, step.next);
    proven = proven || (step.ascent && step.length2 <= small2);
  }
  q = held(done, q, kernels::normalised(q));
  for (int k = 0; k < P::kLanes; ++k) {
    if (proven.v[k] != 0 && lost.v[k] == 0) continue;
    kernels::Mat3<double> f;
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) f[a][b] = F[a][b][k];
    const auto turned = kernels::extract_rotation(
        f, kernels::Quat<double>{start.w[k], start.x[k], start.y[k], start.z[k]});
    q.w.set(k, turned.w);
    q.x.set(k, turned.x);
    q.y.set(k, turned.y);
    q.z.set(k, turned.z);
  }
}

/// The last step, from q of length 1 in single precision; the lanes in which it was the last one.
template <class T>
[[gnu::always_inline]] inline auto take_last_step(const kernels::Mat3<T>& F, kernels::Quat<T>& q) {
  kernels::RotationStep<T> step;
  kernels::rotation_step(F, q, step);
  q = step.next;
  // 1 / |q| by its series: |q|^2 - 1 is some 1e-7, and so is what single precision leaves to do.
  const T over = fma(q.w, q.w, fma(q.x, q.x, fma(q.y, q.y, fma(q.z, q.z, T(-1)))));
  const T less = over * fma(over, T(0.375), T(-0.5));
  q = {fma(q.w, less, q.w), fma(q.x, less, q.x), fma(q.y, less, q.y), fma(q.z, less, q.z)};
  return step.ascent && step.length2 <= T(kLastStep2);
}

/// Rotations of some groups, at most RotationBatch::kGroups, from the displacements.
template <class S>
KERF_FLATTEN void rotate_groups(const PatchedLevel& level, FinestRotations<S>& rotations,
                                std::size_t begin, int count, const double* x) {
  using P = Pack<double>;
  using T = Twin<P>;
  constexpr int kPacks = RotationBatch::kPacks, kHalf = kPacks / 2;
  RotationBatch batch;
  const int gathered = count + kHalf * count % 2;  // the last one twice, for a whole twin
  for (int g = 0; g < gathered; ++g) {
    const std::size_t group = begin + static_cast<std::size_t>(std::min(g, count - 1));
    rotations.prefetch_to_store(group);
    gather_gradients(level, group, x, batch.gradient + kPacks * g);
    for (int n = 0; n < kHalf; ++n)
      batch.near[kHalf * g + n] = rotations.template load<float>(group, n * Pack<float>::kLanes);
  }
  turn_nearly(batch, kHalf * count);
  for (int n = 0; n < kHalf * count; ++n) {
    const std::size_t group = begin + static_cast<std::size_t>(n / kHalf);
    const int first = 2 * (n % kHalf) * P::kLanes, second = first + P::kLanes;
    const kernels::Mat3<P>* const F = batch.gradient + 2 * n;
    kernels::Mat3<T> both;
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) both[a][b] = {F[0][a][b], F[1][a][b]};
    const kernels::Quat<Pack<float>>& near = batch.near[n];
    kernels::Quat<T> q;
    parted(near.w, q.w.a, q.w.b);
    parted(near.x, q.x.a, q.x.b);
    parted(near.y, q.y.a, q.y.b);
    parted(near.z, q.z.a, q.z.b);
    const auto done = take_last_step(both, q);
    kernels::Quat<P> q0{q.w.a, q.x.a, q.y.a, q.z.a}, q1{q.w.b, q.x.b, q.y.b, q.z.b};
    if (!all(done.a)) turn_on(F[0], rotations.template load<double>(group, first), done.a, q0);
    if (!all(done.b)) turn_on(F[1], rotations.template load<double>(group, second), done.b, q1);
    rotations.store(group, first, q0);
    rotations.store(group, second, q1);
  }
}

}  // namespace kerf::cpu
