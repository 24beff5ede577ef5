// SPDX-License-Identifier: MIT
#include "core/setup.hpp"

#include <cmath>

#include "core/base/error.hpp"

namespace kerf {
namespace {

bool finite(const Vec3d& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

void validate_material(const Material& m, const std::string& where) {
  expects(m.young > 0 && std::isfinite(m.young), where + ".young must be positive, in Pa");
  expects(m.poisson > -1 && m.poisson < 0.5,
          where + ".poisson must lie between -1 and 0.5, both excluded");
  expects(m.density > 0 && std::isfinite(m.density),
          where + ".density must be positive, in kg/m^3");
  expects(m.mass_damping >= 0 && m.stiffness_damping >= 0 && std::isfinite(m.mass_damping) &&
              std::isfinite(m.stiffness_damping),
          where + ".damping must not be negative");
}

void validate_cut(const CutSetup& cut, const std::string& where) {
  expects(!cut.lines.empty() || !cut.mesh.triangles.empty(),
          where + " has no blade: give lines or a mesh");
  expects(cut.start >= 0 && std::isfinite(cut.start), where + ".start must not be negative, in s");
  if (cut.end) {
    expects(*cut.end > cut.start && std::isfinite(*cut.end),
            where + ".end must be after its start");
    expects(!cut.lines.empty(), where + ": a blade from a mesh cuts at once; leave out end");
  }
  if (cut.lines.empty()) {
    check_finite(cut.mesh, where + ".mesh");
  } else {
    sweep(cut.lines);  // checks them
  }
}

}  // namespace

void validate(const SimulationSetup& setup) {
  expects(setup.body.solid != nullptr, "body.solid is missing: give a mesh or a shape");
  expects(setup.body.resolution >= 1, "body.resolution must be at least 1");
  expects(setup.body.refinement >= 0 && setup.body.refinement <= 8,
          "body.refinement must lie in 0 .. 8");
  validate_material(setup.material, "material");
  expects(setup.regions.size() < 255, "at most 254 regions");
  for (std::size_t i = 0; i < setup.regions.size(); ++i) {
    expects(setup.regions[i].solid != nullptr, text("region ", i, " has no shape"));
    validate_material(setup.regions[i].material, text("region ", i));
  }
  for (const Support& support : setup.supports)
    expects(finite(support.displacement) && !support.box.empty(),
            "a support needs a box with low <= high and a finite displacement");
  for (const Load& load : setup.loads) {
    if (const auto* gravity = std::get_if<Gravity>(&load))
      expects(finite(gravity->acceleration), "gravity must be finite");
    if (const auto* box = std::get_if<BoxForce>(&load))
      expects(finite(box->force) && !box->box.empty(),
              "a force needs a box with low <= high and a finite force");
    if (const auto* radial = std::get_if<RadialForce>(&load))
      expects(finite(radial->point) && finite(radial->axis) && norm(radial->axis) > 0 &&
                  std::isfinite(radial->strength),
              "a radial force needs a finite point, an axis that is not zero, and a strength");
  }
  for (std::size_t i = 0; i < setup.cuts.size(); ++i) validate_cut(setup.cuts[i], text("cut ", i));
  const TimeSetup& time = setup.time;
  expects(time.step > 0 && std::isfinite(time.step), "time.step must be positive, in s");
  expects(time.duration > 0 && std::isfinite(time.duration),
          "time.duration must be positive, in s");
  expects(time.duration / time.step < 1e9, "time.duration asks for more than 10^9 steps");
  expects(time.nonlinear_tolerance > 0 && time.nonlinear_iterations >= 1,
          "time.tolerance must be positive and time.max_iterations at least 1");
  expects(time.mode == TimeMode::dynamic || !setup.supports.empty(),
          "static mode needs a [[support]]: a body that nothing holds has no equilibrium");
  const SolverSetup& solver = setup.solver;
  expects(solver.omega > 0 && solver.omega < 2, "solver.omega must lie between 0 and 2");
  expects(solver.degree >= 1 && solver.degree <= kMaxDegree,
          text("solver.degree must lie between 1 and ", kMaxDegree));
  expects(solver.pre_sweeps >= 0 && solver.post_sweeps >= 0 &&
              solver.pre_sweeps + solver.post_sweeps > 0,
          "solver.sweeps must not be negative, and one of them positive");
  expects(solver.tolerance > 0 && solver.tolerance < 1,
          "solver.tolerance must lie between 0 and 1");
  expects(solver.cycles >= 0 && solver.max_cycles >= 1 && solver.rotation_updates >= 1,
          "solver.cycles must not be negative; max_cycles and rotation_updates at least 1");
  expects(
      solver.precision != Precision::single,
      "solver.precision \"single\": a solution in single precision cannot reach the tolerance of "
      "most bodies; \"mixed\" does, and costs hardly more, or take \"double\"");
  expects(solver.coarsest_vertices >= 1 && solver.max_levels >= 0,
          "solver.coarsest_vertices must be at least 1, max_levels not negative");
}

}  // namespace kerf
