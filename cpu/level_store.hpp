// SPDX-License-Identifier: MIT
//
// What the CPU backend keeps of one level, and the arithmetic of one cell of it.
#pragma once

#include <cstdint>
#include <vector>

#include "core/backend.hpp"
#include "core/levels/colours.hpp"
#include "kernels/hex_element.hpp"
#include "kernels/layout.hpp"
#include "kernels/mat3.hpp"
#include "kernels/modes.hpp"

namespace kerf::cpu {

using kernels::kEntries;
using Vec = kernels::Vec3<double>;
using Mat = kernels::Mat3<double>;
using Sym = kernels::Sym3<double>;
using Quaternion = kernels::Quat<double>;

/// Constants of one Poisson ratio.
struct MaterialConstants {
  kernels::HexStiffness<double> stiffness;
  kernels::ModeConstants<double> modes;
};

/// The finest level: no stored matrices, but rotations and element values.
struct FinestStore {
  double spacing = 0;
  OperatorScale scale;
  std::vector<Quaternion> rotation;  // per cell
  std::vector<MaterialConstants> materials;
  kernels::HexMass<double> mass;
  const CellValueList* values = nullptr;
};

struct LevelStore {
  const Level* level = nullptr;
  const FinestStore* finest = nullptr;  // of level 0 only
  int tile_log2 = 0;
  std::vector<double> matrices;              // tiles of 300 scalars; empty on level 0
  std::vector<Sym> inverse_diagonal;         // per vertex
  double bound = 0;                          // of the spectrum of D^-1 A
  bool solution_is_zero = false;             // known: the first residual is f, no product needed
  std::vector<std::vector<double>> vectors;  // by VectorId, 3 per vertex
  std::vector<Vec> products;                 // 8 per cell: what each cell adds to its slots
  Colours colours;                           // once Gauss-Seidel asks for them

  std::int32_t cells() const { return level->cells(); }
  std::int32_t vertices() const { return level->vertices(); }
  std::size_t bytes() const;
};

inline Vec load(const double* x, std::int32_t vertex) {
  const double* at = x + 3 * static_cast<std::size_t>(vertex);
  return {at[0], at[1], at[2]};
}

inline void store(double* x, std::int32_t vertex, const Vec& value) {
  double* at = x + 3 * static_cast<std::size_t>(vertex);
  at[0] = value.x;
  at[1] = value.y;
  at[2] = value.z;
}

/// Zero in held components.
inline Vec masked(Vec v, std::uint8_t fixed) {
  for (int c = 0; c < 3; ++c)
    if ((fixed >> c) & 1) v[c] = 0;
  return v;
}

/// f = A u of one cell, over its slots.
void cell_product(const LevelStore& store, std::int32_t cell, const Vec (&u)[8], Vec (&f)[8]);
/// As cell_product on level 0, with other factors.
void finest_product(const LevelStore& store, const OperatorScale& scale, std::int32_t cell,
                    const Vec (&u)[8], Vec (&f)[8]);
/// Row of A u that belongs to one slot of a cell.
Vec cell_row(const LevelStore& store, std::int32_t cell, int slot, const double* u);
/// Lower triangle of A of one cell; rows and columns of held components are zero.
void cell_matrix(const LevelStore& store, std::int32_t cell, double (&packed)[kEntries]);
/// The 3x3 block of a slot with itself, held components included.
Sym diagonal_block(const LevelStore& store, std::int32_t cell, int slot);

}  // namespace kerf::cpu
