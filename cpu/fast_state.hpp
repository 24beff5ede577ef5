// SPDX-License-Identifier: MIT
//
// The state of the fast backend and its loops; what it computes is in fast_backend.cpp (loading,
// rotations and forces), fast_values.cpp (matrices) and fast_cycle.cpp (the cycle and vectors).
#pragma once

#include <algorithm>
#include <array>
#include <initializer_list>
#include <memory>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/backend.hpp"
#include "core/base/error.hpp"
#include "cpu/element_cells.hpp"
#include "cpu/fast_diagonals.hpp"
#include "cpu/fast_kernels.hpp"
#include "cpu/finest_values.hpp"
#include "cpu/flush.hpp"
#include "cpu/front_factor.hpp"
#include "cpu/instruction_set.hpp"
#include "cpu/inverse_diagonals.hpp"
#include "cpu/parallel_errors.hpp"
#include "cpu/patch_sweep.hpp"
#include "cpu/transfer_points.hpp"

namespace kerf::cpu {

using kernels::Vec3;

/// A vector of one level, of the scalars of the cycle or exact.
struct FastVector {
  Array<float> single;
  Array<double> exact;
  template <class S>
  Array<S>& in() {
    if constexpr (std::is_same_v<S, float>)
      return single;
    else
      return exact;
  }
  bool is_exact() const { return single.empty(); }
  bool is_empty() const { return single.empty() && exact.empty(); }
};

/// The vectors of a level, by VectorId. One that is zero may have no memory until it is asked for,
/// so that what a run never uses costs nothing.
class LazyVectors {
 public:
  /// Forgets all. `exact`: of each vector, whether it is double. `scalars`: of one vector. `grow`:
  /// with room, so that the first cut need not move what there is.
  void assign(std::vector<bool> exact, std::size_t scalars, bool grow) {
    exact_ = std::move(exact);
    all_.clear();
    all_.resize(exact_.size());
    scalars_ = scalars;
    grow_ = grow;
  }
  void append(bool exact) {
    exact_.push_back(exact);
    all_.emplace_back();
  }
  void release(std::size_t x) { all_[x] = {}; }
  /// Of vectors that are asked for from now on.
  void set_scalars(std::size_t scalars) { scalars_ = scalars; }
  std::size_t size() const { return all_.size(); }
  bool is_exact(std::size_t x) const { return exact_[x]; }

  FastVector& operator[](std::size_t x) {
    FastVector& vector = all_[x];
    if (vector.is_empty() && exact_[x]) fill(vector.exact);
    if (vector.is_empty() && !exact_[x]) fill(vector.single);
    return vector;
  }
  /// As it is: empty if it is zero and was not asked for.
  FastVector& held(std::size_t x) { return all_[x]; }
  const FastVector& held(std::size_t x) const { return all_[x]; }
  /// Without room, which takes no memory before it is written.
  std::size_t bytes() const {
    std::size_t sum = 0;
    for (const FastVector& vector : all_)
      sum += vector.single.size() * sizeof(float) + vector.exact.size() * sizeof(double);
    return sum;
  }

 private:
  template <class T>
  void fill(Array<T>& vector) const {
    if (grow_) vector.reserve(with_room(scalars_));
    vector.resize(scalars_);
  }

  std::vector<bool> exact_;
  std::vector<FastVector> all_;
  std::size_t scalars_ = 0;
  bool grow_ = false;
};

/// Calls body(from, to) with the typed arrays of two vectors.
template <class From, class To, class Body>
void with_types(From& from, To& to, const Body& body) {
  if (from.is_exact() && to.is_exact())
    body(from.exact.data(), to.exact.data());
  else if (from.is_exact())
    body(from.exact.data(), to.single.data());
  else if (to.is_exact())
    body(from.single.data(), to.exact.data());
  else
    body(from.single.data(), to.single.data());
}

constexpr auto kNothingBefore = [](std::size_t) {};

template <class S>
struct FastLevel {
  PatchedLevel patched;
  StoredMatrices<S> matrices;  // levels above 0
  InverseDiagonals<S> inverse_diagonals;
  LazyVectors vectors;
  double bound = 0;  // of the spectrum of D^-1 A
  bool solution_is_zero = false;

