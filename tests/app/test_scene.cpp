// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "app/scene.hpp"
#include "app/scene_toml.hpp"
#include "core/base/error.hpp"

namespace kerf {
namespace {

namespace fs = std::filesystem;

const std::string kBox = R"(
[body]
shape = "box"
size = [0.1, 0.2, 0.3]
)";

Scene read(const std::string& toml, const std::vector<std::string>& overrides = {}) {
  return read_scene_text(toml, "scene.toml", overrides);
}

/// The message of the error that reading gives; empty if there is none.
std::string error_of(const std::string& toml, const std::vector<std::string>& overrides = {}) {
  try {
    read(toml, overrides);
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::bad_input);
    return error.what();
  }
  return {};
}

void expect_parts(const std::string& message, const std::vector<std::string>& parts) {
  for (const auto& part : parts)
    EXPECT_NE(message.find(part), std::string::npos) << "'" << part << "' not in: " << message;
}

TEST(Scene, DefaultsAreThoseOfTheSetup) {
  const Scene scene = read(kBox);
  const SimulationSetup defaults;

  EXPECT_EQ(scene.setup.body.resolution, defaults.body.resolution);
  EXPECT_EQ(scene.setup.material.young, defaults.material.young);
  EXPECT_EQ(scene.setup.solver.tolerance, defaults.solver.tolerance);
  EXPECT_EQ(scene.setup.time.step, defaults.time.step);
  EXPECT_TRUE(scene.setup.cuts.empty());
  EXPECT_EQ(scene.setup.surface, SurfaceMethod::dual_contouring);
  EXPECT_TRUE(scene.output.vtu && scene.output.vtp && scene.output.pvd && scene.output.preview);
  EXPECT_FALSE(scene.output.ply || scene.output.glb || scene.output.levels || scene.output.links);
  EXPECT_EQ(scene.setup.body.solid->bounds().hi, (Vec3d{0.1, 0.2, 0.3}));
  EXPECT_EQ(scene.setup.body.solid->bounds().lo, (Vec3d{0, 0, 0}));
}

