// SPDX-License-Identifier: MIT
//
// Cells of coarse levels that may be one element each: from one such cell, or from eight of one
// kind, one an octant, none of them held, where no corner hangs. What the operator of each level is
// made from where all of these turn as their mean does.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <tuple>
#include <vector>

#include "kernels/transfer.hpp"
#include "tests/support/problem.hpp"

namespace kerf::test {

struct AsOne {
  std::vector<std::vector<double>> rotations;  ///< per level: of the cells of level 0
  std::vector<int> eights;                     ///< per level: cells that are from eight
  std::vector<double> farthest;  ///< per level: of one of eight from the mean, radians
};

namespace detail {

struct Element {
  Eigen::Vector4d rotation;
  std::tuple<int, int, double, double> kind;  // of its cells of level 0
};
using Elements = std::vector<std::optional<Element>>;  // per cell

inline Elements finest_elements(const Problem& p, const std::vector<double>& rotations) {
  const Level& level = p.hierarchy.levels[0];
  Elements out(level.corner.size());
  for (std::size_t c = 0; c < out.size(); ++c) {
    const CellValues& values = p.hierarchy.values[c];
    if (std::all_of(level.slots[c].begin(), level.slots[c].end(),
                    [&](std::int32_t v) { return level.fixed[v] == 0; }))
      out[c] = Element{Eigen::Map<const Eigen::Vector4d>(&rotations[4 * c]),
                       {level.size_log2[c], values.material, values.stiffness, values.mass}};
  }
  return out;
}

inline Elements next_elements(const Problem& p, std::size_t l, const Elements& below, double near,
                              AsOne& all) {
  const Level &fine = p.hierarchy.levels[l - 1], &level = p.hierarchy.levels[l];
  Elements out(level.corner.size());
  for (std::int32_t c = 0; c < level.cells(); ++c) {
    const auto children = level.children_of(c);
    const std::optional<Element>& first = below[children[0]];
    if (!first) continue;
    if (fine.place[children[0]] == Level::kPassed) {
      out[c] = first;
      continue;
    }
    if (children.size() != 8 || kernels::has_hanging(level.fold[c]) ||
        !std::all_of(children.begin(), children.end(), [&](std::int32_t child) {
          return below[child] && below[child]->kind == first->kind;
        }))
      continue;
    Element one{Eigen::Vector4d::Zero(), first->kind};
    for (const std::int32_t child : children) {
      const Eigen::Vector4d& q = below[child]->rotation;
      one.rotation += q.dot(first->rotation) < 0 ? Eigen::Vector4d(-q) : q;
    }
    one.rotation.normalize();
    double farthest = 0;
    for (const std::int32_t child : children) {
      const double cosine = std::abs(one.rotation.dot(below[child]->rotation));
      farthest = std::max(farthest, 2 * std::acos(std::min(1.0, cosine)));
    }
    all.farthest[l] = std::max(all.farthest[l], farthest);
    ++all.eights[l];
    if (farthest <= near) out[c] = one;
  }
  return out;
}

}  // namespace detail

/// Cells of the coarsest level are never one, nor are eight of which one is farther than `near`.
inline AsOne as_one(const Problem& p, const std::vector<double>& rotations,
                    double near = std::numeric_limits<double>::infinity()) {
  const auto levels = static_cast<std::size_t>(p.levels());
  AsOne out{{rotations}, std::vector<int>(levels), std::vector<double>(levels)};
  detail::Elements elements = detail::finest_elements(p, rotations);
  // Of each cell of level 0: the cell of this level that it is in, -1 once that is not an element.
  std::vector<std::int32_t> in(elements.size());
  for (std::size_t c = 0; c < in.size(); ++c)
    in[c] = elements[c] ? static_cast<std::int32_t>(c) : -1;
  for (std::size_t l = 1; l < levels; ++l) {
    out.rotations.push_back(out.rotations.back());
    if (l + 1 == levels) break;
    elements = detail::next_elements(p, l, elements, near, out);
    for (std::size_t c = 0; c < in.size(); ++c) {
      if (in[c] < 0) continue;
      in[c] = p.hierarchy.levels[l - 1].parent[in[c]];
      if (!elements[in[c]])
        in[c] = -1;
      else
        std::copy_n(elements[in[c]]->rotation.data(), 4,
                    out.rotations[l].begin() + 4 * static_cast<std::ptrdiff_t>(c));
    }
  }
  return out;
}

}  // namespace kerf::test
