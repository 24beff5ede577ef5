// SPDX-License-Identifier: MIT
//
// The backend of a device: memory, launches and sums. What a thread does is in bodies/, and the
// arithmetic in kernels/. Member functions are defined in device_values.hpp, device_cycle.hpp,
// device_vectors.hpp, device_near.hpp and device_surface.hpp; make_device_backend.hpp brings all
// together.
//
// Device  see device_array.hpp.
// S       scalar of the cycle. Vectors that are added on level 0 are double, but for rough ones,
// and
//         so are forces.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>
#include <span>
#include <type_traits>
#include <vector>

#include "core/backend.hpp"
#include "core/base/error.hpp"
#include "core/solve/cycle.hpp"
#include "gpu/bodies/blocks.hpp"
#include "gpu/bodies/coarsen.hpp"
#include "gpu/bodies/dense.hpp"
#include "gpu/bodies/near.hpp"
#include "gpu/bodies/products.hpp"
#include "gpu/bodies/program.hpp"
#include "gpu/bodies/surface.hpp"
#include "gpu/bodies/values.hpp"
#include "gpu/bodies/vectors.hpp"
#include "gpu/device_blocks.hpp"
#include "gpu/device_level.hpp"
#include "gpu/device_options.hpp"

namespace kerf::gpu {

/// The coarsest level: its matrix while it is inverted, and the inverse.
template <class Device, class S>
struct DeviceInverse {
  explicit DeviceInverse(Device& device)
      : cells(device),
        matrix(device),
        diagonal(device),
        panels(device),
        inverse(device),
        slices(device) {}

  std::int32_t unknowns = 0;
  DeviceArray<Device, double> cells;  ///< matrices of level 0 where that is the coarsest
  DeviceArray<Device, double>
      matrix;  ///< of S double the inverse at last; kept, so that no later factor asks for memory
  DeviceArray<Device, double> diagonal;  ///< before the elimination
  DeviceArray<Device, double> panels;    ///< two of kBlock rows, P, and whether a pivot was lost
  DeviceArray<Device, S> inverse;        ///< of S float
  DeviceArray<Device, S> slices;         ///< of the product with it
  bool is_there = false;

  const S* data() const {
    if constexpr (std::is_same_v<S, double>)
      return matrix.data();
    else
      return inverse.data();
  }
};

/// An array that the host has too; only what differs from the last time is sent.
template <class Device, class T>
class SyncedArray {
 public:
  explicit SyncedArray(Device& device) : array_(device) {}

  template <class Convert, class From>
  void sync(std::span<const From> values, const Convert& convert) {
    std::vector<T> now;
    now.reserve(values.size());
    for (const From& value : values) now.push_back(convert(value));
    std::size_t first = 0, last = now.size();
    const std::size_t both = std::min(now.size(), host_.size());
    while (first < both && is_same(now[first], host_[first])) ++first;
    if (now.size() == host_.size())
      while (last > first && is_same(now[last - 1], host_[last - 1])) --last;
    array_.resize(now.size());
    array_.write(first, std::span<const T>(now).subspan(first, last - first));
    host_ = std::move(now);
  }
  T* data() const { return array_.data(); }

 private:
  static bool is_same(const T& a, const T& b) { return std::memcmp(&a, &b, sizeof(T)) == 0; }

  DeviceArray<Device, T> array_;
  std::vector<T> host_;
};

template <class Device, class S>
class DeviceBackend final : public Backend {
 public:
  explicit DeviceBackend(std::unique_ptr<Device> device, const DeviceOptions& options = {});

  const char* name() const noexcept override { return Device::kName; }
  int threads() const noexcept override { return 1; }  // of the host
  std::size_t bytes() const override { return device_->counters().bytes_held; }
  void wait() const override { device_->wait(); }
  DeviceWork device_work() const override;
  Device& device() const { return *device_; }

  void load(const Hierarchy& hierarchy) override;
  bool can_update() const noexcept override { return options_.updates; }
  void update(const Hierarchy& hierarchy, const HierarchyChange& change) override;
  void set_smoother(const SmootherOptions& options) override;
  int add_vector() override { return append_vector(true); }
  int add_rough_vector() override { return append_vector(!kMixed); }

