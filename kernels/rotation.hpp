// SPDX-License-Identifier: MIT
//
// The rotation of a cell from its displacements.
//
// The energy of [DGW11], section 5, is the integral of |R^T (x + u - c) - (x - c0)|^2. All of it
// but -2 tr(R^T G), with G the integral of (x + u - c) (x - c0)^T, does not depend on R. x - c0 is
// side/2 times the xi of modes.hpp, and the products of the xi are orthogonal, so G sees the linear
// modes of u alone: G = side^5/12 F, with F = I + the mean gradient of u over the cell. The energy
// is therefore least where tr(R^T F) is greatest over the proper rotations: at the polar factor of
// F if det F >= 0, and in general at U diag(1, 1, sign det F) V^T of its singular value
// decomposition. No quadrature is needed, and nothing is lost.
//
// A point where S = R^T F is symmetric and tr(S) I - S is positive definite is a maximum, and the
// only one: the eigenvalues of S then have positive pairwise sums, so at most the smallest in size
// is negative, which is the decomposition above. Newton's iteration from the rotation of the step
// before thus carries its own proof; whatever it does not prove goes to the quaternion formulation.
//
// Units   F, R, quaternions: ratios; u and side in m.
// Source  Georgii, Westermann 2008 [GW08]; Horn 1987 [H87].
#pragma once

#include "kernels/layout.hpp"
#include "kernels/mat3.hpp"