TEST(Scene, EveryKeyIsRead) {
  const Scene scene = read(R"(
title = "all"
[body]
shape = "cylinder-shell"
size = [0.2, 0.3, 0.2]
thickness = 0.01
resolution = 33
refinement = 1
[material]
young = 1e4
poisson = 0.3
density = 900
damping = [0.5, 0.02]
[[region]]
sphere = { center = [0.1, 0.1, 0.1], radius = 0.05 }
young = 5e5
[[region]]
box = [[0, 0, 0], [0.1, 0.1, 0.1]]
poisson = -0.2
density = 2000
[[support]]
box = [[-1, -1, -1], [1, 0.005, 1]]
[[support]]
box = [[-1, 0.2, -1], [1, 1, 1]]
displacement = [0, 0.01, 0]
axes = "y"
[[load]]
gravity = [0, -9.81, 0]
[[load]]
box = [[0, 0, 0], [1, 1, 1]]
force = [1, 2, 3]
[[load]]
radial = { point = [0.1, 0, 0.1], axis = [0, 2, 0], strength = 3.0 }
[[cut]]
start = 0.1
end = 0.5
state = "reference"
lines = [[[0.05, 0.2, -0.1], [0.05, 0.2, 0.3]], [[0.06, -0.1, -0.1], [0.06, -0.1, 0.3]]]
[time]
mode = "static"
scheme = "central"
step = 0.01
duration = 2
mass = "lumped"
tolerance = 1e-9
max_iterations = 50
[solver]
method = "cg-jacobi"
cycle = "K"
smoother = "gauss-seidel"
sweeps = [2, 3]
omega = 1.5
degree = 3
tolerance = 1e-7
cycles = 3
max_cycles = 77
rotation_updates = 4
precision = "mixed"
backend = "auto"
threads = 2
coarsest_vertices = 900
max_levels = 3
duplicate = false
[output]
every = 5
formats = ["vtu"]
surface = "splitting-cubes"
preview = false
)");

  const SimulationSetup& s = scene.setup;
  EXPECT_EQ(scene.title, "all");
  EXPECT_EQ(s.body.resolution, 33);
  EXPECT_EQ(s.body.refinement, 1);
  EXPECT_EQ(s.material.young, 1e4);
  EXPECT_EQ(s.material.density, 900);
  EXPECT_EQ(s.material.mass_damping, 0.5);
  EXPECT_EQ(s.material.stiffness_damping, 0.02);
  ASSERT_EQ(s.regions.size(), 2u);
  EXPECT_EQ(s.regions[0].material.young, 5e5);
  EXPECT_EQ(s.regions[0].material.poisson, 0.3) << "left out: as the body";
  EXPECT_EQ(s.regions[1].material.poisson, -0.2);
  EXPECT_EQ(s.regions[1].material.young, 1e4);
  ASSERT_EQ(s.supports.size(), 2u);
  EXPECT_EQ(s.supports[0].held, (std::array<bool, 3>{true, true, true}));
  EXPECT_EQ(s.supports[1].held, (std::array<bool, 3>{false, true, false}));
  EXPECT_EQ(s.supports[1].displacement.y, 0.01);
  ASSERT_EQ(s.loads.size(), 3u);
  EXPECT_EQ(std::get<Gravity>(s.loads[0]).acceleration.y, -9.81);
  EXPECT_EQ(std::get<BoxForce>(s.loads[1]).force, (Vec3d{1, 2, 3}));
  EXPECT_EQ(std::get<RadialForce>(s.loads[2]).axis, (Vec3d{0, 1, 0})) << "of unit length";
  EXPECT_EQ(std::get<RadialForce>(s.loads[2]).strength, 3.0);
  ASSERT_EQ(s.cuts.size(), 1u);
  EXPECT_EQ(s.cuts[0].start, 0.1);
  EXPECT_EQ(s.cuts[0].end, 0.5);
  EXPECT_FALSE(s.cuts[0].deformed);
  ASSERT_EQ(s.cuts[0].lines.size(), 2u);
  EXPECT_EQ(s.cuts[0].lines[1][1], (Vec3d{0.06, -0.1, 0.3}));
  EXPECT_EQ(s.time.mode, TimeMode::statics);
  EXPECT_EQ(s.time.scheme, TimeScheme::central);
  EXPECT_EQ(s.time.step, 0.01);
  EXPECT_EQ(s.time.duration, 2);
  EXPECT_TRUE(s.time.lumped_mass);
  EXPECT_EQ(s.time.nonlinear_tolerance, 1e-9);
  EXPECT_EQ(s.time.nonlinear_iterations, 50);
  EXPECT_EQ(s.solver.method, SolverMethod::cg_jacobi);
  EXPECT_EQ(s.solver.cycle, CycleType::k);
  EXPECT_EQ(s.solver.smoother, SmootherType::gauss_seidel);
  EXPECT_EQ(s.solver.pre_sweeps, 2);
  EXPECT_EQ(s.solver.post_sweeps, 3);
  EXPECT_EQ(s.solver.omega, 1.5);
  EXPECT_EQ(s.solver.degree, 3);
  EXPECT_EQ(s.solver.tolerance, 1e-7);
  EXPECT_EQ(s.solver.cycles, 3);
  EXPECT_EQ(s.solver.max_cycles, 77);
  EXPECT_EQ(s.solver.rotation_updates, 4);
  EXPECT_EQ(s.solver.precision, Precision::mixed);
  EXPECT_EQ(s.solver.backend, "auto");
  EXPECT_EQ(s.solver.threads, 2);
  EXPECT_EQ(s.solver.coarsest_vertices, 900);
  EXPECT_EQ(s.solver.max_levels, 3);
  EXPECT_FALSE(s.solver.duplicate_cells);
  EXPECT_EQ(scene.output.every, 5);
  EXPECT_TRUE(scene.output.vtu);
  EXPECT_FALSE(scene.output.vtp);
  EXPECT_FALSE(scene.output.pvd);
  EXPECT_FALSE(scene.output.preview);
  EXPECT_EQ(s.surface, SurfaceMethod::splitting_cubes);
}

