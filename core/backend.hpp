// SPDX-License-Identifier: MIT
//
// What the cycle in core/solve/ may ask of a machine. Level 0 is the finest.
//
// A backend owns the values of one simulation: rotations, matrices, and named vectors on every
// level. A vector has three components per vertex; on the host it is x0 y0 z0 x1 y1 z1 ...
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/base/workers.hpp"
#include "core/levels/corners.hpp"
#include "core/levels/hierarchy.hpp"
#include "core/levels/update.hpp"
#include "core/surface/surface_view.hpp"

namespace kerf {

/// Vectors that every level has; they may be of single precision. Level 0 has more, in double:
/// `Backend::add_vector`. Forces, and what they are made from, live in these.
enum VectorId : int {
  kSolution,   ///< u of A u = f
  kRight,      ///< f
  kResidual,   ///< f - A u (on the fast backend where it is asked for, not of a cycle)
  kDirection,  ///< of a recursion: Chebyshev (not of the fast backend), Lanczos
  kScratch,    ///< product of the Chebyshev recursion and of the Krylov methods
  kKrylovX,    ///< two vectors of the K-cycle; `smooth` on level 0 may leave anything in the first
  kKrylovV,
  kLevelVectors
};

enum class SweepOrder { forward, backward };

/// A = stiffness * [R] K [R]^T + mass * M, summed over the cells.
struct OperatorScale {
  double stiffness = 1;
  double mass = 0;
};

struct SmootherOptions {
  bool chebyshev = true;
  double omega = 1.0;         ///< Gauss-Seidel
  int degree = 2;             ///< Chebyshev steps in one sweep
  double smallest = 1.0 / 8;  ///< Chebyshev: lower end of the range, relative to the upper
};

/// Vectors of level 0 for conjugate gradients.
struct ConjugateVectors {
  int residual, direction, product;
  bool rounded = false;  ///< to the precision of the cycle
};

/// What a step of conjugate gradients leaves to the next one.
struct ConjugateState {
  double rho = 0, alpha = 0;  ///< r.z and the length of the step
  double residual2 = 0;       ///< r.r after the step
  bool first = true;
};

/// What a device was asked for since the backend was made; zero where there is none.
struct DeviceWork {
  std::size_t calls = 0;     ///< of the host: launches, and graphs of launches
  std::size_t launches = 0;  ///< those in graphs too
  std::size_t bytes_up = 0, bytes_down = 0;
};

struct CycleOptions;  // core/solve/cycle.hpp

/// Holds one simulation's matrices and vectors and runs the loops over them.
/// Not thread-safe. A call may return early; the next call on the same object sees its result.
/// Fixed components take no part: operators read them as zero and leave zero in them.
/// Needs load() before all else but set_smoother and add_vector, and levels and vectors that are
/// there; numbers of them are not checked.
/// @throws Error from any call if the device fails; the object is then unusable. After OutOfMemory
/// read and read_rotations still give the vectors and rotations of level 0, but for what that call
/// was to write, with the sizes of before if the call was an update; not after a load.
class Backend {
 public:
  virtual ~Backend() = default;
  virtual const char* name() const noexcept = 0;  ///< "cpu", "reference", "cuda"
  /// Of the processor, that the loops are compiled for: "baseline", "avx2", ...; empty: on a
  /// device.
  virtual const char* instruction_set() const noexcept { return ""; }
  virtual int threads() const noexcept = 0;
  /// Its threads, for host work between its own calls. Of these only read_some may be called from
  /// them, at once.
  virtual Workers workers() const { return {}; }
  virtual std::size_t bytes() const = 0;
  /// About how much memory of this machine a run takes for each cell of a refined body, all that
  /// others hold of it included; its surface is not.
  virtual double bytes_per_cell() const noexcept;
  virtual void wait() const {}  ///< until all that was asked for is done
  virtual DeviceWork device_work() const { return {}; }

  // Structure.
  /// Topology; again after each cut. Vectors and rotations are then zero and identity.
  /// The hierarchy must outlive the next load.
  virtual void load(const Hierarchy& hierarchy) = 0;
  /// Whether the functions under "Updates" are there. Else the caller packs the hierarchy after a
  /// cut (Hierarchy::pack), loads it, and writes all that it wants kept.
  virtual bool can_update() const noexcept { return false; }
  /// Whether Level::incidences_of is asked for, other than of the coarsest level.
  virtual bool reads_incidences() const noexcept { return true; }
  virtual void set_smoother(const SmootherOptions& options) = 0;
  /// One more vector on level 0; stays through later loads.
  virtual int add_vector() = 0;
  /// The same for what may be rounded to the precision of the cycle: not a force, nor what one is
  /// made from.
  virtual int add_rough_vector() { return add_vector(); }
  /// One of level 0 is zero from now on; its memory may be given back until it is used again.
  virtual void release(int x) { zero(0, x); }

  // Values.
  virtual void set_operator(const OperatorScale& scale) = 0;
  /// Level 0: R of every cell from the displacements, warm-started from the last R.
  virtual void rotate_cells(int displacement) = 0;
  /// R of every cell of level 0 as a unit quaternion, four doubles a cell: w x y z.
  virtual void read_rotations(std::span<double> out) const = 0;
  virtual void write_rotations(std::span<const double> in) = 0;
  virtual void coarsen(int fine) = 0;  ///< matrices of fine + 1 from fine
  /// Diagonal blocks, and the bound for Chebyshev. Leaves anything in u, f, r and the direction.
  virtual void prepare(int level) = 0;
  virtual void factor_coarsest() = 0;  ///< throws Error (bad_input) if a piece is not held
  /// Whether there is a factor, of this structure and operator; perhaps of older rotations.
  virtual bool has_factor() const noexcept = 0;
  /// Lower triangle of the matrix of a cell over its slots, 300 doubles (kernels/layout.hpp).
  virtual void read_cell_matrix(int level, std::int32_t cell, std::span<double> out) const = 0;
  /// Upper end of the smoother's range: an estimate from above of max eig(D^-1 A).
  virtual double spectral_bound(int level) const = 0;

