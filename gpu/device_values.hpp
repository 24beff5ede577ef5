// SPDX-License-Identifier: MIT
//
// Structure and values of a device backend: loads, updates, rotations, matrices, the coarsest
// level.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "core/solve/sparse_cholesky.hpp"
#include "core/solve/spectrum.hpp"
#include "gpu/device_backend.hpp"

namespace kerf::gpu {

template <class Device, class S>
DeviceBackend<Device, S>::DeviceBackend(std::unique_ptr<Device> device,
                                        const DeviceOptions& options)
    : device_(std::move(device)),
      options_(options),
      kinds_(*device_),
      exact_(*device_),
      single_(*device_),
      rotations_(*device_),
      scales_(*device_),
      blocks_(*device_),
      records_(*device_),
      partial_(*device_),
      totals_(*device_),
      conjugate_(*device_),
      krylov_(*device_),
      coarsest_(*device_),
      staging_(*device_),
      other_staging_(*device_),
      values_(*device_),
      keys_(*device_),
      marks_(*device_),
      words_(*device_),
      entries_(*device_),
      points_(*device_),
      corners_(*device_),
      first_corner_(*device_),
      next_corner_(*device_),
      normal_of_(*device_),
      rest_(*device_),
      positions_(*device_),
      faces_(*device_),
      normals_(*device_) {
  partial_.assign(at(kMostSums) * (at(kManyLanes) + at(kLastLanes)));
  totals_.assign(at(kMostSums));
  conjugate_.assign(1);
  scales_.upload(std::vector<Scale>(2));
}

template <class Device, class S>
template <class T>
FinestView<T> DeviceBackend<Device, S>::finest_view(const Scale* scale) const {
  const auto view = [&](const auto& values) -> FinestView<T> {
    return {rotations_.view(),
            kinds_.data(),
            values.element.data(),
            levels_[0].structure.size_log2(),
            values.materials.data(),
            values.mass.data(),
            scale,
            hierarchy_->spacing};
  };
  if constexpr (std::is_same_v<T, double>)
    return view(exact_);
  else
    return view(single_);
}

// ---- structure -----------------------------------------------------------------------------

template <class Device, class S>
void DeviceBackend<Device, S>::load(const Hierarchy& hierarchy) {
  hierarchy_ = &hierarchy;
  keys_.reset();
  kinds_.load(hierarchy.values);
  exact_.load(hierarchy, hierarchy.values.kinds());
  if constexpr (kMixed) single_.load(hierarchy, hierarchy.values.kinds());
  rotations_.assign(hierarchy.values.size());
  run(count_of(hierarchy.values), StraightenCell{rotations_.view()});
  while (levels_.size() > hierarchy.levels.size()) levels_.pop_back();
  while (levels_.size() < hierarchy.levels.size()) levels_.emplace_back(*device_);
  for (std::size_t l = 0; l < levels_.size(); ++l) {
    DeviceLevel<Device, S>& level = levels_[l];
    level.structure.load(hierarchy.levels[l]);
    while (level.vectors.size() < at(kLevelVectors)) level.vectors.emplace_back(*device_, false);
    while (l == 0 && level.vectors.size() < at(kLevelVectors) + added_exact_.size())
      level.vectors.emplace_back(*device_, added_exact_[level.vectors.size() - at(kLevelVectors)]);
    grow_vectors(level, 0);
  }
  if (options_.blocks) blocks_.load(hierarchy.levels[0], levels_[0].view());
  fit_to_levels();
}

/// Vectors of the size of the level, zero from `before` on.
template <class Device, class S>
void DeviceBackend<Device, S>::grow_vectors(DeviceLevel<Device, S>& level, std::size_t before) {
  const auto size = static_cast<std::size_t>(level.scalars());
  for (Vector& vector : level.vectors) {
    if (vector.size() == 0) continue;
    if (before == 0)
      vector.assign(size);
    else
      vector.resize(size);
    vector.with([&](auto* x) {
      run(static_cast<std::int32_t>(size - before),
          ZeroBody<std::decay_t<decltype(*x)>>{x + before});
    });
  }
}

/// One of a level, from now on with memory.
template <class Device, class S>
auto DeviceBackend<Device, S>::vector_at(int level, int x) const -> const Vector& {
  DeviceLevel<Device, S>& l = level_at(level);
  Vector& vector = l.vectors[at(x)];
  if (vector.size() == 0) {
    ensures(program_ == nullptr, "a vector takes memory while a program is written");
    vector.resize(at(l.scalars()));
    vector.with([&](auto* to) { run(l.scalars(), ZeroBody<std::decay_t<decltype(*to)>>{to}); });
  }
  return vector;
}

/// All else, of which nothing is kept.
template <class Device, class S>
void DeviceBackend<Device, S>::fit_to_levels() {
  std::size_t most = 0;
  for (std::size_t l = 0; l < levels_.size(); ++l) {
    DeviceLevel<Device, S>& level = levels_[l];
    level.bound = 0;
    level.solution_is_zero = false;
    level.colours = {};
    level.inverse_diagonal.assign(at(level.vertices()));
    if (l + 1 < levels_.size()) {
      level.first.assign(at(level.vertices()));
      level.first_slots.assign(at(level.cells()));
      run(level.vertices(), FindFirst{level.view(), level.first.data()});
      run(level.cells(), MarkFirst{level.view(), level.first.data(), level.first_slots.data()});
    }
    if (l > 0) {
      level.matrices.assign(kernels::tiled_size(at(level.cells()), kEntries, kTileLog2));
      level.plain.assign(at(level.cells()));
      run(level.cells(),
          MarkPlain{levels_[l - 1].view(), level.view(), l == 1, level.plain.data()});
    }
    const std::size_t scalars = kernels::tiled_size(at(level.cells()), kUnknowns, kTileLog2);
    if (l > 0) most = std::max(most, (scalars * sizeof(S) + sizeof(double) - 1) / sizeof(double));
    if (l == 0 && !in_blocks()) most = scalars;
  }
  records_.assign(most);
  krylov_.assign(levels_.size());
  coarsest_.is_there = false;
  coarsest_.unknowns = levels_.back().scalars();
  cycle_.reset();
}

template <class Device, class S>
void DeviceBackend<Device, S>::update(const Hierarchy& hierarchy, const HierarchyChange& change) {
  ensures(&hierarchy == hierarchy_ && change.levels.size() == levels_.size(),
          "a change is not one of the hierarchy that was loaded");
  for (std::size_t l = 0; l < levels_.size(); ++l) {
    levels_[l].structure.update(hierarchy.levels[l], change.levels[l], staging_);
    for (Vector& vector : levels_[l].vectors)
      if (vector.size() > 0) vector.reserve(at(levels_[l].scalars()));
  }
  const LevelChange& finest = change.levels[0];
  if (options_.blocks) blocks_.update(hierarchy.levels[0], finest, levels_[0].view(), staging_);
  rotations_.reserve(hierarchy.values.size());
  const auto cells = listed(finest.cells, finest.cells_before, levels_[0].cells());
  if (kinds_.update(hierarchy.values, cells, *device_, staging_)) {
    exact_.load_kinds(hierarchy.values.kinds());
    if constexpr (kMixed) single_.load_kinds(hierarchy.values.kinds());
  }
  fit_to_levels();
  const std::int32_t* const origin = staging_.put(finest.origin);

  // All memory is there: what the state is made of changes last, and cannot fail.
  for (std::size_t l = 0; l < levels_.size(); ++l)
    grow_vectors(levels_[l], 3 * at(change.levels[l].vertices_before));
  rotations_.resize(hierarchy.values.size());
  run(count_of(finest.origin), InheritRotation{origin, finest.cells_before, rotations_.view()});
}

template <class Device, class S>
int DeviceBackend<Device, S>::append_vector(bool exact) {
  if (!levels_.empty()) levels_[0].vectors.emplace_back(*device_, exact);
  added_exact_.push_back(exact);
  return kLevelVectors + static_cast<int>(added_exact_.size()) - 1;
}

template <class Device, class S>
void DeviceBackend<Device, S>::set_smoother(const SmootherOptions& options) {
  smoother_ = options;
  cycle_.reset();
  for (DeviceLevel<Device, S>& level : levels_)
    if (level.bound > 0) upload_factors(level);
}

// ---- values --------------------------------------------------------------------------------

template <class Device, class S>
void DeviceBackend<Device, S>::set_operator(const OperatorScale& scale) {
  if (scale.stiffness != scale_.stiffness || scale.mass != scale_.mass) {
    for (DeviceLevel<Device, S>& level : levels_) level.bound = 0;
    coarsest_.is_there = false;
  }
  scale_ = scale;
  const Scale on_device{scale.stiffness, scale.mass};
  scales_.write(0, {&on_device, 1});
}

template <class Device, class S>
void DeviceBackend<Device, S>::rotate_cells(int displacement) {
  const LevelView view = levels_[0].view();
  run(view.cells, RotateCell<S>{view, levels_[0].structure.size_log2(), hierarchy_->spacing,
                                exact_vector(displacement), rotations_.view()});
}

template <class Device, class S>
void DeviceBackend<Device, S>::read_rotations(std::span<double> out) const {
  static_assert(sizeof(Quat<double>) == 4 * sizeof(double));  // w x y z
  const std::vector<Quat<double>> rotations = rotations_.read();
  std::memcpy(out.data(), rotations.data(), out.size_bytes());
}

template <class Device, class S>
void DeviceBackend<Device, S>::write_rotations(std::span<const double> in) {
  std::vector<Quat<double>> rotations(in.size() / 4);
  for (std::size_t c = 0; c < rotations.size(); ++c)
    rotations[c] = {in[4 * c], in[4 * c + 1], in[4 * c + 2], in[4 * c + 3]};
  rotations_.write(rotations);
}

template <class Device, class S>
void DeviceBackend<Device, S>::coarsen(int fine) {
  const LevelView from = level_at(fine).view(), to = level_at(fine + 1).view();
  S* const matrices = level_at(fine + 1).matrices.data();
  const std::uint8_t* const plain = level_at(fine + 1).plain.data();
  const std::int32_t tasks = coarsen_tasks(to.cells);
  if (fine == 0) {
    const FinestView<S> finest = finest_view<S>(scales_.data());
    run(tasks, CoarsenFinestPlain<S>{from, to, finest, plain, matrices});
    run(tasks, CoarsenSums<S, FinestChildren<S>>{from, to, {finest}, plain, matrices});
  } else {
    const S* const stored = level_at(fine).matrices.data();
    run(tasks, CoarsenSums<S, StoredChildren<S, true>>{from, to, {stored}, plain, matrices});
    run(tasks, CoarsenSums<S, StoredChildren<S, false>>{from, to, {stored}, plain, matrices});
  }
}

template <class Device, class S>
void DeviceBackend<Device, S>::prepare(int level) {
  DeviceLevel<Device, S>& l = level_at(level);
  const LevelView view = l.view();
  Sym3<S>* const inverse = l.inverse_diagonal.data();
  if (level == 0)
    run(view.vertices, InvertFinest<S>{view, finest_view<S>(scales_.data()), inverse});
  else
    run(view.vertices, InvertStored<S>{view, l.matrices.data(), inverse});
  if (l.bound != 0 || level == last_level()) return;
  l.bound = estimate_spectral_bound(*this, level, hierarchy_->levels[at(level)]);
  upload_factors(l);
}

/// Chebyshev on [smallest, 1] * bound: take and keep of each step. See cpu/cpu_backend.cpp.
template <class Device, class S>
void DeviceBackend<Device, S>::upload_factors(DeviceLevel<Device, S>& level) {
  const double upper = level.bound, lower = smoother_.smallest * upper;
  const double theta = 0.5 * (upper + lower), delta = 0.5 * (upper - lower);
  const double sigma = theta / delta;
  double rho = 1 / sigma;
  std::vector<S> factors{static_cast<S>(1 / theta), S(0)};
  for (int step = 1; step < smoother_.degree; ++step) {
    const double next = 1 / (2 * sigma - rho);
    factors.push_back(static_cast<S>(2 * next / delta));
    factors.push_back(static_cast<S>(next * rho));
    rho = next;
  }
  if (factors.size() > level.factors.capacity()) cycle_.reset();  // they move
  level.factors.upload(factors);
}

template <class Device, class S>
void DeviceBackend<Device, S>::read_cell_matrix(int level, std::int32_t cell,
                                                std::span<double> out) const {
  values_.assign(kEntries);
  if (level == 0)
    run(1, OneFinestMatrix{levels_[0].view(), finest_view<double>(scales_.data()), cell,
                           values_.data()});
  else
    run(kEntries, OneStoredMatrix<S>{levels_[at(level)].matrices.data(), cell, values_.data()});
  values_.read(0, out.first(kEntries));
}

// ---- the coarsest level --------------------------------------------------------------------

/// Rounding of matrices in single precision can leave a singular one indefinite, so there the
/// share of the diagonal that is added grows.
template <class Device, class S>
void DeviceBackend<Device, S>::factor_coarsest() {
  constexpr double kGrowth = 100, kMost = kMixed ? 1e-2 : 0;
  constexpr std::int32_t kMostUnknowns = 46340;  // entries are numbered by 31 bits
  expects(coarsest_.unknowns <= kMostUnknowns,
          text("the coarsest level has ", coarsest_.unknowns / 3,
               " vertices, too many for a dense inverse on a device; lower "
               "solver.coarsest_vertices or raise solver.max_levels"));
  coarsest_.is_there = false;
  const bool alone = levels_.size() == 1;
  for (double share = alone ? 0 : AssembledLevel::kShare;; share *= kGrowth) {
    assemble_coarsest(share);
    coarsest_.is_there = invert_coarsest();
    if (coarsest_.is_there) return;
    expects(!alone && share < kMost,
            "the system matrix is not positive definite: in static mode some part of the body can "
            "move freely and needs a [[support]]; otherwise sizes, moduli or the time step are out "
            "of range");
  }
}

template <class Device, class S>
void DeviceBackend<Device, S>::assemble_coarsest(double share) {
  DeviceLevel<Device, S>& level = levels_.back();
  const LevelView view = level.view();
  const std::size_t n = at(coarsest_.unknowns);
  if (!kMixed && coarsest_.matrix.capacity() < n * n) cycle_.reset();  // it moves
  coarsest_.matrix.assign(n * n);
  coarsest_.diagonal.assign(n);
  coarsest_.panels.assign(2 * at(kBlock) * n + at(kBlock * kBlock) + 1);
  if (coarsest_.slices.capacity() < at(kSlices) * n) cycle_.reset();
  coarsest_.slices.assign(at(kSlices) * n);
  run(static_cast<std::int32_t>(n * n), ZeroBody<double>{coarsest_.matrix.data()});
  double *const A = coarsest_.matrix.data(), *const diagonal = coarsest_.diagonal.data();
  if (levels_.size() > 1) {
    run(view.vertices, AssembleVertex<S>{view, level.matrices.data(), share, A, diagonal});
    return;
  }
  // In double, so that a body that nothing holds is known as such.
  coarsest_.cells.assign(kernels::tiled_size(at(view.cells), kEntries, kTileLog2));
  double* const cells = coarsest_.cells.data();
  run(view.cells, FinestMatrix<double>{view, finest_view<double>(scales_.data()), cells});
  run(view.vertices, AssembleVertex<double>{view, cells, share, A, diagonal});
}

/// @returns whether the matrix is positive definite beyond rounding; if not, there is no inverse.
template <class Device, class S>
bool DeviceBackend<Device, S>::invert_coarsest() {
  const std::int32_t n = coarsest_.unknowns;
  double* const A = coarsest_.matrix.data();
  double* const columns = coarsest_.panels.data();
  double* const times_P = columns + at(kBlock) * at(n);
  double* const P = times_P + at(kBlock) * at(n);
  double* const failed = P + kBlock * kBlock;
  run(1, ZeroBody<double>{failed});
  for (std::int32_t first = 0; first < n; first += kBlock) {
    const std::int32_t rows = std::min(kBlock, n - first);
    run(1, InvertBlock{n, first, rows, A, coarsest_.diagonal.data(), P, failed});
    run(n, EliminationPanels{n, first, rows, A, P, columns, times_P});
    run(n * n, Eliminate{n, first, rows, A, P, columns, times_P});
  }
  double is_lost = 0;
  device_->download(&is_lost, failed, sizeof is_lost);
  if (is_lost != 0) return false;
  if constexpr (kMixed) {
    if (coarsest_.inverse.capacity() < at(n) * at(n)) cycle_.reset();
    coarsest_.inverse.assign(at(n) * at(n));
    run(n * n, CopyBody<double, S>{A, coarsest_.inverse.data()});
  }
  return true;
}

}  // namespace kerf::gpu
