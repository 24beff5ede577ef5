// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <vector>

#include "kernels/layout.hpp"

namespace kerf::kernels {
namespace {

TEST(Layout, PackedIndexCountsTheLowerTriangleByRows) {
  int expected = 0;
  for (int row = 0; row < kUnknowns; ++row)
    for (int col = 0; col <= row; ++col) EXPECT_EQ(packed_index(row, col), expected++);
  EXPECT_EQ(expected, kEntries);
}

TEST(Layout, TilesHoldEveryEntryOnceForAnyTile) {
  constexpr std::size_t kCells = 37;  // no multiple of a tile
  for (const int log2 : {0, 4, 5}) {
    const std::size_t tile = std::size_t{1} << log2;
    std::vector<int> hits(tiled_size(kCells, kEntries, log2));

    for (std::size_t c = 0; c < kCells; ++c)
      for (std::size_t e = 0; e < kEntries; ++e) {
        const std::size_t at = tile_index(c, e, kEntries, log2);
        ASSERT_EQ(at, (c / tile * kEntries + e) * tile + c % tile);
        ASSERT_LT(at, hits.size());
        ++hits[at];
      }

    EXPECT_EQ(hits.size(), (kCells + tile - 1) / tile * tile * kEntries);
    std::size_t used = 0;
    for (const int count : hits) {
      ASSERT_LE(count, 1);
      used += static_cast<std::size_t>(count);
    }
    EXPECT_EQ(used, kCells * kEntries);
  }
}

TEST(Layout, CellEntriesReadsWhereTileIndexPoints) {
  constexpr int kLog2 = 4;
  std::vector<double> tiles(tiled_size(20, kEntries, kLog2));
  for (std::size_t i = 0; i < tiles.size(); ++i) tiles[i] = static_cast<double>(i);

  const CellEntries<double> cell = cell_entries(tiles.data(), 18, kEntries, kLog2);

  for (int e = 0; e < kEntries; ++e)
    EXPECT_EQ(cell[e],
              static_cast<double>(tile_index(18, static_cast<std::size_t>(e), kEntries, kLog2)));
}

}  // namespace
}  // namespace kerf::kernels