namespace kerf::kernels {

/// F = I + mean displacement gradient of a cell: the three linear modes over 4 side.
///
/// Shapes  u: 8 corners (of the cell, not slots: unfold first).
template <class T>
KERF_HD Mat3<T> mean_gradient(const Vec3<T> (&u)[kCorners], T side) {
  const Vec3<T> mode[3] = {((u[1] - u[0]) + (u[3] - u[2])) + ((u[5] - u[4]) + (u[7] - u[6])),
                           ((u[2] - u[0]) + (u[3] - u[1])) + ((u[6] - u[4]) + (u[7] - u[5])),
                           ((u[4] - u[0]) + (u[5] - u[1])) + ((u[6] - u[2]) + (u[7] - u[3]))};
  const T scale = T(1) / (T(4) * side);
  const auto less_identity = [&](int c, int a) { return scale * mode[a][c]; };
  return {{{T(1) + less_identity(0, 0), less_identity(0, 1), less_identity(0, 2)},
           {less_identity(1, 0), T(1) + less_identity(1, 1), less_identity(1, 2)},
           {less_identity(2, 0), less_identity(2, 1), T(1) + less_identity(2, 2)}}};
}

template <class T>
struct RotationStep {
  Quat<T> next;                  // not of length 1
  T length2;                     // of the rotation vector, radians squared
  decltype(T(0) < T(0)) ascent;  // tr(S) I - S was safely positive definite
  Sym3<T> half_inverse;          // of tr(S) I - S, over 2 |q|^2; zero without ascent
  T trace;                       // of tr(S) I - S, times |q|^2: twice tr(S)
  T spread2;  // sum of squares of tr(S) I - S less its mean, times |q|^4, to roundings of trace^2
};

/// q times (1, w).
template <class T>
KERF_HD Quat<T> turned_on(const Quat<T>& q, const Vec3<T>& w) {
  const Vec3<T> less = -w;
  return {fma(q.x, less.x, fma(q.y, less.y, fma(q.z, less.z, q.w))),
          fma(q.w, w.x, fma(q.y, w.z, fma(q.z, less.y, q.x))),
          fma(q.w, w.y, fma(q.z, w.x, fma(q.x, less.z, q.y))),
          fma(q.w, w.z, fma(q.x, w.y, fma(q.y, less.x, q.z)))};
}

/// One Newton step for the maximum of tr(R^T F): omega = (tr(S) I - S)^-1 axial(R^T F), applied as
/// the Cayley quaternion (1, omega / 2). Where that matrix is not safely positive definite, q
/// stays. A step from a longer q is the same, so several need no square root but that of
/// normalised() behind the last: the next q is sqrt(1 + omega^2 / 4) times as long.
///
/// Needs  |q|^2 F neither so large nor so small that its cube over- or underflows: in single
///        precision the q of five steps, each from near a half turn, comes close. Where it is, the
///        next q may be no number, without ascent; next to underflow the inverse has few digits.
template <class T>
KERF_HD void rotation_step(const Mat3<T>& F, const Quat<T>& q, RotationStep<T>& out) {
  // det > 1e-3 tr^3 keeps the smallest eigenvalue above 0.4 % of the trace; at rest the ratio is
  // 0.037, the greatest there is.
  const T kSafe = T(1e-3);
  const Mat3<T> A = transpose(to_scaled_matrix(q)) * F;
  const Vec3<T> axial{A[2][1] - A[1][2], A[0][2] - A[2][0], A[1][0] - A[0][1]};
  const T hxx = A[1][1] + A[2][2], hyy = A[0][0] + A[2][2], hzz = A[0][0] + A[1][1];
  const T sxy = T(0.5) * (A[0][1] + A[1][0]), sxz = T(0.5) * (A[0][2] + A[2][0]),
          syz = T(0.5) * (A[1][2] + A[2][1]);

  const T cxx = fma(hyy, hzz, -(syz * syz)), cyy = fma(hxx, hzz, -(sxz * sxz)),
          czz = fma(hxx, hyy, -(sxy * sxy));
  const T cxy = fma(sxz, syz, hzz * sxy), cxz = fma(sxy, syz, hyy * sxz),
          cyz = fma(sxy, sxz, hxx * syz);
  const T det = fma(hxx, cxx, -fma(sxy, cxy, sxz * cxz));
  const T trace = hxx + hyy + hzz;
  const T off = fma(sxy, sxy, fma(sxz, sxz, syz * syz));
  const T squares = fma(hxx, hxx, fma(hyy, hyy, fma(hzz, hzz, off + off)));
  // Near a half turn hxx and hyy can be rounding above zero, with det and trace below; and so can
  // all be whose trace is small beside the matrix. Of a positive definite one the trace is greater.
  const auto ascent = hxx > T(0) && czz > T(0) && trace > T(0) && squares <= trace * trace &&
                      det > kSafe * (trace * trace * trace);
  const T half = select(ascent, T(0.5) / select(ascent, det, T(1)), T(0));
  const Vec3<T> w{half * fma(cxx, axial.x, fma(cxy, axial.y, cxz * axial.z)),
                  half * fma(cxy, axial.x, fma(cyy, axial.y, cyz * axial.z)),
                  half * fma(cxz, axial.x, fma(cyz, axial.y, czz * axial.z))};
  out.next = turned_on(q, w);
  out.length2 = T(4) * dot(w, w);
  out.ascent = ascent;
  out.half_inverse = {half * cxx, half * cxy, half * cxz, half * cyy, half * cyz, half * czz};
  out.trace = trace;
  out.spread2 = fma(T(-1.0 / 3.0), trace * trace, squares);
}

/// A fixed number of Newton steps; the fast path for cells that are neither inverted nor collapsed.
/// Two from the rotation of the step before reach 1e-6 from 10 degrees off and 30 % stretch.
///
/// Needs  as rotation_step. An inverted cell may keep `start` or reach no maximum:
/// extract_rotation.
template <class T>
KERF_HD Quat<T> rotation_newton(const Mat3<T>& F, Quat<T> start, int iterations) {
  RotationStep<T> step;
  for (int i = 0; i < iterations; ++i) {
    rotation_step(F, start, step);
    start = step.next;
  }
  return normalised(start);
}

/// Horn's matrix N with tr(R(q)^T F) = q^T N q for a unit quaternion q = (w, x, y, z).
/// `F`: whatever has entries F[row][column].
template <class T, class Matrix>
KERF_HD void horn_matrix(const Matrix& F, T (&N)[4][4]) {
  N[0][0] = F[0][0] + F[1][1] + F[2][2];
  N[1][1] = F[0][0] - F[1][1] - F[2][2];
  N[2][2] = F[1][1] - F[0][0] - F[2][2];
  N[3][3] = F[2][2] - F[0][0] - F[1][1];
  N[0][1] = N[1][0] = F[2][1] - F[1][2];
  N[0][2] = N[2][0] = F[0][2] - F[2][0];
  N[0][3] = N[3][0] = F[1][0] - F[0][1];
  N[1][2] = N[2][1] = F[0][1] + F[1][0];
  N[1][3] = N[3][1] = F[0][2] + F[2][0];
  N[2][3] = N[3][2] = F[1][2] + F[2][1];
}

/// The axial vector of R^T F, times |q|^2, as the vector part of conj(q) N q: without R.
template <class T, class Matrix>
KERF_HD Vec3<T> horn_axial(const Matrix& F, const Quat<T>& q) {
  T N[4][4];
  horn_matrix(F, N);
  const auto row = [&](int i) {
    return fma(N[i][0], q.w, fma(N[i][1], q.x, fma(N[i][2], q.y, N[i][3] * q.z)));
  };
  const T w = row(0);
  const Vec3<T> v{row(1), row(2), row(3)};
  return {fma(q.w, v.x, fma(-q.x, w, fma(-q.y, v.z, q.z * v.y))),
          fma(q.w, v.y, fma(-q.y, w, fma(-q.z, v.x, q.x * v.z))),
          fma(q.w, v.z, fma(-q.z, w, fma(-q.x, v.y, q.y * v.x)))};
}

/// One Jacobi rotation that zeroes N[p][q]; the columns of V collect the eigenvectors.
template <class T>
KERF_HD void jacobi_rotate(T (&N)[4][4], T (&V)[4][4], int p, int q) {
  // tan of the smaller angle, 2 b / (d + sign(d) sqrt(d^2 + 4 b^2)): no cancellation, no branch on
  // a quotient, zero where the entry is zero.
  const T b = N[p][q], d = N[q][q] - N[p][p];
  const T root = sqrt(d * d + T(4) * (b * b));
  const T below = d + (d < T(0) ? -root : root);
  const T t = below != T(0) ? (b + b) / below : T(0);
  const T c = T(1) / sqrt(T(1) + t * t), s = t * c;
  for (int k = 0; k < 4; ++k) {
    const T kp = N[k][p], kq = N[k][q];
    N[k][p] = c * kp - s * kq;
    N[k][q] = s * kp + c * kq;
  }
  for (int k = 0; k < 4; ++k) {
    const T pk = N[p][k], qk = N[q][k];
    N[p][k] = c * pk - s * qk;
    N[q][k] = s * pk + c * qk;
  }
  N[p][q] = N[q][p] = T(0);
  for (int k = 0; k < 4; ++k) {
    const T kp = V[k][p], kq = V[k][q];
    V[k][p] = c * kp - s * kq;
    V[k][q] = s * kp + c * kq;
  }
}

/// The maximum of tr(R^T F) as the dominant eigenvector of Horn's matrix. Where several rotations
/// are equally good (a collapsed or an inverted, equally stretched cell), the one nearest to
/// `start`.
///
/// Needs  |start| = 1; the greatest entry of F near 1.
template <class T>
KERF_HD Quat<T> rotation_horn(const Mat3<T>& F, const Quat<T>& start) {
  constexpr int kSweeps = 8;  // quadratic convergence: double needs 5 or 6; a fixed count for lanes
  T N[4][4], V[4][4] = {};
  horn_matrix(F, N);
  for (int k = 0; k < 4; ++k) V[k][k] = T(1);
  for (int sweep = 0; sweep < kSweeps; ++sweep)
    for (int p = 0; p < 3; ++p)
      for (int q = p + 1; q < 4; ++q) jacobi_rotate(N, V, p, q);

  int best = 0;
  for (int k = 1; k < 4; ++k)
    if (N[k][k] > N[best][best]) best = k;
  // The sweeps leave some tens of roundings of the greatest entry of F, which is 1, on an
  // eigenvalue.
  const T tie = N[best][best] - T(64) * Precision<T>::kEpsilon;
  const T from[4] = {start.w, start.x, start.y, start.z};
  T near[4] = {};
  T length2 = T(0);
  for (int k = 0; k < 4; ++k) {
    if (N[k][k] < tie) continue;
    const T share = from[0] * V[0][k] + from[1] * V[1][k] + from[2] * V[2][k] + from[3] * V[3][k];
    length2 += share * share;
    for (int i = 0; i < 4; ++i) near[i] += share * V[i][k];
  }
  // A start orthogonal to all of the best (180 degrees off) has no nearest: take the first.
  if (length2 < T(1e-6)) return normalised(Quat<T>{V[0][best], V[1][best], V[2][best], V[3][best]});
  return normalised(Quat<T>{near[0], near[1], near[2], near[3]});
}

/// F over its greatest entry in size; all zero if F is zero, and if it is not finite.
template <class T>
KERF_HD Mat3<T> scaled_to_one(const Mat3<T>& F) {
  T greatest = T(0);
  bool finite = true;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const T size = F[i][j] < T(0) ? -F[i][j] : F[i][j];
      finite = finite && size - size == T(0);
      greatest = size > greatest ? size : greatest;
    }
  Mat3<T> out;
  if (!finite || greatest == T(0)) return out;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) out[i][j] = F[i][j] / greatest;
  return out;
}