TEST(Scene, EveryFormatIsRead) {
  const OutputSettings all =
      read(kBox + "[output]\nformats = [\"vtp\", \"ply\", \"glb\", \"levels\", \"links\", \"pvd\"]")
          .output;
  EXPECT_TRUE(all.vtp && all.ply && all.glb && all.levels && all.links && all.pvd);
  EXPECT_FALSE(all.vtu);
  const OutputSettings none = read(kBox + "[output]\nformats = []").output;
  EXPECT_FALSE(none.vtu || none.vtp || none.ply || none.glb || none.levels || none.links ||
               none.pvd);
}

TEST(Scene, WithoutASurfaceTheDefaultFormatsAreThoseOfBodies) {
  const Scene scene = read(kBox + "[output]\nsurface = \"none\"\n");
  EXPECT_EQ(scene.setup.surface, SurfaceMethod::none);
  EXPECT_TRUE(scene.output.vtu && scene.output.pvd);
  EXPECT_FALSE(scene.output.vtp);
}

TEST(Scene, FormatsThatCannotBeWrittenAreNamed) {
  const std::string head = kBox + "[output]\nsurface = \"none\"\n";
  EXPECT_EQ(error_of(head + "formats = [\"vtu\", \"glb\"]\n"),
            "scene.toml:7: 'formats' in [output] must not hold \"glb\" beside surface = \"none\"");
  for (const char* format : {"vtp", "ply", "glb"})
    expect_parts(error_of(head + "formats = [\"" + format + "\"]\n"), {format, "surface"});
  EXPECT_EQ(error_of(kBox + "[output]\nformats = [\"pvd\", \"glb\"]\n"),
            "scene.toml:6: 'formats' in [output] must hold \"vtu\" or \"vtp\" too: \"pvd\" is the "
            "list of these files");
  EXPECT_EQ(error_of(kBox + "[output]\nformats = [\"obj\"]\n"),
            "scene.toml:6: 'formats' in [output] must hold names out of \"vtu\", \"vtp\", \"ply\", "
            "\"glb\", \"levels\", \"links\" and \"pvd\", not \"obj\"");
}

TEST(Scene, MistypedKeyNamesLineSectionAndNearestName) {
  const std::string message = error_of(kBox + "[material]\nyoug = 1e4\n");
  EXPECT_EQ(message, "scene.toml:6: unknown key 'youg' in [material]; did you mean 'young'?");
}

TEST(Scene, MistypedSectionAndRequiredKeyAreNamed) {
  expect_parts(error_of(kBox + "[materail]\nyoung = 1e4\n"),
               {"scene.toml:5: ", "'materail'", "did you mean 'material'"});
  expect_parts(error_of("[body]\nmseh = \"a.off\"\n"),
               {"scene.toml:2: ", "'mseh' in [body]", "did you mean 'mesh'"});
  expect_parts(error_of(kBox + "[[support]]\nbix = [[0,0,0],[1,1,1]]\n"),
               {"scene.toml:6: ", "'bix' in [[support]]", "did you mean 'box'"});
  expect_parts(error_of(kBox + "[time]\nwholly_else = 1\n"),
               {"scene.toml:6: ", "'wholly_else'", "valid are mode, scheme"});
}

TEST(Scene, MistypedValueNamesNearestValue) {
  expect_parts(error_of(kBox + "[solver]\nmethod = \"multgrid\"\n"),
               {"scene.toml:6: ", "'method' in [solver]", "\"multigrid\"", "did you mean"});
}

struct BadScene {
  const char* name;
  std::string toml;                // behind kBox, which ends in line 4
  std::vector<std::string> parts;  // of the message
};

class BadSceneTest : public testing::TestWithParam<BadScene> {};

TEST_P(BadSceneTest, IsOneErrorWithItsLine) {
  expect_parts(error_of(kBox + GetParam().toml), GetParam().parts);
}

const std::string kLine = "[[0,0,0],[0,0,1]]";

