// SPDX-License-Identifier: MIT
//
// Matrices of cells of a level from those of its cells below, some cells side by side: loading and
// storing of lanes, no loops over groups and no threads.
#pragma once

#include <algorithm>
#include <cstdint>

#include "cpu/element_cells.hpp"
#include "cpu/fast_kernels.hpp"
#include "cpu/general_children.hpp"
#include "kernels/coarsen.hpp"
#include "kernels/mode_coarsen.hpp"
#include "kernels/transfer.hpp"

namespace kerf::cpu {

/// w[i][m]: the value at point i of a child from those at the corners m of its parent.
struct Weights {
  float w[8][8];
};

/// Some cells of level 0, one in each lane: -1 is none.
template <class S>
struct FinestLanes {
  using P = Pack<S>;
  kernels::FinestChild<P> element;
  bool any_folded = false, any_held = false;
  int material = kAnyMaterial;  // of the cells; kMixed where they differ
  std::int32_t cell[P::kLanes];
  static constexpr int kMixed = -2;

  template <class Stored>
  FinestLanes(const PatchedLevel& level, const FinestRotations<Stored>& rotations,
              const OperatorScale& scale, const std::int32_t* cells) {
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
    load_elements(FinestCells<Stored>{level, rotations}, scale, lanes, kAnyMaterial, element);
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
void corner_matrices(const PatchedLevel& level, const std::vector<PackedMaterial<S>>& materials,
                     const FinestLanes<S>& lanes, Pack<S> (&full)[24][24]) {
  if (lanes.material != FinestLanes<S>::kMixed) {
    const auto material = static_cast<std::size_t>(std::max(lanes.material, 0));
    return corner_matrices(materials[material], lanes.element, full);
  }
  for (std::size_t m = 0; m < materials.size(); ++m) {
    Pack<S> some[24][24];
    corner_matrices(materials[m], lanes.element, some);
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

/// Matrices by modes of parents whose children are one element each, none of them partly held.
template <class Cells, class S>
void merge_elements(const Cells& cells, const std::vector<PackedMaterial<S>>& materials,
                    const OperatorScale& scale, const std::int32_t* children,
                    Pack<S> (&out)[kEntries]) {
  using P = Pack<S>;
  const std::uint64_t present = materials_of<S>(cells, children, 8);
  if (present == 0)  // all children are wholly held
    for (P& entry : out) entry = P(0);
  bool first = true;
  for (std::size_t m = 0; m < materials.size(); ++m) {
    if (((present >> (m % 64)) & 1) == 0) continue;
    kernels::FinestChild<P> child[8];
    for (int octant = 0; octant < 8; ++octant)
      load_elements(cells, scale, children + kGroup * octant, static_cast<int>(m), child[octant]);
    const kernels::ModeConstants<P>& constants = materials[m].modes;
    P some[kEntries];
    P* to = first ? out : some;
    if (scale.mass == 0)
      kernels::coarsen_finest<false>(child, constants, to);
    else
      kernels::coarsen_finest<true>(child, constants, to);
    const int count = scale.mass != 0 ? kEntries : kernels::kModeEntries;
    if (!first)
      for (int e = 0; e < count; ++e) out[e] += some[e];
    first = false;
  }
}

/// Adds the matrices of cells in some lanes (-1: none) of level 1 of which only rotations are
/// stored.
template <class S>
void add_turned(const TurnedCells<S>& cells, const std::vector<PackedMaterial<S>>& materials,
                const OperatorScale& scale, const std::int32_t (&lanes)[Pack<S>::kLanes],
                Pack<S> (&sum)[kEntries]) {
  std::int32_t turned[Pack<S>::kLanes];
  for (int k = 0; k < Pack<S>::kLanes; ++k)
    turned[k] =
        lanes[k] >= 0 && cells.matrices.is_turned(static_cast<std::size_t>(lanes[k] / kGroup))
            ? lanes[k]
            : -1;
  const std::uint64_t present = materials_of<S>(cells, turned, 1);
  for (std::size_t m = 0; m < materials.size() && present != 0; ++m) {
    if (((present >> (m % 64)) & 1) == 0) continue;
    kernels::FinestChild<Pack<S>> child;
    load_elements(cells, scale, turned, static_cast<int>(m), child);
    Pack<S> some[kEntries];
    kernels::finest_mode_matrix(kernels::to_matrix(child.rotation), child.stiffness, child.mass,
                                materials[m].modes, static_cast<Pack<S>*>(some));
    for (int e = 0; e < kEntries; ++e) sum[e] += some[e];
  }
}

/// Matrices by modes of parents whose children are stored: gather(lanes, entries).
template <class S, class Gather>
void merge_stored(const Gather& gather, const std::int32_t* children, bool passed,
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
    gather(lanes, out);
    return;
  }
  unsigned present = 0;
  for (int octant = 0; octant < 8; ++octant)
    if (lanes_of(octant, lanes)) present |= 1U << octant;
  P scratch[2][kEntries];
  const auto child = [&](int octant) {
    lanes_of(octant, lanes);
    gather(lanes, scratch[octant & 1]);
    return static_cast<const P*>(scratch[octant & 1]);
  };
  if (with_translations)
    kernels::coarsen_modes<true, P>(child, present, static_cast<P*>(out));
  else
    kernels::coarsen_modes<false, P>(child, present, static_cast<P*>(out));
}

}  // namespace kerf::cpu
