// SPDX-License-Identifier: MIT
//
// Cells that have a rotation: those of level 0, which are one element each, and some of the levels
// above it (cpu/stored_matrices.hpp), of which some are. Loading of lanes, no loops over groups and
// no threads.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "cpu/fast_kernels.hpp"
#include "kernels/mode_coarsen.hpp"

namespace kerf::cpu {

/// S: the precision in which their rotations are stored.
template <class S>
struct FinestCells {
  const PatchedLevel& level;
  const FinestRotations<S>& rotations;
  bool unrotated = false;  ///< as if none had turned

  const CellKind& kind(std::uint16_t number) const { return level.kinds[number]; }
  /// w; the others follow in steps of a group.
  const S* rotation(std::size_t lane) const { return rotations.of(lane); }
  template <class T>
  T component(std::size_t lane, std::size_t c) const {
    return rotations.template component<T>(lane, c);
  }
  template <int kLanes = kGroup>
  static bool are_elements(const std::int32_t*) {
    return true;
  }
  static bool is_turned(std::int32_t) { return true; }
};

/// What a cell of a level above level 0 is as one element.
inline CellKind element_kind(const std::vector<CellKind>& finest, std::uint16_t kind) {
  CellKind out = finest[finest_kind(kind)];
  const double times = 1 << doublings(kind);
  out.stiffness *= times;  // E side
  out.mass *= times * times * times;
  out.side *= times;
  return out;
}

/// Cells of a level above level 0: elements, or others that are turned, whose rotations alone are
/// asked for.
template <class S>
struct StoredCells {
  const PatchedLevel &finest, &level;
  const StoredMatrices<S>& matrices;
  bool unrotated = false;  ///< as if none had turned

