// SPDX-License-Identifier: MIT
#include "bench/candidates.hpp"

namespace kerf::bench {
namespace {

// Vertex Gauss-Seidel with over-relaxation, V(1,1), alone and not as a preconditioner; stored
// matrices on all coarse levels, nodal Galerkin. Level 0 is not stored, to its favour.
// Source  [DGW11] sections 6.1, 6.4.
SolverSetup paper_solver() {
  SolverSetup out;
  out.method = SolverMethod::multigrid;
  out.cycle = CycleType::v;
  out.smoother = SmootherType::gauss_seidel;
  out.omega = 1.7;
  return out;
}

// As many products a cycle as Gauss-Seidel V(1,1) has sweeps and residuals; the default, of
// degree 2, is a V(2,2) in this count.
SolverSetup damped_jacobi() {
  SolverSetup out;
  out.degree = 1;
  return out;
}

SolverSetup by_method(SolverMethod method) {
  SolverSetup out;
  out.method = method;
  return out;
}

}  // namespace

const std::vector<Candidate>& candidates() {
  // The factor of 60 000 vertices takes some 2 GB and half a minute; both grow faster than the
  // body.
  constexpr std::int32_t kMostForCholesky = 60000;
  // The number of iterations grows with the length of the body in cells: minutes beyond.
  constexpr std::int32_t kMostForJacobi = 400000;
  static const std::vector<Candidate> all{
      {"cpu", "the CPU backend with its defaults", "cpu", {}, {}},
      {"reference",
       "the readable reference that all others are tested against",
       "reference",
       {},
       {}},
      {"cpu-degree1",
       "the CPU backend with one step of damped Jacobi a sweep: V(1,1) as [DGW11] counts",
       "cpu",
       damped_jacobi(),
       {"smooth-chebyshev", "cycle", "solve", "step"}},
      {"cuda", "the CUDA backend with its defaults", "cuda", {}, {}},
      {"cuda-degree1",
       "the CUDA backend with one step of damped Jacobi a sweep: V(1,1) as [DGW11] counts",
       "cuda",
       damped_jacobi(),
       {"smooth-chebyshev", "cycle", "solve", "step"}},
      {"cuda-records",
       "the CUDA backend with a record of each cell of level 0, not blocks of vertices",
       "cuda-records",
       {},
       {"operator", "residual", "smooth-chebyshev", "cycle", "force", "solve", "step"}},
      {"dense24", "a plain 24x24 product for each cell", "reference", {}, {"operator"}},
      {"paper",
       "the solver of the 2011 paper: Gauss-Seidel with omega 1.7, V(1,1) alone",
       "reference",
       paper_solver(),
       {"smooth-gauss-seidel", "cycle", "solve", "step"}},
      {"cg-jacobi",
       "conjugate gradients with block Jacobi",
       "cpu",
       by_method(SolverMethod::cg_jacobi),
       {"solve"},
       kMostForJacobi},
      {"cholesky",
       "sparse Cholesky factorisation",
       "cpu",
       by_method(SolverMethod::cholesky),
       {"solve"},
       kMostForCholesky}};
  return all;
}

}  // namespace kerf::bench
