// SPDX-License-Identifier: MIT
#include "cpu/near_loops.hpp"

#include <algorithm>
#include <vector>

#include "cpu/parallel_errors.hpp"

namespace kerf::cpu {
namespace {

/// look(first, last, part) for parts of [0, count), joined in their order.
template <class Look>
void in_chunks(std::int32_t count, int threads, const Look& look, NearCells& out) {
  constexpr std::int32_t kChunk = 8192;
  const std::int32_t chunks = (count + kChunk - 1) / kChunk;
  std::vector<NearCells> found(static_cast<std::size_t>(chunks));
  ParallelErrors errors;
#pragma omp parallel for num_threads(threads) schedule(static) if (chunks > 1)
  for (std::int32_t i = 0; i < chunks; ++i)
    errors.run([&] { look(kChunk * i, std::min(count, kChunk * (i + 1)), found[i]); });
  errors.rethrow();
  for (const NearCells& part : found) {
    out.finite = out.finite && part.finite;
    out.bounds.add(part.bounds);
    out.cells.insert(out.cells.end(), part.cells.begin(), part.cells.end());
  }
}

}  // namespace

NearCells find_near(const Hierarchy& hierarchy, std::span<const double> displacement,
                    const BladeReach& reach, std::span<const std::int32_t> opened, int threads) {
  FindNear find(hierarchy, displacement, reach);
  NearCells out;
  in_chunks(
      hierarchy.levels[0].vertices(), threads,
      [&](std::int32_t first, std::int32_t last, NearCells& part) {
        find.look_at_vertices(first, last, part);
      },
      out);
  in_chunks(
      hierarchy.levels[0].cells(), threads,
      [&](std::int32_t first, std::int32_t last, NearCells& part) {
        find.look_at_cells(first, last, part);
      },
      out);
  find.look_at_opened(opened, out);
  return out;
}

}  // namespace kerf::cpu
