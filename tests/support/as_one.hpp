// SPDX-License-Identifier: MIT
//
// Cells of coarse levels that turn as one: those whose children do, all nearly by the mean of
// these. What the operator of each level is made from where all of these turn as their mean does.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <optional>
#include <tuple>
#include <vector>

#include "kernels/transfer.hpp"
#include "tests/support/problem.hpp"

namespace kerf::test {

struct AsOne {
  std::vector<std::vector<double>> rotations;  ///< per level: of the cells of level 0
  // Per level; [0] of cells that are from eight of one kind, [1] of all others: from fewer, or of
  // several kinds, or with held vertices.
  std::vector<int> count[2];        ///< whose children turn as one each
  std::vector<double> farthest[2];  ///< of a child from the mean, radians
};

namespace detail {

/// What a cell is that turns as one.
struct Turned {
  Eigen::Vector4d rotation;
  bool held;                                  // wholly: it has no say
  std::tuple<int, int, double, double> kind;  // of its cells of level 0, if they are of one
  bool is_element;                            // one, or eight of them
};
using TurnedCells = std::vector<std::optional<Turned>>;  // per cell

inline TurnedCells finest_cells(const Problem& p, const std::vector<double>& rotations) {
  const Level& level = p.hierarchy.levels[0];
  TurnedCells out(level.corner.size());
  for (std::size_t c = 0; c < out.size(); ++c) {
    const CellValues& values = p.hierarchy.values[c];
    const auto are_held = [&](std::initializer_list<int> as) {
      return std::all_of(level.slots[c].begin(), level.slots[c].end(), [&](std::int32_t v) {
        return std::find(as.begin(), as.end(), level.fixed[v]) != as.end();
      });
    };
    if (are_held({0, 7}))  // else along some axes alone, which do not turn
      out[c] = Turned{Eigen::Map<const Eigen::Vector4d>(&rotations[4 * c]),
                      are_held({7}),
                      {level.size_log2[c], values.material, values.stiffness, values.mass},
                      are_held({0})};
  }
  return out;
}

inline TurnedCells next_cells(const Problem& p, std::size_t l, const TurnedCells& below,
                              double near, AsOne& all) {
  const Level &fine = p.hierarchy.levels[l - 1], &level = p.hierarchy.levels[l];
  TurnedCells out(level.corner.size());
  for (std::int32_t c = 0; c < level.cells(); ++c) {
    const auto children = level.children_of(c);
    if (!std::all_of(children.begin(), children.end(),
                     [&](std::int32_t child) { return below[child].has_value(); }))
      continue;
    std::vector<Turned> with_say;
    for (const std::int32_t child : children)
      if (!below[child]->held) with_say.push_back(*below[child]);
    if (with_say.empty()) {
      out[c] = below[children[0]];
      continue;
    }
    const Turned& first = with_say[0];
    Turned one{Eigen::Vector4d::Zero(), false, first.kind, false};
    for (const Turned& child : with_say)
      one.rotation += child.rotation.dot(first.rotation) < 0 ? Eigen::Vector4d(-child.rotation)
                                                             : child.rotation;
    one.rotation.normalize();
    double farthest = 0;
    for (const Turned& child : with_say) {
      const double cosine = std::abs(one.rotation.dot(child.rotation));
      farthest = std::max(farthest, 2 * std::acos(std::min(1.0, cosine)));
    }
    const bool alike = std::all_of(with_say.begin(), with_say.end(), [&](const Turned& child) {
      return child.is_element && child.kind == first.kind;
    });
    const bool passed = fine.place[children[0]] == Level::kPassed;
    const bool eight =
        !passed && alike && with_say.size() == 8 && !kernels::has_hanging(level.fold[c]);
    one.is_element = alike && (passed || eight);
    double& most = all.farthest[eight ? 0 : 1][l];
    most = std::max(most, farthest);
    ++all.count[eight ? 0 : 1][l];
    if (farthest <= near) out[c] = one;
  }
  return out;
}

}  // namespace detail

/// Cells of the coarsest level never turn as one, nor do those of which a child is farther from the
/// mean than `near`.
inline AsOne as_one(const Problem& p, const std::vector<double>& rotations,
                    double near = std::numeric_limits<double>::infinity()) {
  const auto levels = static_cast<std::size_t>(p.levels());
  AsOne out;
  out.rotations = {rotations};
  for (int i = 0; i < 2; ++i) {
    out.count[i].resize(levels);
    out.farthest[i].resize(levels);
  }
  detail::TurnedCells cells = detail::finest_cells(p, rotations);
  // Of each cell of level 0: the cell of this level that it is in, -1 once that does not turn.
  std::vector<std::int32_t> in(cells.size());
  for (std::size_t c = 0; c < in.size(); ++c) in[c] = cells[c] ? static_cast<std::int32_t>(c) : -1;
  for (std::size_t l = 1; l < levels; ++l) {
    out.rotations.push_back(out.rotations.back());
    if (l + 1 == levels) break;
    cells = detail::next_cells(p, l, cells, near, out);
    for (std::size_t c = 0; c < in.size(); ++c) {
      if (in[c] < 0) continue;
      in[c] = p.hierarchy.levels[l - 1].parent[in[c]];
      if (!cells[in[c]])
        in[c] = -1;
      else
        std::copy_n(cells[in[c]]->rotation.data(), 4,
                    out.rotations[l].begin() + 4 * static_cast<std::ptrdiff_t>(c));
    }
  }
  return out;
}

}  // namespace kerf::test
