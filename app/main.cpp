// SPDX-License-Identifier: MIT
#include <CLI/CLI.hpp>
#include <cstdio>

#include "app/bounded_wait.hpp"
#include "app/commands.hpp"
#include "app/version.hpp"
#include "core/base/memory.hpp"

namespace {

std::string not_empty(const std::string& folder) {
  return folder.empty() ? "must name a folder" : "";
}

CLI::App* add_render(CLI::App& app, kerf::RenderOptions& options) {
  CLI::App* render = app.add_subcommand("render", "Draw pictures of what a run left");
  render->add_option("folder", options.folder, "The folder of the run, with surface_NNNN.vtp")
      ->check(not_empty)
      ->required()
      ->type_name("DIR");
  render->add_flag("--frames", options.frames,
                   "Draw the whole series as frame_NNNN.png, not only the last as preview.png");
  render->add_option("-o,--out", options.out, "The folder for the pictures; else DIR")
      ->check(not_empty)
      ->type_name("DIR2");
  render->add_option("--size", options.size, "Of a picture, in pixels; else 1200x900")
      ->type_name("WxH");
  render
      ->add_option("--view", options.view,
                   "Where to look from, in degrees: 0,0 is the front, 90,0 the right, 0,90 above; "
                   "else where most of the cuts is seen")
      ->type_name("AZIMUTH,ELEVATION");
  render->add_option("--up", options.up, "The direction up in the picture; else 0,1,0")
      ->type_name("X,Y,Z");
  render->add_option("--samples", options.samples, "Per pixel and direction at edges; else 4")
      ->check(CLI::Range(1, 16))
      ->type_name("N");
  render->add_flag("-q,--quiet", options.quiet, "Print errors and warnings only");
  return render;
}

}  // namespace

int main(int argc, char** argv) {
  kerf::bound_waiting(argv);
  kerf::return_large_blocks_when_freed();
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
      ->check(not_empty)
      ->required()
      ->type_name("DIR");
  run->add_flag("-q,--quiet", options.quiet, "Print errors and warnings only");
  add_overrides(run);

  CLI::App* check = app.add_subcommand("check", "Check a scene and say what it needs; no run");
  check->add_option("scene", options.scene, "The scene file")->required()->type_name("SCENE.toml");
  add_overrides(check);

  kerf::RenderOptions pictures;
  CLI::App* render = add_render(app, pictures);

  CLI::App* info = app.add_subcommand("info", "Print version, build, backends and libraries");

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    // CLI11 has statuses of its own; help and version are 0, everything else is bad input.
    if (error.get_exit_code() == 0) return app.exit(error);
    std::fprintf(stderr, "kerf: error: %s\nRun with --help for more information.\n", error.what());
    return kerf::kBadInput;
  }
  return kerf::guarded([&] {
    if (run->parsed()) return kerf::run_command(options);
    if (check->parsed()) return kerf::check_command(options.scene, options.overrides);
    if (render->parsed()) return kerf::render_command(pictures);
    return info->parsed() ? kerf::info_command() : kerf::kInternal;
  });
}
