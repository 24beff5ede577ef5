// SPDX-License-Identifier: MIT
//
// Two passes as in the reference backend: cells write records, vertices sum them in their fixed
// order. Each lane does what the shared bodies of kernels/ do for a scalar, eight cells at a time,
// and what follows a sum (residual, step of Chebyshev) is done while it is in registers.
#include "cpu/fast_backend.hpp"

#include <omp.h>

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/base/error.hpp"
#include "core/solve/sparse_cholesky.hpp"
#include "core/solve/spectrum.hpp"
#include "cpu/fast_kernels.hpp"
#include "cpu/packed_level.hpp"
#include "cpu/surface_loops.hpp"

namespace kerf {
namespace {

using namespace cpu;
using kernels::Vec3;

constexpr int kMaxThreads = 1024;
constexpr std::int32_t kChunk = 512;  // vertices whose norms are summed together

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
  explicit FastBackend(int threads)
      : threads_(threads > 0 ? threads : omp_get_max_threads()),
        coarsest_factor_(CholeskyEngine::simplicial) {
    expects(threads >= 0 && threads <= kMaxThreads,
            text("solver.threads must lie in 0 .. ", kMaxThreads, "; 0 takes all cores"));
  }

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
std::size_t FastBackend<S>::bytes() const {
  std::size_t sum = bytes_of(records_) + bytes_of(faces_);
  const auto add_values = [&](const auto& values) {
    sum += bytes_of(values.rotation) + bytes_of(values.stiffness) + bytes_of(values.mass) +
           bytes_of(values.side) + bytes_of(values.materials);
  };
  add_values(exact_);
  add_values(single_);
  for (const FastLevel<S>& level : levels_) {
    sum += level.packed.bytes() + bytes_of(level.matrices) + bytes_of(level.inverse_diagonal);
    for (const FastVector& vector : level.vectors)
      sum += bytes_of(vector.single) + bytes_of(vector.exact);
  }
  if (coarsest_) sum += coarsest_->value.capacity() * 12 + coarsest_factor_.factor_entries() * 12;
  return sum;
}

// Three scalars a vertex, three of the vertex that padding lanes read, and one that loads of four
// reach beyond.
template <class S>
void FastBackend<S>::allocate(FastVector& vector, std::int32_t vertices, bool exact) const {
  const std::size_t size = 3 * static_cast<std::size_t>(vertices) + 4;
  vector.single.clear();
  vector.exact.clear();
  if (exact || std::is_same_v<S, double>)
    vector.exact.assign(size, 0.0);
  else
    vector.single.assign(size, 0.0F);
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

template <class S>
void FastBackend<S>::fill_values(const Hierarchy& hierarchy) {
  const PackedLevel& packed = levels_[0].packed;
  const auto fill = [&](auto& values) {
    using T = std::decay_t<decltype(values.stiffness[0])>;
    const std::size_t lanes = packed.cell.size();
    values.stiffness.assign(lanes, 0);
    values.mass.assign(lanes, 0);
    values.side.assign(lanes, 1);
    values.rotation.assign(4 * lanes, 0);
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      values.rotation[4 * kGroup * (lane / kGroup) + lane % kGroup] = 1;
      const std::int32_t c = packed.cell[lane];
      if (c < 0) continue;
      values.stiffness[lane] = static_cast<T>(hierarchy.values[c].stiffness);
      values.mass[lane] = static_cast<T>(hierarchy.values[c].mass);
      values.side[lane] = static_cast<T>(hierarchy.spacing * (1 << packed.level->size_log2[c]));
    }
    values.materials.clear();
    for (const double poisson : hierarchy.poisson)
      values.materials.push_back(pack_material<T>(poisson, hierarchy.lumped_mass));
  };
  fill(exact_);
  if constexpr (!std::is_same_v<S, double>) fill(single_);
}

template <class S>
void FastBackend<S>::load(const Hierarchy& hierarchy) {
  hierarchy_ = &hierarchy;
  levels_.resize(hierarchy.levels.size());
  for (std::size_t l = 0; l < levels_.size(); ++l) {
    FastLevel<S>& level = levels_[l];
    level.packed = pack_level(hierarchy, l, l == 0 ? nullptr : &levels_[l - 1].packed);
    level.columns.clear();
    for (const Weights& w : l == 0 ? level.packed.from_corners : level.packed.from_slots)
      level.columns.push_back(columns_of<Pack<S>>(w));
    level.bound = 0;
    level.solution_is_zero = false;
    level.vectors.resize(l == 0 ? vectors_on_finest_ : kLevelVectors);
    for (std::size_t x = 0; x < level.vectors.size(); ++x)
      allocate(level.vectors[x], level.vertices(), x >= kLevelVectors);
    level.inverse_diagonal.assign(6 * level.packed.vertices(), 0);
    level.matrices.assign(l == 0 ? 0 : kEntries * level.packed.cell.size(), 0);
  }
  fill_values(hierarchy);
  coarsest_ = std::make_unique<AssembledLevel>(hierarchy.levels.back());
  coarsest_factor_.analyse(*coarsest_);
}

template <class S>
int FastBackend<S>::add_vector() {
  if (!levels_.empty()) {
    levels_[0].vectors.emplace_back();
    allocate(levels_[0].vectors.back(), levels_[0].vertices(), true);
  }
  return vectors_on_finest_++;
}

template <class S>
void FastBackend<S>::set_operator(const OperatorScale& scale) {
  if (scale.stiffness != scale_.stiffness || scale.mass != scale_.mass)
    for (FastLevel<S>& level : levels_) level.bound = 0;
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
  const double* u = levels_[0].vectors[displacement].exact.data();
  parallel(levels_[0].groups(), kWorthGroups, [&](std::int32_t g) {
    rotate_group(levels_[0].packed, exact_, static_cast<std::size_t>(g), u);
  });
  round_rotations();
}

template <class S>
void FastBackend<S>::read_rotations(std::span<double> out) const {
  const PackedLevel& packed = levels_[0].packed;
  for (std::size_t c = 0; c < packed.lane.size(); ++c) {
    const auto lane = static_cast<std::size_t>(packed.lane[c]);
    for (std::size_t k = 0; k < 4; ++k)
      out[4 * c + k] = exact_.rotation[4 * kGroup * (lane / kGroup) + kGroup * k + lane % kGroup];
  }
}

template <class S>
void FastBackend<S>::write_rotations(std::span<const double> in) {
  const PackedLevel& packed = levels_[0].packed;
  for (std::size_t c = 0; c < packed.lane.size(); ++c) {
    const auto lane = static_cast<std::size_t>(packed.lane[c]);
    for (std::size_t k = 0; k < 4; ++k)
      exact_.rotation[4 * kGroup * (lane / kGroup) + kGroup * k + lane % kGroup] = in[4 * c + k];
  }
  round_rotations();
}

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
template <class T>
void FastBackend<S>::apply_typed(int level, const OperatorScale& scale, bool masks, int in,
                                 int out) {
  FastLevel<S>& l = levels_[level];
  const T* all = products<T>(level, scale, l.vectors[in].template in<T>().data());
  T* to = l.vectors[out].template in<T>().data();
  parallel(l.vertices(), kWorthVertices, [&](std::int32_t v) {
    store(to, v, masked(sum_records(l.packed, all, v), masks ? l.fixed(v) : std::uint8_t{0}));
  });
}

template <class S>
void FastBackend<S>::apply(int level, int in, int out) {
  ensures(is_exact(level, in) == is_exact(level, out), "apply mixes vectors of two precisions");
  changed(level, out);
  if (is_exact(level, in))
    apply_typed<double>(level, scale_, true, in, out);
  else
    apply_typed<S>(level, scale_, true, in, out);
}

template <class S>
void FastBackend<S>::apply_scaled(const OperatorScale& scale, int in, int out) {
  expects_exact(in, out);
  apply_typed<double>(0, scale, false, in, out);
}

template <class S>
void FastBackend<S>::elastic_force(int displacement, int out) {
  expects_exact(displacement, out);
  FastLevel<S>& l = levels_[0];
  const double* u = l.vectors[displacement].exact.data();
  double* all = records<double>(0);
  parallel(l.groups(), kWorthGroups, [&](std::int32_t g) {
    elastic_records(l.packed, exact_, static_cast<std::size_t>(g), u, all);
  });
  double* to = l.vectors[out].exact.data();
  parallel(l.vertices(), kWorthVertices,
           [&](std::int32_t v) { store(to, v, sum_records<double>(l.packed, all, v)); });
}

// The n-th children of the coarse cells in the lanes: their matrices and their weights.
template <class S>
void FastBackend<S>::add_children(const FastLevel<S>& from, bool finest,
                                  const std::int32_t (&child)[Pack<S>::kLanes],
                                  Pack<S> (&sum)[kEntries]) const {
  using P = Pack<S>;
  const PackedLevel& packed = from.packed;
  P full[24][24];
  bool over_slots = true;
  if (finest) {
    const FinestLanes<S> lanes(packed, values_of<S>(), scale_, child);
    corner_matrices(packed, values_of<S>(), lanes, full);
    // Held components are those of slots, so there the way from corners has two steps.
    over_slots = lanes.any_fixed;
    if (lanes.any_fixed && lanes.any_folded) fold_matrices(packed, lanes, full);
    if (lanes.any_fixed) mask_matrices(packed, lanes, full);
  } else {
    stored_matrices(packed, from.matrices.data(), child, full);
  }
  const std::vector<Weights>& table = over_slots ? packed.from_slots : packed.from_corners;
  const Weights* w[P::kLanes];
  std::int32_t first = -1;
  bool alike = over_slots != finest;  // the columns that are at hand
  for (int k = 0; k < P::kLanes; ++k) {
    w[k] = nullptr;
    if (child[k] < 0) continue;  // its matrix is zero
    const std::int32_t index = packed.weights[child[k]];
    w[k] = &table[static_cast<std::size_t>(index)];
    alike = alike && (first < 0 || index == first);
    first = index;
  }
  if (alike)
    add_product(full, from.columns[static_cast<std::size_t>(first)], sum);
  else
    add_product(full, columns_of<P>(w), sum);
}

template <class S>
void FastBackend<S>::coarsen(int fine) {
  using P = Pack<S>;
  const FastLevel<S>& from = levels_[fine];
  FastLevel<S>& to = levels_[fine + 1];
  const Level& coarse = *to.packed.level;
  parallel(to.groups(), kWorthMatrices, [&](std::int32_t g) {
    for_packs<S>([&](int first) {
      const std::int32_t* cells = to.packed.cell.data() + kGroup * g + first;
      P sum[kEntries] = {};
      for (std::int32_t n = 0;; ++n) {
        std::int32_t child[P::kLanes];
        bool any = false;
        for (int k = 0; k < P::kLanes; ++k) {
          child[k] = -1;
          if (cells[k] < 0) continue;
          const std::int32_t at = coarse.child_begin[cells[k]] + n;
          if (at >= coarse.child_begin[cells[k] + 1]) continue;
          child[k] = coarse.children[at];
          any = true;
        }
        if (!any) break;
        add_children(from, fine == 0, child, sum);
      }
      S* tile = to.matrices.data() + kEntries * kGroup * static_cast<std::size_t>(g) + first;
      for (int e = 0; e < kEntries; ++e) store_pack(tile + kGroup * e, sum[e]);
    });
  });
}

template <class S>
void FastBackend<S>::prepare(int level) {
  FastLevel<S>& l = levels_[level];
  const std::size_t scalars = 8 * 8 * l.packed.cell.size();  // six of eight a record
  records_.resize(std::max(records_.size(), scalars * sizeof(S) / sizeof(double) + 1));
  S* const blocks = reinterpret_cast<S*>(records_.data());
  parallel(l.groups(), kWorthGroups, [&](std::int32_t g) {
    const auto group = static_cast<std::size_t>(g);
    if (level == 0)
      finest_diagonals(l.packed, values_of<S>(), scale_, group, blocks);
    else
      stored_diagonals(l.matrices.data(), group, blocks);
  });
  parallel(l.vertices(), kWorthVertices, [&](std::int32_t v) {
    kernels::Sym3<S> sum{};
    for (std::int32_t k = l.packed.level->incidence_begin[v];
         k < l.packed.level->incidence_begin[v + 1]; ++k) {
      const S* b = blocks + 8 * static_cast<std::size_t>(l.packed.record[k]);
      sum += kernels::Sym3<S>{b[0], b[1], b[2], b[4], b[5], b[6]};
    }
    const std::uint8_t fixed = l.fixed(v);
    if (fixed & 1) sum.xx = sum.xy = sum.xz = 0;
    if (fixed & 2) sum.yy = sum.xy = sum.yz = 0;
    if (fixed & 4) sum.zz = sum.xz = sum.yz = 0;
    const auto inverse = kernels::inverse_semidefinite(sum);
    S* to = l.inverse_diagonal.data() + 6 * static_cast<std::size_t>(v);
    to[0] = inverse.xx, to[1] = inverse.xy, to[2] = inverse.xz;
    to[3] = inverse.yy, to[4] = inverse.yz, to[5] = inverse.zz;
  });
  if (l.bound == 0 && level + 1 < static_cast<int>(levels_.size()))
    l.bound = estimate_spectral_bound(*this, level, *l.packed.level);
}

template <class S>
void FastBackend<S>::read_cell_matrix(int level, std::int32_t cell, std::span<double> out) const {
  const FastLevel<S>& l = levels_[level];
  std::int32_t cells[Pack<double>::kLanes];
  std::fill(std::begin(cells), std::end(cells), -1);
  cells[0] = cell;
  if (level == 0) {
    Pack<double> full[24][24];
    const FinestLanes<double> lanes(l.packed, exact_, scale_, cells);
    corner_matrices(l.packed, exact_, lanes, full);
    if (lanes.any_folded) fold_matrices(l.packed, lanes, full);
    if (lanes.any_fixed) mask_matrices(l.packed, lanes, full);
    for (int i = 0; i < 24; ++i)
      for (int j = 0; j <= i; ++j)
        out[static_cast<std::size_t>(kernels::packed_index(i, j))] = full[i][j][0];
    return;
  }
  const auto lane = static_cast<std::size_t>(l.packed.lane[cell]);
  for (std::size_t e = 0; e < kEntries; ++e)
    out[e] = l.matrices[kEntries * kGroup * (lane / kGroup) + kGroup * e + lane % kGroup];
}

template <class S>
void FastBackend<S>::factor_coarsest() {
  const int last = static_cast<int>(levels_.size()) - 1;
  coarsest_->assemble(hierarchy_->levels.back(), [&](std::int32_t cell, std::span<double> out) {
    read_cell_matrix(last, cell, out);
  });
  if (last > 0) coarsest_->strengthen_diagonal();
  expects(
      coarsest_factor_.factor(*coarsest_),
      "the system matrix is not positive definite: in static mode some part of the body can move "
      "freely and needs a [[support]]; otherwise sizes, moduli or the time step are out of range");
}

template <class S>
double FastBackend<S>::residual(int level) {
  FastLevel<S>& l = levels_[level];
  const S* f = l.at(kRight);
  S* r = l.at(kResidual);
  const S* all = l.solution_is_zero ? nullptr : products<S>(level, scale_, l.at(kSolution));
  parallel(l.vertices(), kWorthVertices, [&](std::int32_t v) {
    Vec3<S> at = load_vertex(f, v);
    if (all != nullptr) at -= masked(sum_records(l.packed, all, v), l.fixed(v));
    store(r, v, at);
  });
  return std::sqrt(dot_typed(r, r, 3 * l.vertices()));
}

template <class S>
void FastBackend<S>::smooth(int level, SweepOrder, int count) {
  for (int i = 0; i < count; ++i) chebyshev(level);
}

// Chebyshev acceleration of block Jacobi on [smallest, 1] * bound; residual, direction and update
// of a vertex in one pass behind the sum of its records.
// Source  Adams, Brezina, Hu, Tuminaro 2003 [ABHT03]; Saad 2003, algorithm 12.1.
template <class S>
void FastBackend<S>::chebyshev(int level) {
  FastLevel<S>& l = levels_[level];
  const double upper = l.bound, lower = smoother_.smallest * upper;
  const double theta = 0.5 * (upper + lower), delta = 0.5 * (upper - lower);
  const double sigma = theta / delta;
  double rho = 1 / sigma;
  S *u = l.at(kSolution), *d = l.at(kDirection);
  const S* f = l.at(kRight);
  for (int step = 0; step < smoother_.degree; ++step) {
    const double next = step == 0 ? rho : 1 / (2 * sigma - rho);
    const S keep = static_cast<S>(step == 0 ? 0 : next * rho);
    const S take = static_cast<S>(step == 0 ? 1 / theta : 2 * next / delta);
    rho = next;
    const S* all = l.solution_is_zero ? nullptr : products<S>(level, scale_, u);
    l.solution_is_zero = false;
    parallel(l.vertices(), kWorthVertices, [&](std::int32_t v) {
      Vec3<S> r = load_vertex(f, v), before{};
      if (all != nullptr) {
        r -= masked(sum_records(l.packed, all, v), l.fixed(v));
        before = load_vertex(u, v);
      }
      const S* b = l.inverse_diagonal.data() + 6 * static_cast<std::size_t>(v);
      Vec3<S> direction = take * (kernels::Sym3<S>{b[0], b[1], b[2], b[3], b[4], b[5]} * r);
      if (step > 0) direction += keep * load_vertex(d, v);
      store(d, v, direction);
      store(u, v, before + direction);
    });
  }
}

template <class S>
void FastBackend<S>::restrict_residual(int fine) {
  const FastLevel<S>& from = levels_[fine];
  FastLevel<S>& to = levels_[fine + 1];
  const SparseWeights& rows = from.packed.restrict_;
  const S* r = levels_[fine].at(kResidual);
  S* f = to.at(kRight);
  parallel(to.vertices(), kWorthVertices / 8, [&](std::int32_t v) {
    Vec3<S> sum{};
    for (std::int32_t k = rows.begin[v]; k < rows.begin[v + 1]; ++k)
      sum += static_cast<S>(rows.weight[k]) * load_vertex(r, rows.vertex[k]);
    store(f, v, masked(sum, to.fixed(v)));
  });
  zero(fine + 1, kSolution);
}

template <class S>
void FastBackend<S>::prolong_correction(int fine) {
  FastLevel<S>& to = levels_[fine];
  const SparseWeights& rows = to.packed.prolong;
  const S* coarse = levels_[fine + 1].at(kSolution);
  changed(fine, kSolution);
  S* u = to.at(kSolution);
  parallel(to.vertices(), kWorthVertices, [&](std::int32_t v) {
    Vec3<S> sum{};
    for (std::int32_t k = rows.begin[v]; k < rows.begin[v + 1]; ++k)
      sum += static_cast<S>(rows.weight[k]) * load_vertex(coarse, rows.vertex[k]);
    store(u, v, load_vertex(u, v) + masked(sum, to.fixed(v)));
  });
}

template <class S>
void FastBackend<S>::solve_coarsest() {
  FastLevel<S>& l = levels_.back();
  l.solution_is_zero = false;
  const std::size_t size = 3 * l.packed.vertices();
  std::vector<double> right(size), solution(size);
  std::copy_n(l.at(kRight), size, right.begin());
  coarsest_factor_.solve(right, solution);
  for (std::size_t i = 0; i < size; ++i) l.at(kSolution)[i] = static_cast<S>(solution[i]);
}

template <class S>
void FastBackend<S>::precondition_jacobi(int level, int in, int out) {
  FastLevel<S>& l = levels_[level];
  changed(level, out);
  with_types(l.vectors[in], l.vectors[out], [&](const auto* from, auto* to) {
    using T = std::decay_t<decltype(*to)>;
    parallel(l.vertices(), kWorthVertices, [&](std::int32_t v) {
      const S* b = l.inverse_diagonal.data() + 6 * static_cast<std::size_t>(v);
      const auto at = load_vertex(from, v);
      const Vec3<S> r{static_cast<S>(at.x), static_cast<S>(at.y), static_cast<S>(at.z)};
      const Vec3<S> z = kernels::Sym3<S>{b[0], b[1], b[2], b[3], b[4], b[5]} * r;
      store(to, v, Vec3<T>{static_cast<T>(z.x), static_cast<T>(z.y), static_cast<T>(z.z)});
    });
  });
}

template <class S>
void FastBackend<S>::move_points(std::span<const BoundPoint> points, int displacement,
                                 std::span<Vec3d> positions) {
  cpu::move_points(*levels_[0].packed.level, points, levels_[0].vectors[displacement].exact.data(),
                   positions, threads_);
}

template <class S>
void FastBackend<S>::surface_normals(const SurfaceView& surface, std::span<const Vec3d> positions,
                                     std::span<Vec3d> normals) {
  cpu::surface_normals(surface, positions, normals, faces_, threads_);
}

template <class S>
void FastBackend<S>::zero(int level, int x) {
  FastVector& vector = levels_[level].vectors[x];
  std::fill(vector.single.begin(), vector.single.end(), 0.0F);
  std::fill(vector.exact.begin(), vector.exact.end(), 0.0);
  if (x == kSolution) levels_[level].solution_is_zero = true;
}

template <class S>
void FastBackend<S>::copy(int level, int from, int to) {
  changed(level, to);
  FastLevel<S>& l = levels_[level];
  with_types(l.vectors[from], l.vectors[to], [&](const auto* a, auto* b) {
    using T = std::decay_t<decltype(*b)>;
    parallel(3 * l.vertices(), kWorthScalars, [&](std::int32_t i) { b[i] = static_cast<T>(a[i]); });
  });
}

template <class S>
void FastBackend<S>::combine(int level, double a, int x, double b, int y) {
  changed(level, y);
  FastLevel<S>& l = levels_[level];
  with_types(l.vectors[x], l.vectors[y], [&](const auto* from, auto* to) {
    using T = std::decay_t<decltype(*to)>;
    const T p = static_cast<T>(a), q = static_cast<T>(b);
    parallel(3 * l.vertices(), kWorthScalars,
             [&](std::int32_t i) { to[i] = p * static_cast<T>(from[i]) + q * to[i]; });
  });
}

// Fixed chunks, summed in their order, eight sums side by side in each: the same bits for any
// number of threads.
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

template <class S>
double FastBackend<S>::dot(int level, int x, int y) {
  FastLevel<S>& l = levels_[level];
  double out = 0;
  with_types(l.vectors[x], l.vectors[y],
             [&](const auto* a, const auto* b) { out = dot_typed(a, b, 3 * l.vertices()); });
  return out;
}

template <class S>
void FastBackend<S>::mask(int level, int x) {
  changed(level, x);
  FastLevel<S>& l = levels_[level];
  with_types(l.vectors[x], l.vectors[x], [&](const auto*, auto* values) {
    parallel(l.vertices(), kWorthVertices,
             [&](std::int32_t v) { store(values, v, masked(load_vertex(values, v), l.fixed(v))); });
  });
}

template <class S>
void FastBackend<S>::write(int level, int x, std::span<const double> values) {
  changed(level, x);
  FastLevel<S>& l = levels_[level];
  expects(values.size() == 3 * l.packed.vertices(), "write: three values per vertex of the level");
  with_types(l.vectors[x], l.vectors[x], [&](const auto*, auto* to) {
    using T = std::decay_t<decltype(*to)>;
    for (std::size_t i = 0; i < values.size(); ++i) to[i] = static_cast<T>(values[i]);
  });
}

template <class S>
void FastBackend<S>::read(int level, int x, std::span<double> values) const {
  const FastLevel<S>& l = levels_[level];
  expects(values.size() == 3 * l.packed.vertices(), "read: three values per vertex of the level");
  with_types(l.vectors[x], l.vectors[x], [&](const auto* from, const auto*) {
    std::copy_n(from, values.size(), values.begin());
  });
}

}  // namespace

std::unique_ptr<Backend> make_fast_backend(const FastOptions& options) {
  if (options.single_cycle) return std::make_unique<FastBackend<float>>(options.threads);
  return std::make_unique<FastBackend<double>>(options.threads);
}

}  // namespace kerf
