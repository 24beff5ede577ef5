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
// Layout  By corner x + 2 y + 4 z: 8 Vec3. By mode, with the same bits: [component][mode].
// Units   As hex_element.hpp: E = 1, side = 1; stiffness = E side in N/m, mass = rho side^3 in kg
//         (or kg/s^2 as a time scheme scales it).
// Source  Derived here; K of Dick, Georgii, Westermann 2011 [DGW11], section 6.4.
#pragma once

#include "kernels/hex_element.hpp"
#include "kernels/mat3.hpp"
#include "kernels/unrolled.hpp"

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

/// One axis of H, of the v[i] with i without the bits `skipped`.
template <int bit, int skipped, class T>
KERF_HD void walsh_axis(T (&v)[kCorners]) {
  unrolled<kCorners>([&](auto i) {
    if constexpr ((i & (bit | skipped)) == 0) {
      const T low = v[i], high = v[i + bit];
      v[i] = high + low;
      v[i + bit] = high - low;
    }
  });
}
/// One axis of H^T.
template <int bit, class T>
KERF_HD void corner_axis(T (&v)[kCorners]) {
  unrolled<kCorners>([&](auto i) {
    if constexpr ((i & bit) == 0) {
      const T even = v[i], odd = v[i + bit];
      v[i] = even - odd;
      v[i + bit] = even + odd;
    }
  });
}

/// H: corners to modes, of one component, in place. 24 additions.
template <class T>
KERF_HD void to_modes(T (&v)[kCorners]) {
  walsh_axis<1, 0>(v);
  walsh_axis<2, 0>(v);
  walsh_axis<4, 0>(v);
}
/// H^T: modes to corners, in place. The inverse of to_modes times 8.
template <class T>
KERF_HD void to_corners(T (&v)[kCorners]) {
  corner_axis<1>(v);
  corner_axis<2>(v);
  corner_axis<4>(v);
}

/// The same for vectors, m[component][mode], one component after the other: eight packs fit into
/// registers, and 24 do not.
template <class T>
KERF_HD void to_modes(const Vec3<T> (&v)[kCorners], T (&m)[3][kCorners]) {
  unrolled<kCorners>([&](auto i) { m[0][i] = v[i].x; });
  to_modes(m[0]);
  unrolled<kCorners>([&](auto i) { m[1][i] = v[i].y; });
  to_modes(m[1]);
  unrolled<kCorners>([&](auto i) { m[2][i] = v[i].z; });
  to_modes(m[2]);
}
template <class T>
KERF_HD void to_corners(T (&m)[3][kCorners], Vec3<T> (&v)[kCorners]) {
  to_corners(m[0]);
  unrolled<kCorners>([&](auto i) { v[i].x = m[0][i]; });
  to_corners(m[1]);
  unrolled<kCorners>([&](auto i) { v[i].y = m[1][i]; });
  to_corners(m[2]);
  unrolled<kCorners>([&](auto i) { v[i].z = m[2][i]; });
}

/// Three modes in the frame of a cell: l[n] = R^T m. By rows of R, so that only l and a row need
/// registers.
template <int first, int second, int third, class T>
KERF_HD void modes_into_frame(const Mat3<T>& R, const T (&m)[3][kCorners], T (&l)[3][3]) {
  constexpr int modes[] = {first, second, third};
  unrolled<3>([&](auto row) {
    constexpr int i = 2 - decltype(row)::value;
    const T r0 = R[i][0], r1 = R[i][1], r2 = R[i][2];
    unrolled<3>([&](auto mode) {
      constexpr int n = decltype(mode)::value;
      const T g = m[i][modes[n]];
      l[n][0] = i == 2 ? r0 * g : fma(r0, g, l[n][0]);
      l[n][1] = i == 2 ? r1 * g : fma(r1, g, l[n][1]);
      l[n][2] = i == 2 ? r2 * g : fma(r2, g, l[n][2]);
    });
  });
}
/// And back: m = R l, or R l + inertia m.
template <int first, int second, int third, bool with_inertia, class T>
KERF_HD void modes_from_frame(const Mat3<T>& R, const T (&l)[3][3], T inertia,
                              T (&m)[3][kCorners]) {
  constexpr int modes[] = {first, second, third};
  unrolled<3>([&](auto row) {
    constexpr int i = decltype(row)::value;
    const T r0 = R[i][0], r1 = R[i][1], r2 = R[i][2];
    unrolled<3>([&](auto mode) {
      constexpr int n = decltype(mode)::value;
      T& out = m[i][modes[n]];
      const T last = with_inertia ? fma(r2, l[n][2], inertia * out) : r2 * l[n][2];
      out = fma(r0, l[n][0], fma(r1, l[n][1], last));
    });
  });
}

