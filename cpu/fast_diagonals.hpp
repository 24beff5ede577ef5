// SPDX-License-Identifier: MIT
//
// Diagonal blocks of groups of cells, added to points of their patch: loading and storing of
// lanes, no loops over groups and no threads.
#pragma once

#include <array>
#include <vector>

#include "cpu/fast_kernels.hpp"
#include "kernels/slot_diagonal.hpp"

namespace kerf::cpu {

/// Symmetric blocks of points, as two records.
template <class S>
struct BlockPoints {
  S *upper, *lower;  // xx xy xz, yy yz zz

  void add(const std::uint16_t* points, const kernels::Sym3<Pack<S>>& b) const {
    add_to_points(upper, points, kernels::Vec3<Pack<S>>{b.xx, b.xy, b.xz});
    add_to_points(lower, points, kernels::Vec3<Pack<S>>{b.yy, b.yz, b.zz});
  }
  /// At the corners of cells that lie like this.
  template <RowKind kKind>
  void add(const std::uint16_t* points, const kernels::Sym3<Pack<S>> (&b)[8]) const {
    if constexpr (run_of(kKind) == 1) {  // pairs take longer: two records of each point follow
      for (int i = 0; i < 8; ++i) add(points + kGroup * i, b[i]);
      return;
    }
    kernels::Vec3<Pack<S>> half[8];
    for (int i = 0; i < 8; ++i) half[i] = {b[i].xx, b[i].xy, b[i].xz};
    add_corners<kKind>(points, half, upper);
    for (int i = 0; i < 8; ++i) half[i] = {b[i].yy, b[i].yz, b[i].zz};
    add_corners<kKind>(points, half, lower);
  }
};

/// What folds do to slots, by fold code: each of the 144 that there are has a place.
template <class S>
class SlotTable {
 public:
  explicit SlotTable(kernels::MassModel model) {
    const auto constants = kernels::mode_constants<double>(0, model);
    places_.fill(0);
    add(0, constants.mass);
    for (int octant = 0; octant < 8; ++octant)
      for (int hanging = 1; hanging < 256; ++hanging) {
        const kernels::FoldCode code = kernels::fold_code(hanging, octant);
        if (!kernels::fold_is_valid(code)) continue;
        places_[code] = static_cast<std::uint8_t>(folded_.size());
        add(code, constants.mass);
      }
  }

  /// The fold of a cell, in the table.
  std::size_t place(kernels::FoldCode code) const {
    return kernels::has_hanging(code) ? places_[code % places_.size()] : 0;
  }
  /// Slots that move other corners than their own, as bits.
  unsigned folded(std::size_t place) const { return folded_[place]; }

  /// Of one slot of the cells in the lanes.
  void modes(const std::uint8_t* places, int slot, Pack<S> (&out)[8]) const {
    alignas(kPackBytes) S m[8][Pack<S>::kLanes];
    for (int k = 0; k < Pack<S>::kLanes; ++k)
      for (std::size_t s = 0; s < 8; ++s) m[s][k] = modes_[8 * places[k] + std::size_t(slot)][s];
    for (int s = 0; s < 8; ++s) out[s] = load_pack(m[s]);
  }
  void gram(const std::uint8_t* places, int slot, kernels::SlotGram<Pack<S>>& out) const {
    std::uint16_t at[Pack<S>::kLanes];
    alignas(kPackBytes) S mass[Pack<S>::kLanes];
    for (int k = 0; k < Pack<S>::kLanes; ++k) {
      at[k] = static_cast<std::uint16_t>(2 * (8 * places[k] + slot));
      mass[k] = mass_[8 * places[k] + std::size_t(slot)];
    }
    kernels::Vec3<Pack<S>> upper, lower;
    gather_points(gradients_[0].s, at, upper);
    gather_points(gradients_[1].s, at, lower);
    out.gradients = {upper.x, upper.y, upper.z, lower.x, lower.y, lower.z};
    out.mass = load_pack(mass);
  }

 private:
  struct alignas(4 * sizeof(S)) Record4 {
    S s[4];
  };

  void add(kernels::FoldCode code, const double (&mass)[4]) {
    unsigned folded = 0;
    for (int slot = 0; slot < 8; ++slot) {
      double m[8];
      kernels::slot_modes(code, slot, m);
      const auto [G, inertia] = kernels::slot_gram(m, mass);
      if (kernels::is_folded_slot(code, slot)) folded |= 1U << slot;
      modes_.emplace_back();
      for (std::size_t s = 0; s < 8; ++s) modes_.back()[s] = static_cast<S>(m[s]);
      gradients_.push_back({{S(G.xx), S(G.xy), S(G.xz), 0}});
      gradients_.push_back({{S(G.yy), S(G.yz), S(G.zz), 0}});
      mass_.push_back(static_cast<S>(inertia));
    }
    folded_.push_back(static_cast<std::uint8_t>(folded));
  }

