// SPDX-License-Identifier: MIT
#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "app/backends.hpp"
#include "app/commands.hpp"
#include "app/interrupt.hpp"
#include "app/preview.hpp"
#include "app/progress.hpp"
#include "app/results.hpp"
#include "app/session.hpp"
#include "core/base/error.hpp"
#include "core/base/timer.hpp"

namespace kerf {
namespace {

std::size_t peak_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::size_t>(usage.ru_maxrss) * 1024;  // Linux counts in KiB
}

Vec3d up_direction(const SimulationSetup& setup) {
  for (const auto& load : setup.loads)
    if (const auto* gravity = std::get_if<Gravity>(&load))
      if (norm(gravity->acceleration) > 0) return -gravity->acceleration;
  return {0, 1, 0};
}

/// One run, from its first step to its files.
class Run {
 public:
  Run(const Scene& scene, const RunOptions& options, Simulation& simulation, ResultsFolder& results)
      : scene_(scene),
        options_(options),
        simulation_(simulation),
        results_(results),
        bar_(!options.quiet),
        hits_(scene.setup.cuts.size(), 0) {}

  int execute() {
    const InterruptGuard guard(
        "interrupted: what there is will be written; once more, to quit without it");
    say_body();
    say_warnings();
    write_state();
    step_through();
    if (last_written_ != simulation_steps()) write_state();
    draw();
    finish_summary();
    guard.hold_on();
    results_.commit(summary_);
    say_end();
    return status();
  }

 private:
  int simulation_steps() const { return summary_.steps.empty() ? 0 : summary_.steps.back().step; }

  void say(const std::string& line) {
    if (options_.quiet) return;
    bar_.clear();
    std::printf("%s\n", line.c_str());
    std::fflush(stdout);
  }

  void complain(const std::string& line) {
    bar_.clear();
    std::fprintf(stderr, "kerf: %s\n", line.c_str());
  }

  void say_body() {
    const auto& s = simulation_;
    const std::string why = why_on_cpu(scene_.setup.solver);
    say(fmt::format("{} cells, {} vertices, {} levels, {}, backend {} with {} {}{}", s.cells(),
                    s.vertices(), s.hierarchy().levels.size(), bytes_text(s.bytes()),
                    s.backend().name(), s.backend().threads(),
                    s.backend().threads() == 1 ? "thread" : "threads",
                    scene_.setup.solver.backend != "auto" ? ""
                    : why.empty()                         ? " (chosen by auto)"
                                  : " (chosen by auto; cuda: " + why + ")"));
  }

  void say_warnings() {
    const auto& all = simulation_.warnings();
    for (; warnings_said_ < all.size(); ++warnings_said_)
      complain("warning: " + all[warnings_said_]);
  }

  void step_through() {
    simulation_.on_progress([this](const char* phase, int cycles, double residual) {
      bar_.phase(phase, cycles, residual);
    });
    bar_.start(simulation_.steps_planned());
    while (!simulation_.finished() && !InterruptGuard::asked()) {
      const StepReport step = simulation_.step();
      summary_.steps.push_back(step);
      note(step);
      bar_.finished(step);
      if (step.step % scene_.output.every == 0) write_state();
    }
    summary_.interrupted = InterruptGuard::asked() && !simulation_.finished();
    simulation_.on_progress({});
    bar_.clear();
  }

  void note(const StepReport& step) {
    for (const auto& cut : step.cuts)
      if (cut.cut_id >= 1 && static_cast<std::size_t>(cut.cut_id) <= hits_.size())
        hits_[static_cast<std::size_t>(cut.cut_id - 1)] += cut.links_hit;
    if (step.pieces != step.pieces_before)
      say(fmt::format("t = {:.4g} s: {} pieces (was {})", step.time, step.pieces,
                      step.pieces_before));
    if (!step.converged) {
      summary_.converged = false;
      if (not_converged_++ == 0) first_not_converged_ = step;
    }
    say_warnings();
  }

  void write_state() {
    const AddTime timer(files_);
    const int step = simulation_steps();
    const double time = simulation_.time();
    if (scene_.output.vtu) results_.add_snapshot(step, time, simulation_.snapshot());
    surface_ = simulation_.surface_mesh();
    if (scene_.setup.surface != SurfaceMethod::none) {
      const std::string left_out = results_.add_surface(step, time, surface_);
      if (!left_out.empty()) warn(left_out);
    }
    if (scene_.output.levels || scene_.output.links)
      results_.add_figures(step, simulation_.body(), simulation_.hierarchy(),
                           simulation_.deformed_corners());
    last_written_ = step;
  }

  void warn(const std::string& what) {
    summary_.warnings.push_back(what);
    complain("warning: " + what);
  }

