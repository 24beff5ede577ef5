// SPDX-License-Identifier: MIT
//
// Each lane does what the shared bodies of kernels/ do for a scalar, a pack of cells at a time, and
// what follows a sum (residual, step of Chebyshev) is done while it is in registers.
#include <omp.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "core/solve/definite.hpp"
#include "core/solve/spectrum.hpp"
#include "cpu/fast_merge.hpp"
#include "cpu/fast_state.hpp"

namespace kerf::cpu {

template <class S>
FastBackend<S>::FastBackend(int threads, bool updates)
    : threads_(threads > 0 ? threads : omp_get_max_threads()), updates_(updates) {
  constexpr int kMaxThreads = 1024;
  expects(threads >= 0 && threads <= kMaxThreads,
          text("solver.threads must lie in 0 .. ", kMaxThreads, "; 0 takes all cores"));
}

template <class S>
std::size_t FastBackend<S>::bytes() const {
  std::size_t sum = bytes_of(partial_) + bytes_of(faces_) + bytes_of(exact_.rotation) +
                    bytes_of(single_.rotation) + bytes_of(exact_.materials) +
                    bytes_of(single_.materials);
  for (const FastLevel<S>& level : levels_) {
    sum += level.patched.bytes() + level.matrices.bytes() + bytes_of(level.inverse_diagonal) +
           level.vectors.bytes();
  }
  if (coarsest_) sum += coarsest_->value.capacity() * 12 + coarsest_factor_.bytes();
  return sum;
}

template <class T>
PackedMaterial<T> pack_material(double poisson, bool lumped) {
  using P = Pack<T>;
  PackedMaterial<T> out;
  const auto modes = kernels::mode_constants(
      poisson, lumped ? kernels::MassModel::lumped : kernels::MassModel::consistent);
  const auto& k = modes.stiffness;
  out.modes.stiffness = {P(k.a), P(k.b), P(k.c), P(k.d), P(k.e), P(k.f), P(k.g)};
  for (int i = 0; i < 4; ++i) out.modes.mass[i] = P(modes.mass[i]);
  const auto K = kernels::unit_hex_stiffness(poisson);
  const auto M =
      lumped ? kernels::unit_hex_mass_lumped<double>() : kernels::unit_hex_mass<double>();
  for (int i = 0; i < 24; ++i)
    for (int j = 0; j < 24; ++j) out.stiffness.k[i][j] = P(K.k[i][j]);
  for (int i = 0; i < 8; ++i)
    for (int j = 0; j < 8; ++j) out.mass.m[i][j] = P(M.m[i][j]);
  return out;
}

template <class T>
void start_values(const Hierarchy& hierarchy, const PatchedLevel& finest, FinestValues<T>& values) {
  values.rotation.clear();
  values.materials.clear();
  for (const double poisson : hierarchy.poisson)
    values.materials.push_back(pack_material<T>(poisson, hierarchy.lumped_mass));
  values.no_rotation(0, finest.groups());
}

// Peaks of runs: docs/results.md, under Memory.
template <class S>
double FastBackend<S>::bytes_per_cell() const noexcept {
  return kIsDouble ? 2650 : 1450;
}

template <class S>
void FastBackend<S>::load_coarsest() {
  coarsest_ = std::make_unique<AssembledLevel>(hierarchy_->levels.back());
  coarsest_factor_.analyse(hierarchy_->levels.back(), *coarsest_);
  factored_ = false;
}

template <class S>
void FastBackend<S>::load(const Hierarchy& hierarchy) {
  hierarchy_ = &hierarchy;
  waiting_ = -1;
  levels_.resize(hierarchy.levels.size());
  for (std::size_t l = 0; l < levels_.size(); ++l) {
    FastLevel<S>& level = levels_[l];
    level.patched =
        make_patches(hierarchy, l, l == 0 ? nullptr : &levels_[l - 1].patched, threads_);
    level.bound = 0;
    level.solution_is_zero = false;
    level.inverse_diagonal.assign(2 * kTileScalars * level.patched.tiles(), 0);
    level.vectors.assign(l == 0 ? exact_on_finest_ : std::vector<bool>(kLevelVectors, kIsDouble),
                         kTileScalars * level.patched.tiles());
  }
  folds_ = SlotTable<S>(hierarchy.lumped_mass ? kernels::MassModel::lumped
                                              : kernels::MassModel::consistent);
  start_values(hierarchy, levels_[0].patched, exact_);
  if constexpr (!std::is_same_v<S, double>) start_values(hierarchy, levels_[0].patched, single_);
  load_coarsest();
}

/// A vector in the numbers of now.
template <class T>
void renumber(const std::vector<PatchMoves::Move>& moves, std::size_t size, Array<T>& vector) {
  if (vector.empty()) return;
  std::vector<std::array<T, 3>> values(moves.size());
  for (std::size_t n = 0; n < moves.size(); ++n)
    for (std::size_t c = 0; c < 3; ++c)
      values[n][c] = std::exchange(vector[scalar_of(moves[n].from) + kGroup * c], T(0));
  resize_with_room(vector, size, T(0));
  for (std::size_t n = 0; n < moves.size(); ++n)
    for (std::size_t c = 0; c < 3; ++c) vector[scalar_of(moves[n].to) + kGroup * c] = values[n][c];
}

/// Rotations of the cells that have another lane now, and of new ones.
template <class T>
void renumber(const PatchMoves& moves, const PatchedLevel& finest, FinestValues<T>& values) {
  std::vector<std::array<T, 4>> before(moves.cells.size());
  for (std::size_t n = 0; n < before.size(); ++n)
    before[n] = values.at(static_cast<std::size_t>(moves.cells[n].from));
  values.rotation.resize(4 * finest.cell.size());
  for (const Range& groups : moves.groups)
    values.no_rotation(static_cast<std::size_t>(groups.first),
                       static_cast<std::size_t>(groups.end()));
  for (std::size_t n = 0; n < before.size(); ++n)
    values.put(static_cast<std::size_t>(finest.lane[moves.cells[n].to]), before[n]);
}

template <class S>
void FastBackend<S>::update(const Hierarchy& hierarchy, const HierarchyChange& change) {
  ensures(&hierarchy == hierarchy_ && change.levels.size() == levels_.size(),
          "a change is not one of the hierarchy that was loaded");
  settle();
  PatchMoves moves;
  for (std::size_t l = 0; l < levels_.size(); ++l) {
    FastLevel<S>& level = levels_[l];
    moves = update_patches(hierarchy, change, l, l == 0 ? nullptr : &levels_[l - 1].patched,
                           l == 0 ? nullptr : &moves, threads_, level.patched);
    level.bound = 0;
    const std::size_t size = kTileScalars * level.patched.tiles();
    // Made anew where there are vertices; elsewhere what is left of it meets zeros.
    resize_with_room(level.inverse_diagonal, 2 * size, S(0));
    for (std::size_t x = 0; x < level.vectors.size(); ++x) {
      renumber(moves.vertices, size, level.vectors.held(x).single);
      renumber(moves.vertices, size, level.vectors.held(x).exact);
    }
    level.vectors.set_scalars(size);
    if (l > 0) continue;
    renumber(moves, level.patched, exact_);
    if constexpr (!std::is_same_v<S, double>) renumber(moves, level.patched, single_);
  }
  load_coarsest();
}

template <class S>
int FastBackend<S>::append_vector(bool exact) {
  if (!levels_.empty()) levels_[0].vectors.append(exact);
  exact_on_finest_.push_back(exact);
  return static_cast<int>(exact_on_finest_.size()) - 1;
}

template <class S>
void FastBackend<S>::release(int x) {
  settle();
  if (!levels_.empty()) levels_[0].vectors.release(x);
}

template <class S>
void FastBackend<S>::set_operator(const OperatorScale& scale) {
  if (scale.stiffness != scale_.stiffness || scale.mass != scale_.mass) {
    for (FastLevel<S>& level : levels_) level.bound = 0;
    factored_ = false;
  }
  scale_ = scale;
}

template <class S>
void FastBackend<S>::round_rotations() {
  if constexpr (!std::is_same_v<S, double>)
    for (std::size_t i = 0; i < exact_.rotation.size(); ++i)
      single_.rotation[i] = static_cast<S>(exact_.rotation[i]);
}

template <class S>
void FastBackend<S>::rotate_cells(int displacement) {
  expects_exact(displacement, displacement);
  settle();
  const PatchedLevel& l = levels_[0].patched;
  const double* u = levels_[0].vectors[displacement].exact.data();
  for_patches(0, static_cast<std::int32_t>(l.patches.size()), threads_, [&](std::int32_t p) {
    const Patch& patch = l.patches[p];
    PatchPoints<double> points(l, patch);
    points.load([&](std::size_t tile, int first) { return load_tile(u, tile, first); }, u);
    for (std::int32_t g = patch.groups.first; g < patch.groups.end(); ++g)
      rotate_group(l, exact_, static_cast<std::size_t>(g), points.x());
  });
  round_rotations();
}

template <class S>
void FastBackend<S>::read_rotations(std::span<double> out) const {
  const PatchedLevel& packed = levels_[0].patched;
  for (std::size_t c = 0; c < packed.lane.size(); ++c) {
    const std::size_t from = exact_.place(static_cast<std::size_t>(packed.lane[c]));
    for (std::size_t k = 0; k < 4; ++k) out[4 * c + k] = exact_.rotation[from + kGroup * k];
  }
}

template <class S>
void FastBackend<S>::write_rotations(std::span<const double> in) {
  const PatchedLevel& packed = levels_[0].patched;
  for (std::size_t c = 0; c < packed.lane.size(); ++c) {
    const std::size_t to = exact_.place(static_cast<std::size_t>(packed.lane[c]));
    for (std::size_t k = 0; k < 4; ++k) exact_.rotation[to + kGroup * k] = in[4 * c + k];
  }
  round_rotations();
}

template <class S>
template <class T>
void FastBackend<S>::apply_typed(int level, int in, int out) {
  FastLevel<S>& l = levels_[level];
  const T* u = l.vectors[in].template in<T>().data();
  T* to = l.vectors[out].template in<T>().data();
  sweep<T>(
      level, kNothingBefore, kNothingBefore,
      [&](std::size_t tile, int first) { return load_tile(u, tile, first); }, u,
      [&](std::size_t group, const T* x, T* y) { add_products(level, group, x, y); },
      [&](std::size_t tile, int first, const Vec3<Pack<T>>& sum, const auto&) {
        store_tile(to, tile, first, masked(sum, l.fixed(tile, first)));
        return Sums{};
      });
}

template <class S>
void FastBackend<S>::apply(int level, int in, int out) {
  ensures(is_exact(level, in) == is_exact(level, out), "apply mixes vectors of two precisions");
  settle();
  changed(level, out);
  if (is_exact(level, in))
    apply_typed<double>(level, in, out);
  else
    apply_typed<S>(level, in, out);
}

/// out from what cells make of in: finish(tile, first lane, sum, to) is asked for each pack.
template <class S>
template <class Cells, class Finish>
Sums FastBackend<S>::sum_forces(int in, int out, const Cells& cells, const Finish& finish) {
  expects_exact(in, out);
  settle();
  const double* u = levels_[0].vectors[in].exact.data();
  double* to = levels_[0].vectors[out].exact.data();
  return sweep<double>(
      0, kNothingBefore, kNothingBefore,
      [&](std::size_t tile, int first) { return load_tile(u, tile, first); }, u, cells,
      [&](std::size_t tile, int first, const Vec3<Pack<double>>& sum, const auto&) {
        return finish(tile, first, sum, to);
      });
}

template <class S>
template <class Cells>
void FastBackend<S>::put_forces(int in, int out, const Cells& cells) {
  sum_forces(in, out, cells, [](std::size_t tile, int first, const auto& sum, double* to) {
    store_tile(to, tile, first, sum);
    return Sums{};
  });
}

template <class S>
template <class Cells>
double FastBackend<S>::subtract_forces(int in, int out, const Cells& cells) {
  const FastLevel<S>& l = levels_[0];
  const auto subtract = [&](std::size_t tile, int first, const auto& sum, double* to) {
    const auto force = masked(sum, l.fixed(tile, first));
    store_tile(to, tile, first, load_tile(static_cast<const double*>(to), tile, first) - force);
    return Sums{dot_lanes(force, force)};
  };
  return sum_forces(in, out, cells, subtract).first;
}

template <class S>
void FastBackend<S>::apply_scaled(const OperatorScale& scale, int in, int out) {
  put_forces(in, out, scaled_cells(scale));
}

template <class S>
void FastBackend<S>::elastic_force(int displacement, int out) {
  put_forces(displacement, out, elastic_cells());
}

template <class S>
double FastBackend<S>::subtract_scaled(const OperatorScale& scale, int in, int out, int) {
  return subtract_forces(in, out, scaled_cells(scale));
}

template <class S>
double FastBackend<S>::subtract_elastic_force(int displacement, int out, int) {
  return subtract_forces(displacement, out, elastic_cells());
}

/// The matrices of some cells of a stored level, one a lane (-1: none).
template <class S>
void FastBackend<S>::gather_matrices(int level, const std::int32_t (&lanes)[Pack<S>::kLanes],
                                     Pack<S> (&out)[kEntries]) const {
  const FastLevel<S>& l = levels_[level];
  l.matrices.gather(lanes, out);
  if (level == 1) add_turned(turned_cells(), values_of<S>().materials, scale_, lanes, out);
}

// Some children of the coarse cells in the lanes, one each. Held components are those of slots, so
// where there are some the way from corners has two steps.
template <class S>
void FastBackend<S>::add_general_children(int fine, const std::int32_t (&child)[Pack<S>::kLanes],
                                          Pack<S> (&sum)[kEntries]) const {
  using P = Pack<S>;
  const PatchedLevel& packed = levels_[fine].patched;
  P full[24][24];
  bool over_slots = false;
  if (fine == 0) {
    const FinestLanes<S> lanes(packed, values_of<S>(), scale_, child);
    corner_matrices(packed, values_of<S>(), lanes, full);
    over_slots = lanes.any_held;
    if (lanes.any_held && lanes.any_folded) fold_matrices<P>(packed, child, full);
    if (lanes.any_held) mask_matrices(packed, lanes, full);
  } else {
    std::int32_t lanes[P::kLanes];
    for (int k = 0; k < P::kLanes; ++k) lanes[k] = child[k] < 0 ? -1 : packed.lane[child[k]];
    P entries[kEntries];
    gather_matrices(fine, lanes, entries);
    full_from_modes(entries, full);
  }
  Weights weights[P::kLanes];
  const Weights* w[P::kLanes];
  for (int k = 0; k < P::kLanes; ++k) {
    w[k] = nullptr;
    if (child[k] < 0) continue;  // its matrix is zero
    weights[k] = child_weights(*packed.level, child[k], over_slots);
    w[k] = &weights[k];
  }
  add_product(full, columns_of<P>(w), sum);
}

template <class S>
void FastBackend<S>::merge_general(int fine, std::size_t group, int first,
                                   Pack<S> (&out)[kEntries]) const {
  using P = Pack<S>;
  const PatchedLevel &from = levels_[fine].patched, &to = levels_[fine + 1].patched;
  GeneralChildren children(from, to, to.cell.data() + kGroup * group + first, P::kLanes);
  bool any_other = false;
  for (P& entry : out) entry = P(0);
  for (int octant = 0; octant < 8; ++octant) {
    std::int32_t child[P::kLanes];
    for (int n = 0; children.others(octant, n, child); ++n) {
      add_general_children(fine, child, out);
      any_other = true;
    }
  }
  if (any_other) kernels::modes_from_corners<P>(out, out);
  if (!children.any_plain()) return;
  P some[kEntries];
  std::fill(std::begin(some), std::end(some), P(0));
  merge_elements(FinestCells<S>{from, values_of<S>()}, values_of<S>().materials, scale_,
                 children.plain(), some);
  for (int e = 0; e < kEntries; ++e) out[e] += some[e];
}

// Rotations of the cells of level 1 that are one element each, or may be. Eight cells of one
// rotation are exactly an element of twice the side. In single precision, where matrices only
// precondition, nearly one rotation is enough.
template <class S>
void FastBackend<S>::turn() {
  constexpr double kNear = 0.1;  // radians
  FastLevel<S>& to = levels_[1];
  const PatchedLevel& packed = to.patched;
  // The mass of lumped cells is not that of a lumped one.
  const bool may_be_one =
      !kIsDouble && levels_.size() > 2 && (scale_.mass == 0 || !hierarchy_->lumped_mass);
  const auto groups = static_cast<std::int32_t>(packed.groups());
#pragma omp parallel for num_threads(threads_) schedule(static) if (groups >= kWorthGroups)
  for (std::int32_t g = 0; g < groups; ++g) {
    const auto group = static_cast<std::size_t>(g);
    if (!is_of_finest(packed.kind[group])) continue;
    const bool eight = is_of_eight(packed.kind[group]);
    bool is_one = !eight || may_be_one;
    if (is_one)
      for_packs<S>([&](int first) {
        const std::int32_t* const children = packed.children.data() + 8 * kGroup * group + first;
        kernels::FinestChild<Pack<S>> child;
        if (!eight)
          load_elements(FinestCells<S>{levels_[0].patched, values_of<S>()}, scale_, children,
                        kAnyMaterial, child);
        else if (!mean_rotation(values_of<S>(), children, kNear, child.rotation))
          is_one = false;
        to.matrices.store(group, first, child.rotation);
      });
    if (!is_one) to.matrices.do_not_turn(group);
  }
}

template <class S>
void FastBackend<S>::coarsen(int fine) {
  using P = Pack<S>;
  const FastLevel<S>& from = levels_[fine];
  FastLevel<S>& to = levels_[fine + 1];
  const PatchedLevel& packed = to.patched;
  const bool coarsest = fine + 2 == static_cast<int>(levels_.size());
  to.matrices.start(packed, fine == 0 && !coarsest, scale_.mass != 0);
  if (fine == 0) turn();
  to.matrices.allocate();
  const auto groups = static_cast<std::int32_t>(packed.groups());
  const std::vector<PackedMaterial<S>>& materials = values_of<S>().materials;
  // General cells cost many times as much as others, and lie together.
#pragma omp parallel for num_threads(threads_) schedule(dynamic, 8) if (groups >= kWorthGroups)
  for (std::int32_t g = 0; g < groups; ++g) {
    const auto group = static_cast<std::size_t>(g);
    const std::uint16_t kind = packed.kind[group];
    if (kind == kNoCells || kind == kIdle || to.matrices.is_turned(group)) continue;
    const bool passed = kind == kPassed || kind == kHeldPassed;
    for_packs<S>([&](int first) {
      const std::int32_t* children = packed.children.data() + 8 * kGroup * group + first;
      const auto cells = packed.cell.begin() + kGroup * g + first;
      P out[kEntries];
      if (std::all_of(cells, cells + P::kLanes, [](std::int32_t c) { return c < 0; })) {
        std::fill(out, out + kEntries, P(0));
        return to.matrices.store(group, first, out);
      }
      if (kind == kGeneral || kind == kGeneralPassed)
        merge_general(fine, group, first, out);
      else if (fine == 0)
        merge_elements(FinestCells<S>{from.patched, values_of<S>()}, materials, scale_, children,
                       out);
      else if (fine == 1 && !passed && turned_cells().are_all(children, 8))
        merge_elements(turned_cells(), materials, scale_, children, out);
      else
        merge_stored<S>(
            [&](const auto& lanes, auto& entries) { gather_matrices(fine, lanes, entries); },
            children, passed, to.matrices.with_translations(group), out);
      to.matrices.store(group, first, out);
    });
  }
}

template <class S>
void invert_tile(FastLevel<S>& l, std::size_t tile, int first, const Vec3<Pack<S>>& upper,
                 const Vec3<Pack<S>>& lower) {
  using P = Pack<S>;
  const std::uint8_t* fixed = l.fixed(tile, first);
  P keep[3];
  for (int c = 0; c < 3; ++c)
    for (int k = 0; k < P::kLanes; ++k) keep[c].set(k, ((fixed[k] >> c) & 1) != 0 ? S(0) : S(1));
  const auto inverse = kernels::inverse_semidefinite(
      kernels::Sym3<P>{keep[0] * upper.x, keep[0] * keep[1] * upper.y, keep[0] * keep[2] * upper.z,
                       keep[1] * lower.x, keep[1] * keep[2] * lower.y, keep[2] * lower.z});
  S* to = l.inverse_diagonal.data() + 2 * kTileScalars * tile + first;
  const P entries[] = {inverse.xx, inverse.xy, inverse.xz, inverse.yy, inverse.yz, inverse.zz};
  for (int e = 0; e < 6; ++e) store_pack(to + kGroup * e, entries[e]);
}

template <class S>
void invert_own(FastLevel<S>& l, const Patch& patch, const BlockPoints<S>& from) {
  for (std::int32_t v = patch.own.first; v < patch.own.end(); v += kGroup)
    for_packs<S>([&](int first) {
      const std::uint16_t* points = l.patched.own_point.data() + v + first;
      invert_tile(l, static_cast<std::size_t>(v / kGroup), first,
                  gathered(static_cast<const S*>(from.upper), points),
                  gathered(static_cast<const S*>(from.lower), points));
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
      if (level > 0 && !l.matrices.is_turned(group)) {
        add_stored_diagonals(packed, l.matrices, folds_, group, to);
        continue;
      }
      const CellKind kind = element_kind(level, group);
      add_element_diagonals(
          packed, kind, values_of<S>().materials[kind.material].modes, scale_, folds_, group,
          [&](int first) {
            return level == 0 ? values_of<S>().quaternion(group, first)
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
      invert_tile(l, static_cast<std::size_t>(packed.shared_tiles[n]), first,
                  shared_sums(packed, n, first, upper), shared_sums(packed, n, first, lower));
    });
  });
  if (l.bound == 0 && level + 1 < static_cast<int>(levels_.size()))
    l.bound = estimate_spectral_bound(*this, level, *packed.level);
}

template <class S>
void FastBackend<S>::read_matrices(int level, const std::int32_t (&cells)[Pack<double>::kLanes],
                                   Pack<double> (&full)[24][24]) const {
  using P = Pack<double>;
  const PatchedLevel& packed = levels_[level].patched;
  bool any_folded = false;
  if (level == 0) {
    const FinestLanes<double> lanes(packed, exact_, scale_, cells);
    corner_matrices(packed, exact_, lanes, full);
    if (lanes.any_folded) fold_matrices<P>(packed, cells, full);
    if (lanes.any_held) mask_matrices(packed, lanes, full);
    return;
  }
  std::int32_t lanes[Pack<S>::kLanes];
  std::fill(std::begin(lanes), std::end(lanes), -1);
  for (int k = 0; k < P::kLanes; ++k) {
    if (cells[k] < 0) continue;
    lanes[k] = packed.lane[cells[k]];
    any_folded = any_folded || kernels::has_hanging(packed.level->fold[cells[k]]);
  }
  Pack<S> entries[kEntries];
  P exact[kEntries];
  gather_matrices(level, lanes, entries);
  for (int e = 0; e < kEntries; ++e)
    for (int k = 0; k < P::kLanes; ++k) exact[e].set(k, static_cast<double>(entries[e][k]));
  full_from_modes(exact, full);
  if (any_folded) fold_matrices<P>(packed, cells, full);
}

void read_lane(const Pack<double> (&full)[24][24], int lane, std::span<double> out) {
  for (int i = 0; i < 24; ++i)
    for (int j = 0; j <= i; ++j)
      out[static_cast<std::size_t>(kernels::packed_index(i, j))] = full[i][j][lane];
}

template <class S>
void FastBackend<S>::read_cell_matrix(int level, std::int32_t cell, std::span<double> out) const {
  std::int32_t cells[Pack<double>::kLanes];
  std::fill(std::begin(cells), std::end(cells), -1);
  cells[0] = cell;
  Pack<double> full[24][24];
  read_matrices(level, cells, full);
  read_lane(full, 0, out);
}

/// The matrices of the coarsest level, several cells at a time.
template <class S>
void FastBackend<S>::assemble_coarsest(bool definite) {
  constexpr double kRounding = 1e-6;
  constexpr int kLanes = Pack<double>::kLanes;
  const Level& level = hierarchy_->levels.back();
  Pack<double> full[24][24];
  coarsest_->assemble(level, [&](std::int32_t cell, std::span<double> out) {
    if (cell % kLanes == 0) {
      std::int32_t cells[kLanes];
      for (int k = 0; k < kLanes; ++k) cells[k] = cell + k < level.cells() ? cell + k : -1;
      read_matrices(static_cast<int>(levels_.size()) - 1, cells, full);
    }
    read_lane(full, cell % kLanes, out);
    if (definite) make_definite(out, kRounding);
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
