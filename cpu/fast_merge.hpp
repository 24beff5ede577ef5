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
#include "kernels/corner_coarsen.hpp"
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
  FinestLanes(const FinestCells<Stored>& from, const OperatorScale& scale,
              const std::int32_t* cells) {
    const PatchedLevel& level = from.level;
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
    load_elements(from, scale, lanes, kAnyMaterial, element);
  }
};

/// The W of the cells in some lanes, entry by entry; zero in others.
template <class P>
struct WeightLanes {
  alignas(kPackBytes) typename P::Scalar at[64][P::kLanes] = {};

  void put(int lane, const Weights& w) {
    for (int e = 0; e < 64; ++e) at[e][lane] = static_cast<typename P::Scalar>(w.w[e / 8][e % 8]);
  }
  void copy(int to, int from) {
    for (auto& entry : at) entry[to] = entry[from];
  }
  /// Their columns, with what is not zero in some lane.
  void columns(kernels::WeightColumns<P>& out) const {
    for (int m = 0; m < 8; ++m) {
      out.count[m] = 0;
      for (int i = 0; i < 8; ++i) {
        const P weight = load_pack(at[8 * i + m]);
        if (all(weight <= P(0)) && all(P(0) <= weight)) continue;
        const int n = out.count[m]++;
        out.child[m][n] = i;
        out.weight[m][n] = weight;
      }
    }
  }
};

/// sum += W^T A W, A given in full; W for each component. As kernels/coarsen.hpp, with sums that
/// stay in registers.
template <class P>
void add_product(const P (&full)[24][24], const kernels::WeightColumns<P>* const (&w)[3],
                 P (&sum)[kEntries]) {
  P strip[3][24];
  for (int n = 0; n < 8; ++n) {
    for (int b = 0; b < 3; ++b)
      for (int col = 0; col < 24; ++col) {
        P at(0);
        for (int k = 0; k < w[b]->count[n]; ++k)
          at = fma(w[b]->weight[n][k], full[3 * w[b]->child[n][k] + b][col], at);
        strip[b][col] = at;
      }
    for (int m = n; m < 8; ++m)
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < (m == n ? a + 1 : 3); ++b) {
          P& to = sum[kernels::packed_index(3 * m + a, 3 * n + b)];
          P at = to;
          for (int k = 0; k < w[a]->count[m]; ++k)
            at = fma(w[a]->weight[m][k], strip[b][3 * w[a]->child[m][k] + a], at);
          to = at;
        }
  }
}

/// Matrices of some cells of level 0 over their corners. Lanes may be of several materials.
template <class S>
void corner_matrices(const PatchedLevel& level, const std::vector<PackedMaterial<S>>& materials,
                     const FinestLanes<S>& lanes, Pack<S> (&out)[kEntries]) {
  using P = Pack<S>;
  const auto R = kernels::to_matrix(lanes.element.rotation);
  const auto of = [&](const PackedMaterial<S>& m, P* to) {
    kernels::cell_matrix(m.stiffness, m.mass, R, lanes.element.stiffness, lanes.element.mass, to);
  };
  if (lanes.material != FinestLanes<S>::kMixed)
    return of(materials[static_cast<std::size_t>(std::max(lanes.material, 0))], out);
  for (std::size_t m = 0; m < materials.size(); ++m) {
    P some[kEntries];
    of(materials[m], some);
    for (int k = 0; k < P::kLanes; ++k) {
      const bool none = lanes.cell[k] < 0;
      if (!none && level.kinds[level.kind[level.lane[lanes.cell[k]] / kGroup]].material != m)
        continue;
      for (int e = 0; e < kEntries; ++e) out[e].set(k, some[e][k]);
    }
  }
}