  std::int32_t tiles() const { return static_cast<std::int32_t>(patched.tiles()); }
  std::int32_t scalars() const { return 3 * kGroup * tiles(); }
  const std::uint8_t* fixed(std::size_t tile, int first) const {
    return patched.fixed.data() + kGroup * tile + first;
  }
  S* at(int x) { return vectors[static_cast<std::size_t>(x)].template in<S>().data(); }
};

/// S: scalar of the cycle, and of the vectors of conjugate gradients. Those that are added on level
/// 0 are double, but for rough ones, and so are forces.
template <class S>
class FastBackend final : public Backend {
 public:
  FastBackend(int threads, bool updates);  ///< threads 0: all that OpenMP offers

  const char* name() const noexcept override { return "cpu"; }
  const char* instruction_set() const noexcept override { return kInstructionSet; }
  int threads() const noexcept override { return threads_; }
  Workers workers() const override {
    const_cast<FastBackend*>(this)->settle();  // else read_some would, on each of them
    return workers_of(threads_);
  }
  std::size_t bytes() const override;
  double bytes_per_cell() const noexcept override;
  void load(const Hierarchy& hierarchy) override;
  bool can_update() const noexcept override { return updates_; }
  bool reads_incidences() const noexcept override { return false; }
  void update(const Hierarchy& hierarchy, const HierarchyChange& change) override;
  void set_smoother(const SmootherOptions& options) override {
    expects(options.chebyshev,
            "this backend smooths by Chebyshev; Gauss-Seidel needs the reference backend");
    smoother_ = options;
  }
  int add_vector() override { return append_vector(true); }
  int add_rough_vector() override { return append_vector(kIsDouble); }
  ConjugateVectors conjugate_vectors() override {
    return {kRight, append_vector(kIsDouble), append_vector(kIsDouble), !kIsDouble};
  }
  void release(int x) override;

  void set_operator(const OperatorScale& scale) override;
  void rotate_cells(int displacement) override;
  void read_rotations(std::span<double> out) const override;
  void write_rotations(std::span<const double> in) override;
  void coarsen(int fine) override;
  void prepare(int level) override;
  void factor_coarsest() override;
  bool has_factor() const noexcept override { return factored_; }
  void read_cell_matrix(int level, std::int32_t cell, std::span<double> out) const override;
  double spectral_bound(int level) const override { return levels_[level].bound; }

  void smooth(int level, SweepOrder order, int count) override;
  double residual(int level) override;
  void restrict_residual(int fine) override;
  void restrict_from_solution(int fine) override;
  void prolong_correction(int fine) override;
  void solve_coarsest() override;
  void apply(int level, int in, int out) override;
  void precondition_jacobi(int level, int in, int out) override;

  double true_residual(int b, int x, int r) override;
  std::array<double, 2> dots(int x, int y, int z) override;
  std::array<double, 2> advance_direction(int z, double beta, int d, int q, int r) override;
  double advance_solution(double a, int d, int q, int x, int r) override;

  void elastic_force(int displacement, int out) override;
  void apply_scaled(const OperatorScale& scale, int in, int out) override;
  double subtract_elastic_force(int displacement, int out, int work) override;
  double subtract_scaled(const OperatorScale& scale, int in, int out, int work) override;
  void move_points(std::span<const BoundPoint> points, int displacement,
                   std::span<Vec3d> positions) override;
  void surface_normals(const SurfaceView& surface, std::span<const Vec3d> positions,
                       std::span<Vec3d> normals) override;

  void zero(int level, int x) override;
  void copy(int level, int from, int to) override;
  void add(int level, double a, int x, int y) override { combine(level, a, x, 1, y); }
  void combine(int level, double a, int x, double b, int y) override;
  double dot(int level, int x, int y) override;
  void mask(int level, int x) override;
  void write(int level, int x, std::span<const double> values) override;
  void read(int level, int x, std::span<double> values) const override;
  void write_some(int level, int x, std::span<const std::int32_t> vertices,
                  std::span<const double> values) override;
  void read_some(int level, int x, std::span<const std::int32_t> vertices,
                 std::span<double> values) const override;
  NearCells find_near(int displacement, const BladeReach& reach,
                      std::span<const std::int32_t> opened) const override;

