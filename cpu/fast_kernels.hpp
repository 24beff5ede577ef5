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
#include "cpu/finest_values.hpp"
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

/// Cells of a row within a pack.
template <RowKind kKind, class S>
inline constexpr int kRunInPack = std::min(run_of(kKind), Pack<S>::kLanes);

/// The corners of the lanes of a pack. In rows they follow each other along x, so that two of them
/// are read and written together, and no numbers but the first of a row are: `points` is of
/// PatchedLevel::heads there, else of its corners. Of pairs each lane's left ones are read.
/// Inlined, since arrays of packs that a call fills are cleared before.
template <RowKind kKind, class S>
[[gnu::always_inline]] inline void gather_corners(const std::uint16_t* points, const S* x,
                                                  kernels::Vec3<Pack<S>> (&out)[8]) {
  kernels::unrolled<4>([&](auto edge) {
    constexpr int i = 2 * edge;
    if constexpr (kKind == kScattered) {
      gather_points(x, points + kGroup * i, out[i]);
      gather_points(x, points + kGroup * (i + 1), out[i + 1]);
    } else if constexpr (kKind == kPairs) {
      gather_pairs(x, points + kGroup * i, out[i], out[i + 1]);
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
    } else if constexpr (kKind == kPairs) {
      add_pairs(y, points + kGroup * i, f[i], f[i + 1]);
    } else {
      add_runs<kRunInPack<kKind, S>>(y, points + 4 * edge, f[i], f[i + 1]);
    }
  });
}

/// Calls body(points of the corners, how they lie, first lane) for each pack of a group.
template <class S, class Body>
void for_corners(const PatchedLevel& level, std::size_t group, const Body& body) {
  const auto run = [&](auto kind) {
    constexpr bool in_rows = run_of(kind()) > 1;
    constexpr std::size_t kPoints = in_rows ? kHeads : 8 * kGroup, kAhead = in_rows ? 16 : 4;
    const std::uint16_t* const points =
        in_rows ? level.heads.data() + kHeads * group : level.corners_of(group);
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
    case kPairs:
      return run(std::integral_constant<RowKind, kPairs>{});
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

template <class Values, class S>
void finest_products(const PatchedLevel& level, const Values& values, const OperatorScale& scale,
                     std::size_t group, const S* x, S* y) {
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
  const bool turned = matrices.is_turned(group);
  for_corners<S>(level, group, [&](const std::uint16_t* points, auto row, int first) KERF_FLATTEN {
    kernels::Vec3<Pack<S>> at[8];
    gather_corners<row()>(points, x, at);
    kernels::Mat3<Pack<S>> R;
    if (turned) {
      R = kernels::to_matrix(matrices.rotation(group, first));
      for (auto& v : at) v = kernels::transpose_times(R, v);
    }
    matrices.read(group, first, [&](const auto& entries, const Pack<S>& unit, auto translations) {
      if constexpr (std::is_same_v<std::decay_t<decltype(entries)>, CodedEntries>)
        for (auto& v : at) v *= unit;
      kernels::apply_mode_matrix<translations()>(entries, at, at);
    });
    if (turned)
      for (auto& v : at) v = R * v;
    add_corners<row()>(points, at, y);
  });
}

/// y += the elastic force of a group of level 0 displaced by x.
template <class Values, class S>
void elastic_forces(const PatchedLevel& level, const Values& values, std::size_t group, const S* x,
                    S* y) {
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

}  // namespace kerf::cpu
