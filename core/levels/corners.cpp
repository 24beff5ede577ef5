// SPDX-License-Identifier: MIT
#include "core/levels/corners.hpp"

#include <algorithm>
#include <cmath>

#include "core/base/error.hpp"
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

NewVertices new_vertices(const Level& level, const LevelChange& change) {
  NewVertices out;
  for (std::int32_t v = change.vertices_before; v < level.vertices(); ++v) {
    // The field is continuous over links, so any cell gives the value; one that has the vertex as
    // its own corner exists, and the first is as good as any.
    std::int32_t cell = -1;
    for (const std::int32_t k : level.incidences_of(v)) {
      if ((level.fold[k / 8] >> (k % 8) & 1) != 0) continue;  // the vertex lies outside this cell
      cell = k / 8;
      break;
    }
    ensures(cell >= 0, "a vertex is no corner of any cell");
    if (cell >= change.cells_before) cell = change.origin[cell - change.cells_before];
    const CellBefore was = change.cell_before(level, cell);
    double fold[8][8], at[8] = {};
    kernels::fold_weights(was.fold, fold);
    for (int i = 0; i < 8; ++i) {
      double w = 1;
      for (int d = 0; d < 3; ++d) {
        const double t = 1.0 * (level.point[v][d] - was.corner[d]) / (1 << was.size_log2);
        w *= ((i >> d) & 1) ? t : 1 - t;
      }
      if (w == 0) continue;
      for (int j = 0; j < 8; ++j) at[j] += w * fold[i][j];
    }
    for (int j = 0; j < 8; ++j) {
      if (at[j] == 0) continue;
      out.source.push_back(was.slots[j]);
      out.weight.push_back(at[j]);
    }
    out.begin.push_back(static_cast<std::int32_t>(out.source.size()));
  }
  return out;
}

std::vector<double> NewVertices::combine(std::span<const double> of_sources) const {
  std::vector<double> out(3 * (begin.size() - 1), 0.0);
  for (std::size_t v = 0; v + 1 < begin.size(); ++v)
    for (std::int32_t k = begin[v]; k < begin[v + 1]; ++k)
      for (std::size_t d = 0; d < 3; ++d)
        out[3 * v + d] += weight[k] * of_sources[3 * static_cast<std::size_t>(k) + d];
  return out;
}

// Most cells lie far off beyond one side, so that is looked at first.
bool may_meet_opened(const Vec3d (&vertices)[8], const BladeReach& reach) {
  Box3 box;
  for (const Vec3d& at : vertices) box.add(at);
  for (int d = 0; d < 3; ++d) {
    const double beyond = BladeReach::kBeyond * (box.hi[d] - box.lo[d]);
    if (box.hi[d] + beyond < reach.box().lo[d] || box.lo[d] - beyond > reach.box().hi[d])
      return false;
  }
  return reach.may_meet(box, true);
}

std::vector<double> values_at(std::span<const double> all, std::span<const std::int32_t> vertices) {
  std::vector<double> out;
  out.reserve(3 * vertices.size());
  for (const std::int32_t v : vertices)
    for (std::size_t d = 0; d < 3; ++d) out.push_back(all[3 * static_cast<std::size_t>(v) + d]);
  return out;
}

void add_opened(std::span<const std::int32_t> opened, NearCells& out) {
  out.cells.insert(out.cells.end(), opened.begin(), opened.end());
  std::sort(out.cells.begin(), out.cells.end());
  out.cells.erase(std::unique(out.cells.begin(), out.cells.end()), out.cells.end());
}

FindNear::FindNear(const Hierarchy& hierarchy, std::span<const double> displacement,
                   const BladeReach& reach)
    : level_(hierarchy.levels[0]),
      spacing_(hierarchy.spacing),
      displacement_(displacement),
      reach_(reach),
      beside_(level_.point.size()) {}

Vec3d FindNear::position(std::int32_t vertex) const {
  const double* u = displacement_.data() + 3 * static_cast<std::size_t>(vertex);
  const Vec3i& x = level_.point[vertex];
  return {x[0] * spacing_ + u[0], x[1] * spacing_ + u[1], x[2] * spacing_ + u[2]};
}

void FindNear::look_at_vertices(std::int32_t first, std::int32_t last, NearCells& out) {
  // In locals, because a byte that is written might be any of theirs.
  const Box3 box = reach_.box();
  const double h = spacing_;
  const LatticePoint* point = level_.point.data();
  const double* u = displacement_.data();
  std::uint8_t* beside = beside_.data();
  Box3 bounds;
  double sum = 0;  // finite as long as all are
  for (std::int32_t v = first; v < last; ++v) {
    const double* at = u + 3 * static_cast<std::size_t>(v);
    const Vec3d p{point[v][0] * h + at[0], point[v][1] * h + at[1], point[v][2] * h + at[2]};
    const int bits = (p.x < box.lo.x ? 1 : 0) | (p.x > box.hi.x ? 2 : 0) |
                     (p.y < box.lo.y ? 4 : 0) | (p.y > box.hi.y ? 8 : 0) |
                     (p.z < box.lo.z ? 16 : 0) | (p.z > box.hi.z ? 32 : 0);
    beside[v] = static_cast<std::uint8_t>(bits);
    for (int d = 0; d < 3; ++d) {
      bounds.lo[d] = p[d] < bounds.lo[d] ? p[d] : bounds.lo[d];
      bounds.hi[d] = p[d] > bounds.hi[d] ? p[d] : bounds.hi[d];
    }
    sum += 0 * (p.x + p.y + p.z);
  }
  out.bounds.add(bounds);
  out.finite = out.finite && std::isfinite(sum);
}

// The sides of the box beyond which all vertices of a cell lie.
std::uint8_t FindNear::sides_beyond(std::int32_t cell) const {
  std::uint8_t beside = 255;
  for (const std::int32_t v : level_.slots[cell]) beside &= beside_[v];
  return beside;
}

void FindNear::look_at_cells(std::int32_t first, std::int32_t last, NearCells& out) const {
  for (std::int32_t c = first; c < last; ++c) {
    if (sides_beyond(c) != 0) continue;
    Box3 box;
    for (const std::int32_t v : level_.slots[c]) box.add(position(v));
    if (reach_.may_meet(box, false)) out.cells.push_back(c);
  }
}

void FindNear::look_at_opened(std::span<const std::int32_t> cells, NearCells& out) const {
  std::vector<std::int32_t> met;
  for (const std::int32_t c : cells) {
    Vec3d at[8];
    for (std::size_t i = 0; i < 8; ++i) at[i] = position(level_.slots[c][i]);
    if (may_meet_opened(at, reach_)) met.push_back(c);
  }
  add_opened(met, out);
}

NearCells near_cells(const Hierarchy& hierarchy, std::span<const double> displacement,
                     const BladeReach& reach, std::span<const std::int32_t> opened) {
  FindNear find(hierarchy, displacement, reach);
  NearCells out;
  find.look_at_vertices(0, hierarchy.levels[0].vertices(), out);
  find.look_at_cells(0, hierarchy.levels[0].cells(), out);
  find.look_at_opened(opened, out);
  return out;
}

}  // namespace kerf
