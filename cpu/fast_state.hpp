// SPDX-License-Identifier: MIT
//
// The state of the fast backend and its loops; what it computes is in fast_backend.cpp (values and
// forces) and fast_cycle.cpp (the cycle and vectors).
#pragma once

#include <algorithm>
#include <memory>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/backend.hpp"
#include "core/base/error.hpp"
#include "core/solve/sparse_cholesky.hpp"
#include "cpu/fast_kernels.hpp"
#include "cpu/packed_level.hpp"

namespace kerf::cpu {

using kernels::Vec3;

inline constexpr std::int32_t kChunk = 512;  // vertices whose norms are summed together

template <class T>
std::size_t bytes_of(const std::vector<T>& array) {
  return array.capacity() * sizeof(T);
}

/// A record: what one cell adds to one vertex, and a fourth scalar that is zero.
template <class S>
struct Record {
  typedef S Vector __attribute__((vector_size(4 * sizeof(S))));
  Vector v{};
};

/// A vector of one level, of the scalars of the cycle or exact.
struct FastVector {
  std::vector<float> single;
  std::vector<double> exact;
  template <class S>
  std::vector<S>& in() {
    if constexpr (std::is_same_v<S, float>)
      return single;
    else
      return exact;
  }
  bool is_exact() const { return single.empty(); }
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

template <class S>
struct FastLevel {
  PackedLevel packed;
  std::vector<S> matrices;                               // [group][300][8], levels above 0
  std::vector<S> inverse_diagonal;                       // six a vertex: xx xy xz yy yz zz
  std::vector<kernels::WeightColumns<Pack<S>>> columns;  // of the weights to the next level
  std::vector<FastVector> vectors;                       // by VectorId
  double bound = 0;                                      // of the spectrum of D^-1 A
  bool solution_is_zero = false;

  std::int32_t vertices() const { return packed.level->vertices(); }
  std::int32_t groups() const { return static_cast<std::int32_t>(packed.groups()); }
  std::uint8_t fixed(std::int32_t v) const { return packed.level->fixed[v]; }
  S* at(int x) { return vectors[x].template in<S>().data(); }
};

template <class S>
Vec3<S> masked(Vec3<S> v, std::uint8_t fixed) {
  for (int c = 0; c < 3; ++c)
    if ((fixed >> c) & 1) v[c] = 0;
  return v;
}
template <class S>
Vec3<S> load_vertex(const S* x, std::int32_t v) {
  const S* at = x + 3 * static_cast<std::size_t>(v);
  return {at[0], at[1], at[2]};
}
template <class S>
void store(S* x, std::int32_t v, const Vec3<S>& value) {
  S* at = x + 3 * static_cast<std::size_t>(v);
  at[0] = value.x;
  at[1] = value.y;
  at[2] = value.z;
}

/// S: scalar of the cycle. Vectors that are added on level 0 are double, and so are forces.
template <class S>
class FastBackend final : public Backend {
 public:
  explicit FastBackend(int threads);  ///< 0: all that OpenMP offers

  const char* name() const noexcept override { return "cpu"; }
  int threads() const noexcept override { return threads_; }
  std::size_t bytes() const override;
  void load(const Hierarchy& hierarchy) override;
  void set_smoother(const SmootherOptions& options) override {
    expects(options.chebyshev,
            "this backend smooths by Chebyshev; Gauss-Seidel needs the reference backend");
    smoother_ = options;
  }
  int add_vector() override;

  void set_operator(const OperatorScale& scale) override;
  void rotate_cells(int displacement) override;
  void read_rotations(std::span<double> out) const override;
  void write_rotations(std::span<const double> in) override;
  void coarsen(int fine) override;
  void prepare(int level) override;
  void factor_coarsest() override;
  void read_cell_matrix(int level, std::int32_t cell, std::span<double> out) const override;
  double spectral_bound(int level) const override { return levels_[level].bound; }

  void smooth(int level, SweepOrder order, int count) override;
  double residual(int level) override;
  void restrict_residual(int fine) override;
  void prolong_correction(int fine) override;
  void solve_coarsest() override;
  void apply(int level, int in, int out) override;
  void precondition_jacobi(int level, int in, int out) override;

  void elastic_force(int displacement, int out) override;
  void apply_scaled(const OperatorScale& scale, int in, int out) override;
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

 private:
  template <class Body>
  void parallel(std::int32_t count, std::int32_t worth, const Body& body) const {
#pragma omp parallel for num_threads(threads_) schedule(static) if (count >= worth)
    for (std::int32_t i = 0; i < count; ++i) body(i);
  }
  static constexpr std::int32_t kWorthMatrices = 8;  // groups whose matrices are made
  static constexpr std::int32_t kWorthGroups = 64;
  static constexpr std::int32_t kWorthVertices = 4096;
  static constexpr std::int32_t kWorthScalars = 65536;

