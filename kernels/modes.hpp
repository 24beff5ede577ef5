// SPDX-License-Identifier: MIT
//
// The operator of one finest cell in the mode basis, where K has 45 non-zeros of 576.
//
// With xi_a in [-1, 1] along axis a, the trilinear field of a cell is a sum of eight products of
// the xi. Mode s (bits x = 1, y = 2, z = 4) is the coefficient of the product of the xi_a with a
// in s:   u(xi) = 1/8 sum_s m_s prod_{a in s} xi_a,   m_s = sum_i chi_s(i) u_i,
// where chi_s(i) = +-1 is that product at corner i: the signed Walsh-Hadamard matrix H, with
// H^T H = 8 I. Reflections of the cube split K = H^T S H into eight 3x3 blocks. H acts on corners
// and a rotation on components, so they commute and [R] K [R]^T = H^T [R] S [R]^T H.
//
// Layout  Arrays of 8 Vec3: by corner x + 2 y + 4 z, or by mode with the same bits.
// Units   As hex_element.hpp: E = 1, side = 1; stiffness = E side in N/m, mass = rho side^3 in kg
//         (or kg/s^2 as a time scheme scales it).
// Source  Derived here; K of Dick, Georgii, Westermann 2011 [DGW11], section 6.4.
#pragma once

#include "kernels/hex_element.hpp"
#include "kernels/mat3.hpp"

