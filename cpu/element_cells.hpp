// SPDX-License-Identifier: MIT
//
// Cells that are one element each: those of level 0, and those of level 1 of which rotations alone
// are stored (cpu/stored_matrices.hpp). Loading of lanes, no loops over groups and no threads.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "cpu/fast_kernels.hpp"
#include "kernels/mode_coarsen.hpp"
#include "kernels/unrolled.hpp"

namespace kerf::cpu {

template <class S>
struct FinestCells {
  const PatchedLevel& level;
  const FinestValues<S>& values;

  const CellKind& kind(std::size_t lane) const { return level.kinds[level.kind[lane / kGroup]]; }
  /// w; the others follow in steps of a group.
  const S* rotation(std::size_t lane) const { return values.rotation.data() + values.place(lane); }
};

/// What a cell of level 1 is as one element.
inline CellKind element_kind(const std::vector<CellKind>& finest, std::uint16_t kind) {
  CellKind out = finest[finest_kind(kind)];
  if (!is_of_eight(kind)) return out;
  out.stiffness *= 2;  // E side
  out.mass *= 8;
  out.side *= 2;
  return out;
}

template <class S>
struct TurnedCells {
  const PatchedLevel &finest, &level;
  const StoredMatrices<S>& matrices;

  CellKind kind(std::size_t lane) const {
    return element_kind(finest.kinds, level.kind[lane / kGroup]);
  }
  const S* rotation(std::size_t lane) const { return matrices.rotation_of(lane); }
  /// Whether all lanes of some that have a cell are such.
  bool are_all(const std::int32_t* lanes, int octants) const {
    for (int octant = 0; octant < octants; ++octant)
      for (int k = 0; k < Pack<S>::kLanes; ++k)
        if (const std::int32_t lane = lanes[kGroup * octant + k];
            lane >= 0 && !matrices.is_turned(static_cast<std::size_t>(lane / kGroup)))
          return false;
    return true;
  }
};

constexpr int kAnyMaterial = -1;

/// Elements of some lanes (-1: none) that are of `material`; others have no stiffness.
template <class Cells, class S>
void load_elements(const Cells& cells, const OperatorScale& scale, const std::int32_t* lanes,
                   int material, kernels::FinestChild<Pack<S>>& out) {
  constexpr int kLanes = Pack<S>::kLanes;
  alignas(kPackBytes) S q[4][kLanes], stiffness[kLanes], mass[kLanes];
  for (int k = 0; k < kLanes; ++k) {
    q[0][k] = 1;
    q[1][k] = q[2][k] = q[3][k] = stiffness[k] = mass[k] = 0;
    if (lanes[k] < 0) continue;
    const auto lane = static_cast<std::size_t>(lanes[k]);
    const CellKind& kind = cells.kind(lane);
    if (material != kAnyMaterial && kind.material != material) continue;
    const S* const from = cells.rotation(lane);
    for (std::size_t c = 0; c < 4; ++c) q[c][k] = from[kGroup * c];
    stiffness[k] = static_cast<S>(scale.stiffness * kind.stiffness);
    mass[k] = static_cast<S>(scale.mass * kind.mass);
  }
  out.rotation = {load_pack(q[0]), load_pack(q[1]), load_pack(q[2]), load_pack(q[3])};
  out.stiffness = load_pack(stiffness);
  out.mass = load_pack(mass);
}

/// Which materials the cells in some lanes are of, as bits. `lanes`: [octant][kGroup].
template <class S, class Cells>
std::uint64_t materials_of(const Cells& cells, const std::int32_t* lanes, int octants) {
  std::uint64_t out = 0;
  for (int octant = 0; octant < octants; ++octant)
    for (int k = 0; k < Pack<S>::kLanes; ++k)
      if (const std::int32_t lane = lanes[kGroup * octant + k]; lane >= 0)
        out |= std::uint64_t{1} << (cells.kind(static_cast<std::size_t>(lane)).material % 64);
  return out;
}

/// Rotations of some lanes of level 0 (-1: the identity).
template <class S>
void load_rotations(const FinestValues<S>& values, const std::int32_t* lanes,
                    kernels::Quat<Pack<S>>& out) {
  constexpr int kLanes = Pack<S>::kLanes;
  const S* const from = values.rotation.data();
#if KERF_PACK_BITS == 512
  if constexpr (kLanes == kGroup) {
    // Children of cells side by side are mostly every other cell of two groups.
    if (const int within = lanes[0] % kGroup; are_every_other(lanes) && within < 2) {
      const S* const at = from + values.place(static_cast<std::size_t>(lanes[0] - within));
      const auto component = [&](int c) {
        return every_other(at + kGroup * c, at + kGroup * (c + 4), within);
      };
      out = {component(0), component(1), component(2), component(3)};
      return;
    }
  }
#endif
  alignas(kPackBytes) S q[4][kLanes];
  for (int k = 0; k < kLanes; ++k) {
    const S* const at = from + values.place(static_cast<std::size_t>(std::max(lanes[k], 0)));
    for (std::size_t c = 0; c < 4; ++c) q[c][k] = lanes[k] < 0 ? S(c == 0 ? 1 : 0) : at[kGroup * c];
  }
  out = {load_pack(q[0]), load_pack(q[1]), load_pack(q[2]), load_pack(q[3])};
}

/// The mean rotations of eight cells of level 0 each; false where one is farther than `angle` from
/// its mean. `children`: [octant][kGroup], lanes of level 0, -1: none of the eight.
template <class S>
bool mean_rotation(const FinestValues<S>& values, const std::int32_t* children, double angle,
                   kernels::Quat<Pack<S>>& mean) {
  using P = Pack<S>;
  kernels::Quat<P> of[8];
  kernels::unrolled<8>(
      [&](auto octant) { load_rotations(values, children + kGroup * octant, of[octant]); });
  const auto dot = [](const kernels::Quat<P>& a, const kernels::Quat<P>& b) {
    return fma(a.w, b.w, fma(a.x, b.x, fma(a.y, b.y, a.z * b.z)));
  };
  const kernels::Quat<P> first = of[0];
  mean = first;
  kernels::unrolled<7>([&](auto n) {
    const kernels::Quat<P>& other = of[n + 1];
    const P sign = select(dot(first, other) < P(S(0)), P(S(-1)), P(S(1)));  // of one rotation
    mean = {fma(sign, other.w, mean.w), fma(sign, other.x, mean.x), fma(sign, other.y, mean.y),
            fma(sign, other.z, mean.z)};
  });
  mean = kernels::normalised(mean);
  const P least = P(static_cast<S>(std::cos(0.5 * angle) * std::cos(0.5 * angle)));
  auto near = P(S(0)) < P(S(1));
  kernels::unrolled<8>([&](auto octant) {
    const P cosine = dot(mean, of[octant]);
    near = near && !(cosine * cosine < least);
  });
  return all(near);
}

}  // namespace kerf::cpu
