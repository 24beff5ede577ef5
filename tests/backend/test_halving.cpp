// SPDX-License-Identifier: MIT
//
// Cells in parts: each once, equally many in each, and those of a box in boxes.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <numeric>
#include <vector>

#include "cpu/halving.hpp"

namespace kerf {
namespace {

using Parts = std::vector<std::vector<std::int32_t>>;

Level box_level(int nx, int ny, int nz) {
  Level level;
  for (int z = 0; z < nz; ++z)
    for (int y = 0; y < ny; ++y)
      for (int x = 0; x < nx; ++x) level.corner.push_back(Vec3i{x, y, z});
  return level;
}

Parts halved_box(int nx, int ny, int nz, std::size_t parts) {
  const Level level = box_level(nx, ny, nz);
  std::vector<std::int32_t> cells(level.corner.size());
  std::iota(cells.begin(), cells.end(), 0);
  Parts out = cpu::halved(level, cells, parts);
  for (const std::vector<std::int32_t>& part : out)
    EXPECT_TRUE(std::is_sorted(part.begin(), part.end()));
  std::reverse(cells.begin(), cells.end());  // their order is nothing
  EXPECT_EQ(out, cpu::halved(level, cells, parts));
  return out;
}

/// Cells along each axis of the box around a part.
std::array<int, 3> extent(const Level& level, const std::vector<std::int32_t>& part) {
  std::array<int, 3> out{};
  for (int d = 0; d < 3; ++d) {
    const auto [low, high] = std::minmax_element(
        part.begin(), part.end(),
        [&](std::int32_t a, std::int32_t b) { return level.corner[a][d] < level.corner[b][d]; });
    out[static_cast<std::size_t>(d)] = level.corner[*high][d] - level.corner[*low][d] + 1;
  }
  return out;
}

TEST(Halving, PutsEachCellInOneOfEqualParts) {
  for (const std::size_t parts : {1u, 2u, 3u, 7u, 16u, 41u}) {
    const Parts all = halved_box(13, 7, 11, parts);
    ASSERT_EQ(all.size(), parts);
    std::vector<std::int32_t> cells;
    std::size_t least = SIZE_MAX, most = 0;
    for (const std::vector<std::int32_t>& part : all) {
      least = std::min(least, part.size());
      most = std::max(most, part.size());
      cells.insert(cells.end(), part.begin(), part.end());
    }
    EXPECT_LE(most, least + 1) << parts << " parts";
    std::sort(cells.begin(), cells.end());
    ASSERT_EQ(cells.size(), 13u * 7u * 11u);
    for (std::size_t c = 0; c < cells.size(); ++c) EXPECT_EQ(cells[c], static_cast<int>(c));
  }
}

TEST(Halving, MakesBoxesOfABoxAndKeepsRowsLong) {
  const Level level = box_level(32, 32, 32);
  for (const std::vector<std::int32_t>& part : halved_box(32, 32, 32, 16))
    EXPECT_EQ(extent(level, part), (std::array{32, 8, 8}));
  const Level row = box_level(96, 4, 4);
  for (const std::vector<std::int32_t>& part : halved_box(96, 4, 4, 4))
    EXPECT_EQ(extent(row, part), (std::array{24, 4, 4}));
}

TEST(Halving, TakesFewerCellsThanParts) {
  const Parts all = halved_box(3, 1, 1, 5);
  ASSERT_EQ(all.size(), 5u);
  std::size_t count = 0;
  for (const std::vector<std::int32_t>& part : all) count += part.size();
  EXPECT_EQ(count, 3u);
}

}  // namespace
}  // namespace kerf
