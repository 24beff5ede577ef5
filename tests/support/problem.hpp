// SPDX-License-Identifier: MIT
//
// A body with materials, supports and a large deformation: what a backend is tested on, and what
// the oracle says of it.
#pragma once

#include <cmath>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include "core/backend.hpp"
#include "core/levels/update.hpp"
#include "cpu/cpu_backend.hpp"
#include "cpu/fast_backend.hpp"
#include "gpu/cuda_backend.hpp"
#include "tests/oracle/system_oracle.hpp"
#include "tests/support/mirror_backend.hpp"
#include "tests/support/scenes.hpp"

namespace kerf::test {

/// "cpu": the reference backend; "mirror": that of a device, on the host. Null for a backend that
/// was not built.
inline std::unique_ptr<Backend> make_backend(const std::string& name, int threads = 1,
                                             int tile_log2 = 0) {
  if (name == "cpu") return make_cpu_backend({threads, tile_log2});
  if (name == "fast") return make_fast_backend({threads, false});
  if (name == "mixed") return make_fast_backend({threads, true});
  if (name == "mirror") return make_mirror_backend(false);
  if (name == "mirror_mixed") return make_mirror_backend(true);
  if (name == "cuda" || name == "cuda_mixed")
    return make_cuda_backend({.device = 0, .single_cycle = name == "cuda_mixed"});
  if (name == "cuda_records" || name == "cuda_mixed_records")
    return make_cuda_backend({.single_cycle = name == "cuda_mixed_records", .records = true});
  return nullptr;
}

/// Why a backend of make_backend cannot be had here; empty where it can.
inline std::string why_missing(const std::string& name) {
  return name.rfind("cuda", 0) == 0 ? cuda_problem() : std::string();
}
/// Whether KERF_REQUIRE names it: tests then fail where it is missing, and do not skip.
inline bool is_required(const std::string& name) {
  const char* required = std::getenv("KERF_REQUIRE");
  return required != nullptr && name.rfind(required, 0) == 0;
}

enum class Holds {
  none,
  one_side,  ///< all of the low x side
  dense,     ///< all but one vertex in eight, which no coarse grid has
  slides,    ///< low x side, and x of a slab but for one vertex in each block of 8^3
  mixed      ///< a slab that no coarse grid agrees with, and single components here and there
};

struct ProblemOptions {
  Holds holds = Holds::mixed;
  bool lumped_mass = false;
  int coarsest_vertices = 30;
  int max_levels = 0;
  bool duplicate_cells = true;
  int materials = 3;
  bool with_oracle = true;  ///< false: no grids, for bodies too large for brute force
};

inline oracle::Vector random_vector(std::size_t size, std::uint64_t seed) {
  Dice dice(seed);
  oracle::Vector out(static_cast<Eigen::Index>(size));
  for (double& x : out) x = dice.between(-1, 1);
  return out;
}

inline std::span<const double> span_of(const oracle::Vector& x) {
  return {x.data(), static_cast<std::size_t>(x.size())};
}

inline void write(Backend& backend, int level, int id, const oracle::Vector& x) {
  backend.write(level, id, span_of(x));
}

struct Problem {
  LinkedOctree body;
  Hierarchy hierarchy;
  oracle::Physics physics;
  std::vector<oracle::Grid> grids;  ///< see oracle::grids_like
  ProblemOptions options;

