// SPDX-License-Identifier: MIT
//
// What the fast backend makes of rotations: the matrices of coarse levels, diagonal blocks, and the
// factor of the coarsest level.
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "core/solve/definite.hpp"
#include "core/solve/spectrum.hpp"
#include "cpu/fast_merge.hpp"
#include "cpu/fast_state.hpp"

namespace kerf::cpu {

/// The matrices of some cells of a stored level, one a lane (-1: none). `unrotated`: as if none had
/// turned; needs  all of them turned.
template <class S>
void FastBackend<S>::gather_matrices(int level, bool unrotated,
                                     const std::int32_t (&lanes)[Pack<S>::kLanes],
                                     Pack<S> (&out)[kEntries]) const {
  const StoredCells<S> cells = stored_cells(level, unrotated);
  cells.matrices.gather(lanes, out);
  if (!unrotated) turn_gathered(cells, lanes, out);
  add_elements(cells, materials<S>(), scale_, lanes, out);
}

// Cells of level 0 in some lanes over their corners, zero where those are held.
template <class S>
void FastBackend<S>::corner_children(bool unrotated, const std::int32_t (&child)[Pack<S>::kLanes],
                                     Pack<S> (&out)[kEntries]) const {
  const PatchedLevel& packed = levels_[0].patched;
  const FinestLanes<S> lanes(finest_cells(unrotated), scale_, child);
  corner_matrices(packed, materials<S>(), lanes, out);
  if (lanes.any_held) mask_matrices(packed, lanes, out);
}

// Some children of the coarse cells in the lanes, one each, of level 0.
template <class S>
void FastBackend<S>::add_by_slots(bool unrotated, const std::int32_t (&child)[Pack<S>::kLanes],
                                  Pack<S> (&sum)[kEntries]) const {
  using P = Pack<S>;
  const PatchedLevel& packed = levels_[0].patched;
  P entries[kEntries], full[24][24];
  corner_matrices(packed, materials<S>(), FinestLanes<S>(finest_cells(unrotated), scale_, child),
                  entries);
  kernels::expand_packed(static_cast<const P*>(entries), full);
  SlotColumns<P>(*packed.level, child).add_product(full, sum);
}

/// body(child, present) for the first of the others of each octant in each lane, the second ones,
/// and so on; child: [octant][lane], present: bits of the octants in which some lane has one.
template <class P, class Body>
void for_rounds(const GeneralChildren& children, const Body& body) {
  std::int32_t child[8][P::kLanes];
  for (int n = 0;; ++n) {
    unsigned present = 0;
    for (int octant = 0; octant < 8; ++octant)
      if (children.others(octant, n, ChildWay::octant, child[octant])) present |= 1U << octant;
    if (present == 0) return;
    body(child, present);
  }
}

template <class S>
void FastBackend<S>::merge_general_finest(std::size_t group, int first, bool unrotated,
                                          Pack<S> (&out)[kEntries]) const {
  using P = Pack<S>;
  const PatchedLevel &from = levels_[0].patched, &to = levels_[1].patched;
  const GeneralChildren children(from, to, to.cell.data() + kGroup * group + first, P::kLanes);
  P some[kEntries];
  bool any_other = false;
  const auto add_some = [&] {
    for (int e = 0; e < kEntries; ++e) out[e] += some[e];
    any_other = true;
  };
  std::fill(std::begin(out), std::end(out), P(0));
  for_rounds<P>(children, [&](const auto& child, unsigned present) {
    kernels::coarsen_corners<P>(
        [&](int octant, P(&entries)[kEntries]) {
          corner_children(unrotated, child[octant], entries);
        },
        present, static_cast<P*>(some));
    add_some();
  });
  std::int32_t child[P::kLanes];
  for (int n = 0; children.others(0, n, ChildWay::whole, child); ++n) {
    corner_children(unrotated, child, some);
    add_some();
  }
  for (int octant = 0; octant < 8; ++octant)
    for (int n = 0; children.others(octant, n, ChildWay::slots, child); ++n) {
      add_by_slots(unrotated, child, out);
      any_other = true;
    }
  if (any_other) kernels::modes_from_corners<P>(out, out);
  if (!children.any_plain()) return;
  std::fill(std::begin(some), std::end(some), P(0));
  merge_elements(finest_cells(unrotated), materials<S>(), scale_, children.plain(), some);
  for (int e = 0; e < kEntries; ++e) out[e] += some[e];
}

// Behind the end of a cut two duplicates of one place can have one parent. A child that is passed
// on is the only one, so these have none.
template <class S>
void FastBackend<S>::merge_general_stored(int fine, std::size_t group, int first, bool unrotated,
                                          Pack<S> (&out)[kEntries]) const {
  using P = Pack<S>;
  const PatchedLevel &from = levels_[fine].patched, &to = levels_[fine + 1].patched;
  const GeneralChildren children(from, to, to.cell.data() + kGroup * group + first, P::kLanes);
  std::fill(std::begin(out), std::end(out), P(0));
  for_rounds<P>(children, [&](const auto& child, unsigned) {
    std::int32_t lanes[8 * kGroup];
    for (int octant = 0; octant < 8; ++octant)
      for (int k = 0; k < P::kLanes; ++k) {
        const std::int32_t cell = child[octant][k];
        lanes[kGroup * octant + k] = cell < 0 ? -1 : from.lane[cell];
      }
    P some[kEntries];
    merge_stored<S>(
        [&](const auto& of, auto& entries) { gather_matrices(fine, unrotated, of, entries); },
        lanes, false, true, some);
    for (int e = 0; e < kEntries; ++e) out[e] += some[e];
  });
}

/// Whether what a cell of level 0 adds to its parent turns as it does: held vertices are so along
/// all axes.
template <class S>
bool FastBackend<S>::turns_with_supports(std::int32_t cell) const {
  const Level& level = *levels_[0].patched.level;
  const auto& slots = level.slots[cell];
  return std::all_of(slots.begin(), slots.end(),
                     [&](std::int32_t v) { return level.fixed[v] == 0 || level.fixed[v] == 7; });
}

/// Lanes of the children of a group that are not wholly held, [n][kGroup], -1: none; however many
/// there are in an octant. Returns the greatest n + 1; none fit if that is above kMostTurned.
template <class S>
int FastBackend<S>::general_children(int level, std::size_t group,
                                     std::int32_t (&out)[kMostTurned * kGroup]) const {
  const PatchedLevel &from = levels_[level - 1].patched, &to = levels_[level].patched;
  std::fill(std::begin(out), std::end(out), -1);
  int most = 0;
  for (int k = 0; k < kGroup; ++k) {
    const std::int32_t cell = to.cell[kGroup * group + static_cast<std::size_t>(k)];
    if (cell < 0) continue;
    int n = 0;
    for (const std::int32_t child : to.level->children_of(cell)) {
      if (from.held[child] == kWhollyHeld) continue;
      if (n < kMostTurned) out[kGroup * n + k] = from.lane[child];
      most = std::max(most, ++n);
    }
  }
  return most;
}

// Eight elements of one rotation are exactly one of twice the side, and what is merged from cells
// of one rotation turns as they do. In single precision, where matrices only precondition, nearly
// one rotation is enough: to the mean of those of the children, on each level anew.
template <class S>
template <class Cells>
void FastBackend<S>::turn_group(int level, std::size_t group, const Cells& cells) {
  constexpr double kNear = 0.1;  // radians
  const double least = std::cos(0.5 * kNear);
  StoredMatrices<S>& matrices = levels_[level].matrices;
  const PatchedLevel& packed = levels_[level].patched;
  const std::uint16_t kind = packed.kind[group];
  const std::int32_t* children = packed.children.data() + 8 * kGroup * group;
  const bool general = kind == kGeneral || kind == kGeneralPassed;
  const bool passed =
      kind == kPassed || kind == kHeldPassed || (is_of_finest(kind) && !is_of_eight(kind));
  // The mass of lumped cells is not that of a lumped one.
  const bool may_be_one = !kIsDouble && level + 1 < static_cast<int>(levels_.size()) &&
                          (scale_.mass == 0 || !hierarchy_->lumped_mass);
  const bool element =
      matrices.is_element(group) && (passed || (may_be_one && cells.are_elements(children)));
  if (element)
    matrices.forget_unrotated(group);
  else
    matrices.store_matrices(group);
  if (!matrices.is_turned(group) || matrices.never_turns(group)) return matrices.do_not_turn(group);
  std::int32_t others[kMostTurned * kGroup];
  int count = passed ? 1 : 8;
  if (general) {
    children = others;
    count = general_children(level, group, others);
    if (count > kMostTurned) return matrices.do_not_turn(group);
    const PatchedLevel& from = levels_[level - 1].patched;
    if (level == 1 && !matrices.knows_unrotated(group) &&
        !std::all_of(others, others + kGroup * count, [&](std::int32_t lane) {
          return lane < 0 || turns_with_supports(from.cell[lane]);
        })) {
      matrices.never_turn(group);
      return matrices.do_not_turn(group);
    }
  }
  const auto is_turned = [&](std::int32_t lane) { return lane < 0 || cells.is_turned(lane); };
  const bool are_turned = element || std::all_of(children, children + kGroup * count, is_turned);
  if (!are_turned) return matrices.do_not_turn(group);
  bool near = true;
  for_packs<S>([&](int first) {
    kernels::Quat<Pack<S>> rotation;
    if (passed)
      load_rotations(cells, children + first, rotation);
    else if (element)
      near = mean_rotation<true, S>(cells, children + first, count, least, rotation) && near;
    else
      near = mean_rotation<false, S>(cells, children + first, count, least, rotation) && near;
    matrices.store(group, first, rotation);
  });
  if (!near) matrices.do_not_turn(group);
}

/// Which cells of a level are turned, and how far.
template <class S>
template <class Cells>
void FastBackend<S>::turn(int level, const Cells& cells) {
  const StoredMatrices<S>& matrices = levels_[level].matrices;
  const auto groups = static_cast<std::int32_t>(levels_[level].patched.groups());
  parallel(groups, kWorthGroups, [&](std::int32_t g) {
    const auto group = static_cast<std::size_t>(g);
    if (matrices.is_turned(group)) turn_group(level, group, cells);
  });
}

/// The matrices of the cells of a group from those of their children.
template <class S>
void FastBackend<S>::merge(int fine, std::size_t group, int first, bool unrotated,
                           Pack<S> (&out)[kEntries]) const {
  const FastLevel<S>& to = levels_[fine + 1];
  const std::uint16_t kind = to.patched.kind[group];
  const bool passed = kind == kPassed || kind == kHeldPassed;
  const std::int32_t* children = to.patched.children.data() + 8 * kGroup * group + first;
  const auto cells = to.patched.cell.begin() + static_cast<std::ptrdiff_t>(kGroup * group) + first;
  if (std::all_of(cells, cells + Pack<S>::kLanes, [](std::int32_t c) { return c < 0; }))
    std::fill(out, out + kEntries, Pack<S>(0));
  else if (kind == kGeneral || kind == kGeneralPassed)
    fine == 0 ? merge_general_finest(group, first, unrotated, out)
              : merge_general_stored(fine, group, first, unrotated, out);
  else if (fine == 0)
    merge_elements(finest_cells(unrotated), materials<S>(), scale_, children, out);
  else if (const auto below = stored_cells(fine, unrotated);
           !passed && below.template are_elements<Pack<S>::kLanes>(children))
    merge_elements(below, materials<S>(), scale_, children, out);
  else
    merge_stored<S>(
        [&](const auto& lanes, auto& entries) { gather_matrices(fine, unrotated, lanes, entries); },
        children, passed, to.matrices.with_translations(group), out);
}

template <class S>
void FastBackend<S>::coarsen(int fine) {
  FastLevel<S>& to = levels_[fine + 1];
  const PatchedLevel& packed = to.patched;
  const bool coarsest = fine + 2 == static_cast<int>(levels_.size());
  to.matrices.start(packed, fine == 0 && !coarsest, scale_.mass != 0, !kIsDouble && !coarsest);
  if (fine == 0)
    turn(1, finest_cells());
  else
    turn(fine + 1, stored_cells(fine));
  to.matrices.allocate();
  const auto groups = static_cast<std::int32_t>(packed.groups());
  // General cells cost many times as much as others, and lie together.
#pragma omp parallel for num_threads(threads_) schedule(dynamic, 8) if (groups >= kWorthGroups)
  for (std::int32_t g = 0; g < groups; ++g) {
    const FlushToZero flush;
    const auto group = static_cast<std::size_t>(g);
    if (packed.kind[group] == kNoCells || packed.kind[group] == kIdle) continue;
    const bool unrotated = to.matrices.is_turned(group);
    if (unrotated && (to.matrices.is_element(group) || to.matrices.knows_unrotated(group)))
      continue;
    for_packs<S>([&](int first) {
      Pack<S> out[kEntries];
      merge(fine, group, first, unrotated, out);
      to.matrices.store(group, first, out);
    });
    if (unrotated) to.matrices.know_unrotated(group);
  }
}

/// The block of each vertex of a tile, without what supports hold.
template <class S>
kernels::Sym3<Pack<S>> free_block(const FastLevel<S>& l, std::size_t tile, int first,
                                  const Vec3<Pack<S>>& upper, const Vec3<Pack<S>>& lower) {
  using P = Pack<S>;
  const std::uint8_t* fixed = l.fixed(tile, first);
  if (std::all_of(fixed, fixed + P::kLanes, [](std::uint8_t held) { return held == 0; }))
    return {upper.x, upper.y, upper.z, lower.x, lower.y, lower.z};
  P keep[3];
  for (int c = 0; c < 3; ++c)
    for (int k = 0; k < P::kLanes; ++k) keep[c].set(k, ((fixed[k] >> c) & 1) != 0 ? S(0) : S(1));
  return {keep[0] * upper.x, keep[0] * keep[1] * upper.y, keep[0] * keep[2] * upper.z,
          keep[1] * lower.x, keep[1] * keep[2] * lower.y, keep[2] * lower.z};
}

/// Two tiles in turn: each operation of a block waits for the one before.
template <class S>
void invert_own(FastLevel<S>& l, const Patch& patch, const BlockPoints<S>& from) {
  for_packs<S>([&](int first) {
    const auto block = [&](std::int32_t v) {
      const std::uint16_t* points = l.patched.own_point.data() + v + first;
      return free_block(l, static_cast<std::size_t>(v / kGroup), first,
                        gathered(static_cast<const S*>(from.upper), points),
                        gathered(static_cast<const S*>(from.lower), points));
    };
    const auto store = [&](std::int32_t v, const auto& blocks) {
      l.inverse_diagonals.store(static_cast<std::size_t>(v / kGroup), first,
                                kernels::inverse_semidefinite(blocks));
    };
    std::int32_t v = patch.own.first;
    for (; v + kGroup < patch.own.end(); v += 2 * kGroup)
      store(v, twins(block(v), block(v + kGroup)));
    if (v < patch.own.end()) store(v, block(v));
  });
}

template <class S>
void FastBackend<S>::prepare(int level) {
  settle();
  FastLevel<S>& l = levels_[level];
  const PatchedLevel& packed = l.patched;
  const std::size_t copies = packed.copy_point.size();
  S* const upper = partial_sums<S>(8 * copies);
  S* const lower = upper + 4 * copies;
  for_patches(0, static_cast<std::int32_t>(packed.patches.size()), threads_, [&](std::int32_t p) {
    const Patch& patch = packed.patches[p];
    thread_local PointBuffer<S> buffer;
    const std::size_t scalars = 4 * static_cast<std::size_t>(patch.points);
    S* const blocks = buffer.reserve(2 * scalars);
    std::fill_n(blocks, 2 * scalars, S(0));
    const BlockPoints<S> to{blocks, blocks + scalars};
    for (std::int32_t g = patch.groups.first; g < patch.groups.end(); ++g) {
      const auto group = static_cast<std::size_t>(g);
      if (packed.idle(group)) continue;
      if (level > 0 && !l.matrices.is_element(group)) {
        add_stored_diagonals(packed, l.matrices, folds_, group, to);
        continue;
      }
      const CellKind kind = element_kind(level, group);
      add_element_diagonals(
          packed, kind, materials<S>()[kind.material].modes, scale_, folds_, group,
          [&](int first) {
            return level == 0 ? rotations_.template load<S>(group, first)
                              : l.matrices.rotation(group, first);
          },
          to);
    }
    invert_own(l, patch, to);
    for (std::int32_t k = patch.copies.first; k < patch.copies.end(); ++k) {
      std::copy_n(to.upper + 4 * std::size_t(packed.copy_point[k]), 4, upper + 4 * std::size_t(k));
      std::copy_n(to.lower + 4 * std::size_t(packed.copy_point[k]), 4, lower + 4 * std::size_t(k));
    }
  });
  parallel(static_cast<std::int32_t>(packed.shared_tiles.size()), kWorthTiles, [&](std::int32_t n) {
    for_packs<S>([&](int first) {
      const auto tile = static_cast<std::size_t>(packed.shared_tiles[n]);
      l.inverse_diagonals.store(tile, first,
                                kernels::inverse_semidefinite(
                                    free_block(l, tile, first, shared_sums(packed, n, first, upper),
                                               shared_sums(packed, n, first, lower))));
    });
  });
  if (l.bound == 0 && level + 1 < static_cast<int>(levels_.size())) {
    l.bound = estimate_spectral_bound(*this, level, *packed.level);
    for (const int x : {kDirection, kResidual}) l.vectors.release(x);  // a cycle asks for neither
  }
}

template <class S>
void FastBackend<S>::read_matrices(int level, const std::int32_t (&cells)[Pack<double>::kLanes],
                                   Pack<double> (&out)[kEntries]) const {
  using P = Pack<double>;
  const PatchedLevel& packed = levels_[level].patched;
  if (level == 0) {
    const FinestLanes<double> lanes(finest_cells(), scale_, cells);
    corner_matrices(packed, materials<double>(), lanes, out);
    if (lanes.any_folded) fold_matrices<P>(packed, cells, out);
    if (lanes.any_held) mask_matrices(packed, lanes, out);
  } else {
    bool any_folded = false;
    std::int32_t lanes[Pack<S>::kLanes];
    std::fill(std::begin(lanes), std::end(lanes), -1);
    for (int k = 0; k < P::kLanes; ++k) {
      if (cells[k] < 0) continue;
      lanes[k] = packed.lane[cells[k]];
      any_folded = any_folded || kernels::has_hanging(packed.level->fold[cells[k]]);
    }
    Pack<S> entries[kEntries];
    gather_matrices(level, false, lanes, entries);
    for (int e = 0; e < kEntries; ++e)
      for (int k = 0; k < P::kLanes; ++k) out[e].set(k, static_cast<double>(entries[e][k]));
    kernels::corners_from_modes<P>(out, out);
    if (any_folded) fold_matrices<P>(packed, cells, out);
  }
}

void read_lane(const Pack<double> (&entries)[kEntries], int lane, std::span<double> out) {
  for (int e = 0; e < kEntries; ++e) out[static_cast<std::size_t>(e)] = entries[e][lane];
}

template <class S>
void FastBackend<S>::read_cell_matrix(int level, std::int32_t cell, std::span<double> out) const {
  std::int32_t cells[Pack<double>::kLanes];
  std::fill(std::begin(cells), std::end(cells), -1);
  cells[0] = cell;
  Pack<double> entries[kEntries];
  read_matrices(level, cells, entries);
  read_lane(entries, 0, out);
}

/// The matrices of the coarsest level, several cells at a time.
template <class S>
void FastBackend<S>::assemble_coarsest(bool definite) {
  constexpr double kRounding = 1e-6;
  constexpr int kLanes = Pack<double>::kLanes;
  const Level& level = hierarchy_->levels.back();
  const int last = static_cast<int>(levels_.size()) - 1;
  std::vector<double> matrices(kEntries * static_cast<std::size_t>(level.cells()));
  const auto of = [&](std::int32_t cell) {
    return std::span(matrices).subspan(kEntries * static_cast<std::size_t>(cell), kEntries);
  };
  for_patches(0, (level.cells() + kLanes - 1) / kLanes, threads_, [&](std::int32_t n) {
    std::int32_t cells[kLanes];
    for (int k = 0; k < kLanes; ++k) {
      const std::int32_t cell = kLanes * n + k;
      cells[k] = cell < level.cells() ? cell : -1;
    }
    Pack<double> entries[kEntries];
    read_matrices(last, cells, entries);
    for (int k = 0; k < kLanes && cells[k] >= 0; ++k) {
      read_lane(entries, k, of(cells[k]));
      if (definite) make_definite(of(cells[k]), kRounding);
    }
  });
  coarsest_->assemble(level, [&](std::int32_t cell, std::span<double> out) {
    std::copy_n(of(cell).begin(), kEntries, out.begin());
  });
}

// What supports leave of a coarse matrix can be singular, and rounding in single precision makes
// some indefinite. There, cell matrices are made definite one by one; as that leaves directions
// with hardly any stiffness, the share of the diagonal grows too.
template <class S>
void FastBackend<S>::factor_coarsest() {
  constexpr double kGrowth = 100;
  constexpr int kMost = kIsDouble ? 1 : 6;  // tries: up to a share of 1e-2
  const int last = static_cast<int>(levels_.size()) - 1;
  factored_ = false;
  double share = AssembledLevel::kShare;
  for (int tries = 1;; ++tries, share *= kGrowth) {
    assemble_coarsest(tries > 1);
    if (last > 0) coarsest_->strengthen_diagonal(share);
    factored_ = coarsest_factor_.factor(*coarsest_, threads_);
    if (factored_) return;
    expects(last > 0 && tries < kMost,
            "the system matrix is not positive definite: in static mode some part of the body can "
            "move freely and needs a [[support]]; otherwise sizes, moduli or the time step are out "
            "of range");
  }
}

template class FastBackend<float>;
template class FastBackend<double>;

}  // namespace kerf::cpu