  // The cycle.
  virtual void smooth(int level, SweepOrder order, int count) = 0;  ///< u from f
  virtual double residual(int level) = 0;                           ///< r = f - A u; returns |r|
  virtual void restrict_residual(int fine) = 0;  ///< f of fine + 1 = P^T r; its u = 0
  /// Both at once, where that costs less: f of fine + 1 = P^T (f - A u), its u = 0. What r of
  /// `fine` holds then is not defined.
  virtual void restrict_from_solution(int fine) {
    residual(fine);
    restrict_residual(fine);
  }
  virtual void prolong_correction(int fine) = 0;       ///< u of fine += P u of fine + 1
  virtual void solve_coarsest() = 0;                   ///< u from f
  virtual void apply(int level, int in, int out) = 0;  ///< out = A in
  virtual void precondition_jacobi(int level, int in, int out) = 0;  ///< out = D^-1 in
  /// A whole cycle on level 0, where a backend has one of its own; else false, and the caller runs
  /// the operations above.
  virtual bool run_cycle(const CycleOptions&) { return false; }

  // Conjugate gradients on level 0: r, d and q are those of conjugate_vectors(), z is kSolution, b
  // and x were added. A backend may fuse what is here said with the operations above.
  /// The residual may be kRight itself, so that a cycle finds it there, and r, d and q may be of
  /// the precision of the cycle: q is then the product with the rounded d, and x follows that d.
  /// What d and q hold between solves is of no use. A second call gives the same, or others.
  virtual ConjugateVectors conjugate_vectors();
  /// r = b - A x, from x and b as they are; returns |r|.
  virtual double true_residual(int b, int x, int r);
  /// x.y and x.z.
  virtual std::array<double, 2> dots(int x, int y, int z);
  /// d = z + beta d and q = A d; returns d.q and d.r.
  virtual std::array<double, 2> advance_direction(int z, double beta, int d, int q, int r);
  /// x += a d and r -= a q; returns r.r.
  virtual double advance_solution(double a, int d, int q, int x, int r);
  /// A whole step behind z = B r, flexible: beta from the change of the residual (Polak, Ribiere).
  /// Returns false where r is zero or rounding has won; x and r are then as before.
  virtual bool advance_conjugate(int z, int d, int q, int x, int r, ConjugateState& state);

  // Forces, level 0.
  /// out = sum over cells of [R] K ([R]^T (x + u) - x); held components too (reactions).
  virtual void elastic_force(int displacement, int out) = 0;
  /// out = (scale.stiffness [R] K [R]^T + scale.mass M) in; held components too.
  virtual void apply_scaled(const OperatorScale& scale, int in, int out) = 0;

  /// out -= elastic_force in free components; returns the sum of the squares of what was taken off.
  /// Anything may be left in `work`.
  virtual double subtract_elastic_force(int displacement, int out, int work);
  /// The same of apply_scaled.
  virtual double subtract_scaled(const OperatorScale& scale, int in, int out, int work);

  // A surface bound to the cells of level 0.
  /// Positions of points that move with their cells, m: reference + u. Free slots keep theirs.
  virtual void move_points(std::span<const BoundPoint> points, int displacement,
                           std::span<Vec3d> positions) = 0;
  /// Unit normals: for each list of corners that share one, the sum of the faces by area, in the
  /// order of the list.
  virtual void surface_normals(const SurfaceView& surface, std::span<const Vec3d> positions,
                               std::span<Vec3d> normals) = 0;

  // Vectors.
  virtual void zero(int level, int x) = 0;
  virtual void copy(int level, int from, int to) = 0;
  virtual void add(int level, double a, int x, int y) = 0;                ///< y += a x
  virtual void combine(int level, double a, int x, double b, int y) = 0;  ///< y = a x + b y
  virtual double dot(int level, int x, int y) = 0;
  virtual void mask(int level, int x) = 0;  ///< zero in fixed components
  virtual void write(int level, int x, std::span<const double> values) = 0;
  virtual void read(int level, int x, std::span<double> values) const = 0;
  /// kernels/noise.hpp, of all `size` components of the level.
  virtual void write_noise(int level, int x, std::size_t size);

  // Updates: what a cut costs follows what it touched.
  /// The hierarchy that was loaded has changed in place, where `change` tells. Vectors keep what
  /// they hold at old vertices and are zero at new ones; new cells have the rotation of their
  /// origin. Between the change and this call, or a load, only read, read_some and read_rotations
  /// are called, with the sizes and numbers of before.
  virtual void update(const Hierarchy& hierarchy, const HierarchyChange& change);
  /// Three values for each of some vertices.
  virtual void write_some(int level, int x, std::span<const std::int32_t> vertices,
                          std::span<const double> values);
  virtual void read_some(int level, int x, std::span<const std::int32_t> vertices,
                         std::span<double> values) const;
  /// What a blade may meet: as near_cells in core/levels/corners.hpp. Of a hierarchy with
  /// neighbours alone, as update.
  virtual NearCells find_near(int displacement, const BladeReach& reach,
                              std::span<const std::int32_t> opened) const;
};

}  // namespace kerf