  CellKind kind(std::uint16_t number) const { return element_kind(finest.kinds, number); }
  const S* rotation(std::size_t lane) const { return matrices.rotation_of(lane); }
  template <class T>
  T component(std::size_t lane, std::size_t c) const {
    return rotation(lane)[kGroup * c];
  }
  /// Whether all children are elements, of so many parents. `lanes`: [octant][kGroup], -1: none.
  template <int kLanes = kGroup>
  bool are_elements(const std::int32_t* lanes) const {
    for (int octant = 0; octant < 8; ++octant)
      for (int k = 0; k < kLanes; ++k)
        if (const std::int32_t lane = lanes[kGroup * octant + k]; lane >= 0 && !is_element(lane))
          return false;
    return true;
  }
  bool is_element(std::int32_t lane) const {
    return matrices.is_element(static_cast<std::size_t>(lane / kGroup));
  }
  bool is_turned(std::int32_t lane) const {
    return matrices.is_turned(static_cast<std::size_t>(lane / kGroup));
  }
};

constexpr int kAnyMaterial = -1;
constexpr std::size_t kMostNumbered = std::size_t{1} << 31;  // by 32 bits

/// Rotations of some lanes (-1: any; needs a lane 0 with one).
template <class Cells, class S>
void load_rotations(const Cells& cells, const std::int32_t* lanes, kernels::Quat<Pack<S>>& out) {
  constexpr int kLanes = Pack<S>::kLanes;
  if (cells.unrotated) {
    out = {Pack<S>(1), Pack<S>(0), Pack<S>(0), Pack<S>(0)};
    return;
  }
#if KERF_PACK_BITS == 512
  if constexpr (kLanes == kGroup) {
    // Children of cells side by side are mostly every other cell of two groups.
    if (const int within = lanes[0] % kGroup;
        within < 2 && lanes[8] % kGroup == within && are_every_other(lanes)) {
      const S* const low = cells.rotation(static_cast<std::size_t>(lanes[0] - within));
      const S* const high = cells.rotation(static_cast<std::size_t>(lanes[8] - within));
      const auto component = [&](int c) {
        return every_other(low + kGroup * c, high + kGroup * c, within);
      };
      out = {component(0), component(1), component(2), component(3)};
      return;
    }
    if constexpr (std::is_same_v<Cells, FinestCells<S>>)
      if (4 * cells.level.cell.size() < kMostNumbered) {
        Pack<S> q[4];
        gather_fours(cells.rotation(0), lanes, q);
        out = {q[0], q[1], q[2], q[3]};
        return;
      }
  }
#endif
  // No lane is asked whether it is there: that cannot be foreseen.
  alignas(kPackBytes) S q[4][kLanes];
  for (int k = 0; k < kLanes; ++k) {
    const auto lane = static_cast<std::size_t>(std::max(lanes[k], 0));
    if constexpr (std::is_same_v<decltype(cells.rotation(lane)), const S*>) {
      const S* const from = cells.rotation(lane);
      for (int c = 0; c < 4; ++c) q[c][k] = from[kGroup * c];
    } else {
      for (std::size_t c = 0; c < 4; ++c) q[c][k] = cells.template component<S>(lane, c);
    }
  }
  out = {load_pack(q[0]), load_pack(q[1]), load_pack(q[2]), load_pack(q[3])};
}

/// The kind of the cells in some lanes (-1: none), if it is one. False where there are several, and
/// -1 where there are no cells.
template <int kLanes, class Cells>
bool are_of_one_kind(const Cells& cells, const std::int32_t* lanes, int& kind) {
  int of[kLanes];
  kind = -1;
  for (int k = 0; k < kLanes; ++k) {
    of[k] = cells.level.kind[static_cast<std::size_t>(std::max(lanes[k], 0)) / kGroup];
    kind = lanes[k] < 0 ? kind : of[k];
  }
  bool others = false;
  for (int k = 0; k < kLanes; ++k) others |= (lanes[k] >= 0) & (of[k] != kind);
  return !others;
}

/// Elements of some lanes (-1: none); those that are not of `material` have no stiffness.
template <class Cells, class S>
void load_elements(const Cells& cells, const OperatorScale& scale, const std::int32_t* lanes,
                   int material, kernels::FinestChild<Pack<S>>& out) {
  using P = Pack<S>;
  load_rotations(cells, lanes, out.rotation);
  const auto is_of_it = [&](const CellKind& kind) {
    return material == kAnyMaterial || kind.material == material;
  };
  int number = -1;
  alignas(kPackBytes) S stiffness[P::kLanes] = {}, mass[P::kLanes] = {};
  if (are_of_one_kind<P::kLanes>(cells, lanes, number)) {
    const CellKind kind = number < 0 ? CellKind{} : cells.kind(static_cast<std::uint16_t>(number));
    const double count = is_of_it(kind) ? 1 : 0;
    for (int k = 0; k < P::kLanes; ++k) stiffness[k] = lanes[k] < 0 ? S(0) : S(1);
    const P present = load_pack(stiffness);
    out.stiffness = P(static_cast<S>(count * scale.stiffness * kind.stiffness)) * present;
    out.mass = P(static_cast<S>(count * scale.mass * kind.mass)) * present;
    return;
  }
  for (int k = 0; k < P::kLanes; ++k) {
    if (lanes[k] < 0) continue;
    const CellKind& kind = cells.kind(cells.level.kind[lanes[k] / kGroup]);
    if (!is_of_it(kind)) continue;
    stiffness[k] = static_cast<S>(scale.stiffness * kind.stiffness);
    mass[k] = static_cast<S>(scale.mass * kind.mass);
  }
  out.stiffness = load_pack(stiffness);
  out.mass = load_pack(mass);
}

/// Which of `count` materials the cells in some lanes are of, as bits. `lanes`: [octant][kGroup].
template <class S, class Cells>
std::uint64_t materials_of(const Cells& cells, const std::int32_t* lanes, int octants,
                           std::size_t count) {
  std::uint64_t out = 0;
  for (int octant = 0; octant < octants; ++octant)
    for (int k = 0; k < Pack<S>::kLanes; ++k)
      if (const std::int32_t lane = lanes[kGroup * octant + k]; lane >= 0) {
        out |= std::uint64_t{1} << (cells.kind(cells.level.kind[lane / kGroup]).material % 64);
        if (count == 1) return out;
      }
  return out;
}

/// Children of a cell that may turn as one: eight, and what a cut leaves behind its end in their
/// octants. Of more it is Galerkin.
inline constexpr int kMostTurned = 16;

/// The mean of `count` rotations in each lane; false where the cosine of half the angle of one from
/// it is less than `least`. children: [one][kGroup], lanes of the cells. `all_present`: each lane
/// has all, or is without a cell; else some may be -1, none.
template <bool all_present, class S, class Cells>
bool mean_rotation(const Cells& cells, const std::int32_t* children, int count, double least,
                   kernels::Quat<Pack<S>>& mean) {
  using P = Pack<S>;
  kernels::Quat<P> of[all_present ? 8 : kMostTurned];
  P weight[all_present ? 1 : kMostTurned];
  const P one = P(S(1)), none = P(S(0));
  const auto dot = [](const kernels::Quat<P>& a, const kernels::Quat<P>& b) {
    return fma(a.w, b.w, fma(a.x, b.x, fma(a.y, b.y, a.z * b.z)));
  };
  mean = {none, none, none, none};
  for (int n = 0; n < count; ++n) {
    const std::int32_t* const lanes = children + kGroup * n;
    load_rotations(cells, lanes, of[n]);
    const auto& q = of[n];
    P sign = select(dot(mean, q) < none, -one, one);  // of one rotation
    if constexpr (!all_present) {
      alignas(kPackBytes) S present[P::kLanes];
      for (int k = 0; k < P::kLanes; ++k) present[k] = lanes[k] < 0 ? S(0) : S(1);
      weight[n] = load_pack(present);
      sign *= weight[n];
    }
    mean = {fma(sign, q.w, mean.w), fma(sign, q.x, mean.x), fma(sign, q.y, mean.y),
            fma(sign, q.z, mean.z)};
  }
  mean = kernels::normalised(mean);
  const P square = P(static_cast<S>(least * least));
  auto near = none < one;
  for (int n = 0; n < count; ++n) {
    const P cosine = dot(mean, of[n]);
    if constexpr (all_present)
      near = near && !(cosine * cosine < square);
    else
      near = near && !(cosine * cosine < square * weight[n]);
  }
  if (!all_present || all(near)) return all(near);
  P absent;  // the rotation of such a lane is anyone's
  for (int k = 0; k < P::kLanes; ++k) absent.set(k, children[k] < 0 ? S(1) : S(0));
  return all(near || absent > none);
}

}  // namespace kerf::cpu