  Problem(LinkedOctree octree, const ProblemOptions& given)
      : body(std::move(octree)), options(given) {
    constexpr oracle::Material kMaterials[] = {
        {3.0e4, 0.3, 900}, {7.0e5, 0.45, 1400}, {1.0e4, 0.0, 700}};
    physics.spacing = hierarchy.spacing = body.lattice().spacing;
    physics.lumped_mass = hierarchy.lumped_mass = given.lumped_mass;
    physics.materials.assign(kMaterials, kMaterials + given.materials);
    for (const auto& m : physics.materials) hierarchy.poisson.push_back(m.poisson);
    hierarchy.levels.push_back(finest_level(body));
    Level& finest = hierarchy.levels[0];
    for (std::int32_t c = 0; c < finest.cells(); ++c) {
      // In layers, but not along the blocks of any level.
      const auto index = static_cast<std::uint8_t>((finest.corner[c][0] + finest.corner[c][2]) / 3 %
                                                   given.materials);
      const double side = physics.spacing * (1 << finest.size_log2[c]);
      const oracle::Material& m = physics.materials[index];
      physics.material.push_back(index);
      hierarchy.values.push_back({m.young * side, m.density * side * side * side, index});
    }
    hold(finest);
    build_coarse_levels(hierarchy, hierarchy_options());
    if (given.with_oracle) grids = oracle::grids_like(body, hierarchy, given.duplicate_cells);
  }
  explicit Problem(const std::string& name, const ProblemOptions& given = {})
      : Problem(scene(name), given) {}

  /// Brings the hierarchy, not the grids, up to date after a cut of the body; what is new is held
  /// as its place says, and old vertices that are named (ascending) are held or free in turn: of
  /// components as `bits` says. Returns false if it would have another number of levels.
  bool update(LevelUpdater& updater, const CutEvent& event,
              const std::vector<std::int32_t>& turned = {}, std::uint8_t bits = 7) {
    updater.update_finest(body, event, hierarchy);
    const LevelChange& change = updater.change().levels[0];
    Level& finest = hierarchy.levels[0];
    const auto value_of = [&](std::int32_t origin, std::int32_t cell) {
      const auto& m = physics.materials[hierarchy.values[origin].material];
      const double side = physics.spacing * (1 << finest.size_log2[cell]);
      return CellValues{m.young * side, m.density * side * side * side,
                        hierarchy.values[origin].material};
    };
    for (std::int32_t c = change.cells_before; c < finest.cells(); ++c)
      hierarchy.values.push_back(value_of(change.origin[c - change.cells_before], c));
    for (const std::int32_t c : change.cells) hierarchy.values.set(c, value_of(c, c));
    for (std::int32_t v = change.vertices_before; v < finest.vertices(); ++v)
      finest.fixed[v] = options.holds != Holds::none && finest.point[v][0] == 0 ? 7 : 0;
    for (const std::int32_t v : turned) finest.fixed[v] = finest.fixed[v] == 0 ? bits : 0;
    return updater.update_coarse(hierarchy, hierarchy_options(), turned);
  }

  HierarchyOptions hierarchy_options() const {
    return {options.coarsest_vertices, options.max_levels, options.duplicate_cells};
  }

  int levels() const { return static_cast<int>(hierarchy.levels.size()); }
  const Level& level(int l) const { return hierarchy.levels[l]; }
  const std::vector<std::uint8_t>& fixed(int l) const { return hierarchy.levels[l].fixed; }
  std::size_t unknowns(int l) const { return 3 * hierarchy.levels[l].point.size(); }

  /// A turn by more than a right angle about a slanted axis, a bend and a twist, and 5 % of a cell
  /// of noise at every vertex. Different on the two sides of a cut.
  oracle::Vector deformation() const {
    const Level& finest = hierarchy.levels[0];
    const double h = physics.spacing;
    const Eigen::Matrix3d turn =
        Eigen::AngleAxisd(1.9, Eigen::Vector3d(1, 2, -0.5).normalized()).toRotationMatrix();
    oracle::Vector u = 0.05 * h * random_vector(unknowns(0), 11);
    for (std::int32_t v = 0; v < finest.vertices(); ++v) {
      const Eigen::Vector3d x =
          h * Eigen::Vector3d(finest.point[v][0], finest.point[v][1], finest.point[v][2]);
      const double t = 0.09 * x.x() / h;
      const Eigen::Vector3d y(1.1 * x.x() + 0.2 * h * std::sin(3 * t),
                              std::cos(t) * x.y() - std::sin(t) * x.z(),
                              std::sin(t) * x.y() + std::cos(t) * x.z());
      u.segment<3>(3 * v) += turn * y - x;
    }
    return u;
  }

