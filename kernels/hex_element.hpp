// SPDX-License-Identifier: MIT
//
// The trilinear hexahedron: stiffness and mass of a unit cube by quadrature, once per material.
//
// Layout  Corner = x + 2 y + 4 z; unknown = 3 * corner + component.
// Units   E = 1 and side = 1; a cube of side s and modulus E has s E k, and mass rho s^3 m.
// Source  Dick, Georgii, Westermann 2011 [DGW11], sections 5 and 6.4; Bathe 2002 [B02], 4.2, 5.3.
#pragma once

#include "kernels/fma.hpp"
#include "kernels/layout.hpp"

namespace kerf::kernels {

template <class T>
struct HexStiffness {
  T k[kUnknowns][kUnknowns];
};

/// Mass couples equal components only: one scalar for a pair of corners.
template <class T>
struct HexMass {
  T m[kCorners][kCorners];
};

/// The two constants of an isotropic material of E = 1.
template <class T>
struct Lame {
  T lambda, mu;
};

/// Needs  poisson in (-1, 1/2).
template <class T>
KERF_HD Lame<T> lame_of_unit_modulus(T poisson) {
  return {poisson / ((T(1) + poisson) * (T(1) - T(2) * poisson)), T(1) / (T(2) * (T(1) + poisson))};
}

/// Gradients of the eight shape functions at a point of [0, 1]^3.
template <class T>
KERF_HD void shape_gradients(const T (&at)[3], T (&gradient)[kCorners][3]) {
  for (int i = 0; i < kCorners; ++i) {
    T value[3], slope[3];
    for (int a = 0; a < 3; ++a) {
      const bool high = ((i >> a) & 1) != 0;
      value[a] = high ? at[a] : T(1) - at[a];
      slope[a] = high ? T(1) : T(-1);
    }
    gradient[i][0] = slope[0] * value[1] * value[2];
    gradient[i][1] = value[0] * slope[1] * value[2];
    gradient[i][2] = value[0] * value[1] * slope[2];
  }
}

/// Integral of B^T D B over the unit cube, 2x2x2 Gauss points: exact, for B is at most linear
/// along each axis. Symmetric to the last bit, for the terms of (i, j) and (j, i) are the same.
///
/// Needs  poisson in (-1, 1/2).
template <class T>
KERF_HD HexStiffness<T> unit_hex_stiffness(T poisson) {
  const Lame<T> material = lame_of_unit_modulus(poisson);
  const T offset = T(1) / (T(2) * sqrt(T(3)));
  HexStiffness<T> out{};
  for (int q = 0; q < 8; ++q) {
    T at[3], g[kCorners][3];
    for (int a = 0; a < 3; ++a) at[a] = T(0.5) + (((q >> a) & 1) != 0 ? offset : -offset);
    shape_gradients(at, g);
    for (int i = 0; i < kCorners; ++i)
      for (int j = 0; j < kCorners; ++j) {
        const T laplace = material.mu * (g[i][0] * g[j][0] + g[i][1] * g[j][1] + g[i][2] * g[j][2]);
        for (int a = 0; a < 3; ++a)
          for (int b = 0; b < 3; ++b) {
            const T coupling =
                material.lambda * (g[i][a] * g[j][b]) + material.mu * (g[i][b] * g[j][a]);
            out.k[3 * i + a][3 * j + b] += T(0.125) * (coupling + (a == b ? laplace : T(0)));
          }
      }
  }
  return out;
}

/// Consistent mass: per axis 1/3 for equal and 1/6 for opposite ends. Sums to 1.
template <class T>
KERF_HD HexMass<T> unit_hex_mass() {
  HexMass<T> out{};
  for (int i = 0; i < kCorners; ++i)
    for (int j = 0; j < kCorners; ++j) {
      int denominator = 1;
      for (int a = 0; a < 3; ++a) denominator *= (((i ^ j) >> a) & 1) != 0 ? 6 : 3;
      out.m[i][j] = T(1) / T(denominator);
    }
  return out;
}

/// Lumped mass: an eighth at each corner.
template <class T>
KERF_HD HexMass<T> unit_hex_mass_lumped() {
  HexMass<T> out{};
  for (int i = 0; i < kCorners; ++i) out.m[i][i] = T(0.125);
  return out;
}

}  // namespace kerf::kernels
