// SPDX-License-Identifier: MIT
#include "core/backend.hpp"

#include <cmath>
#include <vector>

#include "core/base/error.hpp"
#include "kernels/noise.hpp"

namespace kerf {

// The reference backend in double: docs/results.md, under Memory.
double Backend::bytes_per_cell() const noexcept { return 2700; }

namespace {

constexpr const char* kNoUpdates = "a backend without updates is asked for one";

/// out -= force in free components, which are all that is left of it; returns its squares.
double subtract_free(Backend& backend, int force, int out) {
  backend.mask(0, force);
  backend.add(0, -1, force, out);
  return backend.dot(0, force, force);
}

}  // namespace

ConjugateVectors Backend::conjugate_vectors() { return {add_vector(), add_vector(), add_vector()}; }

double Backend::true_residual(int b, int x, int r) {
  apply(0, x, r);
  combine(0, 1, b, -1, r);
  return std::sqrt(dot(0, r, r));
}

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

double Backend::subtract_elastic_force(int displacement, int out, int work) {
  elastic_force(displacement, work);
  return subtract_free(*this, work, out);
}

double Backend::subtract_scaled(const OperatorScale& scale, int in, int out, int work) {
  apply_scaled(scale, in, work);
  return subtract_free(*this, work, out);
}

void Backend::write_noise(int level, int x, std::size_t size) {
  std::vector<double> values(size);
  for (std::size_t i = 0; i < size; ++i) values[i] = kernels::noise(i);
  write(level, x, values);
}

bool Backend::advance_conjugate(int z, int d, int q, int x, int r, ConjugateState& state) {
  const auto [rho, overlap] = state.first ? std::array{dot(0, z, r), 0.0} : dots(z, r, q);
  if (!(rho > 0)) return false;
  const double beta = state.first ? 0 : -state.alpha * overlap / state.rho;
  state.first = false;
  const auto [curvature, slope] = advance_direction(z, beta, d, q, r);
  if (!(curvature > 0)) return false;
  state.rho = rho;
  state.alpha = slope / curvature;
  state.residual2 = advance_solution(state.alpha, d, q, x, r);
  return true;
}

void Backend::update(const Hierarchy&, const HierarchyChange&) { ensures(false, kNoUpdates); }

void Backend::write_some(int, int, std::span<const std::int32_t>, std::span<const double>) {
  ensures(false, kNoUpdates);
}

void Backend::read_some(int, int, std::span<const std::int32_t>, std::span<double>) const {
  ensures(false, kNoUpdates);
}

NearCells Backend::find_near(int, const BladeReach&, std::span<const std::int32_t>) const {
  ensures(false, kNoUpdates);
  return {};
}

}  // namespace kerf
