// SPDX-License-Identifier: MIT
//
// Rotations of groups of cells from their displacements, warm-started: no threads.
//
// Each operation of a Newton step waits for the one before, so two packs of groups take theirs in
// turn. Steps are in single precision. What that leaves to do is small and needs few digits too,
// but for how far the rotation is off: that is taken in double.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "cpu/fast_kernels.hpp"
#include "cpu/finest_values.hpp"
#include "cpu/twin.hpp"
#include "kernels/rotation.hpp"

namespace kerf::cpu {

/// Two packs of cells in single precision, and packs in double of as many.
using Singles = Twin<Pack<float>>;
struct Doubles {
  Twin<Pack<double>> of[2];
};
static_assert(Pack<float>::kLanes == 2 * Pack<double>::kLanes);

inline Doubles in_double(const Singles& x) {
  Doubles out;
  parted(x.a, out.of[0].a, out.of[0].b);
  parted(x.b, out.of[1].a, out.of[1].b);
  return out;
}
inline Singles in_single(const Doubles& x) {
  return {joined(x.of[0].a, x.of[0].b), joined(x.of[1].a, x.of[1].b)};
}

/// Rotations as single precision has them, and what the last step needs.
struct NearRotation {
  kernels::Quat<Singles> q;             // of length 1
  kernels::Sym3<Singles> half_inverse;  // of RotationStep, from some 1e-3 radians off
  Singles::Mask done;                   // all but the last step
};

/// 4 side F of kernels/rotation.hpp, m, by rows: it has the rotation of F. Of two packs in double,
/// which make one in single precision. No Mat3: arrays of those are cleared.
using Gradient = Twin<Pack<double>>[3][3];

/// Where the point of a corner lies, of a lane that corners_of or, in rows, heads has at `points`.
template <RowKind kKind>
[[gnu::always_inline]] inline const double* corner_at(const double* x, const std::uint16_t* points,
                                                      int corner, int lane) {
  const int left = corner & ~1, right = corner & 1;
  if constexpr (run_of(kKind) > 1) {
    return at_lane<kRunInPack<kKind, double>>(x, points + 2 * left, lane) + 4 * right;
  } else if constexpr (kKind == kPairs) {
    return x + 4 * (std::size_t(points[kGroup * left + lane]) + std::size_t(right));
  } else {
    return x + 4 * std::size_t(points[kGroup * corner + lane]);
  }
}

/// 4 side (F - I) of a pack, by columns. Three sums of points are brought into lanes, not eight
/// points.
template <RowKind kKind>
[[gnu::always_inline]] inline void gather_columns(const std::uint16_t* points, const double* x,
                                                  kernels::Vec3<Pack<double>> (&out)[3]) {
  using P = Pack<double>;
  constexpr int kInRegister = P::kLanes / 4;
  P along_x[4], along_y[4], along_z[4];
  kernels::unrolled<4>([&](auto k) {
    P u[8];
    kernels::unrolled<8>([&](auto corner) {
      const auto at = [&](int lane) { return corner_at<kKind>(x, points, corner, lane); };
      if constexpr (run_of(kKind) > 1)
        u[corner] = load_pack(at(kInRegister * k));
      else
        u[corner] = records_of(at, k);
    });
    const P up = (u[6] - u[0]) + (u[7] - u[1]), across = (u[2] - u[4]) + (u[3] - u[5]);
    along_x[k] = ((u[1] - u[0]) + (u[3] - u[2])) + ((u[5] - u[4]) + (u[7] - u[6]));
    along_y[k] = up + across;
    along_z[k] = up - across;
  });
  by_components(along_x, out[0]);
  by_components(along_y, out[1]);
  by_components(along_z, out[2]);
}

/// Of a group, to the packs from `pack` on.
inline void gather_gradients(const PatchedLevel& level, std::size_t group, const double* x,
                             int pack, Gradient* out) {
  using P = Pack<double>;
  const P identity(4 * level.kinds[level.kind[group]].side);
  for_corners<double>(
      level, group, [&](const std::uint16_t* points, auto row, int first) KERF_FLATTEN {
        kernels::Vec3<P> columns[3];
        gather_columns<row()>(points, x, columns);
        const int n = pack + first / P::kLanes;
        kernels::unrolled<9>([&](auto k) {
          constexpr int i = k / 3, j = k % 3;
          Twin<P>& to = out[n / 2][i][j];
          (n % 2 == 0 ? to.a : to.b) = i == j ? columns[j][i] + identity : columns[j][i];
        });
      });
}

/// A matrix from entry(row, column), in one go: one that is filled later is cleared first.
template <class T, class Entry>
[[gnu::always_inline]] inline kernels::Mat3<T> matrix_of(const Entry& entry) {
  return {{{entry(0, 0), entry(0, 1), entry(0, 2)},
           {entry(1, 0), entry(1, 1), entry(1, 2)},
           {entry(2, 0), entry(2, 1), entry(2, 2)}}};
}

/// Radians. Behind a step of kNearStep is one of 1e-6, or of rounding.
inline constexpr float kNearStep = 1e-3F;
/// Turning by an angle changes the matrix of a step, to first order, by less than the angle times
/// its spread. A step that takes the matrix of the step before may be wrong by this part of itself,
/// times the trace of the matrix over its least eigenvalue.
inline constexpr float kStale = 1e-6F;
/// Radians; some 1e-7 is usual. A guard, and no comparison holds for what is no number.
inline constexpr float kLastStep = 1e-6F;

/// Newton's iteration in single precision from near.q, until one step is left that can take the
/// matrix of the step before.
///
/// Errors  The step that is left is one of kLastStep at most: wrong by 1e-12 times trace over least
///         eigenvalue.
[[gnu::always_inline]] inline void turn_nearly(const kernels::Mat3<Singles>& F,
                                               NearRotation& near) {
  using T = Singles;
  constexpr int kIterations = 8;
  const T near2 = T(kNearStep * kNearStep), stale2 = T(kStale * kStale);
  const T least = T(1e-9F);  // m; its cube keeps its digits
  kernels::Quat<T>& q = near.q;
  near.done = T(1) < T(0);  // such lanes stay, so that no lane depends on others
  const auto take_step = [&](auto is_first) {
    kernels::RotationStep<T> step;
    kernels::rotation_step(F, q, step);
    const auto keep = [&](T& held, const T& next) {
      held = is_first() ? next : select(near.done, held, next);
    };
    keep(q.w, step.next.w);
    keep(q.x, step.next.x);
    keep(q.y, step.next.y);
    keep(q.z, step.next.z);
    keep(near.half_inverse.xx, step.half_inverse.xx);
    keep(near.half_inverse.xy, step.half_inverse.xy);
    keep(near.half_inverse.xz, step.half_inverse.xz);
    keep(near.half_inverse.yy, step.half_inverse.yy);
    keep(near.half_inverse.yz, step.half_inverse.yz);
    keep(near.half_inverse.zz, step.half_inverse.zz);
    near.done = near.done || (step.ascent && step.trace > least && step.length2 <= near2 &&
                              step.length2 * step.spread2 <= stale2 * (step.trace * step.trace));
  };
  take_step(std::true_type{});
  for (int i = 1; i < kIterations && !all(near.done); ++i) take_step(std::false_type{});
  const T length2 = fma(q.w, q.w, fma(q.x, q.x, fma(q.y, q.y, q.z * q.z)));
  const T inverse = T(1) / sqrt(length2);
  q = {q.w * inverse, q.x * inverse, q.y * inverse, q.z * inverse};
  const auto& H = near.half_inverse;
  near.half_inverse = {H.xx * length2, H.xy * length2, H.xz * length2,
                       H.yy * length2, H.yz * length2, H.zz * length2};
}

/// The last step, from q of length 1 in single precision; the lanes in which it was the last one.
/// How far q is off is taken in double. So is q (1, w) over its length, but not w, half of the
/// rotation vector.
[[gnu::always_inline]] inline Singles::Mask take_last_step(const Gradient* gradients,
                                                           const NearRotation& near,
                                                           kernels::Quat<Pack<double>> (&out)[4]) {
  using T = Twin<Pack<double>>;
  const auto& q = near.q;
  const auto& H = near.half_inverse;
  const Doubles qw = in_double(q.w), qx = in_double(q.x), qy = in_double(q.y), qz = in_double(q.z);
  const auto at = [&](int half) {
    return kernels::Quat<T>{qw.of[half], qx.of[half], qy.of[half], qz.of[half]};
  };
  Doubles off[3];
  for (int half = 0; half < 2; ++half) {
    const kernels::Vec3<T> axial = kernels::horn_axial<T>(gradients[half], at(half));
    off[0].of[half] = axial.x;
    off[1].of[half] = axial.y;
    off[2].of[half] = axial.z;
  }
  const Singles x = in_single(off[0]), y = in_single(off[1]), z = in_single(off[2]);
  const kernels::Vec3<Singles> w{fma(H.xx, x, fma(H.xy, y, H.xz * z)),
                                 fma(H.xy, x, fma(H.yy, y, H.yz * z)),
                                 fma(H.xz, x, fma(H.yz, y, H.zz * z))};
  const Doubles wx = in_double(w.x), wy = in_double(w.y), wz = in_double(w.z);
  for (int half = 0; half < 2; ++half) {
    const kernels::Quat<T> to =
        kernels::turned_on(at(half), {wx.of[half], wy.of[half], wz.of[half]});
    // 1 / length - 1 by its series: what single precision leaves to do is some 1e-7.
    const T over = fma(to.w, to.w, fma(to.x, to.x, fma(to.y, to.y, fma(to.z, to.z, T(-1)))));
    const T less = over * fma(over, T(0.375), T(-0.5));
    const kernels::Quat<T> unit{fma(to.w, less, to.w), fma(to.x, less, to.x), fma(to.y, less, to.y),
                                fma(to.z, less, to.z)};
    out[2 * half] = {unit.w.a, unit.x.a, unit.y.a, unit.z.a};
    out[2 * half + 1] = {unit.w.b, unit.x.b, unit.y.b, unit.z.b};
  }
  const Singles half2 = fma(w.x, w.x, fma(w.y, w.y, w.z * w.z));  // w is half of the rotation
  return near.done && half2 <= Singles(0.25F * kLastStep * kLastStep);
}

/// Stores the lanes of two packs that are done. The others, which Newton leads nowhere or not so
/// soon, go the way of the reference from where they were.
template <class S>
[[gnu::noinline, gnu::cold]] void store_some(const Gradient& gradient, const PackMask<float>& done,
                                             const kernels::Quat<Pack<double>>* q,
                                             std::size_t group, int first_lane,
                                             FinestRotations<S>& rotations) {
  constexpr int kLanes = Pack<double>::kLanes;
  const std::size_t first = kGroup * group + static_cast<std::size_t>(first_lane);
  std::array<std::array<double, 4>, 2 * kLanes> turned;
  for (int k = 0; k < 2 * kLanes; ++k) {
    if (done.v[k] != 0) continue;
    const auto F = matrix_of<double>([&](int a, int b) {
      const auto& entry = gradient[a][b];
      return k < kLanes ? entry.a[k] : entry.b[k - kLanes];
    });
    const auto from = rotations.at(first + static_cast<std::size_t>(k));
    const auto best =
        kernels::extract_rotation(F, kernels::Quat<double>{from[0], from[1], from[2], from[3]});
    turned[k] = {best.w, best.x, best.y, best.z};
  }
  rotations.store(group, first_lane, q[0]);
  rotations.store(group, first_lane + kLanes, q[1]);
  for (int k = 0; k < 2 * kLanes; ++k)
    if (done.v[k] == 0) rotations.put(first + static_cast<std::size_t>(k), turned[k]);
}

/// Groups of which each part of the work is done before the next: two packs in single precision,
/// twice.
inline constexpr int kTwins = 2;
inline constexpr int kRotatedGroups = std::max(1, kTwins * 2 * Pack<float>::kLanes / kGroup);

/// Rotations of some groups, at most kRotatedGroups, from the displacements.
template <class S>
KERF_FLATTEN void rotate_groups(const PatchedLevel& level, FinestRotations<S>& rotations,
                                std::size_t begin, int count, const double* x) {
  constexpr int kDoubles = kGroup / Pack<double>::kLanes;  // packs of a group
  constexpr int kSingles = kDoubles / 2;
  static_assert(kSingles * kRotatedGroups == 2 * kTwins);
  Gradient gradients[2 * kTwins];
  NearRotation near[kTwins];
  const auto group_of = [&](int n) { return begin + static_cast<std::size_t>(n / kSingles); };
  const auto lane_of = [](int n) { return n % kSingles * Pack<float>::kLanes; };
  const int packs = kSingles * count, twins = (packs + 1) / 2;
  for (int g = 0; g < 2 * twins / kSingles; ++g) {  // the last one twice, for a whole twin
    const std::size_t group = begin + static_cast<std::size_t>(std::min(g, count - 1));
    rotations.prefetch_to_store(group);
    gather_gradients(level, group, x, kDoubles * g, gradients);
  }
  for (int t = 0; t < twins; ++t) {
    const Gradient* const of = gradients + 2 * t;
    const auto F = matrix_of<Singles>([&](int a, int b) {
      return Singles(joined(of[0][a][b].a, of[0][a][b].b), joined(of[1][a][b].a, of[1][a][b].b));
    });
    const auto start = [&](int n) {
      return rotations.template load<float>(group_of(n), lane_of(n));
    };
    const auto q = start(2 * t), r = start(std::min(2 * t + 1, packs - 1));
    near[t].q = {{q.w, r.w}, {q.x, r.x}, {q.y, r.y}, {q.z, r.z}};
    turn_nearly(F, near[t]);
  }
  for (int t = 0; t < twins; ++t) {
    kernels::Quat<Pack<double>> q[4];
    const Singles::Mask done = take_last_step(gradients + 2 * t, near[t], q);
    for (int i = 0; i < 2; ++i) {
      const int n = 2 * t + i;
      if (n == packs) break;
      const PackMask<float>& lanes = i == 0 ? done.a : done.b;
      if (!all(lanes)) {
        store_some(gradients[n], lanes, q + 2 * i, group_of(n), lane_of(n), rotations);
        continue;
      }
      rotations.store(group_of(n), lane_of(n), q[2 * i]);
      rotations.store(group_of(n), lane_of(n) + Pack<double>::kLanes, q[2 * i + 1]);
    }
  }
}

}  // namespace kerf::cpu
