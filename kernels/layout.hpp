// SPDX-License-Identifier: MIT
//
// The one data layout: numbering inside a cell, and stored cell matrices in tiles.
//
// Corners    8 to a cell, numbered x + 2 y + 4 z:
//
//                6-------7          An unknown of a cell is numbered 3 * corner + component,
//               /|      /|          0..23. A slot 0..7 is an unknown vertex of a cell; slot i is
//              4-------5 |          the vertex at corner i unless that corner hangs
//    z  y      | 2-----|-3          (transfer.hpp).
//    | /       |/      |/
//    |/__x     0-------1
//
// Entries    A cell matrix is symmetric, 24 x 24; its lower triangle is stored by rows:
//
//              row 0    0
//              row 1    1   2                  entry(row, col) = row (row + 1) / 2 + col
//              row 2    3   4   5              for row >= col
//              ...
//              row 23   276 ...          299
//
//            300 scalars: 1200 bytes a cell in float, 2400 in double.
//
// Tiles      `Tile` cells are interleaved entry by entry, so that a pack of 16 lanes or a warp of
//            32 threads reads one entry of its cells with one load:
//
//              tile 0                                            tile 1
//              +------------+------------+-----+--------------+--------------
//              | entry 0    | entry 1    | ... | entry 299    | entry 0 ...
//              | c0 c1 ..   | c0 c1 ..   |     | c0 c1 ..     | cTile ..
//              +------------+------------+-----+--------------+--------------
//
//              Tile                     1       16       32
//              one entry of a tile      8      128      256    bytes in double
//              one tile              2400    38400    76800    bytes in double
//              one tile              1200    19200    38400    bytes in float
//
//            Tile is a power of two. The last tile is padded with cells whose matrix is zero.
#pragma once

#include "kernels/host_device.hpp"

namespace kerf::kernels {

inline constexpr int kCorners = 8;
inline constexpr int kUnknowns = 24;  // of a cell: 3 a corner
inline constexpr int kEntries = kUnknowns * (kUnknowns + 1) / 2;
static_assert(kEntries == 300);

/// Place of (row, col) in a packed lower triangle. Needs row >= col.
KERF_HD constexpr int packed_index(int row, int col) { return row * (row + 1) / 2 + col; }

/// Place of an entry of a cell in tiles of 1 << tile_log2 cells with `entries` scalars a cell.
KERF_HD constexpr std::size_t tile_index(std::size_t cell, std::size_t entry, std::size_t entries,
                                         int tile_log2) {
  const std::size_t lane = cell & ((std::size_t{1} << tile_log2) - 1);
  return ((((cell >> tile_log2) * entries) + entry) << tile_log2) + lane;
}

/// Scalars to allocate for `cells` cells: whole tiles.
KERF_HD constexpr std::size_t tiled_size(std::size_t cells, std::size_t entries, int tile_log2) {
  const std::size_t tile = std::size_t{1} << tile_log2;
  return ((cells + tile - 1) >> tile_log2) * entries << tile_log2;
}

/// One cell's entries where they lie: entry e at first[e * stride], stride = Tile.
/// A plain `T*` serves where entries are contiguous; the kernels take either.
template <class T>
struct CellEntries {
  T* first;
  std::size_t stride;

  KERF_HD T& operator[](int entry) const { return first[static_cast<std::size_t>(entry) * stride]; }
};

/// The entries of one cell inside an array of tiles.
template <class T>
KERF_HD CellEntries<T> cell_entries(T* tiles, std::size_t cell, std::size_t entries,
                                    int tile_log2) {
  return {tiles + tile_index(cell, 0, entries, tile_log2), std::size_t{1} << tile_log2};
}

/// Coordinates of a lattice point in its key: so many bits each, x lowest.
inline constexpr int kLatticeBits = 21;
KERF_HD constexpr std::int32_t lattice_coordinate(std::uint64_t key, int axis) {
  constexpr std::uint64_t kMask = (std::uint64_t{1} << kLatticeBits) - 1;
  return static_cast<std::int32_t>(key >> (kLatticeBits * axis) & kMask);
}

}  // namespace kerf::kernels
