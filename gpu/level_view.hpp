// SPDX-License-Identifier: MIT
//
// The structure and the values of one level as a device sees them: plain pointers into its memory.
//
// Layout  As core/levels/hierarchy.hpp: numbers of cells and vertices are the same, slots lie eight
//         to a cell, lists have a begin and a count a row. Vectors are x0 y0 z0 x1 y1 z1 ...
//         Matrices and records lie in tiles of 32 cells (kernels/layout.hpp), so that a warp reads
//         an entry of its cells with one load. A record is what a cell adds to its slots: 24
//         scalars, 3 * slot + component.
#pragma once

#include <type_traits>

#include "kernels/hex_element.hpp"
#include "kernels/layout.hpp"
#include "kernels/mat3.hpp"
#include "kernels/modes.hpp"

namespace kerf::gpu {

using kernels::fma;
using kernels::kCorners;
using kernels::kEntries;
using kernels::kUnknowns;
using kernels::Mat3;
using kernels::Quat;
using kernels::Sym3;
using kernels::Vec3;

inline constexpr int kTileLog2 = 5;

struct LevelView {
  std::int32_t cells, vertices;
  const std::int32_t* slots;
  const std::uint16_t* fold;
  const std::int32_t* parent;  ///< not on the coarsest level
  const std::uint8_t* place;   ///< not on the coarsest level
  const std::uint8_t* fixed;
  const std::int32_t *incidence_begin, *incidence_count, *incidence;
  const std::int32_t *child_begin, *child_count, *children;  ///< not on level 0

  KERF_HD std::int32_t slot(std::int32_t cell, int i) const {
    return slots[kCorners * static_cast<std::size_t>(cell) + static_cast<std::size_t>(i)];
  }
};

/// Vertices that a block of threads finishes at once.
inline constexpr int kBlockVertices = 256;

/// The vertices of level 0 in blocks of such as lie together, and the cells around each block.
struct BlockView {
  const std::int32_t* order;          ///< vertices, block after block
  const std::int32_t *begin, *count;  ///< of the cells of a block
  const std::int32_t* cells;          ///< ascending in each block
  /// Beside the incidences: 8 times the place of the cell in the list of the vertex' block + slot.
  const std::uint16_t* codes;
};

/// What an operator is made of; see OperatorScale in core/backend.hpp.
struct Scale {
  double stiffness, mass;
};

/// N/m and kg, without the factors of the operator, of cells of one kind.
template <class T>
struct Element {
  T stiffness, mass;
  std::int32_t material;
};

/// The rotations of level 0: double, or a float and what rounding to it left, together 48 bits.
/// Half the memory where the cycle is single, which reads the first alone.
struct RotationView {
  Quat<double>* exact;  ///< or null
  Quat<float>*rounded, *rest;

  template <class T>
  KERF_HD Quat<T> get(std::int32_t cell) const {
    if constexpr (std::is_same_v<T, float>) {
      return rounded[cell];
    } else {
      if (exact != nullptr) return exact[cell];
      const Quat<float> a = rounded[cell], b = rest[cell];
      return {T(a.w) + T(b.w), T(a.x) + T(b.x), T(a.y) + T(b.y), T(a.z) + T(b.z)};
    }
  }
  KERF_HD void set(std::int32_t cell, const Quat<double>& q) const {
    if (exact != nullptr) {
      exact[cell] = q;
      return;
    }
    const Quat<float> a{static_cast<float>(q.w), static_cast<float>(q.x), static_cast<float>(q.y),
                        static_cast<float>(q.z)};
    rounded[cell] = a;
    rest[cell] = {static_cast<float>(q.w - static_cast<double>(a.w)),
                  static_cast<float>(q.x - static_cast<double>(a.x)),
                  static_cast<float>(q.y - static_cast<double>(a.y)),
                  static_cast<float>(q.z - static_cast<double>(a.z))};
  }
};

/// Constants of one Poisson ratio.
template <class T>
struct MaterialConstants {
  kernels::HexStiffness<T> stiffness;
  kernels::ModeConstants<T> modes;
};

/// Values of level 0, which stores no matrices.
template <class T>
struct FinestView {
  RotationView rotations;
  const std::uint16_t* kind;  ///< of a cell
  const Element<T>* element;  ///< of a kind
  const std::uint8_t* size_log2;
  const MaterialConstants<T>* materials;
  const kernels::HexMass<T>* mass;
  const Scale* scale;
  double spacing;

