// SPDX-License-Identifier: MIT
//
// What a simulation is made from: plain structs with their defaults. All units SI.
// docs/scene.md says the same for scene files.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "core/body/solid.hpp"
#include "core/geometry/blade.hpp"

namespace kerf {

struct Material {
  double young = 5.0e4;            ///< Pa, > 0
  double poisson = 0.4;            ///< in (-1, 0.5)
  double density = 1000.0;         ///< kg/m^3, > 0
  double mass_damping = 0.0;       ///< Rayleigh alpha, 1/s, >= 0; of the whole body
  double stiffness_damping = 0.0;  ///< Rayleigh beta, s, >= 0; of the whole body
};

struct BodySetup {
  std::shared_ptr<const Solid> solid;
  int resolution = 64;  ///< finest cells along the longest side
  int refinement = 0;   ///< octree levels by which the interior is coarser
};

/// Another material inside a solid; damping is taken from the body's material.
struct Region {
  std::shared_ptr<const Solid> solid;
  Material material;
};

/// Holds the vertices whose reference position lies inside `box`.
struct Support {
  Box3 box;
  Vec3d displacement{};                        ///< m, for the held components
  std::array<bool, 3> held{true, true, true};  ///< which components are held
};

struct Gravity {
  Vec3d acceleration{};  ///< m/s^2
};
/// A force spread evenly over the finest cells whose centre lies inside `box`.
struct BoxForce {
  Box3 box;
  Vec3d force{};  ///< N in all
};
/// A body force away from the line through `point` along `axis`, proportional to mass:
/// strength (m/s^2) times the unit vector away from the axis, in the reference state.
struct RadialForce {
  Vec3d point{};
  Vec3d axis{0, 1, 0};
  double strength = 0;
};
using Load = std::variant<Gravity, BoxForce, RadialForce>;

struct CutSetup {
  double start = 0;            ///< s
  std::optional<double> end;   ///< s; empty: the whole blade at once
  bool deformed = true;        ///< tested in the deformed state; else in the reference state
  std::vector<CutLine> lines;  ///< successive positions of the edge; or
  TriangleMesh mesh;           ///< a blade at rest, cut at once; used when lines is empty
};

enum class TimeMode { dynamic, statics };
enum class TimeScheme { newmark, central };

struct TimeSetup {
  TimeMode mode = TimeMode::dynamic;
  TimeScheme scheme = TimeScheme::newmark;
  double step = 0.02;     ///< s, > 0
  double duration = 1.0;  ///< s, > 0
  bool lumped_mass = false;
  double nonlinear_tolerance = 1e-8;  ///< static mode: relative residual of the equilibrium
  int nonlinear_iterations = 400;     ///< static mode: rotation updates before giving up
};

enum class SolverMethod { cg, multigrid, cg_jacobi, cholesky };
enum class CycleType { automatic, v, w, k };
enum class SmootherType { chebyshev, gauss_seidel };
enum class Precision { double_, mixed, single };

/// Of Chebyshev: far beyond what pays; 3 steps a sweep gain hardly anything already
/// (docs/decisions/0018-runs.md).
inline constexpr int kMaxDegree = 8;

struct SolverSetup {
  SolverMethod method = SolverMethod::cg;
  CycleType cycle = CycleType::automatic;
  SmootherType smoother = SmootherType::chebyshev;
  int pre_sweeps = 1, post_sweeps = 1;
  double omega = 1.0;  ///< over-relaxation of Gauss-Seidel, in (0, 2)
  int degree = 2;      ///< of Chebyshev: steps in one sweep, 1 (damped Jacobi) to kMaxDegree
  /// True residual after the last linear solve of a time step, relative to that before the step;
  /// the solves before it stop at a tenth of what they start from, or where the
  /// rotations undo the rest (docs/decisions/0016-early-updates.md). In static mode each solve
  /// stops at this, or at 0.003 if that is more.
  double tolerance = 1e-6;
  int cycles = 0;                ///< > 0: this fixed number instead of the tolerance
  int max_cycles = 500;          ///< before giving up; cg_jacobi: 50 times as many
  int rotation_updates = 2;      ///< a dynamic step
  int coarsest_vertices = 1500;  ///< direct solve at the first level with at most so many
  int max_levels = 0;            ///< 0: no limit
  bool duplicate_cells = true;   ///< false: merge by place only (for comparison)
  // For whoever makes the backend, as the command does: Simulation takes the one that it is given.
  Precision precision = Precision::double_;
  std::string backend = "cpu";  ///< cpu, reference, cuda, auto
  int threads = 0;              ///< 0: all
};

/// How the surface is drawn on the dual grid of links. Source  [DGW11] section 7, [WWD15] 2.3.2.
enum class SurfaceMethod {
  none,             ///< no surface
  dual_contouring,  ///< a vertex for each side of a cut in each dual cell
  splitting_cubes,  ///< two vertices for each cut link, and one in the middle of each patch
};

struct SimulationSetup {
  BodySetup body;
  Material material;
  std::vector<Region> regions;
  std::vector<Support> supports;
  std::vector<Load> loads;
  std::vector<CutSetup> cuts;
  TimeSetup time;
  SolverSetup solver;
  SurfaceMethod surface = SurfaceMethod::dual_contouring;
};

/// @throws Error (bad_input) that names the first field that makes no sense, and its remedy.
void validate(const SimulationSetup& setup);

}  // namespace kerf