namespace kerf::kernels {

/// The seven numbers in S, for E = 1. The letter's block, by reflection class p (mode p xor c for
/// component c):
///   1    (x of ux, y of uy, z of uz)   a on the diagonal, b off it
///   x    (xy of uy, xz of uz)          c on the diagonal, d off it; likewise y and z
///   xy   (y of ux, x of uy)            e everywhere, shear;  (xyz of uz) f; likewise xz and yz
///   xyz  (yz of ux, xz of uy, xy of uz)   2 g on the diagonal, g off it
template <class T>
struct ModeStiffness {
  T a, b, c, d, e, f, g;
};

/// Derivatives along an axis bring a factor 2, the mean of xi^2 is 1/3, and 1/64 comes from H.
template <class T>
KERF_HD ModeStiffness<T> mode_stiffness(T poisson) {
  const auto [lambda, mu] = lame_of_unit_modulus(poisson);
  return {(lambda + T(2) * mu) / T(16),
          lambda / T(16),
          (lambda + T(3) * mu) / T(48),
          lambda / T(48),
          mu / T(16),
          (lambda + T(4) * mu) / T(144),
          mu / T(48)};
}

/// All that apply_cell needs of a material and a mass model.
template <class T>
struct ModeConstants {
  ModeStiffness<T> stiffness;
  T mass[4];  // of a mode with 0, 1, 2, 3 axes
};

enum class MassModel : std::uint8_t { consistent, lumped };

/// Mass is diagonal in the mode basis: 3^-|s| / 64 consistent, 1 / 64 lumped.
template <class T>
KERF_HD ModeConstants<T> mode_constants(T poisson, MassModel model) {
  ModeConstants<T> out{mode_stiffness(poisson), {}};
  int denominator = 64;
  for (int axes = 0; axes < 4; ++axes) {
    out.mass[axes] = T(1) / T(denominator);
    if (model == MassModel::consistent) denominator *= 3;
  }
  return out;
}

/// Axes in a mode: its bits.
KERF_HD constexpr int mode_axes(int mode) {
  return (mode & 1) + ((mode >> 1) & 1) + ((mode >> 2) & 1);
}

/// H: corners to modes, in place. 24 additions a component.
template <class T>
KERF_HD void to_modes(Vec3<T> (&v)[kCorners]) {
  for (int bit = 1; bit < kCorners; bit *= 2)
    for (int i = 0; i < kCorners; ++i) {
      if ((i & bit) != 0) continue;
      const Vec3<T> low = v[i], high = v[i + bit];
      v[i] = high + low;
      v[i + bit] = high - low;
    }
}

/// H^T: modes to corners, in place. The inverse of to_modes times 8.
template <class T>
KERF_HD void to_corners(Vec3<T> (&v)[kCorners]) {
  for (int bit = 1; bit < kCorners; bit *= 2)
    for (int i = 0; i < kCorners; ++i) {
      if ((i & bit) != 0) continue;
      const Vec3<T> even = v[i], odd = v[i + bit];
      v[i] = even - odd;
      v[i + bit] = even + odd;
    }
}

/// S m, in place. 35 floating-point slots.
template <class T>
KERF_HD void apply_modes(const ModeStiffness<T>& k, Vec3<T> (&m)[kCorners]) {
  m[0] = {};

  const T volume = k.b * (m[1].x + m[2].y + m[4].z);
  const T deviator = k.a - k.b;
  m[1].x = fma(deviator, m[1].x, volume);
  m[2].y = fma(deviator, m[2].y, volume);
  m[4].z = fma(deviator, m[4].z, volume);

  const Vec3<T> xy = m[3], xz = m[5], yz = m[6];
  m[3].y = fma(k.c, xy.y, k.d * xz.z);
  m[5].z = fma(k.c, xz.z, k.d * xy.y);
  m[3].x = fma(k.c, xy.x, k.d * yz.z);
  m[6].z = fma(k.c, yz.z, k.d * xy.x);
  m[5].x = fma(k.c, xz.x, k.d * yz.y);
  m[6].y = fma(k.c, yz.y, k.d * xz.x);

  m[2].x = m[1].y = k.e * (m[2].x + m[1].y);
  m[4].x = m[1].z = k.e * (m[4].x + m[1].z);
  m[4].y = m[2].z = k.e * (m[4].y + m[2].z);
  m[7] *= k.f;

  const T twist = yz.x + xz.y + xy.z;
  m[6].x = k.g * (yz.x + twist);
  m[5].y = k.g * (xz.y + twist);
  m[3].z = k.g * (xy.z + twist);
}

/// f = stiffness [R] K [R]^T u for one finest cell without inertia; f may be u. 318 slots.
///
/// Shapes  u, f: 8 corners; R: proper rotation from the reference to the deformed cell.
/// Source  [DGW11], section 5.
template <class T>
KERF_HD void apply_cell(const Vec3<T> (&u)[kCorners], const Mat3<T>& R, T stiffness,
                        const ModeStiffness<T>& k, Vec3<T> (&f)[kCorners]) {
  for (int i = 0; i < kCorners; ++i) f[i] = u[i];
  to_modes(f);
  for (int s = 1; s < kCorners; ++s) f[s] = transpose_times(R, f[s]);
  apply_modes(k, f);
  const Mat3<T> scaled = stiffness * R;
  for (int s = 1; s < kCorners; ++s) f[s] = scaled * f[s];
  to_corners(f);
}

/// f = (stiffness [R] K [R]^T + mass M (x) I) u; f may be u.
template <class T>
KERF_HD void apply_cell(const Vec3<T> (&u)[kCorners], const Mat3<T>& R, T stiffness, T mass,
                        const ModeConstants<T>& constants, Vec3<T> (&f)[kCorners]) {
  Vec3<T> modes[kCorners], local[kCorners];
  for (int i = 0; i < kCorners; ++i) modes[i] = u[i];
  to_modes(modes);
  for (int s = 1; s < kCorners; ++s) local[s] = transpose_times(R, modes[s]);
  apply_modes(constants.stiffness, local);
  const Mat3<T> scaled = stiffness * R;
  T inertia[4];
  for (int axes = 0; axes < 4; ++axes) inertia[axes] = mass * constants.mass[axes];
  f[0] = inertia[0] * modes[0];
  for (int s = 1; s < kCorners; ++s) {
    const T m = inertia[mode_axes(s)];
    const Vec3<T> elastic = scaled * local[s];
    f[s] = {fma(m, modes[s].x, elastic.x), fma(m, modes[s].y, elastic.y),
            fma(m, modes[s].z, elastic.z)};
  }
  to_corners(f);
}

/// f = [R] K ([R]^T (x + u) - x), the elastic force of one cell; f may be u.
/// Translations drop out, so the rest positions x enter through the three linear modes only:
/// x_i - centre = side/2 chi, that is 4 side in component a of mode a. They are turned by R - I, so
/// that the strain of a stiff body, far below 1, is not what is left of the difference of two ones.
///
/// Shapes  u, f: 8 corners; side in m; stiffness = E side.
/// Source  [DGW11], section 5.
template <class T>
KERF_HD void elastic_force(const Vec3<T> (&u)[kCorners], const Quat<T>& rotation, T side,
                           T stiffness, const ModeStiffness<T>& k, Vec3<T> (&f)[kCorners]) {
  const Mat3<T> D = to_matrix_less_identity(rotation), R = Mat3<T>::identity() + D;
  for (int i = 0; i < kCorners; ++i) f[i] = u[i];
  to_modes(f);
  const T rest = T(4) * side;
  for (int s = 1; s < kCorners; ++s) f[s] = transpose_times(R, f[s]);
  for (int a = 0; a < 3; ++a) f[1 << a] += rest * Vec3<T>{D[a][0], D[a][1], D[a][2]};
  apply_modes(k, f);
  for (int s = 1; s < kCorners; ++s) f[s] = stiffness * (R * f[s]);
  to_corners(f);
}

}  // namespace kerf::kernels
