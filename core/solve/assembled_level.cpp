// SPDX-License-Identifier: MIT
#include <algorithm>

#include "core/base/error.hpp"
#include "core/solve/sparse_cholesky.hpp"
#include "kernels/layout.hpp"

namespace kerf {

AssembledLevel::AssembledLevel(const Level& level) {
  const std::int32_t vertices = level.vertices();
  block_begin_.assign(vertices + 1, 0);
  std::vector<int> near;
  for (std::int32_t v = 0; v < vertices; ++v) {
    near.clear();
    for (const std::int32_t k : level.incidences_of(v))
      for (const std::int32_t w : level.slots[k / 8])
        if (w >= v) near.push_back(w);
    std::sort(near.begin(), near.end());
    near.erase(std::unique(near.begin(), near.end()), near.end());
    block_row_.insert(block_row_.end(), near.begin(), near.end());
    block_begin_[v + 1] = static_cast<int>(block_row_.size());
  }
  expects(9 * block_row_.size() < (std::size_t{1} << 31),
          "this body is too large for sparse Cholesky; set solver.method = \"cg\"");
  column_begin.assign(3 * vertices + 1, 0);
  row.reserve(9 * block_row_.size());
  for (std::int32_t v = 0; v < vertices; ++v)
    for (int c = 0; c < 3; ++c) {
      for (int k = block_begin_[v]; k < block_begin_[v + 1]; ++k)
        for (int r = 0; r < 3; ++r)
          if (block_row_[k] != v || r >= c) row.push_back(3 * block_row_[k] + r);
      column_begin[3 * v + c + 1] = static_cast<int>(row.size());
    }
  value.assign(row.size(), 0.0);
}

int AssembledLevel::position(int row_vertex, int row_component, int column_vertex,
                             int column_component) const {
  const auto first = block_row_.begin() + block_begin_[column_vertex];
  const auto last = block_row_.begin() + block_begin_[column_vertex + 1];
  const int rank = static_cast<int>(std::lower_bound(first, last, row_vertex) - first);
  // The diagonal block, the first one, lacks the rows above the diagonal.
  return column_begin[3 * column_vertex + column_component] + 3 * rank + row_component -
         column_component;
}

void AssembledLevel::assemble(const Level& level, const ReadCell& read_cell) {
  std::fill(value.begin(), value.end(), 0.0);
  std::vector<double> packed(kernels::kEntries);
  for (std::int32_t cell = 0; cell < level.cells(); ++cell) {
    read_cell(cell, packed);
    const auto& slots = level.slots[cell];
    for (int i = 0; i < 8; ++i)
      for (int j = 0; j < 8; ++j) {
        if (slots[j] > slots[i]) continue;  // upper triangle
        const int base = position(slots[i], 0, slots[j], 0);
        const int next_column =
            column_begin[3 * slots[j] + 1] - column_begin[3 * slots[j]] - 1;  // one row less
        for (int c = 0; c < 3; ++c)
          for (int r = (i == j ? c : 0); r < 3; ++r) {
            const int p = 3 * i + r, q = 3 * j + c;
            const int at = base + r + (c > 0 ? next_column : 0) + (c > 1 ? next_column - 1 : 0);
            value[at] += packed[p >= q ? kernels::packed_index(p, q) : kernels::packed_index(q, p)];
          }
      }
  }
  for (std::int32_t v = 0; v < level.vertices(); ++v)
    for (int c = 0; c < 3; ++c)
      if ((level.fixed[v] >> c) & 1) value[column_begin[3 * v + c]] = 1;
}

void AssembledLevel::strengthen_diagonal(double share) {
  for (int i = 0; i < unknowns(); ++i) value[column_begin[i]] *= 1 + share;
}

}  // namespace kerf
