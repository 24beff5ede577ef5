// SPDX-License-Identifier: MIT
//
// Each lane does what the shared bodies of kernels/ do for a scalar, a pack of cells at a time, and
// what follows a sum (residual, step of Chebyshev) is done while it is in registers.
#include <omp.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "cpu/fast_rotate.hpp"
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
  std::size_t sum = bytes_of(partial_) + rotations_.bytes() + bytes_of(exact_materials_) +
                    bytes_of(single_materials_);
  for (const FastLevel<S>& level : levels_) {
    sum += level.patched.bytes() + level.matrices.bytes() + level.inverse_diagonals.bytes() +
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
std::vector<PackedMaterial<T>> pack_materials(const Hierarchy& hierarchy) {
  std::vector<PackedMaterial<T>> out;
  for (const double poisson : hierarchy.poisson)
    out.push_back(pack_material<T>(poisson, hierarchy.lumped_mass));
  return out;
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
  ensures(hierarchy.has_transfers(), "a hierarchy without transfers is loaded");
  hierarchy_ = &hierarchy;
  const bool follows = updates_ && hierarchy.has_neighbours();
  waiting_ = -1;
  levels_.resize(hierarchy.levels.size());
  for (std::size_t l = 0; l < levels_.size(); ++l) {
    FastLevel<S>& level = levels_[l];
    level.patched =
        make_patches(hierarchy, l, l == 0 ? nullptr : &levels_[l - 1].patched, threads_);
    if (!follows) level.patched.forget_rows();
    level.bound = 0;
    level.matrices.forget_unrotated();
    level.solution_is_zero = false;
    const std::size_t scalars = kTileScalars * level.patched.tiles();
    level.inverse_diagonals.assign(level.patched.tiles(), follows);
    level.vectors.assign(l == 0 ? exact_on_finest_ : std::vector<bool>(kLevelVectors, kIsDouble),
                         scalars, follows);
  }
  folds_ = SlotTable<S>(hierarchy.lumped_mass ? kernels::MassModel::lumped
                                              : kernels::MassModel::consistent);
  rotations_.start(levels_[0].patched.groups());
  exact_materials_ = pack_materials<double>(hierarchy);
  if constexpr (!kIsDouble) single_materials_ = pack_materials<float>(hierarchy);
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
template <class S>
void renumber(const PatchMoves& moves, const PatchedLevel& finest, FinestRotations<S>& rotations) {
  std::vector<std::array<double, 4>> before(moves.cells.size());
  for (std::size_t n = 0; n < before.size(); ++n)
    before[n] = rotations.at(static_cast<std::size_t>(moves.cells[n].from));
  rotations.resize(finest.groups());
  for (const Range& groups : moves.groups)
    rotations.no_rotation(static_cast<std::size_t>(groups.first),
                          static_cast<std::size_t>(groups.end()));
  for (std::size_t n = 0; n < before.size(); ++n)
    rotations.put(static_cast<std::size_t>(finest.lane[moves.cells[n].to]), before[n]);
}

/// Matrices without rotation of groups that cells came to or left, or whose cells have other cells
/// or supports below. `stale`: cells of the level before with others; becomes those of this level.
template <class S>
void FastBackend<S>::forget_unrotated(const LevelChange& change, const PatchMoves& moves,
                                      std::size_t level, std::vector<std::int32_t>& stale) {
  StoredMatrices<S>& matrices = levels_[level].matrices;
  const PatchedLevel& packed = levels_[level].patched;
  for (std::int32_t& cell : stale) cell = hierarchy_->levels[level - 1].parent[cell];
  stale.insert(stale.end(), change.cells.begin(), change.cells.end());
  std::sort(stale.begin(), stale.end());
  stale.erase(std::unique(stale.begin(), stale.end()), stale.end());
  const auto forget = [&](std::int32_t lane) {
    matrices.forget_unrotated(static_cast<std::size_t>(lane / kGroup));
  };
  for (const std::int32_t cell : stale) forget(packed.lane[cell]);
  for (const PatchMoves::Move& m : moves.cells)
    if (m.from != packed.lane[m.to]) {
      forget(m.from);
      forget(packed.lane[m.to]);
    }
  stale.insert(stale.end(), moves.others.begin(), moves.others.end());
}

template <class S>
void FastBackend<S>::update(const Hierarchy& hierarchy, const HierarchyChange& change) {
  ensures(&hierarchy == hierarchy_ && change.levels.size() == levels_.size(),
          "a change is not one of the hierarchy that was loaded");
  settle();
  PatchMoves moves;
  std::vector<std::int32_t> stale;
  for (std::size_t l = 0; l < levels_.size(); ++l) {
    FastLevel<S>& level = levels_[l];
    moves = update_patches(hierarchy, change, l, l == 0 ? nullptr : &levels_[l - 1].patched,
                           l == 0 ? nullptr : &moves, threads_, level.patched);
    level.bound = 0;
    const std::size_t size = kTileScalars * level.patched.tiles();
    // Made anew where there are vertices; elsewhere what is left of it meets zeros.
    level.inverse_diagonals.resize(level.patched.tiles());
    for (std::size_t x = 0; x < level.vectors.size(); ++x) {
      renumber(moves.vertices, size, level.vectors.held(x).single);
      renumber(moves.vertices, size, level.vectors.held(x).exact);
    }
    level.vectors.set_scalars(size);
    if (l == 0) {
      renumber(moves, level.patched, rotations_);
      stale = moves.others;
    } else {
      forget_unrotated(change.levels[l], moves, l, stale);
    }
  }
  // The order of elimination hangs on places, which stay, on what is beside what, and on what is
  // held.
  if (change.levels.back().vertices.empty())
    factored_ = false;
  else
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
    for (FastLevel<S>& level : levels_) {
      level.bound = 0;
      level.matrices.forget_unrotated();
    }
    factored_ = false;
  }
  scale_ = scale;
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
    for (std::int32_t g = patch.groups.first; g < patch.groups.end(); g += kRotatedGroups)
      rotate_groups(l, rotations_, static_cast<std::size_t>(g),
                    std::min(kRotatedGroups, patch.groups.end() - g), points.x());
  });
}

template <class S>
void FastBackend<S>::read_rotations(std::span<double> out) const {
  const PatchedLevel& packed = levels_[0].patched;
  for (std::size_t c = 0; c < packed.lane.size(); ++c) {
    const auto q = rotations_.at(static_cast<std::size_t>(packed.lane[c]));
    std::copy(q.begin(), q.end(), out.begin() + 4 * static_cast<std::ptrdiff_t>(c));
  }
}

template <class S>
void FastBackend<S>::write_rotations(std::span<const double> in) {
  const PatchedLevel& packed = levels_[0].patched;
  for (std::size_t c = 0; c < packed.lane.size(); ++c)
    rotations_.put(static_cast<std::size_t>(packed.lane[c]),
                   {in[4 * c], in[4 * c + 1], in[4 * c + 2], in[4 * c + 3]});
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

template class FastBackend<float>;
template class FastBackend<double>;

}  // namespace kerf::cpu
