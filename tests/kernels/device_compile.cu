// SPDX-License-Identifier: MIT
//
// Compiled wherever nvcc is found, never run: the headers of kernels/ must be code for a device,
// templates instantiated, also while no backend calls them there.
#include "kernels/blade_reach.hpp"
#include "kernels/coarsen.hpp"
#include "kernels/component_coarsen.hpp"
#include "kernels/corner_coarsen.hpp"
#include "kernels/corotate.hpp"
#include "kernels/fma.hpp"
#include "kernels/hex_element.hpp"
#include "kernels/host_device.hpp"
#include "kernels/layout.hpp"
#include "kernels/mat3.hpp"
#include "kernels/mode_coarsen.hpp"
#include "kernels/modes.hpp"
#include "kernels/noise.hpp"
#include "kernels/relax.hpp"
#include "kernels/residual.hpp"
#include "kernels/rotation.hpp"
#include "kernels/slot_diagonal.hpp"
#include "kernels/surface.hpp"
#include "kernels/transfer.hpp"
#include "kernels/unrolled.hpp"

namespace kerf::kernels {

/// One thread a cell: its rotation, its matrix, the matrix of its parent, and one relaxation.
template <class T>
__global__ void touch_all(const Vec3<T>* displacement, Quat<T>* rotation, T* matrices, T* coarse,
                          Vec3<T>* force, int cells, T side, T poisson, FoldCode fold) {
  const int cell = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (cell >= cells) return;
  Vec3<T> slots[kCorners], corners[kCorners], f[kCorners];
  for (int i = 0; i < kCorners; ++i) slots[i] = displacement[kCorners * cell + i];
  unfold(slots, fold, corners);
  rotation[cell] = extract_rotation(mean_gradient(corners, side), rotation[cell]);
  const Mat3<T> R = to_matrix(rotation[cell]);

  const ModeConstants<T> constants = mode_constants(poisson, MassModel::consistent);
  apply_cell(corners, R, side, side, constants, f);
  elastic_force(f, rotation[cell], side, side, constants.stiffness, f);
  fold_transpose(f, fold, slots);

  constexpr int kTileLog2 = 5;
  const auto matrix = cell_entries(matrices, cell, kEntries, kTileLog2);
  const HexStiffness<T> K = unit_hex_stiffness(poisson);
  const HexMass<T> M = unit_hex_mass<T>();
  cell_matrix(K, M, R, side, side, matrix);
  T weights[kCorners][kCorners];
  transfer_weights(fold, cell % kCorners, FoldCode{0}, weights);
  coarsen_cell(matrix, weights, cell_entries(coarse, cell, kEntries, kTileLog2));

  apply_packed(matrix, slots, corners);
  const Vec3<T> row = apply_packed_row(matrix, 0, slots);
  force[cell] = relax_vertex(corners[0], row, packed_block<T>(matrix, 0, 0), T(1));
  force[cell] = relax_vertex(force[cell], row,
                             inverse_semidefinite(cell_diagonal(K, M, R, side, side, 0)), T(1));
  force[cell].x += static_cast<T>(noise(static_cast<std::uint64_t>(cell)));
  force[cell] += unit_or_z(area_normal(trilinear(corners, f[0]), f[1], f[2]));
}

/// One thread a parent in the mode basis: from finest cells, and from eight parents like it.
template <bool with_translations, class T>
__global__ void touch_modes(const FinestChild<T>* finest, T* corners, T* matrices, T* coarse,
                            Vec3<T>* u, Sym3<T>* blocks, int cells, T poisson, unsigned present) {
  const int cell = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (cell >= cells) return;
  FinestChild<T> children[kCorners];
  for (int o = 0; o < kCorners; ++o) children[o] = finest[kCorners * cell + o];
  const ModeConstants<T> constants = mode_constants(poisson, MassModel::lumped);
  const Mat3<T> R = to_matrix(children[0].rotation);

  constexpr int kTileLog2 = 5;
  const auto entries = [=](T* tiles, int at) {
    return cell_entries(tiles, at, kEntries, kTileLog2);
  };
  const auto matrix = entries(matrices, cell);
  finest_mode_matrix(R, children[0].stiffness, children[0].mass, constants, matrix);
  coarsen_finest<with_translations>(children, constants, matrix);
  coarsen_modes<with_translations, T>([&](int o) { return entries(matrices, cell + o); }, present,
                                      entries(coarse, cell));
  corners_from_modes<T>(matrix, entries(corners, cell));
  modes_from_corners<T>(entries(corners, cell), matrix);
  coarsen_corners<T>(
      [&](int o, T(&child)[kEntries]) {
        for (int e = 0; e < kEntries; ++e) child[e] = entries(corners, cell + o)[e];
      },
      present, entries(coarse, cell));

  Sym3<T> D[kCorners];
  finest_diagonal_blocks(R, children[0].stiffness, children[0].mass, constants, D);
  blocks[cell] = D[0];
  mode_diagonal_blocks<with_translations>(matrix, D);
  blocks[cell] += D[0];
  T m[kCorners];
  slot_modes(static_cast<FoldCode>(present), cell % kCorners, m);
  stored_slot_block<with_translations>(matrix, m, D[0]);
  finest_slot_block(R, children[0].stiffness, children[0].mass, constants,
                    slot_gram(m, constants.mass), D[1]);
  blocks[cell] += D[0];
  blocks[cell] += D[1];
  Vec3<T> f[kCorners];
  for (int i = 0; i < kCorners; ++i) f[i] = u[kCorners * cell + i];
  apply_mode_matrix<with_translations>(matrix, f, f);
  for (int i = 0; i < kCorners; ++i) u[kCorners * cell + i] = f[i];
}

template __global__ void touch_all<float>(const Vec3<float>*, Quat<float>*, float*, float*,
                                          Vec3<float>*, int, float, float, FoldCode);
template __global__ void touch_all<double>(const Vec3<double>*, Quat<double>*, double*, double*,
                                           Vec3<double>*, int, double, double, FoldCode);
// Once: unrolled as it is, it takes nvcc half a minute.
template __global__ void touch_modes<true, float>(const FinestChild<float>*, float*, float*, float*,
                                                  Vec3<float>*, Sym3<float>*, int, float, unsigned);

}  // namespace kerf::kernels
