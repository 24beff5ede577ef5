// SPDX-License-Identifier: MIT
//
// One update of one vertex from the residual its cells contribute.
// The caller owns the loop and the gather, skips fixed vertices, and in Gauss-Seidel takes one
// colour at a time, so no two vertices in flight share a cell and nothing here needs an atomic.
#pragma once

#include "kernels/mat3.hpp"

namespace kerf::kernels {

/// u + omega D^-1 r for one vertex.
///
/// Shapes  u, r: 3-vectors; D: 3x3, symmetric positive semi-definite.
/// Units   u in m, r in N, D in N/m; omega is a ratio in (0, 2).
/// Needs   Where D has no pivot (a component without stiffness or mass) u stays.
/// Source  Dick, Georgii, Westermann 2011 [DGW11], section 6.1.
template <class T>
KERF_HD Vec3<T> relax_vertex(const Vec3<T>& u, const Vec3<T>& r, const Mat3<T>& D, T omega) {
  return u + omega * solve3(D, r);
}

/// The same with D^-1 at hand (inverse_semidefinite), as a block-Jacobi or Chebyshev smoother
/// keeps.
template <class T>
KERF_HD Vec3<T> relax_vertex(const Vec3<T>& u, const Vec3<T>& r, const Sym3<T>& inverse, T omega) {
  return u + omega * (inverse * r);
}

}  // namespace kerf::kernels
