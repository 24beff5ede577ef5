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
#include "kernels/coarsen.hpp"
#include "kernels/corotate.hpp"
#include "kernels/hex_element.hpp"
#include "kernels/host_device.hpp"
#include "kernels/mode_coarsen.hpp"
#include "kernels/modes.hpp"
#include "kernels/residual.hpp"
#include "kernels/rotation.hpp"
#include "kernels/transfer.hpp"

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
    const S* q = rotation.data() + 4 * kGroup * group + first_lane;
    return {load_pack(q), load_pack(q + kGroup), load_pack(q + 2 * kGroup),
            load_pack(q + 3 * kGroup)};
  }
  /// Asks memory for those that are needed a few groups later.
  void prefetch_behind(std::size_t group) const {
    constexpr std::size_t kAhead = 4, kScalars = 4 * kGroup;
    prefetch(rotation.data(), kScalars * (group + kAhead), kScalars);
  }
  void set_quaternion(std::size_t group, int first_lane, const kernels::Quat<Pack<S>>& q) {
    S* to = rotation.data() + 4 * kGroup * group + first_lane;
    store_pack(to, q.w);
    store_pack(to + kGroup, q.x);
    store_pack(to + 2 * kGroup, q.y);
    store_pack(to + 3 * kGroup, q.z);
  }
};

/// Points of a corner of a group, of the lanes from `first` on.
inline const std::uint16_t* corner_points(const PatchedLevel& level, std::size_t group, int first,
                                          int corner) {
  return level.corners.data() + 8 * kGroup * group + kGroup * static_cast<std::size_t>(corner) +
         static_cast<std::size_t>(first);
}

/// Cells of a row within a pack.
template <RowKind kKind, class S>
inline constexpr int kRunInPack = std::min(run_of(kKind), Pack<S>::kLanes);

/// The corners of the lanes of a pack. In rows they follow each other along x, so that two of them
/// are read and written together, and no numbers but the first of a row are.
/// Inlined, since arrays of packs that a call fills are cleared before.
template <RowKind kKind, class S>
[[gnu::always_inline]] inline void gather_corners(const std::uint16_t* points, const S* x,
                                                  kernels::Vec3<Pack<S>> (&out)[8]) {
  for (int i = 0; i < 8; i += 2) {
    if constexpr (kKind == kScattered) {
      gather_points(x, points + kGroup * i, out[i]);
      gather_points(x, points + kGroup * (i + 1), out[i + 1]);
    } else {
      gather_runs<kRunInPack<kKind, S>>(x, points + kGroup * i, out[i], out[i + 1]);
    }
  }
}
template <RowKind kKind, class S>
[[gnu::always_inline]] inline void add_corners(const std::uint16_t* points,
                                               const kernels::Vec3<Pack<S>> (&f)[8], S* y) {
  for (int i = 0; i < 8; i += 2) {
    if constexpr (kKind == kScattered) {
      add_to_points(y, points + kGroup * i, f[i]);
      add_to_points(y, points + kGroup * (i + 1), f[i + 1]);
    } else {
      add_runs<kRunInPack<kKind, S>>(y, points + kGroup * i, f[i], f[i + 1]);
    }
  }
}