INSTANTIATE_TEST_SUITE_P(
    Scene, BadSceneTest,
    testing::Values(
        BadScene{"PoissonHalf", "[material]\npoisson = 0.5\n", {"scene.toml:6: ", "less than 0.5"}},
        BadScene{"PoissonMinusOne", "[material]\npoisson = -1\n", {":6: ", "greater than -1"}},
        BadScene{"YoungZero", "[material]\nyoung = 0\n", {":6: ", "greater than 0"}},
        BadScene{"YoungNan", "[material]\nyoung = nan\n", {":6: ", "finite"}},
        BadScene{"YoungInf", "[material]\nyoung = inf\n", {":6: ", "finite"}},
        BadScene{"YoungString", "[material]\nyoung = \"1e4\"\n", {":6: ", "a number", "a string"}},
        BadScene{"DensityNegative", "[material]\ndensity = -1\n", {":6: ", "greater than 0"}},
        BadScene{"DampingNegative", "[material]\ndamping = [0, -1]\n", {":6: ", "0 or greater"}},
        BadScene{"DampingOne", "[material]\ndamping = [0]\n", {":6: ", "two numbers"}},
        BadScene{"StepZero", "[time]\nstep = 0\n", {":6: ", "'step'", "greater than 0"}},
        BadScene{"DurationNegative", "[time]\nduration = -1.0\n", {":6: ", "greater than 0"}},
        BadScene{"DurationShort", "[time]\nstep = 0.1\nduration = 0.01\n", {":7: ", "one step"}},
        BadScene{"ModeUnknown", "[time]\nmode = \"quick\"\n", {":6: ", "dynamic", "static"}},
        BadScene{"OmegaTwo", "[solver]\nomega = 2\n", {":6: ", "less than 2"}},
        BadScene{"OmegaZero", "[solver]\nomega = 0\n", {":6: ", "greater than 0"}},
        BadScene{"DegreeZero", "[solver]\ndegree = 0\n", {":6: ", "1"}},
        BadScene{"DegreeNine", "[solver]\ndegree = 9\n", {":6: ", "8"}},
        BadScene{"SweepsNegative", "[solver]\nsweeps = [1, -1]\n", {":6: ", "at least 0"}},
        BadScene{"SweepsNone", "[solver]\nsweeps = [0, 0]\n", {":6: ", "smooth"}},
        BadScene{"ToleranceOne", "[solver]\ntolerance = 1\n", {":6: ", "less than 1"}},
        BadScene{"CyclesReal", "[solver]\ncycles = 3.5\n", {":6: ", "an integer"}},
        BadScene{"ThreadsNegative", "[solver]\nthreads = -1\n", {":6: ", "at least 0"}},
        BadScene{"DuplicateNumber", "[solver]\nduplicate = 1\n", {":6: ", "true or false"}},
        BadScene{"EveryZero", "[output]\nevery = 0\n", {":6: ", "at least 1"}},
        BadScene{"FormatUnknown", "[output]\nformats = [\"obj\"]\n", {":6: ", "\"obj\""}},
        BadScene{"FormatPvdAlone",
                 "[output]\nformats = [\"pvd\"]\n",
                 {":6: ", "\"vtu\" or \"vtp\" too"}},
        BadScene{"SurfaceUnknown",
                 "[output]\nsurface = \"dual-contour\"\n",
                 {":6: ", "did you mean \"dual-contouring\""}},
        BadScene{"StaticFree", "[time]\nmode = \"static\"\n", {":6: ", "[[support]]"}},
        BadScene{"SupportNoBox", "[[support]]\naxes = \"x\"\n", {":5: ", "needs 'box'"}},
        BadScene{
            "SupportBoxTurned", "[[support]]\nbox = [[1,0,0],[0,1,1]]\n", {":6: ", "low corner"}},
        BadScene{"SupportAxes", "[[support]]\nbox = [[0,0,0],[1,1,1]]\naxes = \"xw\"\n", {":7: "}},
        BadScene{"SupportAxisNotHeld",
                 "[[support]]\nbox = [[0,0,0],[1,1,1]]\naxes = \"x\"\ndisplacement = [0,1,0]\n",
                 {":8: ", "along y"}},
        BadScene{"LoadNone", "[[load]]\n", {":5: ", "exactly one"}},
        BadScene{
            "LoadTwo", "[[load]]\ngravity = [0,0,1]\nforce = [1,0,0]\n", {":5: ", "exactly one"}},
        BadScene{"LoadNoForce", "[[load]]\nbox = [[0,0,0],[1,1,1]]\n", {":5: ", "'force'"}},
        BadScene{"LoadGravityTwo", "[[load]]\ngravity = [0, 1]\n", {":6: ", "three numbers"}},
        BadScene{"LoadGravityNan", "[[load]]\ngravity = [0, nan, 0]\n", {":6: ", "finite"}},
        BadScene{"LoadAxisZero",
                 "[[load]]\nradial = { point = [0,0,0], axis = [0,0,0], strength = 1 }\n",
                 {":6: ", "not be zero"}},
        BadScene{"LoadRadialKey", "[[load]]\nradial = { strenth = 1 }\n", {":6: ", "'strength'"}},
        BadScene{"RegionNone", "[[region]]\nyoung = 1\n", {":5: ", "exactly one"}},
        BadScene{"RegionRadius",
                 "[[region]]\nsphere = { center = [0,0,0], radius = 0 }\n",
                 {":6: ", "greater than 0"}},
        BadScene{"RegionSingle", "[region]\nyoung = 1\n", {":5: ", "[[region]]"}},
        BadScene{"CutNothing", "[[cut]]\nstart = 0\n", {":5: ", "'lines' or 'mesh'"}},
        BadScene{"CutOneLine", "[[cut]]\nlines = [" + kLine + "]\n", {":6: ", "at least 2 lines"}},
        BadScene{"CutNoLines", "[[cut]]\nlines = []\n", {":6: ", "at least 2 lines"}},
        BadScene{"CutPoint", "[[cut]]\nlines = [" + kLine + ", [[0,0,0]]]\n", {":6: ", "2 points"}},
        BadScene{"CutUneven",
                 "[[cut]]\nlines = [" + kLine + ", [[0,0,0],[0,0,1],[0,0,2]]]\n",
                 {":6: ", "same number of points"}},
        BadScene{"CutNan",
                 "[[cut]]\nlines = [" + kLine + ",\n [[0,0,nan],[0,0,1]]]\n",
                 {":7: ", "finite"}},
        BadScene{"CutEnd",
                 "[[cut]]\nstart = 0.2\nend = 0.2\nlines = [" + kLine + "," + kLine + "]\n",
                 {":7: ", "later than start"}},
        BadScene{"CutStartNegative",
                 "[[cut]]\nstart = -1\nlines = [" + kLine + "," + kLine + "]\n",
                 {":6: ", "0 or greater"}},
        BadScene{"CutAfterEnd",
                 "[[cut]]\nstart = 5\nlines = [" + kLine + "," + kLine + "]\n",
                 {":6: ", "duration"}},
        BadScene{"CutMeshEnd", "[[cut]]\nend = 1\nmesh = \"b.obj\"\n", {":6: ", "all at once"}},
        BadScene{"CutMeshAndLines",
                 "[[cut]]\nmesh = \"b.obj\"\nlines = [" + kLine + "," + kLine + "]\n",
                 {":6: ", "give one"}},
        BadScene{"CutMeshMissing", "[[cut]]\nmesh = \"none.obj\"\n", {":6: ", "none.obj"}},
        BadScene{"CutMisses",
                 "[[cut]]\nstate = \"reference\"\nlines = [[[5,0,0],[5,0,1]],[[5,1,0],[5,1,1]]]\n",
                 {":5: ", "misses", "(5, 0, 0) to (5, 1, 1)", "(0.1, 0.2, 0.3)"}},
        BadScene{"SectionTwice", "[time]\nstep = 0.1\n[time]\nstep = 0.2\n", {":7: "}},
        BadScene{"KeyTwice", "[time]\nstep = 0.1\nstep = 0.2\n", {":7: "}},
        BadScene{"NotToml", "[time\nstep = 0.1\n", {"scene.toml:5: "}}),
    [](const auto& scene) { return scene.param.name; });

