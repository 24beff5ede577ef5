// SPDX-License-Identifier: MIT
#include "bench/dense24.hpp"

#include "kernels/transfer.hpp"

namespace kerf::bench {
namespace {

using Mat = kernels::Mat3<double>;

Vec3d at(std::span<const double> x, std::int32_t vertex) {
  const std::size_t k = 3 * static_cast<std::size_t>(vertex);
  return {x[k], x[k + 1], x[k + 2]};
}

// f = stiffness [R] K [R]^T u over the corners of one cell, in place. K is symmetric, so columns
// may stand for rows: sums then run side by side and fill the lanes of a vector unit.
void dense_product(const kernels::HexStiffness<double>& K, const Mat& R, double stiffness,
                   Vec3d (&u)[8]) {
  double f[kernels::kUnknowns] = {};
  for (int j = 0; j < 8; ++j) {
    const Vec3d local = kernels::transpose_times(R, u[j]);
    for (int b = 0; b < 3; ++b)
      for (int row = 0; row < kernels::kUnknowns; ++row)
        f[row] = kernels::fma(K.k[3 * j + b][row], local[b], f[row]);
  }
  for (int i = 0; i < 8; ++i) u[i] = stiffness * (R * Vec3d{f[3 * i], f[3 * i + 1], f[3 * i + 2]});
}

}  // namespace

Dense24::Dense24(const Hierarchy& hierarchy, std::span<const double> rotations, int threads)
    : hierarchy_(hierarchy),
      threads_(threads),
      K_(kernels::unit_hex_stiffness(hierarchy.poisson[0])),
      products_(8 * hierarchy.values.size()) {
  for (std::size_t c = 0; c < hierarchy.values.size(); ++c)
    rotation_.push_back(
        {rotations[4 * c], rotations[4 * c + 1], rotations[4 * c + 2], rotations[4 * c + 3]});
}

void Dense24::apply(std::span<const double> in, std::span<double> out) {
  const Level& level = hierarchy_.levels[0];
  const std::int32_t cells = level.cells(), vertices = level.vertices();
#pragma omp parallel for num_threads(threads_) schedule(static)
  for (std::int32_t cell = 0; cell < cells; ++cell) {
    Vec3d slots[8], corners[8];
    for (int i = 0; i < 8; ++i) slots[i] = at(in, level.slots[cell][i]);
    const std::uint16_t fold = level.fold[cell];
    const bool hangs = kernels::has_hanging(fold);
    if (hangs) kernels::unfold(slots, fold, corners);
    Vec3d(&values)[8] = hangs ? corners : slots;
    dense_product(K_, kernels::to_matrix(rotation_[cell]), hierarchy_.values[cell].stiffness,
                  values);
    if (hangs) kernels::fold_transpose(corners, fold, slots);
    for (int i = 0; i < 8; ++i) products_[8 * static_cast<std::size_t>(cell) + i] = slots[i];
  }
#pragma omp parallel for num_threads(threads_) schedule(static)
  for (std::int32_t v = 0; v < vertices; ++v) {
    Vec3d sum{};
    for (const std::int32_t k : level.incidences_of(v)) sum += products_[k];
    for (int c = 0; c < 3; ++c)
      out[3 * static_cast<std::size_t>(v) + c] = ((level.fixed[v] >> c) & 1) != 0 ? 0 : sum[c];
  }
}

}  // namespace kerf::bench
