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
  double at_mean = 0;  // the energy there
  bool flat = true;    // all normals are the same
  Vec3d normal{};
  double largest = 0;  // eigenvalue of A

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
    for (const SurfaceHit& hit : all) {
      if (hit.firm != firm) continue;
      const double off = to_eigen(hit.normal).dot(mean - to_eigen(hit.point));
      at_mean += off * off;
    }
    if (!flat) largest = Eigenvalues(a, Eigen::EigenvaluesOnly).eigenvalues()[2];
  }

  /// The sum of squares; without its constant it would cancel.
  double energy(const Vec& x) const {
    const Vec from_mean = x - mean;
    return from_mean.dot(a * from_mean) - 2 * (b - a * mean).dot(from_mean) + at_mean;
  }
};

/// The directions of `eigen` that count: those with eigenvalues that are not small.
template <class Visit>
void for_counting(const Eigenvalues& eigen, double largest, const Visit& visit) {
  for (int k = 0; k < 3; ++k)
    if (eigen.eigenvalues()[k] > kSmooth * largest)
      visit(Vec(eigen.eigenvectors().col(k)), eigen.eigenvalues()[k]);
}

/// The least of `first`, and in the directions that it leaves open the least of `second` (null:
/// there is none), nearest to `mean` in those that neither counts. Only the `free` components of x
/// are unknown.
Vec solve(const Quadric& first, const Quadric* second, const Vec& mean, Vec x, unsigned free) {
  Mat open = Mat::Zero();  // projects onto the directions that are not settled yet
  for (int d = 0; d < 3; ++d)
    if ((free >> d & 1) != 0) {
      open(d, d) = 1;
      x[d] = mean[d];
    }
  for (const Quadric* q : {&first, second}) {
    if (q == nullptr) continue;
    const Vec b = open * (q->b - q->a * x);
    Mat settled = Mat::Zero();
    for_counting(Eigenvalues(open * q->a * open), q->largest, [&](Vec along, double value) {
      along = open * along;  // eigenvectors are not to the last bit in what is open
      x += along.dot(b) / value * along;
      settled += along * along.transpose();
    });
    open -= settled;
  }
  return x;
}

/// The best place on the faces, edges and corners of the cube; of those that fit alike, as the two
/// ends of an edge that runs through the cube, the nearest to the mean.
Vec solve_on_boundary(const Quadric& q) {
  constexpr double kTie = 1e-12;  // squares of distances
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
    x = solve(q, nullptr, q.mean, x, free);
    const double energy = q.energy(x), distance = (x - q.mean).squaredNorm();
    if (!in_cube(x) || !(energy < least + kTie)) continue;
    if (energy > least - kTie && distance >= nearest) continue;
    least = energy;
    nearest = distance;
    best = x;
  }
  return best;
}

Vec fit(const Quadric& q) {
  if (q.flat || !(q.largest > 0)) return q.mean;  // the common case, without eigenvectors
  const Vec x = solve(q, nullptr, q.mean, Vec::Zero(), 7);
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

/// Fits `soft` among the places that fit `firm`. Where the best of them lies outside, as far
/// towards it as the cube allows: straight on, since a search along the sides would let neighbours
/// on a rim slide to opposite ends.
Vec fit_along(const Quadric& firm, const Quadric& soft) {
  const Vec mean = (firm.hits * firm.mean + soft.hits * soft.mean) / (firm.hits + soft.hits);
  const Vec best = solve(firm, &soft, mean, Vec::Zero(), 7);
  if (in_cube(best)) return best;
  const Vec nearest = solve(firm, nullptr, mean, Vec::Zero(), 7);
  return stay_in_cube(stay_in_cube(fit(firm), nearest), best);
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