TEST(Scene, BadBodiesAreNamed) {
  const auto body = [](const std::string& rest) { return error_of("[body]\n" + rest); };
  expect_parts(error_of(""), {"scene.toml: ", "[body]"});
  expect_parts(error_of("[[body]]\nshape = \"box\"\n"), {"scene.toml:1: ", "only once"});
  expect_parts(body("resolution = 3\n"), {"scene.toml:1: ", "'mesh' or 'shape'"});
  expect_parts(body("mesh = \"a.off\"\nshape = \"box\"\n"), {":3: ", "give one"});
  expect_parts(body("mesh = \"none.off\"\n"), {"scene.toml:2: ", "none.off"});
  expect_parts(body("mesh = \"none.off\"\nsize = [1,1,1]\n"), {":3: ", "'length'"});
  expect_parts(body("shape = \"box\"\n"), {":1: ", "needs 'size'"});
  expect_parts(body("shape = \"bix\"\nsize=[1,1,1]\n"), {":2: ", "did you mean \"box\""});
  expect_parts(body("shape = \"box\"\nsize = [1, 0, 1]\n"), {":3: ", "greater than 0"});
  expect_parts(body("shape = \"box\"\nsize = [1, 1]\n"), {":3: ", "three numbers"});
  expect_parts(body("shape = \"box\"\nsize = [1,1,1]\nlength = 1\n"), {":4: ", "'mesh'"});
  expect_parts(body("shape = \"box\"\nsize = [1,1,1]\nthickness = 1\n"),
               {":4: ", "cylinder-shell"});
  expect_parts(body("shape = \"box\"\nsize = [1,1,1]\nresolution = 0\n"), {":4: ", "resolution"});
  expect_parts(body("shape = \"box\"\nsize = [1,1,1]\nrefinement = 9\n"), {":4: ", "from 0 to 8"});
  expect_parts(body("shape = \"box\"\nsize = [1,1,1]\nrefinement = -1\n"), {":4: ", "from 0 to 8"});
  expect_parts(body("shape = \"cylinder-shell\"\nsize = [1,1,1]\n"), {":1: ", "'thickness'"});
  expect_parts(body("shape = \"cylinder-shell\"\nsize = [1,1,1]\nthickness = 0.5\n"),
               {":4: ", "less than half"});
}

