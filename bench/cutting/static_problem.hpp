// SPDX-License-Identifier: MIT
//
// Linear elasticity on a cut body: rotations stay the identity, so that what differs from a closed
// form is the discretisation alone, and no load needs to be tiny.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "bench/cutting/body.hpp"
#include "core/backend.hpp"
#include "core/solve/linear_solver.hpp"

namespace kerf::cutting {

/// What holds the vertex at a place.
struct Hold {
  std::uint8_t fixed = 0;  ///< bit c: component c is held
  Vec3d displacement{};    ///< m, of the held components
};
using Holder = std::function<Hold(const Vec3d&)>;

/// A face of a cell that no link crosses, and that is not of the box: a side of a cut.
struct CutFace {
  std::array<std::int32_t, 4> vertices;
  Vec3d normal;  ///< out of the cell
  double area;   ///< m^2
};
/// Cells of the octree beside a cut are finest, so every such face is a whole face of a cell.
std::vector<CutFace> cut_faces(const CutBody& body);

/// Costs of one problem.
struct Cost {
  std::size_t cells = 0, vertices = 0, unknowns = 0, levels = 0, pieces = 0;
  double octree = 0, cut = 0, structure = 0, values = 0, solve = 0;  ///< s
  int cycles = 0;
  double residual = 0;    ///< true, relative
  double bytes = 0;       ///< of octree, levels and backend
  double peak_bytes = 0;  ///< most memory of the process while it was built and solved, less before
  double removed = 0;     ///< part of the volume

  double seconds() const { return octree + cut + structure + values + solve; }
  /// Adds times and cycles, keeps the largest of all others.
  void add(const Cost& other);
};

class StaticProblem {
 public:
  /// Held where `holder` says so; crumbs that hang on nothing are held where they are.
  /// @throws Error (bad_input) if a larger piece is not held.
  StaticProblem(const Shape& shape, Method method, int threads, const Holder& holder);

  const CutBody& body() const { return body_; }
  const Level& level() const { return body_.level(); }
  Vec3d place(std::int32_t vertex) const { return body_.lattice.point(level().point[vertex]); }
  /// The piece of each cell, and their number.
  const std::vector<std::int32_t>& piece() const { return piece_; }
  std::size_t pieces() const { return cost_.pieces; }
  std::int32_t piece_of(std::int32_t vertex) const {
    return piece_[level().incidences_of(vertex)[0] / 8];
  }

  /// Replaces displacement, energy and cost by those under `force`, 3 per vertex, N.
  /// @throws Error (internal) if the solver does not reach its tolerance.
  void solve(const std::vector<double>& force);
  std::vector<double> force_of(const std::vector<Load>& loads) const;

  Vec3d displacement(std::int32_t vertex) const;
  double energy() const { return energy_; }  ///< u . K u / 2, J
  /// u . K u / 2 over the cells of each piece, J.
  std::vector<double> energy_by_piece() const;
  /// u . f / 2, J
  double half_work() const { return half_work_; }
  const Cost& cost() const { return cost_; }

 private:
  void hold(const Holder& holder);

  double memory_before_;
  CutBody body_;
  std::vector<double> held_;  // m, 3 per vertex
  std::vector<std::int32_t> piece_;
  std::unique_ptr<Backend> backend_;
  std::unique_ptr<LinearSolver> solver_;
  int b_ = -1, x_ = -1;
  std::vector<double> displacement_, reaction_;  // reaction: K u
  double energy_ = 0, half_work_ = 0;
  Cost cost_;
};

}  // namespace kerf::cutting
