// SPDX-License-Identifier: MIT
#include "bench/cutting/static_problem.hpp"

#include <algorithm>
#include <cmath>

#include "bench/memory_peak.hpp"
#include "core/base/error.hpp"
#include "core/base/timer.hpp"
#include "core/fem/held.hpp"
#include "core/fem/loads.hpp"
#include "core/levels/piece_labels.hpp"
#include "cpu/fast_backend.hpp"

namespace kerf::cutting {
namespace {

// Relative residuals: the goal, and what rounding may leave of it on slender bodies. What either
// does to the answers is far below the errors of discretisation: docs/cutting.md.
constexpr double kTolerance = 1e-10, kRounding = 1e-9;

SolverSetup solver_setup(int threads) {
  SolverSetup out;
  out.tolerance = kTolerance;
  out.max_cycles = 2000;
  out.coarsest_vertices = 400;  // so that small bodies have levels too, and are not all factor
  out.threads = threads;
  return out;
}

double fresh_memory_peak() {
  bench::release_free_memory();
  bench::reset_memory_peak();
  return bench::memory_peak();
}

// Bit f: face f of the cell is crossed by a link.
std::uint8_t linked_faces(const Level& level, std::int32_t cell) {
  std::uint8_t out = 0;
  for (const std::int32_t item : level.links_of(cell))
    out = static_cast<std::uint8_t>(out | 1 << (item % 8));
  return out;
}

}  // namespace

std::vector<CutFace> cut_faces(const CutBody& body) {
  const Level& level = body.level();
  Vec3i end{};  // of the box, whole cells
  for (std::int32_t c = 0; c < level.cells(); ++c)
    for (std::size_t d = 0; d < 3; ++d)
      end[d] = std::max(end[d], level.corner[c][d] + (1 << level.size_log2[c]));
  const double area = body.lattice.spacing * body.lattice.spacing;
  std::vector<CutFace> out;
  for (std::int32_t c = 0; c < level.cells(); ++c) {
    if (level.size_log2[c] != 0) continue;
    const std::uint8_t linked = linked_faces(level, c);
    for (int face = 0; face < 6; ++face) {
      const int axis = face / 2, side = face % 2;
      const std::int32_t at = level.corner[c][static_cast<std::size_t>(axis)] + side;
      const bool of_box = at == (side == 0 ? 0 : end[static_cast<std::size_t>(axis)]);
      if ((linked >> face & 1) != 0 || of_box) continue;
      CutFace one{{}, {}, area};
      one.normal[axis] = side == 0 ? -1 : 1;
      std::size_t k = 0;
      for (int corner = 0; corner < 8; ++corner)
        if ((corner >> axis & 1) == side)
          one.vertices[k++] = level.slots[c][static_cast<std::size_t>(corner)];
      out.push_back(one);
    }
  }
  return out;
}

void Cost::add(const Cost& other) {
  octree += other.octree;
  cut += other.cut;
  structure += other.structure;
  values += other.values;
  solve += other.solve;
  cycles += other.cycles;
  cells = std::max(cells, other.cells);
  vertices = std::max(vertices, other.vertices);
  unknowns = std::max(unknowns, other.unknowns);
  levels = std::max(levels, other.levels);
  pieces = std::max(pieces, other.pieces);
  residual = std::max(residual, other.residual);
  bytes = std::max(bytes, other.bytes);
  peak_bytes = std::max(peak_bytes, other.peak_bytes);
  removed = std::max(removed, other.removed);
}

StaticProblem::StaticProblem(const Shape& shape, Method method, int threads, const Holder& holder)
    : memory_before_(fresh_memory_peak()),
      body_(make_body(shape, method)),
      backend_(make_fast_backend({threads, false, true})) {
  hold(holder);
  const SolverSetup setup = solver_setup(threads);
  const Timer timer;
  build_coarse_levels(body_.hierarchy, {setup.coarsest_vertices, setup.max_levels, true});
  cost_.structure = body_.level_seconds + timer.seconds();
  cost_.octree = body_.octree_seconds;
  cost_.cut = body_.cut_seconds;
  cost_.removed = body_.removed;
  cost_.cells = level().corner.size();
  cost_.vertices = level().point.size();
  for (const std::uint8_t fixed : level().fixed)
    for (int c = 0; c < 3; ++c) cost_.unknowns += (fixed >> c & 1) == 0 ? 1 : 0;
  cost_.levels = body_.hierarchy.levels.size();

  solver_ = std::make_unique<LinearSolver>(*backend_, setup);
  b_ = backend_->add_vector();
  x_ = backend_->add_vector();
  const Timer values;
  backend_->load(body_.hierarchy);
  backend_->set_operator({});
  solver_->set_structure(body_.hierarchy);
  solver_->refresh();
  cost_.values = values.seconds();
}

void StaticProblem::hold(const Holder& holder) {
  Level& level = body_.hierarchy.levels[0];
  held_.assign(3 * level.point.size(), 0.0);
  for (std::int32_t v = 0; v < level.vertices(); ++v) {
    const Hold at = holder(place(v));
    level.fixed[v] = at.fixed;
    for (int c = 0; c < 3; ++c)
      if ((at.fixed >> c & 1) != 0)
        held_[3 * static_cast<std::size_t>(v) + static_cast<std::size_t>(c)] = at.displacement[c];
  }
  PieceLabels labels;
  labels.build(level);
  piece_ = labels.by_first_cell();
  cost_.pieces = labels.count();
  hold_crumbs(body_.lattice, piece_, labels.count(), level);
}

std::vector<double> StaticProblem::force_of(const std::vector<Load>& loads) const {
  return ExternalForce(body_.lattice, loads, level()).on_all(body_.hierarchy);
}

void StaticProblem::solve(const std::vector<double>& force) {
  const Timer timer;
  // The free part x of the solution: K x = f - K u_held.
  backend_->write(0, x_, held_);
  backend_->apply_scaled({}, x_, b_);
  std::vector<double> right(force.size());
  backend_->read(0, b_, right);
  for (std::size_t i = 0; i < right.size(); ++i) right[i] = force[i] - right[i];
  backend_->write(0, b_, right);
  backend_->mask(0, b_);
  backend_->zero(0, x_);
  const SolveStats stats = solver_->solve(b_, x_, kTolerance);
  ensures(stats.residual <= kRounding,
          text("the solver stopped at a residual of ", stats.residual));
  displacement_.resize(force.size());
  reaction_.resize(force.size());
  backend_->read(0, x_, displacement_);
  for (std::size_t i = 0; i < held_.size(); ++i) displacement_[i] += held_[i];
  cost_.solve = timer.seconds();
  cost_.cycles = stats.cycles;
  cost_.residual = stats.residual;
  cost_.bytes =
      static_cast<double>(body_.octree_bytes + body_.hierarchy.bytes() + backend_->bytes());
  cost_.peak_bytes = bench::memory_peak() - memory_before_;

  backend_->write(0, x_, displacement_);
  backend_->apply_scaled({}, x_, b_);
  backend_->read(0, b_, reaction_);
  energy_ = half_work_ = 0;
  for (std::size_t i = 0; i < force.size(); ++i) {
    energy_ += 0.5 * displacement_[i] * reaction_[i];
    half_work_ += 0.5 * displacement_[i] * force[i];
  }
}

std::vector<double> StaticProblem::energy_by_piece() const {
  std::vector<double> out(cost_.pieces, 0.0);
  for (std::int32_t v = 0; v < level().vertices(); ++v)
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t i = 3 * static_cast<std::size_t>(v) + c;
      out[static_cast<std::size_t>(piece_of(v))] += 0.5 * displacement_[i] * reaction_[i];
    }
  return out;
}

Vec3d StaticProblem::displacement(std::int32_t vertex) const {
  const std::size_t i = 3 * static_cast<std::size_t>(vertex);
  return {displacement_[i], displacement_[i + 1], displacement_[i + 2]};
}

}  // namespace kerf::cutting