  void set_operator(const OperatorScale& scale) override;
  void rotate_cells(int displacement) override;
  void read_rotations(std::span<double> out) const override;
  void write_rotations(std::span<const double> in) override;
  void coarsen(int fine) override;
  void prepare(int level) override;
  void factor_coarsest() override;
  bool has_factor() const noexcept override { return coarsest_.is_there; }
  void read_cell_matrix(int level, std::int32_t cell, std::span<double> out) const override;
  double spectral_bound(int level) const override { return levels_[at(level)].bound; }

  void smooth(int level, SweepOrder order, int count) override;
  double residual(int level) override;
  void restrict_residual(int fine) override;
  void prolong_correction(int fine) override;
  void solve_coarsest() override;
  void apply(int level, int in, int out) override;
  void precondition_jacobi(int level, int in, int out) override;
  bool run_cycle(const CycleOptions& options) override;

  ConjugateVectors conjugate_vectors() override {
    return {kRight, add_rough_vector(), add_rough_vector(), kMixed};
  }
  double true_residual(int b, int x, int r) override;
  std::array<double, 2> dots(int x, int y, int z) override;
  bool advance_conjugate(int z, int d, int q, int x, int r, ConjugateState& state) override;

  void elastic_force(int displacement, int out) override;
  void apply_scaled(const OperatorScale& scale, int in, int out) override;
  void move_points(std::span<const BoundPoint> points, int displacement,
                   std::span<Vec3d> positions) override;
  void surface_normals(const SurfaceView& surface, std::span<const Vec3d> positions,
                       std::span<Vec3d> normals) override;

  void zero(int level, int x) override;
  void release(int x) override;
  void copy(int level, int from, int to) override;
  void add(int level, double a, int x, int y) override { combine(level, a, x, 1, y); }
  void combine(int level, double a, int x, double b, int y) override;
  double dot(int level, int x, int y) override;
  void mask(int level, int x) override;
  void write(int level, int x, std::span<const double> values) override;
  void read(int level, int x, std::span<double> values) const override;
  void write_noise(int level, int x, std::size_t size) override;
  void write_some(int level, int x, std::span<const std::int32_t> vertices,
                  std::span<const double> values) override;
  void read_some(int level, int x, std::span<const std::int32_t> vertices,
                 std::span<double> values) const override;
  NearCells find_near(int displacement, const BladeReach& reach,
                      std::span<const std::int32_t> opened) const override;

 private:
  using Vector = DeviceVector<Device, S>;
  static constexpr bool kMixed = !std::is_same_v<S, double>;
  static constexpr std::int32_t kManyLanes = 16384;     // of sums, see bodies/vectors.hpp
  static constexpr std::int32_t kWorthLanes = 1 << 16;  // scalars: below, kLastLanes do
  static constexpr int kMostSums = 3;

  static std::size_t at(int i) { return static_cast<std::size_t>(i); }
  int last_level() const { return static_cast<int>(levels_.size()) - 1; }
  DeviceLevel<Device, S>& level_at(int l) const { return levels_[at(l)]; }
  bool has_vector(int level, int x) const { return levels_[at(level)].vectors[at(x)].size() > 0; }
  const Vector& vector_at(int level, int x) const;
  S* cycle_vector(int level, int x) const {
    const Vector& vector = vector_at(level, x);
    ensures(!kMixed || !vector.is_exact, "a vector of the cycle is asked for, and this one is not");
    return vector.template in<S>();
  }
  double* exact_vector(int x) const {
    ensures(vector_at(0, x).is_exact, "a force is asked for in a vector of the cycle");
    return vector_at(0, x).doubled.data();
  }
  void changed(int level, int x) {
    if (x == kSolution) level_at(level).solution_is_zero = false;
  }
  /// All launches pass here.
  template <class Body>
  void run(std::int32_t count, const Body& body) const {
    if (program_ == nullptr) {
      device_->launch(count, body);
    } else if constexpr (CycleBodies<S>::template index_of<Body>() >= 0) {
      program_->push_back(program_entry<CycleBodies<S>>(count, body));
    } else {
      ensures(false, "a cycle launches what CycleBodies does not list");
    }
  }