  std::array<std::uint8_t, 2048> places_;  // per code
  std::vector<std::uint8_t> folded_;
  std::vector<std::array<S, 8>> modes_;  // [place][slot]
  std::vector<Record4> gradients_;       // two for each slot
  std::vector<S> mass_;
};

/// The folds of the cells in some lanes, in the table; and the slots that some fold changes.
template <class S>
struct GroupFold {
  std::uint8_t places[Pack<S>::kLanes];
  unsigned folded = 0;
  const std::uint16_t* slots;  // points

  GroupFold(const PatchedLevel& level, const SlotTable<S>& table, std::size_t group, int first)
      : slots(level.slots.data() + 8 * kGroup * static_cast<std::size_t>(level.slots_at[group]) +
              first) {
    const std::int32_t* cells = level.cell.data() + kGroup * group + first;
    for (int k = 0; k < Pack<S>::kLanes; ++k) {
      const std::size_t place = cells[k] < 0 ? 0 : table.place(level.level->fold[cells[k]]);
      places[k] = static_cast<std::uint8_t>(place);
      folded |= table.folded(place);
    }
  }
  bool changes(int slot) const { return ((folded >> slot) & 1) != 0; }
};

/// Diagonal blocks at the vertices of a group of cells of level 0, there or as another level has
/// them: quaternion(first lane). Lanes without a cell have blocks too, at the point that is
/// nothing.
template <class S, class Quaternion>
void add_element_diagonals(const PatchedLevel& level, const CellKind& kind,
                           const kernels::ModeConstants<Pack<S>>& constants,
                           const OperatorScale& scale, const SlotTable<S>& table, std::size_t group,
                           const Quaternion& quaternion, const BlockPoints<S>& to) {
  using P = Pack<S>;
  const P stiffness = P(scale.stiffness * kind.stiffness), mass = P(scale.mass * kind.mass);
  for_corners<S>(level, group, [&](const std::uint16_t* points, auto row, int first) {
    const auto R = kernels::to_matrix(quaternion(first));
    kernels::Sym3<P> blocks[8];
    kernels::finest_diagonal_blocks(R, stiffness, mass, constants, blocks);
    if (!level.folded(group)) return to.template add<row()>(points, blocks);
    const GroupFold<S> fold(level, table, group, first);
    for (int slot = 0; slot < 8; ++slot) {
      if (fold.changes(slot)) {
        kernels::SlotGram<P> gram;
        table.gram(fold.places, slot, gram);
        kernels::finest_slot_block(R, stiffness, mass, constants, gram, blocks[slot]);
      }
      to.add(fold.slots + kGroup * slot, blocks[slot]);
    }
  });
}

/// The same for a group of a stored level.
template <class S>
void add_stored_diagonals(const PatchedLevel& level, const StoredMatrices<S>& matrices,
                          const SlotTable<S>& table, std::size_t group, const BlockPoints<S>& to) {
  using P = Pack<S>;
  const bool turned = matrices.is_turned(group);
  for_corners<S>(level, group, [&](const std::uint16_t* points, auto row, int first) {
    kernels::Mat3<P> R;
    if (turned) R = kernels::to_matrix(matrices.rotation(group, first));
    const auto finish = [&](const P& unit, kernels::Sym3<P>& b) {
      b = {unit * b.xx, unit * b.xy, unit * b.xz, unit * b.yy, unit * b.yz, unit * b.zz};
      if (turned) b = kernels::turned(R, b);
    };
    matrices.read(group, first, [&](const auto& entries, const P& unit, auto translations) {
      kernels::Sym3<P> blocks[8];
      if (!level.folded(group)) {
        kernels::mode_diagonal_blocks<translations()>(entries, blocks);
        for (kernels::Sym3<P>& block : blocks) finish(unit, block);
        to.template add<row()>(points, blocks);
        return;
      }
      P all[kernels::kStoredEntries<translations()>];
      for (int e = 0; e < kernels::kStoredEntries<translations()>; ++e) all[e] = entries[e];
      kernels::mode_diagonal_blocks<translations()>(all, blocks);
      const GroupFold<S> fold(level, table, group, first);
      for (int slot = 0; slot < 8; ++slot) {
        if (fold.changes(slot)) {
          P m[8];
          table.modes(fold.places, slot, m);
          kernels::stored_slot_block<translations()>(all, m, blocks[slot]);
        }
        finish(unit, blocks[slot]);
        to.add(fold.slots + kGroup * slot, blocks[slot]);
      }
    });
  });
}

}  // namespace kerf::cpu
