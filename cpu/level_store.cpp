// SPDX-License-Identifier: MIT
#include "cpu/level_store.hpp"

#include "kernels/coarsen.hpp"
#include "kernels/corotate.hpp"
#include "kernels/residual.hpp"
#include "kernels/transfer.hpp"

namespace kerf::cpu {
namespace {

int hanging(const LevelStore& store, std::int32_t cell) { return store.level->fold[cell] & 255; }

// The finest cell's matrix over its corners, before folding.
void corner_matrix(const LevelStore& store, std::int32_t cell, double (&packed)[kEntries]) {
  const FinestStore& finest = *store.finest;
  const CellValues& values = (*finest.values)[cell];
  kernels::cell_matrix(finest.materials[values.material].stiffness, finest.mass,
                       kernels::to_matrix(finest.rotation[cell]),
                       finest.scale.stiffness * values.stiffness, finest.scale.mass * values.mass,
                       static_cast<double*>(packed));
}

void folded_matrix(const LevelStore& store, std::int32_t cell, double (&packed)[kEntries]) {
  if (hanging(store, cell) == 0) return corner_matrix(store, cell, packed);
  double corners[kEntries];
  corner_matrix(store, cell, corners);
  double weights[8][8];
  kernels::fold_weights(store.level->fold[cell], weights);
  for (double& entry : packed) entry = 0;
  kernels::coarsen_cell(static_cast<const double*>(corners), weights, static_cast<double*>(packed));
}

}  // namespace

// Room that is reserved and was never written takes no memory.
std::size_t LevelStore::bytes() const {
  std::size_t sum = matrices.size() * sizeof(double) + inverse_diagonal.size() * sizeof(Sym) +
                    products.size() * sizeof(Vec);
  for (const auto& vector : vectors) sum += vector.size() * sizeof(double);
  return sum;
}

void finest_product(const LevelStore& store, const OperatorScale& scale, std::int32_t cell,
                    const Vec (&u)[8], Vec (&f)[8]) {
  const FinestStore& finest = *store.finest;
  const CellValues& values = (*finest.values)[cell];
  const Mat R = kernels::to_matrix(finest.rotation[cell]);
  const auto& constants = finest.materials[values.material].modes;
  const double stiffness = scale.stiffness * values.stiffness, mass = scale.mass * values.mass;
  if (hanging(store, cell) == 0) {
    kernels::apply_cell(u, R, stiffness, mass, constants, f);
    return;
  }
  const std::uint16_t fold = store.level->fold[cell];
  Vec corners[8];
  kernels::unfold(u, fold, corners);
  kernels::apply_cell(corners, R, stiffness, mass, constants, corners);
  kernels::fold_transpose(corners, fold, f);
}

void cell_product(const LevelStore& store, std::int32_t cell, const Vec (&u)[8], Vec (&f)[8]) {
  if (store.finest != nullptr) return finest_product(store, store.finest->scale, cell, u, f);
  kernels::apply_packed(kernels::cell_entries(store.matrices.data(), static_cast<std::size_t>(cell),
                                              kEntries, store.tile_log2),
                        u, f);
}

Vec cell_row(const LevelStore& store, std::int32_t cell, int slot, const double* u) {
  const auto& slots = store.level->slots[cell];
  if (store.finest != nullptr && hanging(store, cell) == 0) {
    const FinestStore& finest = *store.finest;
    const CellValues& values = (*finest.values)[cell];
    const auto& K = finest.materials[values.material].stiffness.k;
    const Mat R = kernels::to_matrix(finest.rotation[cell]);
    Vec elastic{}, inertia{};
    for (int j = 0; j < 8; ++j) {
      const Vec at = load(u, slots[j]);
      const Vec local = kernels::transpose_times(R, at);
      for (int a = 0; a < 3; ++a) {
        const double* row = K[3 * slot + a] + 3 * j;
        elastic[a] += row[0] * local.x + row[1] * local.y + row[2] * local.z;
      }
      inertia += finest.mass.m[slot][j] * at;
    }
    return (finest.scale.stiffness * values.stiffness) * (R * elastic) +
           (finest.scale.mass * values.mass) * inertia;
  }
  Vec at[8];
  for (int j = 0; j < 8; ++j) at[j] = load(u, slots[j]);
  if (store.finest != nullptr) {
    Vec f[8];
    cell_product(store, cell, at, f);
    return f[slot];
  }
  return kernels::apply_packed_row(
      kernels::cell_entries(store.matrices.data(), static_cast<std::size_t>(cell), kEntries,
                            store.tile_log2),
      slot, at);
}

void cell_matrix(const LevelStore& store, std::int32_t cell, double (&packed)[kEntries]) {
  if (store.finest == nullptr) {
    const auto A = kernels::cell_entries(store.matrices.data(), static_cast<std::size_t>(cell),
                                         kEntries, store.tile_log2);
    for (int e = 0; e < kEntries; ++e) packed[e] = A[e];
    return;
  }
  folded_matrix(store, cell, packed);
  for (int i = 0; i < 8; ++i) {
    const std::uint8_t fixed = store.level->fixed[store.level->slots[cell][i]];
    for (int a = 0; a < 3; ++a) {
      if (!((fixed >> a) & 1)) continue;
      const int p = 3 * i + a;
      for (int q = 0; q < 24; ++q)
        packed[p >= q ? kernels::packed_index(p, q) : kernels::packed_index(q, p)] = 0;
    }
  }
}

Sym diagonal_block(const LevelStore& store, std::int32_t cell, int slot) {
  if (store.finest == nullptr) {
    const auto A = kernels::cell_entries(store.matrices.data(), static_cast<std::size_t>(cell),
                                         kEntries, store.tile_log2);
    return kernels::packed_diagonal<double>(A, slot);
  }
  const FinestStore& finest = *store.finest;
  const CellValues& values = (*finest.values)[cell];
  const auto& K = finest.materials[values.material].stiffness;
  const Mat R = kernels::to_matrix(finest.rotation[cell]);
  const double stiffness = finest.scale.stiffness * values.stiffness;
  const double mass = finest.scale.mass * values.mass;
  if (hanging(store, cell) == 0)
    return kernels::cell_diagonal(K, finest.mass, R, stiffness, mass, slot);
  // Only the few corners that this slot speaks for.
  double weights[8][8];
  kernels::fold_weights(store.level->fold[cell], weights);
  Mat sum;
  for (int k = 0; k < 8; ++k)
    for (int l = 0; l < 8; ++l) {
      const double w = weights[k][slot] * weights[l][slot];
      if (w != 0) sum += kernels::rotate_block(K, finest.mass, R, w * stiffness, w * mass, k, l);
    }
  return kernels::lower_triangle(sum);
}

}  // namespace kerf::cpu