TEST(Scene, OverridesReplaceCreateAndReachIntoLists) {
  const std::string toml = kBox + "[[cut]]\nstart = 0.1\nlines = [" + kLine + "," + kLine + "]\n";

  const Scene scene =
      read(toml, {"solver.method=cholesky", "cut.0.start=0.25", "time.step=1e-3",
                  "cut.0.lines.1.0.2=0.5", "title=two words", "body.size=[1, 2, 3]"});

  EXPECT_EQ(scene.setup.solver.method, SolverMethod::cholesky);
  EXPECT_EQ(scene.setup.cuts[0].start, 0.25);
  EXPECT_EQ(scene.setup.time.step, 1e-3);
  EXPECT_EQ(scene.setup.cuts[0].lines[1][0].z, 0.5);
  EXPECT_EQ(scene.title, "two words");
  EXPECT_EQ(scene.setup.body.solid->bounds().hi, (Vec3d{1, 2, 3}));
}

TEST(Scene, OverrideErrorsNameTheArgument) {
  EXPECT_EQ(error_of(kBox, {"solver.tolernce=1e-3"}),
            "--set solver.tolernce=1e-3: unknown key 'tolernce' in [solver]; did you mean "
            "'tolerance'?");
  expect_parts(error_of(kBox, {"slver.tolerance=1e-3"}),
               {"--set slver.tolerance=1e-3: ", "did you mean 'solver'"});
  expect_parts(error_of(kBox, {"material.poisson=0.6"}), {"--set material.poisson=0.6: "});
  expect_parts(error_of(kBox, {"material.young=soft"}),
               {"--set material.young=soft: ", "a string"});
  expect_parts(error_of(kBox, {"cut.0.start=1"}), {"--set cut.0.start=1: ", "[[cut]]"});
  expect_parts(error_of(kBox, {"body.size.3=1"}), {"--set body.size.3=1: ", "3 entries"});
  expect_parts(error_of(kBox, {"body.size.x=1"}), {"--set body.size.x=1: ", "a number"});
  expect_parts(error_of(kBox, {"body.size.0=nan"}), {"--set body.size.0=nan: ", "finite"});
  expect_parts(error_of(kBox, {"body.shape.x=1"}), {"--set body.shape.x=1: "});
  expect_parts(error_of(kBox, {"body.size=[1, 2"}), {"--set body.size=[1, 2: "});
  for (const char* bad : {"solver", "=1", "solver.=1", ".x=1", "solver.method="})
    expect_parts(error_of(kBox, {bad}), {std::string("--set ") + bad + ": "});
}

