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
  /// Empty: some of the figures are not there, or those of small bodies, or it is for information.
  std::optional<bool> met;
  bool is_report = false;  ///< nothing is decided: the paper's own figures differ
};

std::vector<Criterion> criteria(const Results& results);

}  // namespace kerf::papers