/// S of the modes x, y and z of a cell, l[mode][component], in place.
template <class T>
KERF_HD void apply_linear_modes(const ModeStiffness<T>& k, T (&l)[3][3]) {
  const T volume = k.b * (l[0][0] + l[1][1] + l[2][2]);
  const T deviator = k.a - k.b;
  l[0][0] = fma(deviator, l[0][0], volume);
  l[1][1] = fma(deviator, l[1][1], volume);
  l[2][2] = fma(deviator, l[2][2], volume);
  l[1][0] = l[0][1] = k.e * (l[1][0] + l[0][1]);
  l[2][0] = l[0][2] = k.e * (l[2][0] + l[0][2]);
  l[2][1] = l[1][2] = k.e * (l[2][1] + l[1][2]);
}

/// S of the modes xy, xz and yz.
template <class T>
KERF_HD void apply_bilinear_modes(const ModeStiffness<T>& k, T (&l)[3][3]) {
  const auto couple = [&](T& p, T& q) {
    const T was = p;
    p = fma(k.c, was, k.d * q);
    q = fma(k.c, q, k.d * was);
  };
  couple(l[0][1], l[1][2]);
  couple(l[0][0], l[2][2]);
  couple(l[1][0], l[2][1]);
  const T twist = l[2][0] + l[1][1] + l[0][2];
  l[2][0] = k.g * (l[2][0] + twist);
  l[1][1] = k.g * (l[1][1] + twist);
  l[0][2] = k.g * (l[0][2] + twist);
}

/// m = stiffness [R] S [R]^T m, or that + inertia m, in place; inertia of a mode with 0, 1, 2, 3
/// axes. add_rest(l) adds to the linear modes in the frame of the cell.
template <bool with_inertia, class T, class Rest>
KERF_HD void apply_modes(const Mat3<T>& R, T stiffness, const ModeStiffness<T>& unit,
                         const T (&inertia)[4], const Rest& add_rest, T (&m)[3][kCorners]) {
  const ModeStiffness<T> k{stiffness * unit.a, stiffness * unit.b, stiffness * unit.c,
                           stiffness * unit.d, stiffness * unit.e, stiffness * unit.f,
                           stiffness * unit.g};
  unrolled<3>([&](auto i) { m[i][0] = with_inertia ? inertia[0] * m[i][0] : T(0); });
  T linear[3][3];
  modes_into_frame<1, 2, 4>(R, m, linear);
  add_rest(linear);
  apply_linear_modes(k, linear);
  modes_from_frame<1, 2, 4, with_inertia>(R, linear, inertia[1], m);
  T bilinear[3][3];
  modes_into_frame<3, 5, 6>(R, m, bilinear);
  apply_bilinear_modes(k, bilinear);
  modes_from_frame<3, 5, 6, with_inertia>(R, bilinear, inertia[2], m);
  // Mode xyz is a multiple of its own, and R R^T = 1.
  const T all = with_inertia ? k.f + inertia[3] : k.f;
  unrolled<3>([&](auto i) { m[i][7] *= all; });
}

/// f = stiffness [R] K [R]^T u for one finest cell without inertia; f may be u. 300 slots.
///
/// Shapes  u, f: 8 corners; R: proper rotation from the reference to the deformed cell.
/// Source  [DGW11], section 5.
template <class T>
KERF_HD void apply_cell(const Vec3<T> (&u)[kCorners], const Mat3<T>& R, T stiffness,
                        const ModeStiffness<T>& k, Vec3<T> (&f)[kCorners]) {
  T m[3][kCorners];
  to_modes(u, m);
  const T inertia[4] = {T(0), T(0), T(0), T(0)};
  apply_modes<false>(
      R, stiffness, k, inertia, [](const auto&) {}, m);
  to_corners(m, f);
}

/// f = (stiffness [R] K [R]^T + mass M (x) I) u; f may be u.
template <class T>
KERF_HD void apply_cell(const Vec3<T> (&u)[kCorners], const Mat3<T>& R, T stiffness, T mass,
                        const ModeConstants<T>& constants, Vec3<T> (&f)[kCorners]) {
  T m[3][kCorners];
  to_modes(u, m);
  const T(&unit)[4] = constants.mass;
  const T inertia[4] = {mass * unit[0], mass * unit[1], mass * unit[2], mass * unit[3]};
  apply_modes<true>(
      R, stiffness, constants.stiffness, inertia, [](const auto&) {}, m);
  to_corners(m, f);
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
  T m[3][kCorners];
  to_modes(u, m);
  const T rest = T(4) * side;
  const T inertia[4] = {T(0), T(0), T(0), T(0)};
  const auto add_rest = [&](T(&l)[3][3]) {
    unrolled<3>([&](auto n) {
      unrolled<3>([&](auto i) { l[n][i] = fma(rest, D[n][i], l[n][i]); });
    });
  };
  apply_modes<false>(R, stiffness, k, inertia, add_rest, m);
  to_corners(m, f);
}

}  // namespace kerf::kernels