  /// A vector that held components take no part in.
  oracle::Vector free_vector(int l, std::uint64_t seed) const {
    return oracle::masked(random_vector(unknowns(l), seed), fixed(l));
  }

  oracle::Vector read(const Backend& backend, int l, int id) const {
    oracle::Vector out(static_cast<Eigen::Index>(unknowns(l)));
    backend.read(l, id, {out.data(), unknowns(l)});
    return out;
  }

 private:
  void hold(Level& finest) const {
    Dice dice(5);
    for (std::int32_t v = 0; v < finest.vertices(); ++v) {
      const Vec3i& p = finest.point[v];
      int bits = 0;
      if (options.holds != Holds::none && p[0] == 0) bits = 7;
      if (options.holds == Holds::dense && (p[0] & p[1] & p[2] & 1) == 0) bits = 7;
      if (options.holds == Holds::slides && p[0] < 17 &&
          !(p[0] % 8 == 3 && p[1] % 8 == 3 && p[2] % 8 == 3))
        bits |= 1;
      if (options.holds == Holds::mixed && p[0] == 1) bits |= 1;
      if (options.holds == Holds::mixed && dice.roll(12) == 0) bits |= 1 << dice.roll(3);
      finest.fixed[v] = static_cast<std::uint8_t>(bits);
    }
  }
};

/// A block with larger cells inside, cut half through at a point by a slanted blade of some half
/// width, with held components and hanging corners. Without the oracle.
inline Problem cut_block(const Vec3i& size, const Vec3d& point, double half_width,
                         int coarsest_vertices) {
  LinkedOctree body(box_body(size), 1);
  cut_plane(body, point, {1, 0.2, 0.3}, half_width);
  ProblemOptions options;
  options.coarsest_vertices = coarsest_vertices;
  options.with_oracle = false;
  return {std::move(body), options};
}
/// One large enough for several patches and threads.
inline Problem large_cut_block() { return cut_block({33, 22, 15}, {14.3, 9.2, 7.1}, 8, 300); }

/// A backend that holds a problem's values, ready to cycle, and the oracle's matrices of it.
struct Loaded {
  const Problem& problem;
  std::unique_ptr<Backend> backend;
  int extra;  ///< two vectors on level 0, of consecutive ids

  Loaded(const Problem& p, std::unique_ptr<Backend> machine, const OperatorScale& scale,
         const SmootherOptions& smoother, const oracle::Vector& displacement)
      : problem(p), backend(std::move(machine)), extra(backend->add_vector()) {
    backend->add_vector();
    backend->set_smoother(smoother);
    backend->load(p.hierarchy);
    backend->set_operator(scale);
    write(*backend, 0, extra, displacement);
    backend->rotate_cells(extra);
    backend->prepare(0);
    for (int l = 0; l + 1 < p.levels(); ++l) {
      backend->coarsen(l);
      backend->prepare(l + 1);
    }
  }
};

/// The matrix of every level: assembled on the finest, triple products from there on.
inline std::vector<oracle::Sparse> matrices_of(const Problem& p, const OperatorScale& scale,
                                               const oracle::Vector& displacement) {
  const auto R = oracle::rotations(p.grids[0], p.physics, displacement);
  std::vector<oracle::Sparse> A{
      oracle::masked(oracle::assemble(p.grids[0], p.physics, R, scale), p.fixed(0), p.fixed(0))};
  for (int l = 0; l + 1 < p.levels(); ++l) {
    const oracle::Sparse P = oracle::masked(oracle::prolongation_matrix(p.grids[l], p.grids[l + 1]),
                                            p.fixed(l), p.fixed(l + 1));
    A.emplace_back(P.transpose() * A[l] * P);
  }
  return A;
}

}  // namespace kerf::test