/// The proper rotation of least element energy for any F, inverted, flat or collapsed ones
/// included. Newton from `start` to round-off; Horn's quaternion where Newton proves nothing.
/// Deterministic, never NaN: F = 0, or one that is not finite, keeps `start`.
///
/// Source  [DGW11], section 5; [H87].
template <class T>
KERF_HD Quat<T> extract_rotation(const Mat3<T>& F, const Quat<T>& start) {
  constexpr int kIterations = 8;  // 4 from 60 degrees off
  // A step this small is followed by an error of its square, well below rounding.
  const T kSmall2 = T(0.01) * Precision<T>::kEpsilon;
  const Mat3<T> scaled = scaled_to_one(F);
  const Quat<T> first = normalised(start);
  Quat<T> q = first;
  RotationStep<T> step;
  for (int i = 0; i < kIterations; ++i) {
    rotation_step(scaled, q, step);
    if (!step.ascent) break;
    q = step.next;
    if (step.length2 <= kSmall2) return normalised(q);
  }
  return rotation_horn(scaled, first);
}

/// extract_rotation in double, but for the last step in single precision, where devices have twice
/// the arithmetic or more. That step is of 1e-6 at most, and so wrong by 1e-12 times trace over
/// least eigenvalue of its matrix; what does not come so far goes the way of extract_rotation.
KERF_HD Quat<double> extract_rotation_mixed(const Mat3<double>& F, const Quat<double>& start) {
  constexpr int kIterations = 5;
  constexpr float kNear2 = 1e-6F;  // squares of radians
  constexpr double kLast2 = 1e-12;
  Mat3<float> single;
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b) single[a][b] = static_cast<float>(F[a][b]);
  Quat<float> q{static_cast<float>(start.w), static_cast<float>(start.x),
                static_cast<float>(start.y), static_cast<float>(start.z)};
  RotationStep<float> step;
  for (int i = 0; i < kIterations; ++i) {
    rotation_step(single, q, step);
    q = step.next;
    if (!step.ascent || step.length2 <= kNear2) break;
  }
  if (!step.ascent) return extract_rotation(F, start);
  RotationStep<double> last;
  rotation_step(F, normalised(Quat<double>{q.w, q.x, q.y, q.z}), last);
  const bool is_last = last.ascent && last.length2 <= kLast2;
  return is_last ? normalised(last.next) : extract_rotation(F, start);
}

}  // namespace kerf::kernels
