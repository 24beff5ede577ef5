// SPDX-License-Identifier: MIT
//
// The bodies of kernels/ over groups of cells: loading and storing of lanes, no loops over
// groups and no threads.
#pragma once

#include <algorithm>
#include <array>
#include <type_traits>
#include <vector>

#include "core/backend.hpp"
#include "cpu/patch_sweep.hpp"
#include "cpu/stored_matrices.hpp"
#include "kernels/corotate.hpp"
#include "kernels/hex_element.hpp"
#include "kernels/host_device.hpp"
#include "kernels/mode_coarsen.hpp"
#include "kernels/modes.hpp"
#include "kernels/rotation.hpp"
#include "kernels/unrolled.hpp"

namespace kerf::cpu {

using kernels::kEntries;

/// Constants of one Poisson ratio and mass model, in every lane.
template <class S>
struct PackedMaterial {
  kernels::ModeConstants<Pack<S>> modes;
  kernels::HexStiffness<Pack<S>> stiffness;
  kernels::HexMass<Pack<S>> mass;
};

/// What the elements of level 0 are made of.
template <class S>
struct FinestValues {
  Array<S> rotation;  // [group][w x y z][lane]
  std::vector<PackedMaterial<S>> materials;

  /// Where w of a lane lies; the others follow in steps of a group.
  static std::size_t place(std::size_t lane) {
    return 4 * kGroup * (lane / kGroup) + lane % kGroup;
  }
  std::array<S, 4> at(std::size_t lane) const {
    const S* q = rotation.data() + place(lane);
    return {q[0], q[kGroup], q[2 * kGroup], q[3 * kGroup]};
  }
  void put(std::size_t lane, const std::array<S, 4>& q) {
    for (std::size_t k = 0; k < 4; ++k) rotation[place(lane) + kGroup * k] = q[k];
  }
  /// The identity in some groups.
  void no_rotation(std::size_t begin, std::size_t end) {
    rotation.resize(std::max(rotation.size(), 4 * kGroup * end));
    std::fill(rotation.begin() + 4 * kGroup * begin, rotation.begin() + 4 * kGroup * end, S(0));
    for (std::size_t g = begin; g < end; ++g)
      std::fill_n(rotation.begin() + 4 * kGroup * g, kGroup, S(1));
  }
  kernels::Quat<Pack<S>> quaternion(std::size_t group, int first_lane) const {
    return load_quaternion(rotation.data() + 4 * kGroup * group + first_lane);
  }
  /// Asks memory for those that are needed a few groups later.
  void prefetch_behind(std::size_t group) const {
    constexpr std::size_t kAhead = 4, kScalars = 4 * kGroup;
    prefetch(rotation.data(), kScalars * (group + kAhead), kScalars);
  }
  void set_quaternion(std::size_t group, int first_lane, const kernels::Quat<Pack<S>>& q) {
    store_quaternion(rotation.data() + 4 * kGroup * group + first_lane, q);
  }
};

/// Cells of a row within a pack.
template <RowKind kKind, class S>
inline constexpr int kRunInPack = std::min(run_of(kKind), Pack<S>::kLanes);

/// The corners of the lanes of a pack. In rows they follow each other along x, so that two of them
/// are read and written together, and no numbers but the first of a row are: `points` is of
/// PatchedLevel::heads there, else of its corners.
/// Inlined, since arrays of packs that a call fills are cleared before.
template <RowKind kKind, class S>
[[gnu::always_inline]] inline void gather_corners(const std::uint16_t* points, const S* x,
                                                  kernels::Vec3<Pack<S>> (&out)[8]) {
  kernels::unrolled<4>([&](auto edge) {
    constexpr int i = 2 * edge;
    if constexpr (kKind == kScattered) {
      gather_points(x, points + kGroup * i, out[i]);
      gather_points(x, points + kGroup * (i + 1), out[i + 1]);
    } else {
      gather_runs<kRunInPack<kKind, S>>(x, points + 4 * edge, out[i], out[i + 1]);
    }
  });
}
template <RowKind kKind, class S>
[[gnu::always_inline]] inline void add_corners(const std::uint16_t* points,
                                               const kernels::Vec3<Pack<S>> (&f)[8], S* y) {
  kernels::unrolled<4>([&](auto edge) {
    constexpr int i = 2 * edge;
    if constexpr (kKind == kScattered) {
      add_to_points(y, points + kGroup * i, f[i]);
      add_to_points(y, points + kGroup * (i + 1), f[i + 1]);
    } else {
      add_runs<kRunInPack<kKind, S>>(y, points + 4 * edge, f[i], f[i + 1]);
    }
  });
}

/// Calls body(points of the corners, how they lie, first lane) for each pack of a group.
template <class S, class Body>
void for_corners(const PatchedLevel& level, std::size_t group, const Body& body) {
  const auto run = [&](auto kind) {
    constexpr bool in_rows = kind() != kScattered;
    constexpr std::size_t kPoints = in_rows ? kHeads : 8 * kGroup, kAhead = in_rows ? 16 : 4;
    const auto& all = in_rows ? level.heads : level.corners;
    const std::uint16_t* const points = all.data() + kPoints * group;
    prefetch(points, kPoints * kAhead, kPoints);
    for_packs<S>([&](int first) { body(points + (in_rows ? first / 4 : first), kind, first); });
  };
  switch (level.row[group]) {
    case kRow:
      return run(std::integral_constant<RowKind, kRow>{});
    case kTwoRows:
      return run(std::integral_constant<RowKind, kTwoRows>{});
    case kFourRows:
      return run(std::integral_constant<RowKind, kFourRows>{});
    default:
      return run(std::integral_constant<RowKind, kScattered>{});
  }
}

/// y += A x for a group of cells of level 0, there or as another level has them:
/// quaternion(first lane).
template <class S, class Quaternion>
void element_products(const PatchedLevel& level, const CellKind& kind,
                      const PackedMaterial<S>& material, const OperatorScale& scale,
                      std::size_t group, const Quaternion& quaternion, const S* x, S* y) {
  using P = Pack<S>;
  const P stiffness = P(scale.stiffness * kind.stiffness), mass = P(scale.mass * kind.mass);
  for_corners<S>(level, group, [&](const std::uint16_t* points, auto row, int first) KERF_FLATTEN {
    kernels::Vec3<P> at[8];
    gather_corners<row()>(points, x, at);
    const auto R = kernels::to_matrix(quaternion(first));
    if (scale.mass == 0)
      kernels::apply_cell(at, R, stiffness, material.modes.stiffness, at);
    else
      kernels::apply_cell(at, R, stiffness, mass, material.modes, at);
    add_corners<row()>(points, at, y);
  });
}

template <class S>
void finest_products(const PatchedLevel& level, const FinestValues<S>& values,
                     const OperatorScale& scale, std::size_t group, const S* x, S* y) {
  const CellKind& kind = level.kinds[level.kind[group]];
  values.prefetch_behind(group);
  element_products(
      level, kind, values.materials[kind.material], scale, group,
      [&](int first) { return values.quaternion(group, first); }, x, y);
}

/// y += A x for a group of a stored level.
template <class S>
void stored_products(const PatchedLevel& level, const StoredMatrices<S>& matrices,
                     std::size_t group, const S* x, S* y) {
  for_corners<S>(level, group, [&](const std::uint16_t* points, auto row, int first) KERF_FLATTEN {
    kernels::Vec3<Pack<S>> at[8];
    gather_corners<row()>(points, x, at);
    matrices.read(group, first, [&](const auto& entries, const Pack<S>& unit, auto translations) {
      if constexpr (std::is_same_v<std::decay_t<decltype(entries)>, CodedEntries>)
        for (auto& v : at) v *= unit;
      kernels::apply_mode_matrix<translations()>(entries, at, at);
    });
    add_corners<row()>(points, at, y);
  });
}

/// y += the elastic force of a group of level 0 displaced by x.
template <class S>
void elastic_forces(const PatchedLevel& level, const FinestValues<S>& values, std::size_t group,
                    const S* x, S* y) {
  using P = Pack<S>;
  const CellKind& kind = level.kinds[level.kind[group]];
  values.prefetch_behind(group);
  for_corners<S>(level, group, [&](const std::uint16_t* points, auto row, int first) KERF_FLATTEN {
    kernels::Vec3<P> at[8];
    gather_corners<row()>(points, x, at);
    kernels::elastic_force(at, values.quaternion(group, first), P(kind.side), P(kind.stiffness),
                           values.materials[kind.material].modes.stiffness, at);
    add_corners<row()>(points, at, y);
  });
}

/// Two packs of rotations from mean gradients, warm-started: they take their steps in turn, since
/// each operation of a step waits for the one before. Where Newton proves nothing within its steps,
/// a lane goes the way of the reference.
template <class S>
KERF_FLATTEN void rotate_two(const kernels::Mat3<Pack<S>>* F, const kernels::Quat<Pack<S>>* start,
                             kernels::Quat<Pack<S>>* q) {
  using P = Pack<S>;
  constexpr int kIterations = 8, kPacks = 2;
  const P small2 = P(S(0.01) * kernels::Precision<S>::kEpsilon);
  PackMask<S> proven[kPacks], lost[kPacks];
  for (int n = 0; n < kPacks; ++n) {
    q[n] = start[n];
    proven[n] = lost[n] = {P(S(1)).v < P(S(0)).v};
  }
  for (int i = 0; i < kIterations; ++i) {
    bool done = true;
    for (int n = 0; n < kPacks; ++n) {
      kernels::RotationStep<P> step;
      kernels::rotation_step(F[n], q[n], step);
      lost[n] = lost[n] || !(step.ascent || proven[n]);
      q[n] = {select(proven[n], q[n].w, step.next.w), select(proven[n], q[n].x, step.next.x),
              select(proven[n], q[n].y, step.next.y), select(proven[n], q[n].z, step.next.z)};
      proven[n] = proven[n] || (step.ascent && step.length2 <= small2);
      done = done && all(proven[n] || lost[n]);
    }
    if (done) break;
  }
  for (int n = 0; n < kPacks; ++n) {
    q[n] = kernels::normalised(q[n]);
    const PackMask<S> done = proven[n] && !lost[n];
    for (int k = 0; k < P::kLanes && !all(done); ++k) {
      if (done.v[k] != 0) continue;
      kernels::Mat3<S> f;
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b) f[a][b] = F[n][a][b][k];
      const kernels::Quat<P>& from = start[n];
      const auto turned = kernels::extract_rotation(
          f, kernels::Quat<S>{from.w[k], from.x[k], from.y[k], from.z[k]});
      q[n].w.set(k, turned.w);
      q[n].x.set(k, turned.x);
      q[n].y.set(k, turned.y);
      q[n].z.set(k, turned.z);
    }
  }
}

/// Rotations of a group from the displacements.
template <class S>
void rotate_group(const PatchedLevel& level, FinestValues<S>& values, std::size_t group,
                  const S* x) {
  using P = Pack<S>;
  constexpr int kPacks = kGroup / P::kLanes;
  static_assert(kPacks % 2 == 0);
  const P side = P(level.kinds[level.kind[group]].side);
  kernels::Mat3<P> F[kPacks];
  kernels::Quat<P> start[kPacks], q[kPacks];
  values.prefetch_behind(group);
  for_corners<S>(level, group, [&](const std::uint16_t* points, auto row, int first) KERF_FLATTEN {
    kernels::Vec3<P> corners[8];
    gather_corners<row()>(points, x, corners);
    F[first / P::kLanes] = kernels::mean_gradient(corners, side);
    start[first / P::kLanes] = values.quaternion(group, first);
  });
  for (int n = 0; n < kPacks; n += 2) rotate_two<S>(F + n, start + n, q + n);
  for (int n = 0; n < kPacks; ++n) values.set_quaternion(group, n * P::kLanes, q[n]);
}

}  // namespace kerf::cpu