  // device_values.hpp
  template <class T>
  FinestView<T> finest_view(const Scale* scale) const;
  int append_vector(bool exact);
  void fit_to_levels();
  void grow_vectors(DeviceLevel<Device, S>& level, std::size_t before);
  void upload_factors(DeviceLevel<Device, S>& level);
  void assemble_coarsest(double share);
  bool invert_coarsest();

  // device_cycle.hpp
  template <class T>
  T* records() const {
    return reinterpret_cast<T*>(records_.data());
  }
  bool in_blocks() const {
    constexpr std::size_t kMost = 8191;  // codes have 16 bits
    return options_.blocks && blocks_.most_cells() <= std::min(options_.most_block_cells, kMost);
  }
  template <class T, class Cells, class Then>
  void gather_by_records(int level, const Cells& cells, const Then& then) const;
  template <class T, class Cells, class Then>
  void gather_finest(const Cells& cells, const Then& then) const;
  template <class T, class Then>
  void multiply(int level, const T* u, const Then& then) const;
  void compute_residual(int level);
  void chebyshev(int level);
  void colour_level(int level);
  void gauss_seidel(int level, SweepOrder order);
  void touch_vectors(const CycleOptions& options);
  void write_program(const CycleOptions& options);
  void descend(int level, const CycleOptions& options);
  void solve_coarse(int level, const CycleOptions& options);
  void krylov_step(int level, const CycleOptions& options);

  // device_near.hpp
  VertexPlaces vertex_places(int displacement) const;
  void find_bounds(const VertexPlaces& places, NearCells& out) const;

  // device_vectors.hpp
  template <class Body>
  void with(int level, int x, int y, const Body& body) const;
  template <class Terms, class Then>
  void sum(std::int32_t size, const Terms& terms, const Then& then) const;
  template <std::size_t sums>
  std::array<double, sums> read_sums() const;

  std::unique_ptr<Device> device_;  // first: what follows gives its memory back to it
  DeviceOptions options_;
  const Hierarchy* hierarchy_ = nullptr;
  SmootherOptions smoother_;
  OperatorScale scale_;
  ElementKinds<Device> kinds_;          // of the cells of level 0
  FinestValues<Device, double> exact_;  // of these
  FinestValues<Device, S> single_;      // the same, rounded; empty if S is double
  DeviceRotations<Device, S> rotations_;
  DeviceArray<Device, Scale> scales_;                   // of the operator, and of apply_scaled
  mutable std::vector<DeviceLevel<Device, S>> levels_;  // vectors are made when they are read
  DeviceBlocks<Device> blocks_;                         // of level 0
  std::vector<bool> added_exact_;                       // of the vectors of level 0 that were added
  DeviceArray<Device, double> records_;  // of the cells of one level, of either type; of level 0
                                         // only without blocks
  DeviceArray<Device, double> partial_;  // sums of lanes
  DeviceArray<Device, double> totals_;   // sums
  DeviceArray<Device, ConjugateScalars> conjugate_;
  DeviceArray<Device, KrylovScalars> krylov_;  // of each level
  DeviceInverse<Device, S> coarsest_;
  mutable Staging<Device> staging_, other_staging_;  // of two lists at once
  mutable DeviceArray<Device, double> values_;       // on their way to the host
  mutable DeviceArray<Device, std::uint64_t> keys_;  // of vertices of level 0, see VertexPlaces
  mutable DeviceArray<Device, std::uint8_t> marks_;  // of cells, and in words
  mutable DeviceArray<Device, std::uint32_t> words_;

  struct RecordedCycle {
    CycleOptions options;
    bool from_zero;
    typename Device::Graph graph;
  };
  std::optional<RecordedCycle> cycle_;  // until structure or smoother change
  // The levels from small_level_ on, in one launch of the cycle that is recorded; -1: none.
  static constexpr std::int32_t kSmallCells = 4096;
  int small_level_ = -1;
  DeviceArray<Device, ProgramEntry> entries_;
  std::int32_t most_threads_ = 0;                 // of an entry
  std::vector<ProgramEntry>* program_ = nullptr;  // while it is written

  SyncedArray<Device, SurfacePoint> points_;
  SyncedArray<Device, std::int32_t> corners_, first_corner_, next_corner_, normal_of_;
  SyncedArray<Device, Vec3d> rest_;  // positions as the host gave them
  DeviceArray<Device, Vec3d> positions_, faces_, normals_;
};

}  // namespace kerf::gpu