/// Calls body(points of the corners, how they lie, first lane) for each pack of a group.
template <class S, class Body>
void for_corners(const PatchedLevel& level, std::size_t group, const Body& body) {
  constexpr std::size_t kAhead = 4, kPoints = 8 * kGroup;
  const std::uint16_t* points = level.corners.data() + kPoints * group;
  prefetch(points, kPoints * kAhead, kPoints);
  const auto run = [&](auto kind) {
    for_packs<S>([&](int first) { body(points + first, kind, first); });
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

/// y += A x for a group of level 0.
template <class S>
void finest_products(const PatchedLevel& level, const FinestValues<S>& values,
                     const OperatorScale& scale, std::size_t group, const S* x, S* y) {
  using P = Pack<S>;
  const CellKind& kind = level.kinds[level.kind[group]];
  const PackedMaterial<S>& material = values.materials[kind.material];
  const P stiffness = P(scale.stiffness * kind.stiffness), mass = P(scale.mass * kind.mass);
  values.prefetch_behind(group);
  for_corners<S>(level, group, [&](const std::uint16_t* points, auto row, int first) KERF_FLATTEN {
    kernels::Vec3<P> at[8];
    gather_corners<row()>(points, x, at);
    const auto R = kernels::to_matrix(values.quaternion(group, first));
    if (scale.mass == 0)
      kernels::apply_cell(at, R, stiffness, material.modes.stiffness, at);
    else
      kernels::apply_cell(at, R, stiffness, mass, material.modes, at);
    add_corners<row()>(points, at, y);
  });
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
    q[n] = kernels::normalised(start[n]);
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

/// w[i][m]: the value at point i of a child from those at the corners m of its parent.
struct Weights {
  float w[8][8];
};

constexpr int kAnyMaterial = -1;

/// Elements of some lanes of level 0 (-1: none) that are of `material`; others have no stiffness.
template <class S>
void load_elements(const PatchedLevel& level, const FinestValues<S>& values,
                   const OperatorScale& scale, const std::int32_t* lanes, int material,
                   kernels::FinestChild<Pack<S>>& out) {
  constexpr int kLanes = Pack<S>::kLanes;
  alignas(kPackBytes) S q[4][kLanes], stiffness[kLanes], mass[kLanes];
  for (int k = 0; k < kLanes; ++k) {
    q[0][k] = 1;
    q[1][k] = q[2][k] = q[3][k] = stiffness[k] = mass[k] = 0;
    if (lanes[k] < 0) continue;
    const auto lane = static_cast<std::size_t>(lanes[k]);
    const CellKind& kind = level.kinds[level.kind[lane / kGroup]];
    if (material != kAnyMaterial && kind.material != material) continue;
    const S* from = values.rotation.data() + values.place(lane);
    for (std::size_t c = 0; c < 4; ++c) q[c][k] = from[kGroup * c];
    stiffness[k] = static_cast<S>(scale.stiffness * kind.stiffness);
    mass[k] = static_cast<S>(scale.mass * kind.mass);
  }
  out.rotation = {load_pack(q[0]), load_pack(q[1]), load_pack(q[2]), load_pack(q[3])};
  out.stiffness = load_pack(stiffness);
  out.mass = load_pack(mass);
}

/// Some cells of level 0, one in each lane: -1 is none.
template <class S>
struct FinestLanes {
  using P = Pack<S>;
  kernels::FinestChild<P> element;
  bool any_folded = false, any_held = false;
  int material = kAnyMaterial;  // of the cells; kMixed where they differ
  std::int32_t cell[P::kLanes];
  static constexpr int kMixed = -2;

  FinestLanes(const PatchedLevel& level, const FinestValues<S>& values, const OperatorScale& scale,
              const std::int32_t* cells) {
    std::int32_t lanes[P::kLanes];
    for (int k = 0; k < P::kLanes; ++k) {
      cell[k] = cells[k];
      lanes[k] = cell[k] < 0 ? -1 : level.lane[cell[k]];
      if (cell[k] < 0) continue;
      const int its = level.kinds[level.kind[lanes[k] / kGroup]].material;
      any_folded = any_folded || kernels::has_hanging(level.level->fold[cell[k]]);
      any_held = any_held || level.held[cell[k]] != kFree;
      material = material == kAnyMaterial || material == its ? its : kMixed;
    }
    load_elements(level, values, scale, lanes, kAnyMaterial, element);
  }
};

/// Columns of the W of each lane, with their non-zeros in any lane; null is a lane without a cell.
template <class P>
kernels::WeightColumns<P> columns_of(const Weights* const (&w)[P::kLanes]) {
  using S = typename P::Scalar;
  kernels::WeightColumns<P> out{};
  for (int m = 0; m < 8; ++m)
    for (int i = 0; i < 8; ++i) {
      S weight[P::kLanes];
      bool any = false;
      for (int k = 0; k < P::kLanes; ++k) {
        weight[k] = w[k] == nullptr ? S(0) : static_cast<S>(w[k]->w[i][m]);
        any = any || weight[k] != 0;
      }
      if (!any) continue;
      const int at = out.count[m]++;
      out.child[m][at] = i;
      out.weight[m][at] = load_pack(weight);
    }
  return out;
}

/// Columns of the fold of each lane: its corners from its slots.
template <class P>
kernels::WeightColumns<P> fold_columns(const PatchedLevel& level, const std::int32_t* cells) {
  Weights fold[P::kLanes];
  const Weights* w[P::kLanes];
  for (int k = 0; k < P::kLanes; ++k) {
    w[k] = nullptr;
    if (cells[k] < 0) continue;
    kernels::fold_weights(level.level->fold[cells[k]], fold[k].w);
    w[k] = &fold[k];
  }
  return columns_of<P>(w);
}

/// sum += W^T A W, A given in full.
template <class P>
void add_product(const P (&full)[24][24], const kernels::WeightColumns<P>& columns,
                 P (&sum)[kEntries]) {
  P strip[3][24];
  for (int n = 0; n < 8; ++n) {
    if (columns.count[n] == 0) continue;
    kernels::gather_strip(full, columns, n, strip);
    for (int m = n; m < 8; ++m) {
      if (columns.count[m] == 0) continue;
      const kernels::Mat3<P> block = kernels::gather_block(strip, columns, m);
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < (m == n ? a + 1 : 3); ++b)
          sum[kernels::packed_index(3 * m + a, 3 * n + b)] += block[a][b];
    }
  }
}

/// Matrices of some cells of level 0 over their corners, in full.
template <class S>
void corner_matrices(const PackedMaterial<S>& m, const kernels::FinestChild<Pack<S>>& element,
                     Pack<S> (&full)[24][24]) {
  const auto R = kernels::to_matrix(element.rotation);
  for (int i = 0; i < 8; ++i)
    for (int j = 0; j <= i; ++j) {
      const auto block =
          kernels::rotate_block(m.stiffness, m.mass, R, element.stiffness, element.mass, i, j);
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b)
          full[3 * i + a][3 * j + b] = full[3 * j + b][3 * i + a] =
              i == j && b > a ? block[b][a] : block[a][b];
    }
}

/// The same where lanes may be of several materials.
template <class S>
void corner_matrices(const PatchedLevel& level, const FinestValues<S>& values,
                     const FinestLanes<S>& lanes, Pack<S> (&full)[24][24]) {
  if (lanes.material != FinestLanes<S>::kMixed) {
    const auto material = static_cast<std::size_t>(std::max(lanes.material, 0));
    return corner_matrices(values.materials[material], lanes.element, full);
  }
  for (std::size_t m = 0; m < values.materials.size(); ++m) {
    Pack<S> some[24][24];
    corner_matrices(values.materials[m], lanes.element, some);
    for (int k = 0; k < Pack<S>::kLanes; ++k) {
      const bool none = lanes.cell[k] < 0;
      if (!none && level.kinds[level.kind[level.lane[lanes.cell[k]] / kGroup]].material != m)
        continue;
      for (int i = 0; i < 24; ++i)
        for (int j = 0; j < 24; ++j) full[i][j].set(k, some[i][j][k]);
    }
  }
}

/// Brings matrices of some cells from corners to slots.
template <class P>
void fold_matrices(const PatchedLevel& level, const std::int32_t* cells, P (&full)[24][24]) {
  P sum[kEntries];
  std::fill(sum, sum + kEntries, P(0));
  add_product(full, fold_columns<P>(level, cells), sum);
  kernels::expand_packed(static_cast<const P*>(sum), full);
}

/// Zero in the rows and columns of held components. Needs  matrices over slots.
template <class S>
void mask_matrices(const PatchedLevel& level, const FinestLanes<S>& lanes,
                   Pack<S> (&full)[24][24]) {
  Pack<S> keep[24];
  for (int i = 0; i < 24; ++i) {
    S of[Pack<S>::kLanes];
    for (int k = 0; k < Pack<S>::kLanes; ++k) {
      of[k] = 1;
      if (lanes.cell[k] < 0) continue;
      const std::int32_t v = level.level->slots[lanes.cell[k]][static_cast<std::size_t>(i / 3)];
      if ((level.level->fixed[v] >> (i % 3) & 1) != 0) of[k] = 0;
    }
    keep[i] = load_pack(of);
  }
  for (int i = 0; i < 24; ++i)
    for (int j = 0; j < 24; ++j) full[i][j] *= keep[i] * keep[j];
}

/// Matrices over corners from entries by modes, in full.
template <class P>
void full_from_modes(P (&entries)[kEntries], P (&full)[24][24]) {
  kernels::corners_from_modes<P>(entries, entries);
  kernels::expand_packed(static_cast<const P*>(entries), full);
}

/// w[i][m]: the value at slot i of a cell from those at its corners m, the inverse of its fold:
/// what lies beyond the cell is extrapolated from its own octant.
inline void unfold_weights(kernels::FoldCode code, float (&w)[8][8]) {
  const int o = kernels::fold_octant(code);
  for (int i = 0; i < 8; ++i)
    for (int j = 0; j < 8; ++j) {
      if (!kernels::is_hanging(code, i)) {
        w[i][j] = i == j ? 1 : 0;
        continue;
      }
      const int far = kernels::mode_axes(j ^ o), all = kernels::mode_axes(i ^ o);
      const int sign = (all - far) % 2 == 0 ? 1 : -1;
      w[i][j] = kernels::is_between(o, i, j) ? static_cast<float>(sign * (1 << far)) : 0;
    }
}

/// Points of a child from the corners of its parent: its corners, or its slots.
inline Weights child_weights(const Level& level, std::int32_t child, bool slots) {
  Weights out;
  const int place = level.place[child];
  if (place == kernels::kPassed && slots)
    unfold_weights(level.fold[child], out.w);
  else
    kernels::transfer_weights(slots ? level.fold[child] : kernels::FoldCode{0}, place,
                              kernels::FoldCode{0}, out.w);
  return out;
}

/// Which materials the children in some lanes of a group are of, as bits.
template <class S>
std::uint64_t materials_of(const PatchedLevel& level, const std::int32_t* children) {
  std::uint64_t out = 0;
  for (int octant = 0; octant < 8; ++octant)
    for (int k = 0; k < Pack<S>::kLanes; ++k)
      if (const std::int32_t lane = children[kGroup * octant + k]; lane >= 0)
        out |= std::uint64_t{1} << (level.kinds[level.kind[lane / kGroup]].material % 64);
  return out;
}

/// Matrices by modes of parents whose children are of level 0, none of them partly held.
template <class S>
void merge_finest(const PatchedLevel& level, const FinestValues<S>& values,
                  const OperatorScale& scale, const std::int32_t* children, bool passed,
                  Pack<S> (&out)[kEntries]) {
  using P = Pack<S>;
  const std::uint64_t materials = materials_of<S>(level, children);
  if (materials == 0)  // all children are wholly held
    for (P& entry : out) entry = P(0);
  bool first = true;
  for (std::size_t m = 0; m < values.materials.size(); ++m) {
    if (((materials >> (m % 64)) & 1) == 0) continue;
    kernels::FinestChild<P> child[8];
    for (int octant = 0; octant < (passed ? 1 : 8); ++octant)
      load_elements(level, values, scale, children + kGroup * octant, static_cast<int>(m),
                    child[octant]);
    const kernels::ModeConstants<P>& constants = values.materials[m].modes;
    P some[kEntries];
    P* to = first ? out : some;
    if (passed)
      kernels::finest_mode_matrix(kernels::to_matrix(child[0].rotation), child[0].stiffness,
                                  child[0].mass, constants, to);
    else if (scale.mass == 0)
      kernels::coarsen_finest<false>(child, constants, to);
    else
      kernels::coarsen_finest<true>(child, constants, to);
    const int count = passed || scale.mass != 0 ? kEntries : kernels::kModeEntries;
    if (!first)
      for (int e = 0; e < count; ++e) out[e] += some[e];
    first = false;
  }
}

/// Matrices by modes of parents whose children are stored.
template <class S>
void merge_stored(const StoredMatrices<S>& from, const std::int32_t* children, bool passed,
                  bool with_translations, Pack<S> (&out)[kEntries]) {
  using P = Pack<S>;
  const auto lanes_of = [&](int octant, std::int32_t(&lanes)[P::kLanes]) {
    bool any = false;
    for (int k = 0; k < P::kLanes; ++k) {
      lanes[k] = children[kGroup * octant + k];
      any = any || lanes[k] >= 0;
    }
    return any;
  };
  std::int32_t lanes[P::kLanes];
  if (passed) {
    lanes_of(0, lanes);
    from.gather(lanes, out);
    return;
  }
  unsigned present = 0;
  for (int octant = 0; octant < 8; ++octant)
    if (lanes_of(octant, lanes)) present |= 1U << octant;
  P scratch[2][kEntries];
  const auto child = [&](int octant) {
    lanes_of(octant, lanes);
    from.gather(lanes, scratch[octant & 1]);
    return static_cast<const P*>(scratch[octant & 1]);
  };
  if (with_translations)
    kernels::coarsen_modes<true, P>(child, present, static_cast<P*>(out));
  else
    kernels::coarsen_modes<false, P>(child, present, static_cast<P*>(out));
}

}  // namespace kerf::cpu