/// Brings matrices of some cells from corners to slots.
template <class P>
void fold_matrices(const PatchedLevel& level, const std::int32_t* cells, P (&entries)[kEntries]) {
  WeightLanes<P> lanes;
  for (int k = 0; k < P::kLanes; ++k) {
    if (cells[k] < 0) continue;
    Weights w;
    kernels::fold_weights(level.level->fold[cells[k]], w.w);
    lanes.put(k, w);
  }
  kernels::WeightColumns<P> columns;
  lanes.columns(columns);
  P full[24][24];
  kernels::expand_packed(static_cast<const P*>(entries), full);
  std::fill(entries, entries + kEntries, P(0));
  add_product(full, {&columns, &columns, &columns}, entries);
}

/// Zero in the rows and columns of held components. Needs  matrices over slots, or of cells whose
/// corners are their slots.
template <class S>
void mask_matrices(const PatchedLevel& level, const FinestLanes<S>& lanes,
                   Pack<S> (&entries)[kEntries]) {
  using P = Pack<S>;
  alignas(kPackBytes) S keep[24][P::kLanes];
  for (auto& row : keep) std::fill(std::begin(row), std::end(row), S(1));
  for (int k = 0; k < P::kLanes; ++k) {
    if (lanes.cell[k] < 0 || level.held[lanes.cell[k]] == kFree) continue;
    const auto& slots = level.level->slots[lanes.cell[k]];
    for (std::size_t i = 0; i < 24; ++i)
      if ((level.level->fixed[slots[i / 3]] >> (i % 3) & 1) != 0) keep[i][k] = 0;
  }
  for (int i = 0; i < 24; ++i)
    for (int j = 0; j <= i; ++j)
      entries[kernels::packed_index(i, j)] *= load_pack(keep[i]) * load_pack(keep[j]);
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

/// Slots of a child from the corners of its parent.
inline void slot_weights(const Level& level, std::int32_t child, Weights& out) {
  if (level.place[child] == kernels::kPassed)
    unfold_weights(level.fold[child], out.w);
  else
    kernels::transfer_weights(level.fold[child], level.place[child], kernels::FoldCode{0}, out.w);
}

/// Corners of some children (-1: none) from the corners of their parents, for each component: by
/// way of slots, of which some are held.
template <class P>
class SlotColumns {
 public:
  SlotColumns(const SlotColumns&) = delete;
  SlotColumns& operator=(const SlotColumns&) = delete;
  SlotColumns(const Level& level, const std::int32_t* cells) {
    std::uint32_t held[P::kLanes];  // bit 3 j + c: component c of slot j
    bool alike = true;              // the components
    for (int k = 0; k < P::kLanes; ++k) {
      if (cells[k] < 0) continue;
      held[k] = 0;
      for (std::size_t j = 0; j < 8; ++j) {
        const std::uint8_t fixed = level.fixed[level.slots[cells[k]][j]];
        held[k] |= std::uint32_t{fixed} << 3 * j;
        alike = alike && (fixed == 0 || fixed == 7);
      }
    }
    for (int c = 0; c < (alike ? 1 : 3); ++c) {
      WeightLanes<P> lanes;
      for (int k = 0; k < P::kLanes; ++k) {
        if (cells[k] < 0) continue;
        int same = 0;  // most lanes are like one before
        while (same < k && !(cells[same] >= 0 && held[same] == held[k] &&
                             level.fold[cells[same]] == level.fold[cells[k]] &&
                             level.place[cells[same]] == level.place[cells[k]]))
          ++same;
        if (same < k)
          lanes.copy(k, same);
        else
          lanes.put(k, component(level, cells[k], held[k] >> c));
      }
      lanes.columns(of_[c]);
      by_[c] = &of_[c];
    }
    if (alike) by_[1] = by_[2] = by_[0];
  }

  void add_product(const P (&full)[24][24], P (&sum)[kEntries]) const {
    cpu::add_product(full, by_, sum);
  }

 private:
  /// `held`: bit 3 j of slot j.
  static Weights component(const Level& level, std::int32_t cell, std::uint32_t held) {
    Weights fold, slots, out{};
    kernels::fold_weights(level.fold[cell], fold.w);
    slot_weights(level, cell, slots);
    for (int j = 0; j < 8; ++j) {
      if ((held >> 3 * j & 1) != 0) continue;
      for (int i = 0; i < 8; ++i)
        for (int m = 0; m < 8; ++m) out.w[i][m] += fold.w[i][j] * slots.w[j][m];
    }
    return out;
  }

  kernels::WeightColumns<P> of_[3];
  const kernels::WeightColumns<P>* by_[3];
};

/// Matrices by modes of parents whose children are one element each, none of them partly held.
template <class Cells, class S>
void merge_elements(const Cells& cells, const std::vector<PackedMaterial<S>>& materials,
                    const OperatorScale& scale, const std::int32_t* children,
                    Pack<S> (&out)[kEntries]) {
  using P = Pack<S>;
  const std::uint64_t present = materials_of<S>(cells, children, 8, materials.size());
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

/// Entries to which is added what is assigned, once to each.
template <class P>
struct AddedEntries {
  struct Entry {
    P& of;
    void operator=(const P& value) const { of += value; }
  };
  P* to;
  Entry operator[](int entry) const { return {to[entry]}; }
};

/// Those of some lanes (-1: none) for which is(lane) holds, -1 for others. Whether there are any.
template <int kLanes, class Is>
bool pick_lanes(const std::int32_t (&lanes)[kLanes], const Is& is, std::int32_t (&out)[kLanes]) {
  bool any = false;
  for (int k = 0; k < kLanes; ++k) {
    out[k] = lanes[k] >= 0 && is(lanes[k]) ? lanes[k] : -1;
    any = any || out[k] >= 0;
  }
  return any;
}

/// Turns the matrices of cells in some lanes (-1: none) that are stored without rotation.
template <class S>
void turn_gathered(const StoredCells<S>& cells, const std::int32_t (&lanes)[Pack<S>::kLanes],
                   Pack<S> (&entries)[kEntries]) {
  std::int32_t turned[Pack<S>::kLanes];
  const auto is_unrotated = [&](std::int32_t lane) {
    return cells.is_turned(lane) && !cells.is_element(lane);
  };
  if (!pick_lanes(lanes, is_unrotated, turned)) return;
  alignas(kPackBytes) S q[4][Pack<S>::kLanes];
  for (int k = 0; k < Pack<S>::kLanes; ++k)
    for (int c = 0; c < 4; ++c)
      q[c][k] = turned[k] >= 0 ? cells.rotation(static_cast<std::size_t>(turned[k]))[kGroup * c]
                               : S(c == 0 ? 1 : 0);
  kernels::turn_mode_matrix(
      kernels::to_matrix(kernels::Quat<Pack<S>>{load_pack(q[0]), load_pack(q[1]), load_pack(q[2]),
                                                load_pack(q[3])}),
      entries);
}

/// Adds the matrices of cells in some lanes (-1: none) that are elements.
template <class S>
void add_elements(const StoredCells<S>& cells, const std::vector<PackedMaterial<S>>& materials,
                  const OperatorScale& scale, const std::int32_t (&lanes)[Pack<S>::kLanes],
                  Pack<S> (&sum)[kEntries]) {
  std::int32_t elements[Pack<S>::kLanes];
  pick_lanes(
      lanes, [&](std::int32_t lane) { return cells.is_element(lane); }, elements);
  const std::uint64_t present = materials_of<S>(cells, elements, 1, materials.size());
  for (std::size_t m = 0; m < materials.size() && present != 0; ++m) {
    if (((present >> (m % 64)) & 1) == 0) continue;
    kernels::FinestChild<Pack<S>> child;
    load_elements(cells, scale, elements, static_cast<int>(m), child);
    kernels::finest_mode_matrix(kernels::to_matrix(child.rotation), child.stiffness, child.mass,
                                materials[m].modes, AddedEntries<Pack<S>>{sum});
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
