// SPDX-License-Identifier: MIT
#include "core/surface/quadric.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

namespace kerf {
namespace {

using Vec = Eigen::Vector3d;
using Mat = Eigen::Matrix3d;
using Eigenvalues = Eigen::SelfAdjointEigenSolver<Mat>;

/// Eigenvalues below this part of the largest belong to directions along the surface; the square of
/// the least angle between normals, about, that makes an edge.
constexpr double kSmooth = 0.01;
constexpr double kHalf = 0.5;

Vec to_eigen(const Vec3d& v) { return {v.x, v.y, v.z}; }

bool in_cube(const Vec& x) { return (x.array().abs() <= kHalf).all(); }

/// The hits of one kind: sum_i (n_i . (x - p_i))^2 = x^T A x - 2 b^T x + const.
struct Quadric {
  Mat a = Mat::Zero();
  Vec b = Vec::Zero();
  Vec mean = Vec::Zero();
  int hits = 0;
  bool flat = true;  // all normals are the same
  Vec3d normal{};
  Eigenvalues eigen;   // of A, unless flat
  double largest = 0;  // eigenvalue

  Quadric(std::span<const SurfaceHit> all, bool firm) {
    for (const SurfaceHit& hit : all) {
      if (hit.firm != firm) continue;
      if (hits == 0) normal = hit.normal;
      flat = flat && hit.normal == normal;
      const Vec n = to_eigen(hit.normal), p = to_eigen(hit.point);
      a += n * n.transpose();
      b += n.dot(p) * n;
      mean += p;
      ++hits;
    }
    if (hits == 0) return;
    mean /= hits;
    largest = hits * dot(normal, normal);
    if (flat) return;  // the common case, without eigenvectors
    eigen.compute(a);
    largest = eigen.eigenvalues()[2];
  }

  double energy(const Vec& x) const { return x.dot(a * x) - 2 * b.dot(x); }
};

/// A^-1 b over the directions that count: those with eigenvalues that are not small.
Vec apply_inverse(const Eigenvalues& eigen, double largest, const Vec& b) {
  Vec x = Vec::Zero();
  for (int k = 0; k < 3; ++k) {
    const double value = eigen.eigenvalues()[k];
    if (!(value > kSmooth * largest)) continue;
    const Vec along = eigen.eigenvectors().col(k);
    x += along.dot(b) / value * along;
  }
  return x;
}

/// The least x with `free` components unknown and the others given, nearest to the mean in
/// directions that do not count.
Vec solve(const Quadric& q, Vec x, unsigned free) {
  Mat a = Mat::Zero();
  Vec b = Vec::Zero();
  for (int i = 0; i < 3; ++i) {
    if ((free >> i & 1) == 0) continue;
    b[i] = q.b[i];
    for (int j = 0; j < 3; ++j) {
      const bool unknown = (free >> j & 1) != 0;
      b[i] -= q.a(i, j) * (unknown ? q.mean[j] : x[j]);
      if (unknown) a(i, j) = q.a(i, j);
    }
  }
  const Vec step = apply_inverse(Eigenvalues(a), q.largest, b);
  for (int i = 0; i < 3; ++i)
    if ((free >> i & 1) != 0) x[i] = q.mean[i] + step[i];
  return x;
}

/// The least energy over the faces, edges and corners of the cube; of places that fit alike, such
/// as the two ends of an edge that runs through the cube, the nearest to the mean.
Vec solve_on_boundary(const Quadric& q) {
  const double tie = 1e-12 * q.largest;  // rounding of energies, with room
  Vec best = q.mean;
  double least = std::numeric_limits<double>::infinity(), nearest = least;
  for (int part = 1; part < 27; ++part) {  // per axis: free, at the low side, at the high side
    const int state[3] = {part % 3, part / 3 % 3, part / 9};
    unsigned free = 0;
    Vec x = Vec::Zero();
    for (int d = 0; d < 3; ++d) {
      if (state[d] == 0) free |= 1u << d;
      if (state[d] != 0) x[d] = state[d] == 1 ? -kHalf : kHalf;
    }
    x = solve(q, x, free);
    const double energy = q.energy(x), distance = (x - q.mean).squaredNorm();
    if (!in_cube(x) || !(energy < least + tie)) continue;
    if (energy > least - tie && distance >= nearest) continue;
    least = energy;
    nearest = distance;
    best = x;
  }
  return best;
}

Vec fit(const Quadric& q) {
  if (q.flat || !(q.largest > 0)) return q.mean;
  const Vec x = q.mean + apply_inverse(q.eigen, q.largest, q.b - q.a * q.mean);
  return in_cube(x) ? x : solve_on_boundary(q);
}

/// From x, which lies in the cube, towards y until the cube ends.
Vec stay_in_cube(const Vec& x, const Vec& y) {
  double part = 1;
  for (int d = 0; d < 3; ++d) {
    if (y[d] > kHalf) part = std::min(part, (kHalf - x[d]) / (y[d] - x[d]));
    if (y[d] < -kHalf) part = std::min(part, (-kHalf - x[d]) / (y[d] - x[d]));
  }
  return x + std::max(part, 0.0) * (y - x);
}

/// Fits `soft` in the directions that `firm` leaves open.
Vec fit_along(const Quadric& firm, const Quadric& soft) {
  const Vec x = fit(firm);
  Mat open = Mat::Zero();  // projects onto those directions
  if (firm.flat) {
    const Vec n = to_eigen(firm.normal);
    open = Mat::Identity() - n * n.transpose() / std::max(n.squaredNorm(), 1e-300);
  } else {
    for (int k = 0; k < 3; ++k) {
      const Vec along = firm.eigen.eigenvectors().col(k);
      if (!(firm.eigen.eigenvalues()[k] > kSmooth * firm.largest))
        open += along * along.transpose();
    }
  }
  const Vec mean = (firm.hits * firm.mean + soft.hits * soft.mean) / (firm.hits + soft.hits);
  const Vec start = stay_in_cube(x, x + open * (mean - x));
  const Vec step = apply_inverse(Eigenvalues(open * soft.a * open), soft.largest,
                                 open * (soft.b - soft.a * start));
  return stay_in_cube(start, start + open * step);
}

}  // namespace

Vec3d fit_vertex(std::span<const SurfaceHit> hits) {
  const Quadric firm(hits, true), soft(hits, false);
  const Vec x = firm.hits == 0 ? fit(soft) : soft.hits == 0 ? fit(firm) : fit_along(firm, soft);
  Vec3d out;
  for (int d = 0; d < 3; ++d) out[d] = std::clamp(x[d], -kHalf, kHalf);
  return out;
}

}  // namespace kerf
