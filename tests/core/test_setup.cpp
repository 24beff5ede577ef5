// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <string>

#include "core/base/error.hpp"
#include "tests/support/physics.hpp"

namespace kerf {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A setup that has one of everything, and makes sense.
SimulationSetup sound() {
  SimulationSetup setup;
  setup.body = {test::box_solid({1, 1, 1}), 4, 0};
  setup.regions = {{test::box_solid({0.5, 1, 1}), {}}};
  setup.supports = {{{{-1, -1, -1}, {2, 0.01, 2}}, {}, {true, true, true}}};
  setup.loads = {Gravity{{0, -9.81, 0}}, BoxForce{{{0, 0, 0}, {1, 1, 1}}, {1, 0, 0}},
                 RadialForce{{0.5, 0, 0.5}, {0, 1, 0}, 2}};
  CutSetup lines, mesh;
  lines.lines = test::straight_cut({0.5, 0.5, -1}, {0.5, 2, -1}, {0, 0, 3});
  lines.end = 0.5;
  mesh.mesh = sweep(lines.lines);
  setup.cuts = {lines, mesh};
  return setup;
}

struct Spoil {
  const char* word;  ///< that the message must hold
  std::function<void(SimulationSetup&)> change;
};

template <class T>
T& load(SimulationSetup& s, std::size_t i) {
  return std::get<T>(s.loads[i]);
}

void expect_refused(const std::vector<Spoil>& spoils) {
  for (const Spoil& spoil : spoils) {
    SimulationSetup setup = sound();
    spoil.change(setup);
    try {
      validate(setup);
      ADD_FAILURE() << spoil.word << " was accepted";
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::bad_input) << error.what();
      EXPECT_NE(std::string(error.what()).find(spoil.word), std::string::npos) << error.what();
    }
  }
}

TEST(Validate, AcceptsWhatMakesSense) { EXPECT_NO_THROW(validate(sound())); }

TEST(Validate, RefusesEveryNumberThatIsNone) {
  std::vector<Spoil> spoils;
  for (const double bad : {kNan, kInfinity}) {
    const std::vector<Spoil> of_this{
        {"young", [bad](auto& s) { s.material.young = bad; }},
        {"poisson", [bad](auto& s) { s.material.poisson = bad; }},
        {"density", [bad](auto& s) { s.material.density = bad; }},
        {"damping", [bad](auto& s) { s.material.mass_damping = bad; }},
        {"damping", [bad](auto& s) { s.material.stiffness_damping = bad; }},
        {"region 0", [bad](auto& s) { s.regions[0].material.young = bad; }},
        {"support", [bad](auto& s) { s.supports[0].displacement.y = bad; }},
        {"gravity", [bad](auto& s) { load<Gravity>(s, 0).acceleration.x = bad; }},
        {"force", [bad](auto& s) { load<BoxForce>(s, 1).force.z = bad; }},
        {"radial", [bad](auto& s) { load<RadialForce>(s, 2).point.z = bad; }},
        {"radial", [bad](auto& s) { load<RadialForce>(s, 2).axis.y = bad; }},
        {"radial", [bad](auto& s) { load<RadialForce>(s, 2).strength = bad; }},
        {"cut 0", [bad](auto& s) { s.cuts[0].start = bad; }},
        {"cut 0", [bad](auto& s) { s.cuts[0].end = bad; }},
        {"cut line 1", [bad](auto& s) { s.cuts[0].lines[1][0].y = bad; }},
        {"cut 1", [bad](auto& s) { s.cuts[1].mesh.points[0].x = bad; }},
        {"time.step", [bad](auto& s) { s.time.step = bad; }},
        {"time.duration", [bad](auto& s) { s.time.duration = bad; }},
        {"solver.omega", [bad](auto& s) { s.solver.omega = bad; }},
        {"solver.tolerance", [bad](auto& s) { s.solver.tolerance = bad; }},
    };
    spoils.insert(spoils.end(), of_this.begin(), of_this.end());
  }
  spoils.push_back({"support", [](auto& s) { s.supports[0].box.lo.x = kNan; }});
  spoils.push_back({"force", [](auto& s) { load<BoxForce>(s, 1).box.hi.y = kNan; }});
  spoils.push_back({"tolerance", [](auto& s) { s.time.nonlinear_tolerance = kNan; }});

  expect_refused(spoils);
}

TEST(Validate, NamesWhatMakesNoSense) {
  expect_refused({
      {"body.solid", [](auto& s) { s.body.solid = nullptr; }},
      {"body.resolution", [](auto& s) { s.body.resolution = 0; }},
      {"body.refinement", [](auto& s) { s.body.refinement = -1; }},
      {"body.refinement", [](auto& s) { s.body.refinement = 9; }},
      {"young", [](auto& s) { s.material.young = 0; }},
      {"young", [](auto& s) { s.material.young = -1; }},
      {"poisson", [](auto& s) { s.material.poisson = 0.5; }},
      {"poisson", [](auto& s) { s.material.poisson = -1; }},
      {"density", [](auto& s) { s.material.density = 0; }},
      {"region 0", [](auto& s) { s.regions[0].solid = nullptr; }},
      {"support", [](auto& s) { s.supports[0].box.hi.y = -2; }},
      {"radial", [](auto& s) { load<RadialForce>(s, 2).axis = {}; }},
      {"cut 0", [](auto& s) { s.cuts[0].start = -1; }},
      {"cut 0", [](auto& s) { s.cuts[0].end = 0; }},
      {"cut 0", [](auto& s) { s.cuts[0].lines.clear(); }},
      {"cut lines", [](auto& s) { s.cuts[0].lines.resize(1); }},
      {"cut 1", [](auto& s) { s.cuts[1].end = 1; }},
      {"time.step", [](auto& s) { s.time.step = 0; }},
      {"time.duration", [](auto& s) { s.time.duration = -1; }},
      {"steps", [](auto& s) { s.time.step = 1e-12; }},
      {"solver.omega", [](auto& s) { s.solver.omega = 2; }},
      {"solver.degree", [](auto& s) { s.solver.degree = 0; }},
      {"solver.degree", [](auto& s) { s.solver.degree = 9; }},
      {"solver.sweeps", [](auto& s) { s.solver.pre_sweeps = s.solver.post_sweeps = 0; }},
      {"solver.tolerance", [](auto& s) { s.solver.tolerance = 1; }},
      {"support",
       [](auto& s) {
         s.supports.clear();
         s.time.mode = TimeMode::statics;
       }},
      {"double", [](auto& s) { s.solver.precision = Precision::single; }},
  });
}

}  // namespace
}  // namespace kerf