  KERF_HD T side(std::int32_t cell) const {
    return static_cast<T>(spacing * static_cast<double>(1 << size_log2[cell]));
  }
  KERF_HD Quat<T> rotation(std::int32_t cell) const { return rotations.template get<T>(cell); }
  /// E times the side, N/m.
  KERF_HD T unscaled_stiffness(std::int32_t cell) const { return element[kind[cell]].stiffness; }
  KERF_HD T stiffness(std::int32_t cell) const {
    return static_cast<T>(scale->stiffness) * element[kind[cell]].stiffness;
  }
  KERF_HD T inertia(std::int32_t cell) const {
    return static_cast<T>(scale->mass) * element[kind[cell]].mass;
  }
  KERF_HD const MaterialConstants<T>& material(std::int32_t cell) const {
    return materials[element[kind[cell]].material];
  }
};

/// A vertex of a vector.
template <class T>
KERF_HD Vec3<T> load(const T* x, std::int32_t vertex) {
  const T* at = x + 3 * static_cast<std::size_t>(vertex);
  return {at[0], at[1], at[2]};
}
template <class T>
KERF_HD void store(T* x, std::int32_t vertex, const Vec3<T>& value) {
  T* at = x + 3 * static_cast<std::size_t>(vertex);
  at[0] = value.x;
  at[1] = value.y;
  at[2] = value.z;
}

/// In another precision.
template <class To, class From>
KERF_HD Vec3<To> as(const Vec3<From>& v) {
  return {static_cast<To>(v.x), static_cast<To>(v.y), static_cast<To>(v.z)};
}

/// Zero in held components.
template <class T>
KERF_HD Vec3<T> masked(Vec3<T> v, std::uint8_t fixed) {
  for (int c = 0; c < 3; ++c)
    if (((fixed >> c) & 1) != 0) v[c] = T(0);
  return v;
}

/// The vertices of a cell.
template <class From, class T>
KERF_HD void load_slots(const LevelView& level, std::int32_t cell, const From* x,
                        Vec3<T> (&out)[kCorners]) {
  for (int i = 0; i < kCorners; ++i) out[i] = as<T>(load(x, level.slot(cell, i)));
}

template <class T>
KERF_HD void store_record(T* records, std::int32_t cell, const Vec3<T> (&f)[kCorners]) {
  const auto to =
      kernels::cell_entries(records, static_cast<std::size_t>(cell), kUnknowns, kTileLog2);
  for (int i = 0; i < kCorners; ++i)
    for (int c = 0; c < 3; ++c) to[3 * i + c] = f[i][c];
}

/// What the cells around a vertex add to it, in the order of its incidences.
template <class T>
KERF_HD Vec3<T> gather_records(const LevelView& level, const T* records, std::int32_t vertex) {
  const std::int32_t* const incidence = level.incidence + level.incidence_begin[vertex];
  Vec3<T> sum{};
  for (std::int32_t k = 0; k < level.incidence_count[vertex]; ++k) {
    const auto at = kernels::cell_entries(
        records, static_cast<std::size_t>(incidence[k] / kCorners), kUnknowns, kTileLog2);
    const int first = 3 * (incidence[k] % kCorners);
    sum += Vec3<T>{at[first], at[first + 1], at[first + 2]};
  }
  return sum;
}

}  // namespace kerf::gpu
