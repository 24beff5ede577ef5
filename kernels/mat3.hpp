// SPDX-License-Identifier: MIT
//
// Three-vectors, three-by-three matrices and quaternions, values only.
//
// Layout  Mat3 is row-major: m[row][column].
#pragma once

#include "kernels/fma.hpp"
#include "kernels/unrolled.hpp"

namespace kerf::kernels {

template <class T>
struct Vec3 {
  T x{}, y{}, z{};

  // Written out, since GCC 12 clears an array of an aggregate whose scalars do nothing themselves.
  KERF_HD constexpr Vec3() {}
  KERF_HD constexpr Vec3(const T& a, const T& b, const T& c) : x(a), y(b), z(c) {}

  KERF_HD T& operator[](int i) { return i == 0 ? x : (i == 1 ? y : z); }
  KERF_HD const T& operator[](int i) const { return i == 0 ? x : (i == 1 ? y : z); }

  KERF_HD Vec3& operator+=(const Vec3& b) {
    x += b.x;
    y += b.y;
    z += b.z;
    return *this;
  }
  KERF_HD Vec3& operator-=(const Vec3& b) {
    x -= b.x;
    y -= b.y;
    z -= b.z;
    return *this;
  }
  KERF_HD Vec3& operator*=(T s) {
    x *= s;
    y *= s;
    z *= s;
    return *this;
  }
  friend KERF_HD Vec3 operator+(Vec3 a, const Vec3& b) { return a += b; }
  friend KERF_HD Vec3 operator-(Vec3 a, const Vec3& b) { return a -= b; }
  friend KERF_HD Vec3 operator*(T s, Vec3 a) { return a *= s; }
  friend KERF_HD Vec3 operator*(Vec3 a, T s) { return a *= s; }
  friend KERF_HD Vec3 operator-(const Vec3& a) { return {-a.x, -a.y, -a.z}; }
  friend KERF_HD bool operator==(const Vec3& a, const Vec3& b) {
    return a.x == b.x && a.y == b.y && a.z == b.z;
  }
};

template <class T>
KERF_HD T dot(const Vec3<T>& a, const Vec3<T>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

template <class T>
KERF_HD Vec3<T> cross(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

template <class T>
KERF_HD T norm(const Vec3<T>& a) {
  return sqrt(dot(a, a));
}

template <class T>
struct Mat3 {
  T m[3][3]{};

  KERF_HD T* operator[](int row) { return m[row]; }
  KERF_HD const T* operator[](int row) const { return m[row]; }

  KERF_HD static Mat3 identity() {
    return {{{T(1), T(0), T(0)}, {T(0), T(1), T(0)}, {T(0), T(0), T(1)}}};
  }
  KERF_HD Mat3& operator+=(const Mat3& b) {
    unrolled<9>([&](auto at) { m[at / 3][at % 3] += b.m[at / 3][at % 3]; });
    return *this;
  }
  KERF_HD Mat3& operator*=(T s) {
    unrolled<9>([&](auto at) { m[at / 3][at % 3] *= s; });
    return *this;
  }
  friend KERF_HD Mat3 operator+(Mat3 a, const Mat3& b) { return a += b; }
  // In one go: an array of packs that is filled later is cleared first.
  friend KERF_HD Mat3 operator*(T s, const Mat3& a) {
    return {{{s * a[0][0], s * a[0][1], s * a[0][2]},
             {s * a[1][0], s * a[1][1], s * a[1][2]},
             {s * a[2][0], s * a[2][1], s * a[2][2]}}};
  }
};

template <class T>
KERF_HD Vec3<T> operator*(const Mat3<T>& a, const Vec3<T>& v) {
  return {fma(a[0][0], v.x, fma(a[0][1], v.y, a[0][2] * v.z)),
          fma(a[1][0], v.x, fma(a[1][1], v.y, a[1][2] * v.z)),
          fma(a[2][0], v.x, fma(a[2][1], v.y, a[2][2] * v.z))};
}

/// transpose(a) * v without forming the transpose.
template <class T>
KERF_HD Vec3<T> transpose_times(const Mat3<T>& a, const Vec3<T>& v) {
  return {fma(a[0][0], v.x, fma(a[1][0], v.y, a[2][0] * v.z)),
          fma(a[0][1], v.x, fma(a[1][1], v.y, a[2][1] * v.z)),
          fma(a[0][2], v.x, fma(a[1][2], v.y, a[2][2] * v.z))};
}

template <class T>
KERF_HD Mat3<T> operator*(const Mat3<T>& a, const Mat3<T>& b) {
  const auto at = [&](int i, int j) {
    return fma(a[i][0], b[0][j], fma(a[i][1], b[1][j], a[i][2] * b[2][j]));
  };
  return {{{at(0, 0), at(0, 1), at(0, 2)},
           {at(1, 0), at(1, 1), at(1, 2)},
           {at(2, 0), at(2, 1), at(2, 2)}}};
}

template <class T>
KERF_HD Mat3<T> transpose(const Mat3<T>& a) {
  return {{{a[0][0], a[1][0], a[2][0]}, {a[0][1], a[1][1], a[2][1]}, {a[0][2], a[1][2], a[2][2]}}};
}

template <class T>
KERF_HD T determinant(const Mat3<T>& a) {
  return a[0][0] * (a[1][1] * a[2][2] - a[1][2] * a[2][1]) -
         a[0][1] * (a[1][0] * a[2][2] - a[1][2] * a[2][0]) +
         a[0][2] * (a[1][0] * a[2][1] - a[1][1] * a[2][0]);
}

/// A symmetric matrix, six numbers.
template <class T>
struct Sym3 {
  T xx{}, xy{}, xz{}, yy{}, yz{}, zz{};

  KERF_HD Mat3<T> full() const {
    Mat3<T> a;
    a[0][0] = xx;
    a[1][1] = yy;
    a[2][2] = zz;
    a[0][1] = a[1][0] = xy;
    a[0][2] = a[2][0] = xz;
    a[1][2] = a[2][1] = yz;
    return a;
  }
  KERF_HD Sym3& operator+=(const Sym3& b) {
    xx += b.xx;
    xy += b.xy;
    xz += b.xz;
    yy += b.yy;
    yz += b.yz;
    zz += b.zz;
    return *this;
  }
};

/// The lower triangle of a matrix that is symmetric up to rounding.
template <class T>
KERF_HD Sym3<T> lower_triangle(const Mat3<T>& a) {
  return {a[0][0], a[1][0], a[2][0], a[1][1], a[2][1], a[2][2]};
}

template <class T>
KERF_HD Vec3<T> operator*(const Sym3<T>& a, const Vec3<T>& v) {
  return {a.xx * v.x + a.xy * v.y + a.xz * v.z, a.xy * v.x + a.yy * v.y + a.yz * v.z,
          a.xz * v.x + a.yz * v.y + a.zz * v.z};
}

/// R a R^T.
template <class T>
KERF_HD Sym3<T> turned(const Mat3<T>& R, const Sym3<T>& a) {
  const Vec3<T> x{R[0][0], R[0][1], R[0][2]}, y{R[1][0], R[1][1], R[1][2]};
  const Vec3<T> z{R[2][0], R[2][1], R[2][2]};
  const Vec3<T> ax = a * x, ay = a * y, az = a * z;
  return {dot(x, ax), dot(y, ax), dot(z, ax), dot(y, ay), dot(z, ay), dot(z, az)};
}

template <class T, class Mask>
KERF_HD void swap_if(const Mask& mask, T& a, T& b) {
  const T kept = a;
  a = select(mask, b, a);
  b = select(mask, kept, b);
}

/// Exchanges two components of a symmetric matrix, rows and columns alike, where the mask holds.
template <class T, class Mask>
KERF_HD void swap_xy_if(const Mask& mask, Sym3<T>& a) {
  swap_if(mask, a.xx, a.yy);
  swap_if(mask, a.xz, a.yz);
}
template <class T, class Mask>
KERF_HD void swap_xz_if(const Mask& mask, Sym3<T>& a) {
  swap_if(mask, a.xx, a.zz);
  swap_if(mask, a.xy, a.yz);
}
template <class T, class Mask>
KERF_HD void swap_yz_if(const Mask& mask, Sym3<T>& a) {
  swap_if(mask, a.yy, a.zz);
  swap_if(mask, a.xy, a.xz);
}

/// Inverse of a symmetric positive semi-definite block, by L D L^T with the greatest pivot first
/// and without branches. A pivot below some roundings of the trace is dropped: its row and column
/// of the result are zero. So an inactive component (zero row and column) stays untouched, and a
/// rank-deficient block yields a generalised inverse G with A G A = A, never a NaN.
///
/// Needs   A finite and positive semi-definite up to rounding.
template <class T>
KERF_HD Sym3<T> inverse_semidefinite(Sym3<T> A) {
  const T least = T(32 * Precision<T>::kEpsilon) * (A.xx + A.yy + A.zz);
  const auto reciprocal = [least](const T& pivot) {
    const auto kept = pivot > least;
    return select(kept, T(1) / select(kept, pivot, T(1)), T(0));
  };
  const auto y_first = A.yy > A.xx;
  swap_xy_if(y_first, A);
  const auto z_first = A.zz > A.xx;
  swap_xz_if(z_first, A);
  const T p0 = reciprocal(A.xx);
  const auto z_second = A.zz - A.xz * p0 * A.xz > A.yy - A.xy * p0 * A.xy;
  swap_yz_if(z_second, A);

  const T l10 = A.xy * p0, l20 = A.xz * p0;
  const T p1 = reciprocal(A.yy - l10 * A.xy);
  const T c21 = A.yz - l20 * A.xy;
  const T l21 = c21 * p1;
  const T p2 = reciprocal(A.zz - l20 * A.xz - l21 * c21);

  // Columns of L^-T: (1 0 0), (-l10 1 0), (l10 l21 - l20, -l21, 1).
  const T k20 = l10 * l21 - l20;
  Sym3<T> G;
  G.zz = p2;
  G.yz = -l21 * p2;
  G.xz = k20 * p2;
  G.yy = p1 - l21 * G.yz;
  G.xy = -l10 * p1 - l21 * G.xz;
  G.xx = p0 + l10 * l10 * p1 + k20 * G.xz;
  swap_yz_if(z_second, G);
  swap_xz_if(z_first, G);
  swap_xy_if(y_first, G);
  return G;
}

/// A^-1 b for a symmetric positive semi-definite A; dropped components yield zero.
template <class T>
KERF_HD Vec3<T> solve3(const Sym3<T>& A, const Vec3<T>& b) {
  return inverse_semidefinite(A) * b;
}
template <class T>
KERF_HD Vec3<T> solve3(const Mat3<T>& A, const Vec3<T>& b) {
  return inverse_semidefinite(lower_triangle(A)) * b;
}

/// w + x i + y j + z k; a rotation when of length one. q and -q are the same rotation.
template <class T>
struct Quat {
  T w{T(1)}, x{T(0)}, y{T(0)}, z{T(0)};

  friend KERF_HD bool operator==(const Quat& a, const Quat& b) {
    return a.w == b.w && a.x == b.x && a.y == b.y && a.z == b.z;
  }
};

/// First b, then a.
template <class T>
KERF_HD Quat<T> operator*(const Quat<T>& a, const Quat<T>& b) {
  return {
      a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
      a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x, a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w};
}

/// q scaled to length one; the identity where q is zero, or too far from one to be squared, or not
/// finite.
template <class T>
KERF_HD Quat<T> normalised(const Quat<T>& q) {
  const T squared = q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z;
  const T tiny = T(1e-30);
  const auto usable = squared > tiny && squared < T(1e30);
  const T scale = T(1) / sqrt(select(usable, squared, T(1)));
  return {select(usable, q.w * scale, T(1)), select(usable, q.x * scale, T(0)),
          select(usable, q.y * scale, T(0)), select(usable, q.z * scale, T(0))};
}

/// R - I, to full relative precision however small the angle; of a longer q |q|^2 times that.
template <class T>
KERF_HD Mat3<T> to_matrix_less_identity(const Quat<T>& q) {
  const T x2 = q.x + q.x, y2 = q.y + q.y, z2 = q.z + q.z;
  const T xx = x2 * q.x, yy = y2 * q.y, zz = z2 * q.z;
  const T xy = x2 * q.y, xz = x2 * q.z, yz = y2 * q.z;
  const T wx = x2 * q.w, wy = y2 * q.w, wz = z2 * q.w;
  return {
      {{-yy - zz, xy - wz, xz + wy}, {xy + wz, -xx - zz, yz - wx}, {xz - wy, yz + wx, -xx - yy}}};
}

/// Needs  |q| = 1 up to rounding.
template <class T>
KERF_HD Mat3<T> to_matrix(const Quat<T>& q) {
  const T x2 = q.x + q.x, y2 = q.y + q.y, z2 = q.z + q.z;
  const T xx = x2 * q.x, yy = y2 * q.y, zz = z2 * q.z;
  const T xy = x2 * q.y, xz = x2 * q.z, yz = y2 * q.z;
  const T wx = x2 * q.w, wy = y2 * q.w, wz = z2 * q.w;
  const T one = T(1);
  return {{{one - (yy + zz), xy - wz, xz + wy},
           {xy + wz, one - (xx + zz), yz - wx},
           {xz - wy, yz + wx, one - (xx + yy)}}};
}

/// |q|^2 times the rotation of q.
template <class T>
KERF_HD Mat3<T> to_scaled_matrix(const Quat<T>& q) {
  const T x2 = q.x + q.x, y2 = q.y + q.y, z2 = q.z + q.z;
  const T xy = x2 * q.y, xz = x2 * q.z, yz = y2 * q.z;
  const T wx = x2 * q.w, wy = y2 * q.w, wz = z2 * q.w;
  const T ww = q.w * q.w, xx = q.x * q.x, yy = q.y * q.y, zz = q.z * q.z;
  const T sum = ww + xx, less = ww - xx, other = yy - zz;
  return {{{sum - (yy + zz), xy - wz, xz + wy},
           {xy + wz, less + other, yz - wx},
           {xz - wy, yz + wx, less - other}}};
}

}  // namespace kerf::kernels
