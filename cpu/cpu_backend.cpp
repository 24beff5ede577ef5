// SPDX-License-Identifier: MIT
//
// Two passes make every operator free of conflicts: each cell writes what it adds to its slots,
// then each vertex gathers its incidences in their fixed order. No atomics, and the same bits for
// any number of threads.
#include "cpu/cpu_backend.hpp"

#include <omp.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "core/base/error.hpp"
#include "core/solve/sparse_cholesky.hpp"
#include "core/solve/spectrum.hpp"
#include "cpu/instruction_set.hpp"
#include "cpu/level_store.hpp"
#include "cpu/near_loops.hpp"
#include "cpu/parallel_errors.hpp"
#include "cpu/surface_loops.hpp"
#include "kernels/coarsen.hpp"
#include "kernels/relax.hpp"
#include "kernels/rotation.hpp"
#include "kernels/transfer.hpp"

namespace kerf {
namespace {

using namespace cpu;

constexpr int kMaxThreads = 1024;

class CpuBackend final : public Backend {
 public:
  explicit CpuBackend(const CpuOptions& options)
      : threads_(options.threads > 0 ? options.threads : omp_get_max_threads()),
        tile_log2_(options.tile_log2),
        updates_(options.updates),
        coarsest_factor_(CholeskyEngine::simplicial) {
    expects(options.threads >= 0 && options.threads <= kMaxThreads,
            text("solver.threads must lie in 0 .. ", kMaxThreads, "; 0 takes all cores"));
    expects(options.tile_log2 >= 0 && options.tile_log2 <= 6, "tile_log2 must lie in 0 .. 6");
  }

  const char* name() const noexcept override { return "reference"; }
  const char* instruction_set() const noexcept override { return kInstructionSet; }
  int threads() const noexcept override { return threads_; }
  Workers workers() const override { return workers_of(threads_); }
  std::size_t bytes() const override;
  void load(const Hierarchy& hierarchy) override;
  bool can_update() const noexcept override { return updates_; }
  void update(const Hierarchy& hierarchy, const HierarchyChange& change) override;
  void set_smoother(const SmootherOptions& options) override { smoother_ = options; }
  int add_vector() override;

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
  void write_some(int level, int x, std::span<const std::int32_t> vertices,
                  std::span<const double> values) override;
  void read_some(int level, int x, std::span<const std::int32_t> vertices,
                 std::span<double> values) const override;
  NearCells find_near(int displacement, const BladeReach& reach,
                      std::span<const std::int32_t> opened) const override;

 private:
  // Calls body(i) for i in [0, count), the range cut into one slab a thread. Below `worth` items,
  // waking the threads costs more than the loop, and far more on a machine with other work.
  template <class Body>
  void parallel(std::int32_t count, const Body& body, std::int32_t worth = kWorthCells) const {
#pragma omp parallel for num_threads(threads_) schedule(static) if (count >= worth)
    for (std::int32_t i = 0; i < count; ++i) body(i);
  }
  static constexpr std::int32_t kWorthCells = 512;      // hundreds of operations an item
  static constexpr std::int32_t kWorthVertices = 4096;  // tens
  static constexpr std::int32_t kWorthScalars = 65536;  // one or two
  void fit_to_levels();
  template <class CellBody>
  void cells_to_vertices(LevelStore& store, double* out, bool masks, const CellBody& body);
  void gauss_seidel(LevelStore& store, int level, SweepOrder order);
  void chebyshev(LevelStore& store, int level);

  double* data(int level, int x) { return levels_[level].vectors[x].data(); }
  // Every change of a vector passes here, so that a zero solution is known as such.
  double* changed(int level, int x) {
    if (x == kSolution) levels_[level].solution_is_zero = false;
    return data(level, x);
  }

