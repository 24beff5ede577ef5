// SPDX-License-Identifier: MIT
#include "core/solve/spectrum.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace kerf {
namespace {

// Largest eigenvalue of a symmetric tridiagonal matrix by bisection on Sturm counts.
double largest_eigenvalue(const std::vector<double>& diagonal, const std::vector<double>& beside) {
  double low = diagonal[0], high = diagonal[0];
  for (std::size_t i = 0; i < diagonal.size(); ++i) {
    const double left = i > 0 ? std::abs(beside[i - 1]) : 0;
    const double right = i < beside.size() ? std::abs(beside[i]) : 0;
    low = std::max(low, diagonal[i]);
    high = std::max(high, diagonal[i] + left + right);
  }
  const auto all_below = [&](double x) {
    double q = diagonal[0] - x;
    for (std::size_t i = 1; q < 0 && i < diagonal.size(); ++i)
      q = diagonal[i] - x - beside[i - 1] * beside[i - 1] / q;
    return q < 0;
  };
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (all_below(middle) ? high : low) = middle;
  }
  return high;
}

}  // namespace

double estimate_spectral_bound(Backend& backend, int level, const Level& structure) {
  constexpr int kSteps = 8;
  // Eight steps find the largest eigenvalue to some per cent from below. Chebyshev of degree 2 on
  // [l/8, l] still damps at 1.13 l, so that a margin of a tenth is on the safe side twice.
  constexpr double kMargin = 1.1;
  const int r = kResidual, p = kDirection, q = kRight, z = kSolution;  // a cycle overwrites them
  backend.write_noise(level, r, 3 * structure.point.size());
  backend.mask(level, r);
  std::vector<double> diagonal, beside;
  double rho = 0, alpha = 0, beta = 0;
  for (int step = 0; step < kSteps; ++step) {
    backend.precondition_jacobi(level, r, z);
    const double next = backend.dot(level, r, z);
    if (!(next > 0)) break;
    if (step > 0) beta = next / rho;
    rho = next;
    if (step == 0)
      backend.copy(level, z, p);
    else
      backend.combine(level, 1, z, beta, p);
    backend.apply(level, p, q);
    const double curvature = backend.dot(level, p, q);
    if (!(curvature > 0)) break;
    const double previous = alpha;
    alpha = rho / curvature;
    diagonal.push_back(1 / alpha + (step > 0 ? beta / previous : 0));
    if (step > 0) beside.push_back(std::sqrt(beta) / previous);
    backend.add(level, -alpha, q, r);
  }
  if (diagonal.empty()) return 1;  // every component is held
  return kMargin * largest_eigenvalue(diagonal, beside);
}

}  // namespace kerf
