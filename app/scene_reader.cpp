// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <sstream>

#include "app/mesh_io.hpp"
#include "app/scene.hpp"
#include "app/scene_toml.hpp"

namespace kerf {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxRefinement = 8;      // the coarsest cells are 256 finest ones wide
constexpr int kMaxResolution = 16384;  // keeps link keys and indices far from their limits

/// Runs `make` and puts the place of `key` in front of what it throws.
template <class Make>
auto at_place(const SceneValue& value, Make make) {
  try {
    return make();
  } catch (const Error& error) {
    throw Error(error.kind(), text(value.place(), ": ", error.what()), error.where());
  }
}

std::string show(const Vec3d& v) { return text("(", v.x, ", ", v.y, ", ", v.z, ")"); }
std::string show(const Box3& b) { return text(show(b.lo), " to ", show(b.hi)); }

TriangleMesh read_scene_mesh(const SceneValue& value) {
  const fs::path path = value.source->folder() / value.string();
  return at_place(value, [&] {
    TriangleMesh mesh = read_mesh(path);
    check_finite(mesh, path.string());
    return mesh;
  });
}

/// Longest side `length`, bounding box moved to the origin.
void scale_to(TriangleMesh& mesh, double length, const SceneValue& where) {
  const Box3 box = mesh.bounds();
  const Vec3d extent = box.extent();
  const double longest = std::max({extent.x, extent.y, extent.z});
  if (!(longest > 0)) where.fail("cannot be reached: the mesh has no extent");
  const double scale = length / longest;
  for (auto& p : mesh.points) p = (p - box.lo) * scale;
}

std::shared_ptr<const Solid> read_shape(SceneTable& table, const std::string& shape) {
  const SceneValue size_value = table.require("size");
  const Vec3d size = size_value.vec3();
  if (!(size.x > 0 && size.y > 0 && size.z > 0))
    size_value.fail(text("must be greater than 0 along each axis, not ", show(size)));
  const Box3 box{{0, 0, 0}, size};
  if (shape == "box") return make_box(box);
  if (shape == "sphere") return make_ellipsoid(0.5 * size, 0.5 * size);
  const SceneValue thickness_value = table.require("thickness");
  const double thickness = thickness_value.number(kPositive);
  if (2 * thickness >= std::min(size.x, size.z))
    thickness_value.fail(text("must be less than half of size along x and z, not ", thickness));
  return make_cylinder_shell(box, thickness);
}

void read_body(SceneTable& table, BodySetup& body) {
  const auto mesh = table.find("mesh");
  const auto shape = table.find("shape");
  const auto length = table.find("length");
  if (mesh && shape) shape->fail("cannot stand beside 'mesh': give one of them");
  if (!mesh && !shape) {
    table.find("size"), table.find("thickness"), table.find("resolution"), table.find("refinement");
    table.finish();  // a mistyped 'mesh' is named as such
    table.fail("[body] needs 'mesh' or 'shape'");
  }
  table.read("resolution", body.resolution, 1, kMaxResolution);
  table.read("refinement", body.refinement, 0, kMaxRefinement);
  if (mesh) {
    for (const char* key : {"size", "thickness"})
      if (const auto value = table.find(key))
        value->fail("goes with 'shape'; the size of a mesh is set by 'length'");
    TriangleMesh triangles = read_scene_mesh(*mesh);
    if (length) scale_to(triangles, length->number(kPositive), *length);
    const std::string name = mesh->string();
    body.solid = at_place(*mesh, [&] { return make_mesh_solid(std::move(triangles), name); });
  } else {
    if (length) length->fail("goes with 'mesh'; a shape has 'size'");
    std::string kind;
    table.read_choice<std::string>(
        "shape", kind,
        {{"box", "box"}, {"sphere", "sphere"}, {"cylinder-shell", "cylinder-shell"}});
    if (kind != "cylinder-shell")
      if (const auto value = table.find("thickness"))
        value->fail("goes with shape = \"cylinder-shell\"");
    body.solid = read_shape(table, kind);
  }
  table.finish();
}

constexpr Range kPoisson{-1, 0.5, true, "greater than -1 and less than 0.5"};

void read_elasticity(SceneTable& table, Material& material) {
  table.read("young", material.young, kPositive);
  table.read("poisson", material.poisson, kPoisson);
  table.read("density", material.density, kPositive);
}

void read_material(SceneTable& table, Material& material) {
  read_elasticity(table, material);
  if (const auto damping = table.find("damping")) {
    if (damping->size() != 2)
      damping->fail(text("must be two numbers [of the mass in 1/s, of the stiffness in s], not ",
                         damping->size()));
    material.mass_damping = damping->element(0).number(kNotNegative);
    material.stiffness_damping = damping->element(1).number(kNotNegative);
  }
  table.finish();
}

Region read_region(SceneTable& table, const Material& body) {
  Region region;
  region.material = body;
  const auto mesh = table.find("mesh");
  const auto box = table.find("box");
  auto sphere = table.table("sphere", "sphere of [[region]]");
  read_elasticity(table, region.material);
  table.finish();
  if ((mesh ? 1 : 0) + (box ? 1 : 0) + (sphere ? 1 : 0) != 1)
    table.fail("[[region]] needs exactly one of 'mesh', 'box' and 'sphere'");
  if (mesh) {
    TriangleMesh triangles = read_scene_mesh(*mesh);
    const std::string name = mesh->string();
    region.solid = at_place(*mesh, [&] { return make_mesh_solid(std::move(triangles), name); });
  } else if (box) {
    region.solid = make_box(box->box());
  } else {
    const Vec3d center = sphere->require("center").vec3();
    const double radius = sphere->require("radius").number(kPositive);
    sphere->finish();
    region.solid = make_ellipsoid(center, {radius, radius, radius});
  }
  return region;
}

Support read_support(SceneTable& table) {
  Support support;
  support.box = table.require("box").box();
  table.read("displacement", support.displacement);
  if (const auto axes = table.find("axes")) {
    support.held = {false, false, false};
    const std::string given = axes->string();
    for (const char axis : given) {
      const std::size_t d = std::string_view("xyz").find(axis);
      if (d == std::string_view::npos || support.held[d])
        axes->fail(text("must name axes once each, such as \"xyz\" or \"y\", not \"", given, "\""));
      support.held[d] = true;
    }
    if (given.empty()) axes->fail("must name at least one of x, y, z");
  }
  for (int d = 0; d < 3; ++d)
    if (!support.held[static_cast<std::size_t>(d)] && support.displacement[d] != 0)
      table.fail("displacement",
                 text("[[support]] displaces along ", "xyz"[d], ", which is not among its 'axes'"));
  table.finish();
  return support;
}

Load read_load(SceneTable& table) {
  const auto gravity = table.find("gravity");
  const auto box = table.find("box");
  const auto force = table.find("force");
  auto radial = table.table("radial", "radial of [[load]]");
  table.finish();
  if ((gravity ? 1 : 0) + (box || force ? 1 : 0) + (radial ? 1 : 0) != 1)
    table.fail("[[load]] needs exactly one of 'gravity', 'box' with 'force', and 'radial'");
  if (gravity) return Gravity{gravity->vec3()};
  if (radial) {
    RadialForce load;
    radial->read("point", load.point);
    radial->read("axis", load.axis);
    load.strength = radial->require("strength").number(kAnyNumber);
    radial->finish();
    const double length = norm(load.axis);
    if (!(length > 0)) radial->fail("axis", "'axis' in radial of [[load]] must not be zero");
    load.axis = load.axis * (1 / length);
    return load;
  }
  if (!box) table.fail("[[load]] with 'force' needs 'box'");
  if (!force) table.fail("[[load]] with 'box' needs 'force'");
  return BoxForce{box->box(), force->vec3()};
}

std::vector<CutLine> read_lines(const SceneValue& value) {
  std::vector<CutLine> lines;
  if (value.size() < 2) value.fail(text("must hold at least 2 lines, not ", value.size()));
  for (std::size_t i = 0; i < value.size(); ++i) {
    const SceneValue line = value.element(i);
    if (!line.node->is_array() || line.size() < 2)
      line.fail(text("must be lines of at least 2 points [x, y, z]; entry ", i, " is not"));
    CutLine points;
    for (std::size_t j = 0; j < line.size(); ++j) points.push_back(line.element(j).vec3());
    if (i > 0 && points.size() != lines.front().size())
      line.fail(text("must have the same number of points in each line: entry ", i, " has ",
                     points.size(), ", entry 0 has ", lines.front().size()));
    lines.push_back(std::move(points));
  }
  return lines;
}

Box3 blade_box(const CutSetup& cut) {
  if (cut.lines.empty()) return cut.mesh.bounds();
  Box3 box;
  for (const auto& line : cut.lines)
    for (const auto& p : line) box.add(p);
  return box;
}

CutSetup read_cut(SceneTable& table, const SimulationSetup& setup) {
  CutSetup cut;
  table.read("start", cut.start, kNotNegative);
  const auto end = table.find("end");
  const auto lines = table.find("lines");
  const auto mesh = table.find("mesh");
  table.read_choice("state", cut.deformed, {{"deformed", true}, {"reference", false}});
  table.finish();
  if (!lines && !mesh) table.fail("[[cut]] needs 'lines' or 'mesh'");
  if (lines && mesh) mesh->fail("cannot stand beside 'lines': give one of them");
  if (end) {
    if (mesh) end->fail("goes with 'lines'; a mesh cuts all at once");
    cut.end = end->number(kAnyNumber);
    if (*cut.end <= cut.start)
      end->fail(text("must be later than start = ", cut.start, " s, not ", *cut.end));
  }
  if (lines) cut.lines = read_lines(*lines);
  if (mesh) cut.mesh = read_scene_mesh(*mesh);
  if (setup.time.mode == TimeMode::dynamic && cut.start >= setup.time.duration)
    table.fail("start", text("[[cut]] starts at ", cut.start,
                             " s, but the run ends at duration = ", setup.time.duration, " s"));
  const Box3 blade = blade_box(cut), body = setup.body.solid->bounds();
  if (!cut.deformed && !blade.overlaps(body))
    table.fail(text("the blade misses the body: it sweeps ", show(blade), ", the body fills ",
                    show(body)));
  return cut;
}

void read_time(SceneTable& table, TimeSetup& time) {
  table.read_choice("mode", time.mode,
                    {{"dynamic", TimeMode::dynamic}, {"static", TimeMode::statics}});
  table.read_choice("scheme", time.scheme,
                    {{"newmark", TimeScheme::newmark}, {"central", TimeScheme::central}});
  table.read("step", time.step, kPositive);
  table.read("duration", time.duration, kPositive);
  table.read_choice("mass", time.lumped_mass, {{"consistent", false}, {"lumped", true}});
  table.read("tolerance", time.nonlinear_tolerance, {0, 1, true, "greater than 0 and less than 1"});
  table.read("max_iterations", time.nonlinear_iterations, 1);
  table.finish();
  // A tenth of a step is forgiven: durations are seldom exact multiples in binary.
  if (time.mode == TimeMode::dynamic && time.duration < 0.9 * time.step)
    table.fail("duration", text("'duration' in [time] must be at least one step = ", time.step,
                                " s, not ", time.duration));
}

void read_solver(SceneTable& table, SolverSetup& solver) {
  table.read_choice("method", solver.method,
                    {{"cg", SolverMethod::cg},
                     {"multigrid", SolverMethod::multigrid},
                     {"cg-jacobi", SolverMethod::cg_jacobi},
                     {"cholesky", SolverMethod::cholesky}});
  table.read_choice("cycle", solver.cycle,
                    {{"auto", CycleType::automatic},
                     {"V", CycleType::v},
                     {"W", CycleType::w},
                     {"K", CycleType::k}});
  table.read_choice(
      "smoother", solver.smoother,
      {{"chebyshev", SmootherType::chebyshev}, {"gauss-seidel", SmootherType::gauss_seidel}});
  if (const auto sweeps = table.find("sweeps")) {
    if (sweeps->size() != 2)
      sweeps->fail(text("must be two integers [before, after], not ", sweeps->size()));
    solver.pre_sweeps = sweeps->element(0).integer(0, std::numeric_limits<int>::max());
    solver.post_sweeps = sweeps->element(1).integer(0, std::numeric_limits<int>::max());
    if (solver.pre_sweeps + solver.post_sweeps == 0)
      sweeps->fail("must not both be 0: the cycle would not smooth");
  }
  table.read("omega", solver.omega, {0, 2, true, "greater than 0 and less than 2"});
  table.read("degree", solver.degree, 1, kMaxDegree);
  table.read("tolerance", solver.tolerance, {0, 1, true, "greater than 0 and less than 1"});
  table.read("cycles", solver.cycles, 0);
  table.read("max_cycles", solver.max_cycles, 1);
  table.read("rotation_updates", solver.rotation_updates, 1);
  table.read("coarsest_vertices", solver.coarsest_vertices, 1);
  table.read("max_levels", solver.max_levels, 0);
  table.read("duplicate", solver.duplicate_cells);
  table.read_choice(
      "precision", solver.precision,
      {{"double", Precision::double_}, {"mixed", Precision::mixed}, {"single", Precision::single}});
  table.read_choice<std::string>(
      "backend", solver.backend,
      {{"cpu", "cpu"}, {"reference", "reference"}, {"cuda", "cuda"}, {"auto", "auto"}});
  table.read("threads", solver.threads, 0);
  table.finish();
}

void read_formats(const SceneValue& formats, OutputSettings& output, SurfaceMethod surface) {
  struct Format {
    const char* name;
    bool* flag;
    bool needs_surface;
  };
  const Format known[] = {{"vtu", &output.vtu, false},       {"vtp", &output.vtp, true},
                          {"ply", &output.ply, true},        {"glb", &output.glb, true},
                          {"levels", &output.levels, false}, {"links", &output.links, false},
                          {"pvd", &output.pvd, false}};
  for (const Format& format : known) *format.flag = false;
  for (std::size_t i = 0; i < formats.size(); ++i) {
    const SceneValue entry = formats.element(i);
    const std::string given = entry.string();
    const auto* const format =
        std::find_if(std::begin(known), std::end(known),
                     [&](const Format& candidate) { return given == candidate.name; });
    if (format == std::end(known))
      entry.fail(
          text("must hold names out of \"vtu\", \"vtp\", \"ply\", \"glb\", \"levels\", "
               "\"links\" and \"pvd\", not \"",
               given, "\""));
    if (format->needs_surface && surface == SurfaceMethod::none)
      entry.fail(text("must not hold \"", given, "\" beside surface = \"none\""));
    *format->flag = true;
  }
  if (output.pvd && !output.vtu && !output.vtp)
    formats.fail("must hold \"vtu\" or \"vtp\" too: \"pvd\" is the list of these files");
}

void read_output(SceneTable& table, OutputSettings& output, SurfaceMethod& surface) {
  table.read("every", output.every, 1);
  table.read("preview", output.preview);
  table.read_choice("surface", surface,
                    {{"dual-contouring", SurfaceMethod::dual_contouring},
                     {"splitting-cubes", SurfaceMethod::splitting_cubes},
                     {"none", SurfaceMethod::none}});
  if (const auto formats = table.find("formats"))
    read_formats(*formats, output, surface);
  else
    output.vtp = surface != SurfaceMethod::none;
  table.finish();
}

void read_sections(SceneTable& root, Scene& scene) {
  SimulationSetup& setup = scene.setup;
  root.read("title", scene.title);
  // Names first, so that a mistyped section is named before what it lacks.
  auto body = root.table("body", "[body]");
  auto material = root.table("material", "[material]");
  auto regions = root.tables("region", "[[region]]");
  auto supports = root.tables("support", "[[support]]");
  auto loads = root.tables("load", "[[load]]");
  auto cuts = root.tables("cut", "[[cut]]");
  auto time = root.table("time", "[time]");
  auto solver = root.table("solver", "[solver]");
  auto output = root.table("output", "[output]");
  root.finish();
  if (!body) root.fail("the scene needs a section [body] with 'mesh' or 'shape'");

  // What is cheap to check comes before the meshes are read.
  if (material) read_material(*material, setup.material);
  if (time) read_time(*time, setup.time);
  if (solver) read_solver(*solver, setup.solver);
  if (output) read_output(*output, scene.output, setup.surface);
  for (auto& support : supports) setup.supports.push_back(read_support(support));
  for (auto& load : loads) setup.loads.push_back(read_load(load));
  if (setup.time.mode == TimeMode::statics && setup.supports.empty()) {
    const std::string why = "static mode needs a [[support]]: nothing holds the body";
    if (time) time->fail("mode", why);
    root.fail(why);
  }
  read_body(*body, setup.body);
  for (auto& region : regions) setup.regions.push_back(read_region(region, setup.material));
  for (auto& cut : cuts) setup.cuts.push_back(read_cut(cut, setup));
}

}  // namespace

std::string Scene::place_of(const std::string& key) const {
  for (std::string path = key;;) {
    const auto it = places.find(path);
    if (it != places.end()) return it->second;
    if (path.empty()) return file.string();
    const std::size_t dot = path.rfind('.');
    path = dot == std::string::npos ? "" : path.substr(0, dot);
  }
}

Scene read_scene_text(const std::string& toml, const fs::path& file,
                      const std::vector<std::string>& overrides) {
  Scene scene;
  scene.file = file;
  const SceneSource source(toml, file, overrides);
  SceneTable root(source.root(), source, "", "the scene", scene.places);
  read_sections(root, scene);
  return scene;
}

Scene read_scene(const fs::path& file, const std::vector<std::string>& overrides) {
  std::error_code error;
  if (fs::is_directory(file, error))
    throw Error(ErrorKind::bad_input, text(file.string(), ": is a folder, not a scene file"));
  std::ifstream in(file, std::ios::binary);
  if (!in)
    throw Error(ErrorKind::bad_input, text(file.string(), ": cannot be read; is the path right?"));
  const std::string toml{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  return read_scene_text(toml, file, overrides);
}

}  // namespace kerf