 private:
  /// body(i), for i from begin to end; on one thread if the work is not worth more.
  template <class Body>
  void parallel(std::int32_t begin, std::int32_t end, bool is_worth, const Body& body) const {
#pragma omp parallel num_threads(threads_) if (is_worth)
    {
      const FlushToZero flush;
#pragma omp for schedule(static)
      for (std::int32_t i = begin; i < end; ++i) body(i);
    }
  }
  template <class Body>
  void parallel(std::int32_t count, std::int32_t worth, const Body& body) const {
    parallel(0, count, count >= worth, body);
  }
  /// body(tile), for tiles of vertices.
  template <class Body>
  void for_tiles(std::int32_t begin, std::int32_t end, const Body& body) const {
    parallel(begin, end, end - begin >= kWorthTiles,
             [&](std::int32_t t) { body(static_cast<std::size_t>(t)); });
  }
  /// body(patch), for the patches of a level.
  template <class Body>
  void for_patches_of(int level, const Body& body) const {
    const PatchedLevel& l = levels_[level].patched;
    for_patches(0, static_cast<std::int32_t>(l.patches.size()),
                l.cell.size() >= kWorthCells ? threads_ : 1,
                [&](std::int32_t p) { body(static_cast<std::size_t>(p)); });
  }
  static constexpr std::int32_t kWorthGroups = 4;  // whose matrices are made
  static constexpr std::int32_t kWorthTiles = 256;
  static constexpr std::size_t kWorthCells = 2048;  // below, waking the threads costs more
  static constexpr std::int32_t kWorthScalars = 65536;

  static constexpr bool kIsDouble = std::is_same_v<S, double>;

  int append_vector(bool exact);
  void load_coarsest();
  template <class T>
  const std::vector<PackedMaterial<T>>& materials() const {
    if constexpr (std::is_same_v<T, double>)
      return exact_materials_;
    else
      return single_materials_;
  }
  template <class T>
  FinestValues<T, S> values_of() const {
    return {rotations_, materials<T>()};
  }
  template <class T>
  T* partial_sums(std::size_t scalars);
  template <class T, class From, class Before, class Start, class Own, class Cells, class Finish>
  Sums sweep(int level, const Before& before, const Start& start, const Own& own, const From* u,
             const Cells& cells, const Finish& finish) {
    return sweep<T>(level, before, start, own, u, cells, finish, finish);
  }
  template <class T, class From, class Before, class Start, class Own, class Cells, class Finish,
            class FinishShared>
  Sums sweep(int level, const Before& before, const Start& start, const Own& own, const From* u,
             const Cells& cells, const Finish& finish, const FinishShared& finish_shared);
  template <class T>
  void add_products(int level, std::size_t group, const T* x, T* y) const;
  template <class T>
  void apply_typed(int level, int in, int out);
  auto elastic_cells() const {
    return [this](std::size_t group, const double* x, double* y) {
      elastic_forces(levels_[0].patched, values_of<double>(), group, x, y);
    };
  }
  auto scaled_cells(const OperatorScale& scale) const {
    return [this, scale](std::size_t group, const double* x, double* y) {
      finest_products(levels_[0].patched, values_of<double>(), scale, group, x, y);
    };
  }
  template <class Cells, class Finish>
  Sums sum_forces(int in, int out, const Cells& cells, const Finish& finish);
  template <class Cells>
  void put_forces(int in, int out, const Cells& cells);
  template <class Cells>
  double subtract_forces(int in, int out, const Cells& cells);
  template <std::size_t kSums, class Body>
  std::array<double, kSums> sum_scalars(std::int32_t size, const Body& body) const;
  void read_matrices(int level, const std::int32_t (&cells)[Pack<double>::kLanes],
                     Pack<double> (&out)[kEntries]) const;
  void assemble_coarsest(bool definite);
  /// What the cells of a group are that are one element each.
  CellKind element_kind(int level, std::size_t group) const {
    const std::uint16_t kind = levels_[level].patched.kind[group];
    const std::vector<CellKind>& kinds = levels_[0].patched.kinds;
    return level == 0 ? kinds[kind] : cpu::element_kind(kinds, kind);
  }
  FinestCells<S> finest_cells(bool unrotated = false) const {
    return {levels_[0].patched, rotations_, unrotated};
  }
  StoredCells<S> stored_cells(int level, bool unrotated = false) const {
    return {levels_[0].patched, levels_[level].patched, levels_[level].matrices, unrotated};
  }
  bool turns_with_supports(std::int32_t cell) const;
  int general_children(int level, std::size_t group,
                       std::int32_t (&out)[kMostTurned * kGroup]) const;
  template <class Cells>
  void turn_group(int level, std::size_t group, const Cells& cells);
  template <class Cells>
  void turn(int level, const Cells& cells);
  void gather_matrices(int level, bool unrotated, const std::int32_t (&lanes)[Pack<S>::kLanes],
                       Pack<S> (&out)[kEntries]) const;
  void corner_children(bool unrotated, const std::int32_t (&child)[Pack<S>::kLanes],
                       Pack<S> (&out)[kEntries]) const;
  void add_by_slots(bool unrotated, const std::int32_t (&child)[Pack<S>::kLanes],
                    Pack<S> (&sum)[kEntries]) const;
  void merge_general_finest(std::size_t group, int first, bool unrotated,
                            Pack<S> (&out)[kEntries]) const;
  void merge_general_stored(int fine, std::size_t group, int first, bool unrotated,
                            Pack<S> (&out)[kEntries]) const;
  void merge(int fine, std::size_t group, int first, bool unrotated,
             Pack<S> (&out)[kEntries]) const;
  void forget_unrotated(const LevelChange& change, const PatchMoves& moves, std::size_t level,
                        std::vector<std::int32_t>& stale);
  template <class Value>
  void chebyshev_step(int level, const Value& value, double step, bool put);
  void chebyshev(int level);
  void restrict_vector(int fine, int x);
  void sum_given(int fine, const S* given);
  void correct_shared(int level);
  void settle();
  void expects_exact(int in, int out) const {
    ensures(is_exact(0, in) && is_exact(0, out), "a force is asked for in a vector of the cycle");
  }
  void expects_rounded(std::initializer_list<int> vectors) const {
    for (const int x : vectors)
      ensures(is_exact(0, x) == kIsDouble, "conjugate gradients are given other vectors");
  }
  bool is_exact(int level, int x) const { return levels_[level].vectors.is_exact(x); }
  void changed(int level, int x) {
    if (x == kSolution) levels_[level].solution_is_zero = false;
  }

