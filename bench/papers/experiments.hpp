// SPDX-License-Identifier: MIT
//
// The tables and figures that kerf_papers runs.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "bench/papers/bodies.hpp"
#include "bench/papers/problem.hpp"
#include "bench/papers/results.hpp"

namespace kerf::papers {

/// What all experiments share.
struct Context {
  bench::Size size = bench::Size::full;
  std::vector<std::filesystem::path> folders;  ///< of meshes
  int threads = 1;                             ///< where seconds count
  int all_threads = 1;                         ///< elsewhere
  int repeat = 3;
  double give_up = 30;                            ///< s: longest run of a slow solver
  Results results;                                ///< they are added here
  std::function<void(const std::string&)> doing;  ///< told what runs now
  std::function<void(const std::string&)> note;   ///< told what was left out, and why
};

struct Experiment;
/// Runs one, and blanks what is printed of the paper's bodies where ours are small.
void run(Context& context, const Experiment& experiment);

/// The same with coarse levels, if bodies are small.
SimulationSetup fitted(const Context& context, SimulationSetup setup);
/// The set-up of a body, prepared for `size`; empty, with a note, if its mesh is missing.
std::optional<SimulationSetup> setup_of(Context& context, const BodyInfo& info, Grid grid);

// Names of methods, in results and pictures.
inline constexpr const char* kPaperMethod = "as in the paper";
inline constexpr const char* kKerfMethod = "Kerf";

void run_table1(Context&);
void run_table2(Context&);
void run_figure10(Context&);
void run_figure12(Context&);
void run_pictures(Context&);
void run_survey(Context&);

struct Experiment {
  const char* name;
  const char* what;
  void (*run)(Context&);
};
/// In the order in which they run.
const std::vector<Experiment>& experiments();

}  // namespace kerf::papers