  void allocate(FastVector& vector, std::int32_t vertices, bool exact) const;
  void fill_values(const Hierarchy& hierarchy);
  void round_rotations();
  template <class T>
  const FinestValues<T>& values_of() const;
  template <class T>
  T* records(int level);
  template <class T>
  Vec3<T> sum_records(const PackedLevel& packed, const T* all, std::int32_t v) const;
  template <class T>
  const T* products(int level, const OperatorScale& scale, const T* u);
  template <class T>
  void apply_typed(int level, const OperatorScale& scale, bool masks, int in, int out);
  template <class A, class B>
  double dot_typed(const A* a, const B* b, std::int32_t size) const;
  void add_children(const FastLevel<S>& from, bool finest,
                    const std::int32_t (&child)[Pack<S>::kLanes], Pack<S> (&sum)[kEntries]) const;
  void chebyshev(int level);
  void expects_exact(int in, int out) const {
    ensures(is_exact(0, in) && is_exact(0, out), "a force is asked for in a vector of the cycle");
  }
  bool is_exact(int level, int x) const { return levels_[level].vectors[x].is_exact(); }
  void changed(int level, int x) {
    if (x == kSolution) levels_[level].solution_is_zero = false;
  }

  int threads_;
  const Hierarchy* hierarchy_ = nullptr;
  SmootherOptions smoother_;
  OperatorScale scale_;
  FinestValues<double> exact_;  // of level 0
  FinestValues<S> single_;      // the same, rounded; empty if S is double
  std::vector<FastLevel<S>> levels_;
  int vectors_on_finest_ = kLevelVectors;
  std::vector<double> records_;
  std::vector<Vec3d> faces_;  // of the surface: area normals
  std::unique_ptr<AssembledLevel> coarsest_;
  SparseCholesky coarsest_factor_;
};

template <class S>
template <class T>
const FinestValues<T>& FastBackend<S>::values_of() const {
  if constexpr (std::is_same_v<T, double>)
    return exact_;
  else
    return single_;
}

template <class S>
template <class T>
T* FastBackend<S>::records(int level) {
  const std::size_t scalars = 4 * 8 * levels_[level].packed.cell.size();
  records_.resize(std::max(records_.size(), scalars * sizeof(T) / sizeof(double) + 1));
  return reinterpret_cast<T*>(records_.data());
}

template <class S>
template <class T>
Vec3<T> FastBackend<S>::sum_records(const PackedLevel& packed, const T* all, std::int32_t v) const {
  typename Record<T>::Vector sum{};
  for (std::int32_t k = packed.level->incidence_begin[v]; k < packed.level->incidence_begin[v + 1];
       ++k) {
    typename Record<T>::Vector one;
    __builtin_memcpy(&one, all + 4 * static_cast<std::size_t>(packed.record[k]), sizeof one);
    sum += one;
  }
  return {sum[0], sum[1], sum[2]};
}

template <class S>
template <class T>
const T* FastBackend<S>::products(int level, const OperatorScale& scale, const T* u) {
  FastLevel<S>& l = levels_[level];
  T* out = records<T>(level);
  parallel(l.groups(), kWorthGroups, [&](std::int32_t g) {
    const auto group = static_cast<std::size_t>(g);
    if (level == 0) {
      finest_products(l.packed, values_of<T>(), scale, group, u, out);
    } else if constexpr (std::is_same_v<T, S>) {
      stored_products(l.packed, l.matrices.data(), group, u, out);
    }
  });
  return out;
}

template <class S>
template <class A, class B>
double FastBackend<S>::dot_typed(const A* a, const B* b, std::int32_t size) const {
  constexpr std::int32_t kLanes = 8;
  const std::int32_t chunks = (size + kChunk * kLanes - 1) / (kChunk * kLanes);
  std::vector<double> part(static_cast<std::size_t>(chunks));
  parallel(chunks, kWorthScalars / (kChunk * kLanes), [&](std::int32_t chunk) {
    double sums[kLanes] = {};
    std::int32_t i = chunk * kChunk * kLanes;
    const std::int32_t end = std::min(size, i + kChunk * kLanes);
    for (; i + kLanes <= end; i += kLanes)
      for (int k = 0; k < kLanes; ++k)
        sums[k] += static_cast<double>(a[i + k]) * static_cast<double>(b[i + k]);
    for (int k = 0; i < end; ++i, ++k)
      sums[k] += static_cast<double>(a[i]) * static_cast<double>(b[i]);
    part[static_cast<std::size_t>(chunk)] =
        ((sums[0] + sums[1]) + (sums[2] + sums[3])) + ((sums[4] + sums[5]) + (sums[6] + sums[7]));
  });
  double sum = 0;
  for (const double p : part) sum += p;
  return sum;
}

}  // namespace kerf::cpu