TEST(Scene, LaterOverrideWinsAndIsNamed) {
  const std::vector<std::string> both{"time.step=0.1", "time.step=-1"};
  expect_parts(error_of(kBox, both), {"--set time.step=-1: "});
}

TEST(Scene, PlacesAreKept) {
  const Scene scene =
      read(kBox + "[[cut]]\nlines = [" + kLine + "," + kLine + "]\n", {"solver.precision=mixed"});
  EXPECT_EQ(scene.place_of("cut.0"), "scene.toml:5");
  EXPECT_EQ(scene.place_of("cut.0.lines"), "scene.toml:6");
  EXPECT_EQ(scene.place_of("cut.0.end"), "scene.toml:5") << "not given: its section";
  EXPECT_EQ(scene.place_of("solver.precision"), "--set solver.precision=mixed");
  EXPECT_EQ(scene.place_of("output.every"), "scene.toml");
}

TEST(Scene, MissingFileAndFolderAreErrors) {
  for (const fs::path& path : {fs::path("no-such-scene.toml"), fs::temp_directory_path()}) try {
      read_scene(path);
      FAIL() << path;
    } catch (const Error& error) {
      expect_parts(error.what(), {path.string()});
    }
}

/// A tetrahedron far from the origin, in a folder of its own.
class MeshSceneTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) / ("kerf_mesh_scene" + std::to_string(getpid()));
    fs::create_directories(folder_);
    std::ofstream(folder_ / "tetra.off") << "OFF\n4 4 0\n10 20 30\n14 20 30\n10 22 30\n10 20 31\n"
                                            "3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";
  }
  void TearDown() override { fs::remove_all(folder_); }
  Scene read_with(const std::string& rest) {
    std::ofstream(folder_ / "scene.toml") << "[body]\nmesh = \"tetra.off\"\n" << rest;
    return read_scene(folder_ / "scene.toml");
  }
  fs::path folder_;
};

constexpr double kSingle = 1e-5;  // the reader keeps single precision of coordinates up to 31

TEST_F(MeshSceneTest, LengthScalesAndMovesToTheOrigin) {
  const Box3 box = read_with("length = 0.2\n").setup.body.solid->bounds();
  EXPECT_NEAR(norm(box.lo), 0, kSingle);
  EXPECT_NEAR(norm(box.hi - Vec3d{0.2, 0.1, 0.05}), 0, kSingle);
}

TEST_F(MeshSceneTest, WithoutLengthNothingMoves) {
  const Box3 box = read_with("").setup.body.solid->bounds();
  EXPECT_NEAR(norm(box.lo - Vec3d{10, 20, 30}), 0, kSingle);
  EXPECT_NEAR(norm(box.hi - Vec3d{14, 22, 31}), 0, kSingle);
}

TEST(NearestName, OffersTypingErrorsOnly) {
  const std::vector<std::string> names{"young", "poisson", "density"};
  EXPECT_EQ(nearest_name("youg", names), "young");
  EXPECT_EQ(nearest_name("poison", names), "poisson");
  EXPECT_EQ(nearest_name("gravity", names), "");
  EXPECT_EQ(nearest_name("x", names), "");
}

}  // namespace
}  // namespace kerf
