// SPDX-License-Identifier: MIT
//
// The tables of docs/convergence.md: which cases each one runs.
#pragma once

#include <string>
#include <vector>

#include "bench/convergence/record.hpp"
#include "bench/linear_problem.hpp"
#include "bench/scenes.hpp"

namespace kerf::convergence {

using bench::Size;

struct Case {
  std::string label, body;
  bench::ProblemSetup setup;
};

struct Table {
  const char* name;
  const char* what;      ///< title
  const char* label_of;  ///< what the label of a case names
  const char* x;         ///< column that its picture is drawn over; empty: no picture
  std::vector<Case> (*cases)(Size size);
};
const std::vector<Table>& tables();
/// @throws Error (bad_input) with the nearest name that is known.
const Table& find_table(const std::string& name);

Record run_case(const Table& table, const Case& one, int threads);

}  // namespace kerf::convergence
