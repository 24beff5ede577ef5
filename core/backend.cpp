// SPDX-License-Identifier: MIT
#include "core/backend.hpp"

namespace kerf {

std::array<double, 2> Backend::dots(int x, int y, int z) { return {dot(0, x, y), dot(0, x, z)}; }

std::array<double, 2> Backend::advance_direction(int z, double beta, int d, int q, int r) {
  if (beta == 0)
    copy(0, z, d);
  else
    combine(0, 1, z, beta, d);
  apply(0, d, q);
  return {dot(0, d, q), dot(0, d, r)};
}

double Backend::advance_solution(double a, int d, int q, int x, int r) {
  add(0, a, d, x);
  add(0, -a, q, r);
  return dot(0, r, r);
}

}  // namespace kerf
