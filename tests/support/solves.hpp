// SPDX-License-Identifier: MIT
//
// Whole linear solves of a problem, for comparison between backends.
#pragma once

#include <cmath>
#include <memory>
#include <vector>

#include "core/solve/linear_solver.hpp"
#include "tests/support/problem.hpp"

namespace kerf::test {

/// The greatest difference, of the greatest value.
inline double relative(const oracle::Vector& found, const oracle::Vector& expected) {
  return (found - expected).lpNorm<Eigen::Infinity>() / expected.lpNorm<Eigen::Infinity>();
}

/// The right side of `solve`.
inline oracle::Vector right_of_solve(const Problem& p) { return p.free_vector(0, 101); }

struct Solved {
  SolveStats stats;
  std::vector<double> history;  ///< residuals
  oracle::Vector x;
};

/// One solve in a deformed state, from zero, whatever the vector held before.
inline Solved solve(const Problem& p, Backend& backend, const SolverSetup& setup,
                    const OperatorScale& scale, double tolerance) {
  LinearSolver solver(backend, setup);
  Solved out;
  solver.on_progress([&](int, double residual) { out.history.push_back(residual); });
  const int b = backend.add_vector(), x = backend.add_vector();
  backend.load(p.hierarchy);
  solver.set_structure(p.hierarchy);
  backend.set_operator(scale);
  write(backend, 0, x, p.deformation());
  backend.rotate_cells(x);
  solver.refresh();
  const oracle::Vector right = right_of_solve(p);
  write(backend, 0, b, right);
  write(backend, 0, x, oracle::Vector::Constant(right.size(), std::nan("")));
  out.stats = solver.solve_from_zero(b, x, tolerance);
  out.x = p.read(backend, 0, x);
  return out;
}

}  // namespace kerf::test
