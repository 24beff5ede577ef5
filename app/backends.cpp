// SPDX-License-Identifier: MIT
#include "app/backends.hpp"

#include "app/version.hpp"
#include "core/base/error.hpp"
#include "cpu/cpu_backend.hpp"
#include "cpu/fast_backend.hpp"
#include "gpu/cuda_backend.hpp"

namespace kerf {

const char* precision_name(Precision precision) {
  switch (precision) {
    case Precision::mixed:
      return "mixed";
    case Precision::single:
      return "single";
    default:
      return "double";
  }
}

std::unique_ptr<Backend> make_backend(const SolverSetup& solver) {
  expects(
      solver.precision != Precision::single,
      "solver.precision = \"single\": a solution in single precision cannot reach the tolerance "
      "of most bodies; \"mixed\" does, or take \"double\"");
  const bool mixed = solver.precision == Precision::mixed;
  const bool known = solver.backend == "cpu" || solver.backend == "auto" ||
                     solver.backend == "reference" || solver.backend == "cuda";
  expects(known, text("solver.backend = \"", solver.backend,
                      "\": expected \"cpu\", \"reference\", \"cuda\" or \"auto\""));
  if (solver.backend == "cuda" || (solver.backend == "auto" && cuda_problem().empty()))
    return make_cuda_backend({.device = 0, .single_cycle = mixed});
  // Gauss-Seidel is at home in the reference backend alone.
  if (solver.backend != "reference" && solver.smoother == SmootherType::chebyshev)
    return make_fast_backend({.threads = solver.threads, .single_cycle = mixed});
  expects(!mixed, text("solver.precision = \"mixed\" needs solver.smoother = \"chebyshev\" and "
                       "solver.backend = \"cpu\" or \"cuda\""));
  return make_cpu_backend(CpuOptions{.threads = solver.threads});
}

std::string why_on_cpu(const SolverSetup& solver) {
  return solver.backend == "auto" ? cuda_problem() : std::string();
}

std::vector<std::pair<std::string, std::string>> backend_states() {
  const auto cpu = make_cpu_backend({});
  const std::string problem = cuda_problem();
  const char* threads = cpu->threads() == 1 ? " thread" : " threads";
  std::string sets = make_fast_backend()->instruction_set();
  const auto all = fast_instruction_sets();
  for (std::size_t i = 0; i < all.size() && all.size() > 1; ++i)
    sets += (i == 0 ? "; KERF_INSTRUCTION_SET may be " : ", ") + all[i];
  return {
      {"cpu", text("ready, ", cpu->threads(), threads, ", double and mixed precision, ", sets)},
      {"reference", text("ready, ", cpu->threads(), threads, ", double precision")},
      {"cuda", problem.empty() ? text("ready, ", cuda_device_name(), ", double and mixed precision")
                               : text("not there: ", problem)}};
}

}  // namespace kerf