  void draw() {
    if (!scene_.output.preview) return;
    const AddTime timer(picture_);
    if (scene_.setup.surface == SurfaceMethod::none) {
      if (scene_.places.contains("output.preview"))
        warn("no preview.png: output.surface is \"none\"");
      return;
    }
    if (InterruptGuard::asked()) return warn("no preview.png: interrupted");
    try {
      draw_preview(results_.add_file("preview.png"), surface_,
                   {.up = up_direction(scene_.setup),
                    .threads = simulation_.backend().threads(),
                    .stop = InterruptGuard::asked});  // who interrupts does not want to wait
      drawn_ = true;
    } catch (const std::exception& error) {  // a run is worth keeping without its picture
      results_.drop_file("preview.png");
      warn(text("no preview.png: ", error.what()));
    }
  }

  void finish_summary() {
    const auto& s = simulation_;
    summary_.scene = scene_.file.string();
    summary_.title = scene_.title;
    summary_.cells = s.cells();
    summary_.cells_before_cuts = s.cells_before_cuts();
    summary_.vertices = s.vertices();
    summary_.unknowns = s.unknowns();
    summary_.hanging = s.hanging();
    summary_.pieces = s.pieces();
    summary_.links_cut = s.links_cut();
    summary_.surface = scene_.setup.surface;
    summary_.surface_points = surface_.reference.size();
    summary_.surface_triangles = surface_.triangles.size();
    for (const auto& level : s.hierarchy().levels) {
      summary_.level_cells.push_back(static_cast<std::size_t>(level.cells()));
      summary_.level_vertices.push_back(static_cast<std::size_t>(level.vertices()));
    }
    summary_.seconds = s.seconds();
    summary_.seconds.emplace_back("files", files_);
    summary_.seconds.emplace_back("picture", picture_);
    summary_.seconds_total = timer_.seconds();
    summary_.peak_bytes = peak_bytes();
    summary_.bytes = s.bytes();
    summary_.backend = s.backend().name();
    summary_.instruction_set = s.backend().instruction_set();
    summary_.threads = s.backend().threads();
    summary_.precision = precision_name(scene_.setup.solver.precision);
    summary_.state_hash = s.state_hash();
    summary_.warnings.insert(summary_.warnings.begin(), s.warnings().begin(), s.warnings().end());
    // A blade may still be on its way in a run that stopped early.
    if (!hits_.empty() && static_cast<int>(summary_.steps.size()) >= simulation_.steps_planned())
      missed_ = missed_blades(scene_, hits_, s.deformed_box());
    if (!missed_.empty()) summary_.warnings.push_back(missed_);
  }

  void say_end() {
    if (drawn_) say(fmt::format("picture    {}", (results_.folder() / "preview.png").string()));
    say(fmt::format("folder     {}", results_.folder().string()));
    say(fmt::format("cells      {} ({} before cuts)", summary_.cells, summary_.cells_before_cuts));
    say(fmt::format("steps      {}", summary_.steps.size()));
    say(fmt::format("seconds    {:.1f}", summary_.seconds_total));
    say(fmt::format("links cut  {}", summary_.links_cut));
    say(fmt::format("pieces     {}", summary_.pieces));
  }

  int status() {
    if (!missed_.empty()) complain("error: " + missed_);
    if (not_converged_ > 0) {
      const StepReport& step = first_not_converged_;
      complain(fmt::format(
          "error: not converged in {} of {} steps, first in step {}: linear residual {:.2e}, "
          "residual {:.2e} after {} cycles; results are kept",
          not_converged_, summary_.steps.size(), step.step, step.linear_residual, step.residual,
          step.cycles));
    }
    if (summary_.interrupted) {
      complain(fmt::format("interrupted after step {} of {}; results so far are kept",
                           summary_.steps.size(), simulation_.steps_planned()));
      return kInterrupted;
    }
    if (!missed_.empty()) return kBadInput;
    return not_converged_ > 0 ? kNotConverged : kDone;
  }

  const Scene& scene_;
  const RunOptions& options_;
  Simulation& simulation_;
  ResultsFolder& results_;
  ProgressBar bar_;
  Summary summary_;
  SurfaceMesh surface_;            // of step last_written_; empty if the scene asks for none
  std::vector<std::size_t> hits_;  // links met, per cut
  Timer timer_;
  double files_ = 0, picture_ = 0;  // seconds
  std::string missed_;
  std::size_t warnings_said_ = 0;
  StepReport first_not_converged_;
  int last_written_ = -1, not_converged_ = 0;
  bool drawn_ = false;
};

}  // namespace

int run_command(const RunOptions& options) {
  let_writes_fail();
  const Scene scene = read_scene(options.scene, options.overrides);
  auto backend = open_backend(scene);
  ResultsFolder results(options.out, scene.output);
  Simulation simulation = open_simulation(scene, std::move(backend));
  return Run(scene, options, simulation, results).execute();
}

}  // namespace kerf
