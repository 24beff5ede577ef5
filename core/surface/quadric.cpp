// SPDX-License-Identifier: MIT
#include "core/surface/quadric.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

namespace kerf {
namespace {

/// Eigenvalues below this part of the largest belong to directions along the surface; the square of
/// the least angle between normals, about, that makes an edge.
constexpr double kSmooth = 0.01;
constexpr double kHalf = 0.5;

/// The sum of squares as x^T A x - 2 b^T x + const, x counted from the mean of the points.
struct Quadric {
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();

  double energy(const Eigen::Vector3d& x) const { return x.dot(a * x) - 2 * b.dot(x); }
};

/// The least x with `free` components unknown and the others given; smooth directions stay 0.
/// `largest` is the eigenvalue of the whole quadric that counts as one.
Eigen::Vector3d solve(const Quadric& q, Eigen::Vector3d x, unsigned free, double largest) {
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (int i = 0; i < 3; ++i) {
    if ((free >> i & 1) == 0) continue;
    b[i] = q.b[i];
    for (int j = 0; j < 3; ++j) {
      if ((free >> j & 1) != 0)
        a(i, j) = q.a(i, j);
      else
        b[i] -= q.a(i, j) * x[j];
    }
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(a);
  Eigen::Vector3d y = Eigen::Vector3d::Zero();
  for (int k = 0; k < 3; ++k) {
    const double value = eigen.eigenvalues()[k];
    if (!(value > kSmooth * largest)) continue;
    const Eigen::Vector3d along = eigen.eigenvectors().col(k);
    y += along.dot(b) / value * along;
  }
  for (int i = 0; i < 3; ++i)
    if ((free >> i & 1) != 0) x[i] = y[i];
  return x;
}

/// The least energy over the faces, edges and corners of the cube [lo, hi].
Eigen::Vector3d solve_on_boundary(const Quadric& q, const Eigen::Vector3d& lo,
                                  const Eigen::Vector3d& hi, double largest) {
  Eigen::Vector3d best = Eigen::Vector3d::Zero();
  double least = std::numeric_limits<double>::infinity();
  for (int part = 0; part < 27; ++part) {  // per axis: free, at lo, at hi
    const int state[3] = {part % 3, part / 3 % 3, part / 9};
    unsigned free = 0;
    Eigen::Vector3d x = Eigen::Vector3d::Zero();
    for (int d = 0; d < 3; ++d) {
      if (state[d] == 0) free |= 1u << d;
      if (state[d] == 1) x[d] = lo[d];
      if (state[d] == 2) x[d] = hi[d];
    }
    if (free == 7) continue;
    x = solve(q, x, free, largest);
    bool inside = true;
    for (int d = 0; d < 3; ++d) inside = inside && lo[d] <= x[d] && x[d] <= hi[d];
    const double energy = q.energy(x);
    if (!inside || !(energy < least)) continue;
    least = energy;
    best = x;
  }
  return best;
}

bool all_alike(std::span<const SurfaceHit> hits) {
  return std::all_of(hits.begin(), hits.end(),
                     [&](const SurfaceHit& h) { return h.normal == hits[0].normal; });
}

}  // namespace

Vec3d fit_vertex(std::span<const SurfaceHit> hits) {
  Vec3d mean{};
  for (const SurfaceHit& hit : hits) mean += hit.point;
  mean *= 1.0 / static_cast<double>(hits.size());
  if (all_alike(hits)) return mean;  // the common case, and it spares the eigenvalues

  Quadric q;
  for (const SurfaceHit& hit : hits) {
    const Eigen::Vector3d n{hit.normal.x, hit.normal.y, hit.normal.z};
    q.a += n * n.transpose();
    q.b += dot(hit.normal, hit.point - mean) * n;
  }
  const double largest =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(q.a, Eigen::EigenvaluesOnly).eigenvalues()[2];
  if (!(largest > 0)) return mean;
  Eigen::Vector3d lo, hi;
  for (int d = 0; d < 3; ++d) {
    lo[d] = -kHalf - mean[d];
    hi[d] = kHalf - mean[d];
  }
  Eigen::Vector3d x = solve(q, Eigen::Vector3d::Zero(), 7, largest);
  if (!((x.array() >= lo.array()).all() && (x.array() <= hi.array()).all()))
    x = solve_on_boundary(q, lo, hi, largest);
  Vec3d out;
  for (int d = 0; d < 3; ++d) out[d] = std::clamp(mean[d] + x[d], -kHalf, kHalf);
  return out;
}

}  // namespace kerf
