// SPDX-License-Identifier: MIT
//
// What must hold on any machine, if the papers are right and so are we.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "bench/papers/results.hpp"

namespace kerf::papers {

struct Criterion {
  std::string id;         ///< as in the headings of docs/papers.md
  std::string statement;  ///< what must hold
  std::string seen;       ///< the figures that decide
  /// Empty: the figures are not there.
  std::optional<bool> met;
};

std::vector<Criterion> criteria(const Results& results);

}  // namespace kerf::papers