  int threads_;
  bool updates_;
  const Hierarchy* hierarchy_ = nullptr;
  SmootherOptions smoother_;
  OperatorScale scale_;
  FinestRotations<S> rotations_;
  std::vector<PackedMaterial<double>> exact_materials_;
  std::vector<PackedMaterial<float>> single_materials_;  // the same, rounded; none if S is double
  SlotTable<S> folds_{kernels::MassModel::consistent};
  std::vector<FastLevel<S>> levels_;
  std::vector<bool> exact_on_finest_ = std::vector<bool>(kLevelVectors, kIsDouble);
  Array<double> partial_;  // of shared vertices: sums by copy, in the scalars of the sweep;
                           // what a level gives to the next; area normals of a surface
  int waiting_ = -1;       // level whose solution is still to be corrected
  std::unique_ptr<AssembledLevel> coarsest_;
  FrontFactor<S> coarsest_factor_;
  bool factored_ = false;
};

template <class S>
template <class T>
T* FastBackend<S>::partial_sums(std::size_t scalars) {
  partial_.resize(std::max(partial_.size(), scalars * sizeof(T) / sizeof(double) + 1));
  return reinterpret_cast<T*>(partial_.data());
}

/// One pass over the cells of a level, from the vector u to what finish makes of the sums; u may be
/// of another precision than the arithmetic, T.
/// before(tile): shared tiles, first of all, in any order. start(patch): before what is asked of a
/// patch, on the same thread. own, cells, finish: see PatchPoints; cells gets (group, x, y).
/// finish_shared: of shared tiles, behind all others, on any thread; its x is read from u. Returns
/// the sum of what these return, in an order that threads do not change.
template <class S>
template <class T, class From, class Before, class Start, class Own, class Cells, class Finish,
          class FinishShared>
Sums FastBackend<S>::sweep(int level, const Before& before, const Start& start, const Own& own,
                           const From* u, const Cells& cells, const Finish& finish,
                           const FinishShared& finish_shared) {
  const PatchedLevel& l = levels_[level].patched;
  const auto patches = static_cast<std::int32_t>(l.patches.size());
  const auto shared = static_cast<std::int32_t>(l.shared_tiles.size());
  T* const partial = partial_sums<T>(4 * l.copy_point.size());
  ParallelErrors errors;
  std::vector<Sums> sums(l.patches.size() + l.shared_tiles.size());
#pragma omp parallel num_threads(threads_) if (l.cell.size() >= kWorthCells)
  {
    const FlushToZero flush;
#pragma omp for schedule(static)
    for (std::int32_t n = 0; n < shared; ++n) before(static_cast<std::size_t>(l.shared_tiles[n]));
#pragma omp for schedule(dynamic, 1)
    for (std::int32_t p = 0; p < patches; ++p)
      errors.run([&] {
        const Patch& patch = l.patches[p];
        PatchPoints<T> points(l, patch);
        start(static_cast<std::size_t>(p));
        points.load(own, u);
        points.start_sums();
        for (std::int32_t g = patch.groups.first; g < patch.groups.end(); ++g)
          cells(static_cast<std::size_t>(g), points.x(), points.y());
        sums[p] = points.store(finish, partial);
      });
#pragma omp for schedule(static)
    for (std::int32_t n = 0; n < shared; ++n) {
      const auto tile = static_cast<std::size_t>(l.shared_tiles[n]);
      Sums sum;
      for_packs<T>([&](int first) {
        sum += finish_shared(tile, first, shared_sums(l, n, first, partial),
                             [&] { return load_tile_as<T>(u, tile, first); });
      });
      sums[l.patches.size() + static_cast<std::size_t>(n)] = sum;
    }
  }
  errors.rethrow();
  Sums sum;
  for (const Sums& one : sums) sum += one;
  return sum;
}

/// Held components are not exact: what wholly held cells add to theirs is left out.
template <class S>
template <class T>
void FastBackend<S>::add_products(int level, std::size_t group, const T* x, T* y) const {
  const FastLevel<S>& l = levels_[level];
  if (l.patched.idle(group)) return;
  if (level == 0) {
    finest_products(l.patched, values_of<T>(), scale_, group, x, y);
  } else if constexpr (std::is_same_v<T, S>) {
    if (!l.matrices.is_element(group)) return stored_products(l.patched, l.matrices, group, x, y);
    const CellKind kind = element_kind(level, group);
    element_products(
        l.patched, kind, materials<S>()[kind.material], scale_, group,
        [&](int first) { return l.matrices.rotation(group, first); }, x, y);
  }
}

/// Sums of body(i) over scalars i: fixed chunks, summed in their order, eight sums side
/// by side in each. The same bits for any number of threads.
template <class S>
template <std::size_t kSums, class Body>
std::array<double, kSums> FastBackend<S>::sum_scalars(std::int32_t size, const Body& body) const {
  constexpr std::int32_t kChunk = 4096, kLanes = 8;
  const std::int32_t chunks = (size + kChunk - 1) / kChunk;
  std::vector<std::array<double, kSums>> part(static_cast<std::size_t>(chunks));
  parallel(chunks, kWorthScalars / kChunk, [&](std::int32_t chunk) {
    double sums[kSums][kLanes] = {};
    const std::int32_t begin = chunk * kChunk, end = std::min(size, begin + kChunk);
    for (std::int32_t i = begin; i < end; i += kLanes)  // whole tiles
      for (int k = 0; k < kLanes; ++k) {
        const std::array<double, kSums> one = body(i + k);
        for (std::size_t n = 0; n < kSums; ++n) sums[n][k] += one[n];
      }
    for (std::size_t n = 0; n < kSums; ++n) {
      const double* s = sums[n];
      part[static_cast<std::size_t>(chunk)][n] =
          ((s[0] + s[1]) + (s[2] + s[3])) + ((s[4] + s[5]) + (s[6] + s[7]));
    }
  });
  std::array<double, kSums> out{};
  for (const auto& p : part)
    for (std::size_t n = 0; n < kSums; ++n) out[n] += p[n];
  return out;
}

}  // namespace kerf::cpu
