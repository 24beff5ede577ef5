// SPDX-License-Identifier: MIT
#include "core/levels/colours.hpp"

#include <algorithm>
#include <bit>

#include "core/base/error.hpp"

namespace kerf {
namespace {

// Where all cells have one size, the parity of the grid point: eight colours, however many vertices
// share a place.
std::vector<std::uint8_t> colours_by_parity(const Level& level) {
  std::vector<std::uint8_t> colour(level.point.size());
  for (std::size_t v = 0; v < colour.size(); ++v)
    for (int d = 0; d < 3; ++d)
      colour[v] |= static_cast<std::uint8_t>(((level.point[v][d] >> level.size_log2[0]) & 1) << d);
  return colour;
}

// Greedy in vertex order: somewhat more than eight at level jumps.
std::vector<std::uint8_t> colours_by_greed(const Level& level) {
  constexpr int kMaxColours = 128;
  std::vector<std::uint8_t> colour(level.point.size(), kMaxColours);
  for (std::int32_t v = 0; v < level.vertices(); ++v) {
    std::uint64_t used[2] = {0, 0};
    for (const std::int32_t k : level.incidences_of(v))
      for (const std::int32_t w : level.slots[k / 8])
        if (colour[w] < kMaxColours) used[colour[w] / 64] |= std::uint64_t{1} << (colour[w] % 64);
    int c = std::countr_one(used[0]);
    if (c == 64) c = 64 + std::countr_one(used[1]);
    ensures(c < kMaxColours, "more than 128 colours");
    colour[v] = static_cast<std::uint8_t>(c);
  }
  return colour;
}

}  // namespace

Colours colour_vertices(const Level& level) {
  const bool one_size = std::all_of(level.size_log2.begin(), level.size_log2.end(),
                                    [&](std::uint8_t s) { return s == level.size_log2[0]; });
  const std::vector<std::uint8_t> colour =
      one_size ? colours_by_parity(level) : colours_by_greed(level);
  std::vector<std::int32_t> count(*std::max_element(colour.begin(), colour.end()) + std::size_t{1},
                                  0);
  for (const std::uint8_t c : colour) ++count[c];
  Colours out;
  out.begin.assign(count.size() + 1, 0);
  for (std::size_t c = 0; c < count.size(); ++c) out.begin[c + 1] = out.begin[c] + count[c];
  out.order.resize(level.point.size());
  std::vector<std::int32_t> next(out.begin.begin(), out.begin.end() - 1);
  for (std::int32_t v = 0; v < level.vertices(); ++v) out.order[next[colour[v]]++] = v;
  return out;
}

}  // namespace kerf
