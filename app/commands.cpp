// SPDX-License-Identifier: MIT
#include "app/commands.hpp"

#include <fmt/format.h>

#include <cstdio>
#include <new>

#include "app/backends.hpp"
#include "app/session.hpp"
#include "app/version.hpp"
#include "core/base/error.hpp"

namespace kerf {

namespace {

/// What was said is all that these commands leave.
void expect_said() {
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0)
    throw Error(ErrorKind::bad_input, "standard output: cannot be written");
}

}  // namespace

int check_command(const std::filesystem::path& file, const std::vector<std::string>& overrides) {
  const Scene scene = read_scene(file, overrides);
  const Simulation simulation = open_simulation(scene, open_backend(scene));
  const Lattice& lattice = simulation.body().lattice();
  for (const auto& warning : simulation.warnings())
    std::fprintf(stderr, "kerf: warning: %s\n", warning.c_str());
  fmt::print("{}: no fault found\n", scene.file.string());
  fmt::print("lattice   {} x {} x {} finest cells of {:.4g} m\n", lattice.size[0], lattice.size[1],
             lattice.size[2], lattice.spacing);
  fmt::print("cells     {}, {} vertices, {} hanging corners, {} {}\n", simulation.cells(),
             simulation.vertices(), simulation.hanging(), simulation.pieces(),
             simulation.pieces() == 1 ? "piece" : "pieces");
  fmt::print("unknowns  {} on {} levels\n", simulation.unknowns(),
             simulation.hierarchy().levels.size());
  fmt::print("memory    {} before cuts ({:.0f} bytes a cell)\n", bytes_text(simulation.bytes()),
             static_cast<double>(simulation.bytes()) / static_cast<double>(simulation.cells()));
  fmt::print("run       {} steps, {} {}\n", simulation.steps_planned(), scene.setup.cuts.size(),
             scene.setup.cuts.size() == 1 ? "cut" : "cuts");
  expect_said();
  return kDone;
}

int info_command() {
  fmt::print("kerf      {} (commit {})\n", kVersion, kCommit);
  fmt::print("build     {}, {}, {}\n", kBuildType, kCompiler, kSystem);
  for (const auto& [name, state] : backend_states()) fmt::print("{:<9} {}\n", name, state);
  fmt::print("preview   {}\n",
             kHasPreview ? "ready" : "not built; configure with -DKERF_PREVIEW=ON");
  fmt::print("libraries {}\n", kLibraries);
  expect_said();
  return kDone;
}

int guarded(const std::function<int()>& command) {
  const auto complain = [](const char* what) {
    std::fflush(stdout);
    std::fprintf(stderr, "kerf: error: %s\n", what);
  };
  try {
    return command();
  } catch (const Error& error) {
    complain(error.what());
    if (error.kind() == ErrorKind::bad_input) return kBadInput;
    return error.kind() == ErrorKind::unavailable ? kUnavailable : kInternal;
  } catch (const std::bad_alloc&) {
    complain("out of memory; lower resolution or raise refinement in [body]");
    return kUnavailable;
  } catch (const std::exception& error) {
    complain(error.what());
    return kInternal;
  }
}

}  // namespace kerf
