// SPDX-License-Identifier: MIT
//
// Three-vectors and three-by-three matrices, values only.
//
// Layout  Mat3 is row-major: m[row][column].
#pragma once

#include <cmath>

#include "kernels/host_device.hpp"

namespace kerf::kernels {

template <class T>
struct Vec3 {
  T x{}, y{}, z{};

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
  using std::sqrt;
  return sqrt(dot(a, a));
}

template <class T>
struct Mat3 {
  T m[3][3]{};

  KERF_HD T* operator[](int row) { return m[row]; }
  KERF_HD const T* operator[](int row) const { return m[row]; }

  KERF_HD static Mat3 identity() {
    Mat3 a;
    a.m[0][0] = a.m[1][1] = a.m[2][2] = T(1);
    return a;
  }
  KERF_HD Mat3& operator+=(const Mat3& b) {
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) m[i][j] += b.m[i][j];
    return *this;
  }
  KERF_HD Mat3& operator*=(T s) {
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) m[i][j] *= s;
    return *this;
  }
  friend KERF_HD Mat3 operator+(Mat3 a, const Mat3& b) { return a += b; }
  friend KERF_HD Mat3 operator*(T s, Mat3 a) { return a *= s; }
};

template <class T>
KERF_HD Vec3<T> operator*(const Mat3<T>& a, const Vec3<T>& v) {
  return {a[0][0] * v.x + a[0][1] * v.y + a[0][2] * v.z,
          a[1][0] * v.x + a[1][1] * v.y + a[1][2] * v.z,
          a[2][0] * v.x + a[2][1] * v.y + a[2][2] * v.z};
}

/// transpose(a) * v without forming the transpose.
template <class T>
KERF_HD Vec3<T> transpose_times(const Mat3<T>& a, const Vec3<T>& v) {
  return {a[0][0] * v.x + a[1][0] * v.y + a[2][0] * v.z,
          a[0][1] * v.x + a[1][1] * v.y + a[2][1] * v.z,
          a[0][2] * v.x + a[1][2] * v.y + a[2][2] * v.z};
}

template <class T>
KERF_HD Mat3<T> operator*(const Mat3<T>& a, const Mat3<T>& b) {
  Mat3<T> c;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      c[i][j] = a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j];
  return c;
}

template <class T>
KERF_HD Mat3<T> transpose(const Mat3<T>& a) {
  Mat3<T> t;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) t[i][j] = a[j][i];
  return t;
}

template <class T>
KERF_HD T determinant(const Mat3<T>& a) {
  return a[0][0] * (a[1][1] * a[2][2] - a[1][2] * a[2][1]) -
         a[0][1] * (a[1][0] * a[2][2] - a[1][2] * a[2][0]) +
         a[0][2] * (a[1][0] * a[2][1] - a[1][1] * a[2][0]);
}

}  // namespace kerf::kernels
