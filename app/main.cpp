// SPDX-License-Identifier: MIT
#include <CLI/CLI.hpp>

#include "app/commands.hpp"
#include "app/version.hpp"

int main(int argc, char** argv) {
  CLI::App app{"Kerf simulates cuts in deformable bodies."};
  app.name("kerf");
  app.require_subcommand(1);
  app.set_version_flag("--version", std::string("kerf ") + kerf::kVersion);
  app.footer(
      "Exit status: 0 done; 2 bad input; 3 not converged (results kept);\n"
      "4 no such backend or out of memory; 130 interrupted (results so far kept).");

  kerf::RunOptions options;
  const auto add_overrides = [&](CLI::App* command) {
    // One value for each --set, which may itself begin with a bracket.
    command->add_option("--set", options.overrides, "Override a key, as in solver.method=cholesky")
        ->type_name("KEY=VALUE")
        ->expected(1)
        ->allow_extra_args(false)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  };
  CLI::App* run = app.add_subcommand("run", "Run a scene and write its results");
  run->add_option("scene", options.scene, "The scene file")->required()->type_name("SCENE.toml");
  run->add_option("-o,--out", options.out, "The folder for the results")
      ->check([](const std::string& out) {
        return out.empty() ? std::string("must name a folder") : std::string();
      })
      ->required()
      ->type_name("DIR");
  run->add_flag("-q,--quiet", options.quiet, "Print errors and warnings only");
  add_overrides(run);

  CLI::App* check = app.add_subcommand("check", "Check a scene and say what it needs; no run");
  check->add_option("scene", options.scene, "The scene file")->required()->type_name("SCENE.toml");
  add_overrides(check);

  CLI::App* info = app.add_subcommand("info", "Print version, build, backends and libraries");

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    // CLI11 has statuses of its own; help and version are 0, everything else is bad input.
    return app.exit(error) == 0 ? kerf::kDone : kerf::kBadInput;
  }
  return kerf::guarded([&] {
    if (run->parsed()) return kerf::run_command(options);
    if (check->parsed()) return kerf::check_command(options.scene, options.overrides);
    return info->parsed() ? kerf::info_command() : kerf::kInternal;
  });
}