  int threads_;
  int tile_log2_;
  bool updates_;
  const Hierarchy* hierarchy_ = nullptr;
  SmootherOptions smoother_;
  FinestStore finest_;
  std::vector<LevelStore> levels_;
  int vectors_on_finest_ = kLevelVectors;
  std::vector<Vec> faces_;  // of the surface: area normals
  std::unique_ptr<AssembledLevel> coarsest_;
  SparseCholesky coarsest_factor_;
  bool factored_ = false;
};

std::size_t CpuBackend::bytes() const {
  std::size_t sum =
      finest_.rotation.capacity() * sizeof(Quaternion) + faces_.capacity() * sizeof(Vec);
  for (const LevelStore& store : levels_) sum += store.bytes();
  if (coarsest_) sum += coarsest_->value.capacity() * 12 + coarsest_factor_.factor_entries() * 12;
  return sum;
}

void CpuBackend::load(const Hierarchy& hierarchy) {
  hierarchy_ = &hierarchy;
  finest_.spacing = hierarchy.spacing;
  finest_.values = &hierarchy.values;
  finest_.rotation.assign(hierarchy.values.size(), Quaternion{});
  finest_.mass = hierarchy.lumped_mass ? kernels::unit_hex_mass_lumped<double>()
                                       : kernels::unit_hex_mass<double>();
  finest_.materials.clear();
  const auto model =
      hierarchy.lumped_mass ? kernels::MassModel::lumped : kernels::MassModel::consistent;
  for (const double poisson : hierarchy.poisson)
    finest_.materials.push_back(
        {kernels::unit_hex_stiffness(poisson), kernels::mode_constants(poisson, model)});

  levels_.resize(hierarchy.levels.size());
  for (std::size_t l = 0; l < levels_.size(); ++l) {
    LevelStore& store = levels_[l];
    store.level = &hierarchy.levels[l];
    store.finest = l == 0 ? &finest_ : nullptr;
    store.tile_log2 = tile_log2_;
    store.vectors.clear();
    store.vectors.resize(l == 0 ? vectors_on_finest_ : kLevelVectors);
  }
  fit_to_levels();
}

// Arrays of the sizes of the levels. Vectors are longer by zeros; of the rest nothing is kept.
void CpuBackend::fit_to_levels() {
  for (std::size_t l = 0; l < levels_.size(); ++l) {
    LevelStore& store = levels_[l];
    store.bound = 0;
    store.solution_is_zero = false;
    store.colours = {};
    for (auto& vector : store.vectors)
      resize_with_room(vector, 3 * static_cast<std::size_t>(store.vertices()));
    resize_with_room(store.products, 8 * static_cast<std::size_t>(store.cells()));
    resize_with_room(store.inverse_diagonal, store.vertices());
    if (l > 0)
      resize_with_room(store.matrices, kernels::tiled_size(static_cast<std::size_t>(store.cells()),
                                                           kEntries, tile_log2_));
  }
  coarsest_ = std::make_unique<AssembledLevel>(*levels_.back().level);
  coarsest_factor_.analyse(*coarsest_);
  factored_ = false;
}

void CpuBackend::update(const Hierarchy& hierarchy, const HierarchyChange& change) {
  ensures(&hierarchy == hierarchy_ && change.levels.size() == levels_.size(),
          "a change is not one of the hierarchy that was loaded");
  for (const std::int32_t origin : change.levels[0].origin)
    finest_.rotation.push_back(finest_.rotation[origin]);
  fit_to_levels();
}

int CpuBackend::add_vector() {
  if (!levels_.empty())
    levels_[0].vectors.emplace_back(3 * static_cast<std::size_t>(levels_[0].vertices()), 0.0);
  return vectors_on_finest_++;
}

void CpuBackend::set_operator(const OperatorScale& scale) {
  if (scale.stiffness != finest_.scale.stiffness || scale.mass != finest_.scale.mass) {
    for (LevelStore& store : levels_) store.bound = 0;
    factored_ = false;
  }
  finest_.scale = scale;
}

void CpuBackend::rotate_cells(int displacement) {
  const LevelStore& store = levels_[0];
  const double* u = store.vectors[displacement].data();
  parallel(store.cells(), [&](std::int32_t cell) {
    Vec slots[8], corners[8];
    for (int i = 0; i < 8; ++i) slots[i] = cpu::load(u, store.level->slots[cell][i]);
    kernels::unfold(slots, store.level->fold[cell], corners);
    const double side = finest_.spacing * (1 << store.level->size_log2[cell]);
    finest_.rotation[cell] =
        kernels::extract_rotation(kernels::mean_gradient(corners, side), finest_.rotation[cell]);
  });
}

void CpuBackend::read_rotations(std::span<double> out) const {
  for (std::size_t c = 0; c < finest_.rotation.size(); ++c) {
    const Quaternion& q = finest_.rotation[c];
    out[4 * c] = q.w;
    out[4 * c + 1] = q.x;
    out[4 * c + 2] = q.y;
    out[4 * c + 3] = q.z;
  }
}

void CpuBackend::write_rotations(std::span<const double> in) {
  for (std::size_t c = 0; c < finest_.rotation.size(); ++c)
    finest_.rotation[c] = {in[4 * c], in[4 * c + 1], in[4 * c + 2], in[4 * c + 3]};
}

void CpuBackend::coarsen(int fine) {
  const LevelStore& from = levels_[fine];
  LevelStore& to = levels_[fine + 1];
  parallel(to.cells(), [&](std::int32_t cell) {
    double sum[kEntries] = {};
    for (const std::int32_t child : to.level->children_of(cell)) {
      double packed[kEntries];
      cpu::cell_matrix(from, child, packed);
      if (from.level->place[child] == Level::kPassed) {
        for (int e = 0; e < kEntries; ++e) sum[e] += packed[e];
        continue;
      }
      double weights[8][8];
      kernels::transfer_weights(from.level->fold[child], from.level->place[child],
                                to.level->fold[cell], weights);
      kernels::coarsen_cell(static_cast<const double*>(packed), weights, static_cast<double*>(sum));
    }
    const auto A = kernels::cell_entries(to.matrices.data(), static_cast<std::size_t>(cell),
                                         kEntries, tile_log2_);
    for (int e = 0; e < kEntries; ++e) A[e] = sum[e];
  });
}

void CpuBackend::prepare(int level) {
  LevelStore& store = levels_[level];
  const Level& l = *store.level;
  parallel(store.vertices(), [&](std::int32_t v) {
    Sym sum{};
    for (const std::int32_t k : l.incidences_of(v)) sum += cpu::diagonal_block(store, k / 8, k % 8);
    const std::uint8_t fixed = l.fixed[v];
    if (fixed & 1) sum.xx = sum.xy = sum.xz = 0;
    if (fixed & 2) sum.yy = sum.xy = sum.yz = 0;
    if (fixed & 4) sum.zz = sum.xz = sum.yz = 0;
    store.inverse_diagonal[v] = kernels::inverse_semidefinite(sum);
  });
  if (store.bound == 0 && level + 1 < static_cast<int>(levels_.size()))
    store.bound = estimate_spectral_bound(*this, level, l);
}

void CpuBackend::factor_coarsest() {
  const LevelStore& store = levels_.back();
  coarsest_->assemble(*store.level, [&](std::int32_t cell, std::span<double> out) {
    double packed[kEntries];
    cpu::cell_matrix(store, cell, packed);
    std::copy_n(packed, kEntries, out.data());
  });
  if (levels_.size() > 1) coarsest_->strengthen_diagonal(AssembledLevel::kShare);
  factored_ = coarsest_factor_.factor(*coarsest_);
  expects(
      factored_,
      "the system matrix is not positive definite: in static mode some part of the body can move "
      "freely and needs a [[support]]; otherwise sizes, moduli or the time step are out of range");
}

void CpuBackend::read_cell_matrix(int level, std::int32_t cell, std::span<double> out) const {
  double packed[kEntries];
  cpu::cell_matrix(levels_[level], cell, packed);
  std::copy_n(packed, kEntries, out.data());
}

template <class CellBody>
void CpuBackend::cells_to_vertices(LevelStore& store, double* out, bool masks,
                                   const CellBody& body) {
  const Level& l = *store.level;
  parallel(store.cells(), [&](std::int32_t cell) {
    Vec f[8];
    body(cell, f);
    std::copy_n(f, 8, store.products.begin() + 8 * static_cast<std::ptrdiff_t>(cell));
  });
  parallel(
      store.vertices(),
      [&](std::int32_t v) {
        Vec sum{};
        for (const std::int32_t k : l.incidences_of(v)) sum += store.products[k];
        cpu::store(out, v, masks ? masked(sum, l.fixed[v]) : sum);
      },
      kWorthVertices);
}

void CpuBackend::apply(int level, int in, int out) {
  LevelStore& store = levels_[level];
  const double* u = data(level, in);
  cells_to_vertices(store, changed(level, out), true, [&](std::int32_t cell, Vec(&f)[8]) {
    Vec at[8];
    for (int i = 0; i < 8; ++i) at[i] = cpu::load(u, store.level->slots[cell][i]);
    cpu::cell_product(store, cell, at, f);
  });
}

void CpuBackend::apply_scaled(const OperatorScale& scale, int in, int out) {
  LevelStore& store = levels_[0];
  const double* u = data(0, in);
  cells_to_vertices(store, changed(0, out), false, [&](std::int32_t cell, Vec(&f)[8]) {
    Vec at[8];
    for (int i = 0; i < 8; ++i) at[i] = cpu::load(u, store.level->slots[cell][i]);
    cpu::finest_product(store, scale, cell, at, f);
  });
}

void CpuBackend::elastic_force(int displacement, int out) {
  LevelStore& store = levels_[0];
  const double* u = data(0, displacement);
  cells_to_vertices(store, changed(0, out), false, [&](std::int32_t cell, Vec(&f)[8]) {
    Vec at[8], corners[8];
    for (int i = 0; i < 8; ++i) at[i] = cpu::load(u, store.level->slots[cell][i]);
    kernels::unfold(at, store.level->fold[cell], corners);
    const CellValues& values = hierarchy_->values[cell];
    const double side = finest_.spacing * (1 << store.level->size_log2[cell]);
    kernels::elastic_force(corners, finest_.rotation[cell], side, values.stiffness,
                           finest_.materials[values.material].modes.stiffness, corners);
    kernels::fold_transpose(corners, store.level->fold[cell], f);
  });
}

void CpuBackend::move_points(std::span<const BoundPoint> points, int displacement,
                             std::span<Vec3d> positions) {
  const double* u = data(0, displacement);
  cpu::move_points(
      *levels_[0].level, points, [&](std::int32_t v) { return cpu::load(u, v); }, positions,
      threads_);
}

void CpuBackend::surface_normals(const SurfaceView& surface, std::span<const Vec3d> positions,
                                 std::span<Vec3d> normals) {
  faces_.resize(surface.triangles.size());
  cpu::surface_normals(surface, positions, normals, faces_, threads_);
}

double CpuBackend::residual(int level) {
  if (levels_[level].solution_is_zero) {
    copy(level, kRight, kResidual);
  } else {
    apply(level, kSolution, kResidual);
    combine(level, 1, kRight, -1, kResidual);
  }
  return std::sqrt(dot(level, kResidual, kResidual));
}

void CpuBackend::smooth(int level, SweepOrder order, int count) {
  LevelStore& store = levels_[level];
  for (int i = 0; i < count; ++i) {
    if (smoother_.chebyshev)
      chebyshev(store, level);
    else
      gauss_seidel(store, level, order);
  }
}

void CpuBackend::gauss_seidel(LevelStore& store, int level, SweepOrder order) {
  const Level& l = *store.level;
  double* u = changed(level, kSolution);
  const double* f = store.vectors[kRight].data();
  if (store.colours.order.empty()) store.colours = colour_vertices(l);
  const Colours& colours = store.colours;
  for (int step = 0; step < colours.count(); ++step) {
    const int colour = order == SweepOrder::forward ? step : colours.count() - 1 - step;
    const std::int32_t begin = colours.begin[colour];
    parallel(colours.begin[colour + 1] - begin, [&](std::int32_t i) {
      const std::int32_t v = colours.order[begin + i];
      Vec r = cpu::load(f, v);
      for (const std::int32_t k : l.incidences_of(v)) r -= cpu::cell_row(store, k / 8, k % 8, u);
      const Vec at = cpu::load(u, v);
      cpu::store(u, v, kernels::relax_vertex(at, r, store.inverse_diagonal[v], smoother_.omega));
    });
  }
}

// Chebyshev acceleration of block Jacobi on [smallest, 1] * bound.
// Source  Adams, Brezina, Hu, Tuminaro 2003 [ABHT03]; Saad 2003, algorithm 12.1.
void CpuBackend::chebyshev(LevelStore& store, int level) {
  const double upper = store.bound, lower = smoother_.smallest * upper;
  const double theta = 0.5 * (upper + lower), delta = 0.5 * (upper - lower);
  const double sigma = theta / delta;
  double rho = 1 / sigma;
  double* u = data(level, kSolution);
  double* d = data(level, kDirection);
  const double* r = data(level, kResidual);
  for (int step = 0; step < smoother_.degree; ++step) {
    residual(level);
    store.solution_is_zero = false;
    const double next = step == 0 ? rho : 1 / (2 * sigma - rho);
    const double keep = step == 0 ? 0 : next * rho, take = step == 0 ? 1 / theta : 2 * next / delta;
    rho = next;
    parallel(
        store.vertices(),
        [&](std::int32_t v) {
          const Vec z = store.inverse_diagonal[v] * cpu::load(r, v);
          Vec direction = take * z;
          if (step > 0) direction += keep * cpu::load(d, v);
          cpu::store(d, v, direction);
          cpu::store(u, v, cpu::load(u, v) + direction);
        },
        kWorthVertices);
  }
}

void CpuBackend::restrict_residual(int fine) {
  LevelStore& from = levels_[fine];
  LevelStore& to = levels_[fine + 1];
  const Level &f = *from.level, &c = *to.level;
  // A fine vertex counts once, although many cells meet it: its first incidence speaks for it.
  const double* r = data(fine, kResidual);
  parallel(to.cells(), [&](std::int32_t cell) {
    Vec sum[8];
    for (const std::int32_t child : c.children_of(cell)) {
      double w[8][8];
      kernels::transfer_weights(f.fold[child], f.place[child], c.fold[cell], w);
      for (int i = 0; i < 8; ++i) {
        const std::int32_t v = f.slots[child][i];
        if (f.incidences_of(v)[0] != 8 * child + i) continue;
        const Vec at = cpu::load(r, v);
        for (int m = 0; m < 8; ++m)
          if (w[i][m] != 0) sum[m] += w[i][m] * at;
      }
    }
    std::copy_n(sum, 8, to.products.begin() + 8 * static_cast<std::ptrdiff_t>(cell));
  });
  double* out = data(fine + 1, kRight);
  parallel(
      to.vertices(),
      [&](std::int32_t v) {
        Vec sum{};
        for (const std::int32_t k : c.incidences_of(v)) sum += to.products[k];
        cpu::store(out, v, masked(sum, c.fixed[v]));
      },
      kWorthVertices);
  zero(fine + 1, kSolution);
}

void CpuBackend::prolong_correction(int fine) {
  const Level &f = *levels_[fine].level, &c = *levels_[fine + 1].level;
  const double* coarse = data(fine + 1, kSolution);
  double* u = changed(fine, kSolution);
  parallel(
      f.vertices(),
      [&](std::int32_t v) {
        const std::int32_t first = f.incidences_of(v)[0];
        const std::int32_t child = first / 8, cell = f.parent[child];
        double w[8][8];
        kernels::transfer_weights(f.fold[child], f.place[child], c.fold[cell], w);
        Vec sum{};
        for (int m = 0; m < 8; ++m)
          if (w[first % 8][m] != 0) sum += w[first % 8][m] * cpu::load(coarse, c.slots[cell][m]);
        cpu::store(u, v, cpu::load(u, v) + masked(sum, f.fixed[v]));
      },
      kWorthVertices);
}

void CpuBackend::solve_coarsest() {
  LevelStore& store = levels_.back();
  store.solution_is_zero = false;
  coarsest_factor_.solve(store.vectors[kRight], store.vectors[kSolution]);
}

void CpuBackend::precondition_jacobi(int level, int in, int out) {
  const LevelStore& store = levels_[level];
  const double* from = data(level, in);
  double* to = changed(level, out);
  parallel(
      store.vertices(),
      [&](std::int32_t v) { cpu::store(to, v, store.inverse_diagonal[v] * cpu::load(from, v)); },
      kWorthVertices);
}

void CpuBackend::zero(int level, int x) {
  auto& vector = levels_[level].vectors[x];
  std::fill(vector.begin(), vector.end(), 0.0);
  if (x == kSolution) levels_[level].solution_is_zero = true;
}

void CpuBackend::copy(int level, int from, int to) {
  const auto& source = levels_[level].vectors[from];
  std::copy(source.begin(), source.end(), changed(level, to));
}

void CpuBackend::combine(int level, double a, int x, double b, int y) {
  const double* from = data(level, x);
  double* to = changed(level, y);
  parallel(
      3 * levels_[level].vertices(), [&](std::int32_t i) { to[i] = a * from[i] + b * to[i]; },
      kWorthScalars);
}

// Fixed chunks, summed in their order: the same bits for any number of threads.
double CpuBackend::dot(int level, int x, int y) {
  constexpr std::int32_t kChunk = 2048;
  const double *a = data(level, x), *b = data(level, y);
  const std::int32_t size = 3 * levels_[level].vertices();
  const std::int32_t chunks = (size + kChunk - 1) / kChunk;
  std::vector<double> part(chunks);
  parallel(
      chunks,
      [&](std::int32_t chunk) {
        double sum = 0;
        const std::int32_t end = std::min(size, (chunk + 1) * kChunk);
        for (std::int32_t i = chunk * kChunk; i < end; ++i) sum += a[i] * b[i];
        part[chunk] = sum;
      },
      kWorthScalars / kChunk);
  double sum = 0;
  for (const double p : part) sum += p;
  return sum;
}

void CpuBackend::mask(int level, int x) {
  double* values = changed(level, x);
  const Level& l = *levels_[level].level;
  parallel(
      l.vertices(),
      [&](std::int32_t v) { cpu::store(values, v, masked(cpu::load(values, v), l.fixed[v])); },
      kWorthVertices);
}

void CpuBackend::write(int level, int x, std::span<const double> values) {
  const auto& vector = levels_[level].vectors[x];
  expects(values.size() == vector.size(), "write: three values per vertex of the level");
  std::copy(values.begin(), values.end(), changed(level, x));
}

void CpuBackend::read(int level, int x, std::span<double> values) const {
  const auto& vector = levels_[level].vectors[x];
  expects(values.size() == vector.size(), "read: three values per vertex of the level");
  std::copy(vector.begin(), vector.end(), values.begin());
}

void CpuBackend::write_some(int level, int x, std::span<const std::int32_t> vertices,
                            std::span<const double> values) {
  double* to = changed(level, x);
  for (std::size_t k = 0; k < values.size(); ++k)
    to[3 * static_cast<std::size_t>(vertices[k / 3]) + k % 3] = values[k];
}

void CpuBackend::read_some(int level, int x, std::span<const std::int32_t> vertices,
                           std::span<double> values) const {
  const double* from = levels_[level].vectors[x].data();
  for (std::size_t k = 0; k < values.size(); ++k)
    values[k] = from[3 * static_cast<std::size_t>(vertices[k / 3]) + k % 3];
}

NearCells CpuBackend::find_near(int displacement, const BladeReach& reach,
                                std::span<const std::int32_t> opened) const {
  return cpu::find_near(*hierarchy_, levels_[0].vectors[displacement], reach, opened, threads_);
}

}  // namespace

std::unique_ptr<Backend> make_cpu_backend(const CpuOptions& options) {
  return std::make_unique<CpuBackend>(options);
}

}  // namespace kerf
