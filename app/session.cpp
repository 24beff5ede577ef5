// SPDX-License-Identifier: MIT
#include "app/session.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "app/backends.hpp"
#include "core/base/error.hpp"

namespace kerf {
namespace {

template <class Make>
auto with_place(const std::string& place, Make make) {
  try {
    return make();
  } catch (const Error& error) {
    throw Error(error.kind(), text(place, ": ", error.what()), error.where());
  }
}

std::string show(const Box3& b) {
  return fmt::format("({:.4g}, {:.4g}, {:.4g}) to ({:.4g}, {:.4g}, {:.4g}) m", b.lo.x, b.lo.y,
                     b.lo.z, b.hi.x, b.hi.y, b.hi.z);
}

double gap(const Box3& a, const Box3& b) {
  Vec3d apart;
  for (int d = 0; d < 3; ++d) apart[d] = std::max({0.0, a.lo[d] - b.hi[d], b.lo[d] - a.hi[d]});
  return norm(apart);
}

}  // namespace

std::unique_ptr<Backend> open_backend(const Scene& scene) {
  const bool precision = scene.setup.solver.precision != Precision::double_;
  return with_place(scene.place_of(precision ? "solver.precision" : "solver.backend"),
                    [&] { return make_backend(scene.setup.solver); });
}

Simulation open_simulation(const Scene& scene, std::unique_ptr<Backend> backend) {
  const std::string name = backend->name();
  const bool may_fall_back =
      scene.setup.solver.backend == "auto" && name != "cpu" && name != "reference";
  return with_place(scene.file.string(), [&] {
    if (!may_fall_back) return Simulation(scene.setup, std::move(backend));
    SolverSetup on_cpu = scene.setup.solver;
    on_cpu.backend = "cpu";
    try {
      Simulation simulation(scene.setup, std::move(backend));
      simulation.set_fallback([on_cpu] { return make_backend(on_cpu); });
      return simulation;
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::unavailable) throw;
      std::fprintf(stderr, "kerf: warning: %s; goes on with backend cpu\n", error.what());
    }
    return Simulation(scene.setup, make_backend(on_cpu));
  });
}

std::string bytes_text(std::size_t bytes) {
  const auto value = static_cast<double>(bytes);
  if (value < 1e6) return fmt::format("{:.1f} kB", value / 1e3);
  if (value < 1e9) return fmt::format("{:.1f} MB", value / 1e6);
  return fmt::format("{:.2f} GB", value / 1e9);
}

std::string missed_blades(const Scene& scene, const std::vector<std::size_t>& hits,
                          const Box3& body) {
  std::string all;
  for (std::size_t i = 0; i < scene.setup.cuts.size(); ++i) {
    if (i < hits.size() && hits[i] > 0) continue;
    const CutSetup& cut = scene.setup.cuts[i];
    Box3 blade;
    for (const auto& line : cut.lines)
      for (const auto& p : line) blade.add(p);
    for (const auto& p : cut.mesh.points) blade.add(p);
    const double distance = gap(blade, body);
    const TimeSetup& time = scene.setup.time;
    if (time.mode == TimeMode::dynamic && cut.end && *cut.end > time.duration) {
      all += fmt::format(
          "{}{}: cut {} met no link of the body: the run ended at {:.4g} s, when {:.0f} % of its "
          "sweep was made; lengthen time.duration or let the cut end earlier",
          all.empty() ? "" : "\n", scene.place_of(fmt::format("cut.{}", i)), i + 1, time.duration,
          100 * (time.duration - cut.start) / (*cut.end - cut.start));
      continue;
    }
    all += fmt::format(
        "{}{}: cut {} met no link of the body: the blade sweeps {}, the body fills "
        "{}{}",
        all.empty() ? "" : "\n", scene.place_of(fmt::format("cut.{}", i)), i + 1, show(blade),
        show(body),
        distance > 0 ? fmt::format(", {:.4g} m apart", distance)
                     : std::string("; the boxes overlap, the surfaces do not"));
  }
  return all;
}

}  // namespace kerf
