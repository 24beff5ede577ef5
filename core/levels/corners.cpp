// SPDX-License-Identifier: MIT
#include "core/levels/corners.hpp"

#include "kernels/transfer.hpp"

namespace kerf {

void corner_values(const Level& level, std::int32_t cell, std::span<const double> vertex_values,
                   Vec3d (&out)[8]) {
  Vec3d slots[8];
  for (int i = 0; i < 8; ++i) {
    const std::size_t v = 3 * static_cast<std::size_t>(level.slots[cell][i]);
    slots[i] = {vertex_values[v], vertex_values[v + 1], vertex_values[v + 2]};
  }
  kernels::unfold(slots, level.fold[cell], out);
}

std::vector<double> transfer_values(const Level& before, std::span<const double> values,
                                    const Level& after, std::span<const std::int32_t> origin) {
  std::vector<double> out(3 * after.point.size(), 0.0);
  for (std::int32_t v = 0; v < after.vertices(); ++v) {
    // The field is continuous over links, so any cell gives the value; one that has the vertex as
    // its own corner exists, and the first is as good as any.
    for (const std::int32_t k : after.incidences_of(v)) {
      const std::int32_t cell = k / 8;
      const int slot = k % 8;
      if ((after.fold[cell] >> slot) & 1) continue;  // the vertex lies outside this cell
      const std::int32_t old = origin[cell];
      Vec3d corners[8];
      corner_values(before, old, values, corners);
      const double side = 1 << before.size_log2[old];
      double t[3];
      for (int d = 0; d < 3; ++d) t[d] = (after.point[v][d] - before.corner[old][d]) / side;
      Vec3d sum{};
      for (int i = 0; i < 8; ++i) {
        double w = 1;
        for (int d = 0; d < 3; ++d) w *= ((i >> d) & 1) ? t[d] : 1 - t[d];
        if (w != 0) sum += w * corners[i];
      }
      for (int d = 0; d < 3; ++d) out[3 * static_cast<std::size_t>(v) + d] = sum[d];
      break;
    }
  }
  return out;
}

}  // namespace kerf
