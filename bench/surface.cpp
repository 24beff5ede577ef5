// SPDX-License-Identifier: MIT
//
// Prints the tables of docs/surface.md as Markdown, and writes them as CSV:
//   kerf_bench_surface [--mesh FILE] [--csv PREFIX] [--repeat N]
// A mesh (the bunny) joins the analytic bodies where it is given.
#include "core/surface/surface.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "app/mesh_io.hpp"
#include "core/body/cut.hpp"
#include "core/body/pieces.hpp"
#include "core/geometry/blade.hpp"
#include "core/levels/hierarchy.hpp"
#include "cpu/cpu_backend.hpp"

namespace {

using namespace kerf;

double milliseconds(const std::function<void()>& work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin)
      .count();
}

struct Times {
  std::vector<double> ms;
  double least() const { return *std::min_element(ms.begin(), ms.end()); }
  double median() const {
    std::vector<double> sorted = ms;
    std::sort(sorted.begin(), sorted.end());
    return sorted[sorted.size() / 2];
  }
};

const char* name(SurfaceMethod method) {
  return method == SurfaceMethod::dual_contouring ? "dual contouring" : "splitting cubes";
}

SurfaceMesh mesh_at_rest(const Surface& surface, const LinkedOctree& body) {
  const std::vector<Vec3d> normals(surface.view().normals, Vec3d{1, 0, 0});
  return surface.mesh(surface.store().reference, normals, label_pieces(body, nullptr));
}

/// Two planes that cross, and a stamp: flat and curved cut faces.
std::vector<TriangleMesh> blades(const Box3& box) {
  const Vec3d c = 0.5 * (box.lo + box.hi), e = box.extent();
  const double r = std::max({e.x, e.y, e.z});
  const auto plane = [&](const Vec3d& p, const Vec3d& u, const Vec3d& v) {
    return TriangleMesh{{p - u - v, p + u - v, p + u + v, p - u + v}, {{0, 1, 2}, {0, 2, 3}}};
  };
  constexpr int kSides = 720;
  std::vector<CutLine> stamp(2);
  for (int i = 0; i <= kSides; ++i) {
    const double angle = 2 * std::numbers::pi * (i % kSides) / kSides;
    const Vec3d p = c + 0.22 * r * Vec3d{std::cos(angle), 0, std::sin(angle)};
    stamp[0].push_back(p + Vec3d{0, r, 0});
    stamp[1].push_back(p - Vec3d{0, r, 0});
  }
  return {plane(c + Vec3d{0.13 * r, 0, 0}, {0.3 * r, 2 * r, 0}, {0, 0, 2 * r}),
          plane(c + Vec3d{0, 0.07 * r, 0}, {2 * r, 0.5 * r, 0}, {0, 0.3 * r, 2 * r}), sweep(stamp)};
}

/// Longest edge over the diameter of the inscribed circle, 1 for an equilateral triangle.
double aspect(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  const double x = norm(b - a), y = norm(c - b), z = norm(a - c);
  const double area = 0.5 * norm(cross(b - a, c - a));
  return std::max({x, y, z}) * (x + y + z) / (4 * std::sqrt(3.0) * area);
}

/// A ball whose own surface and stamp have known distances.
struct Quality {
  std::size_t triangles = 0;
  double aspect_median = 0, aspect_worst = 0;  // of all but the worst hundredth
  double own_mean = 0, own_most = 0;           // distance to the true surface, cells
  double cut_mean = 0, cut_most = 0;
};

double percentile(std::vector<double>& values, double part) {
  const auto k = static_cast<std::ptrdiff_t>(part * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + k, values.end());
  return values[static_cast<std::size_t>(k)];
}

Quality ball_quality(int resolution, SurfaceMethod method) {
  const auto solid = make_ellipsoid({0.5, 0.5, 0.5}, {0.5, 0.5, 0.5});
  const Lattice lattice = make_lattice(solid->bounds(), resolution, 2);
  LinkedOctree body(voxelise(*solid, lattice), 2);
  const std::vector<TriangleMesh> knives = blades(solid->bounds());
  for (std::size_t i = 0; i < knives.size(); ++i)
    cut(body, {}, knives[i], static_cast<std::int32_t>(i + 1));
  Surface surface(body, method);
  surface.bind(body);
  const SurfaceMesh mesh = mesh_at_rest(surface, body);

  Quality out;
  out.triangles = mesh.triangles.size();
  std::vector<double> aspects, own, stamped;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    Vec3d x[3];
    for (std::size_t k = 0; k < 3; ++k) x[k] = mesh.reference[mesh.triangles[t][k]];
    const double a = aspect(x[0], x[1], x[2]);
    aspects.push_back(std::isfinite(a) ? a : 1e9);
    const Vec3d middle = (1.0 / 3) * (x[0] + x[1] + x[2]) - Vec3d{0.5, 0.5, 0.5};
    if (mesh.cut_id[t] == 0) own.push_back(std::abs(norm(middle) - 0.5) / lattice.spacing);
    if (mesh.cut_id[t] == 3)
      stamped.push_back(std::abs(std::hypot(middle.x, middle.z) - 0.22) / lattice.spacing);
  }
  const auto mean = [](const std::vector<double>& values) {
    double sum = 0;
    for (const double v : values) sum += v;
    return sum / static_cast<double>(values.size());
  };
  out.aspect_median = percentile(aspects, 0.5);
  out.aspect_worst = percentile(aspects, 0.99);
  out.own_mean = mean(own);
  out.own_most = percentile(own, 0.99);
  out.cut_mean = mean(stamped);
  out.cut_most = percentile(stamped, 0.99);
  return out;
}

void print_quality(std::FILE* csv) {
  std::printf(
      "\n### Dual contouring and splitting cubes: a ball cut by two planes and a stamp\n\n"
      "| finest cells across | method | triangles | aspect, median | aspect, 99 %% | own surface: "
      "mean, "
      "99 %% (cells) | stamp: mean, 99 %% (cells) |\n|---|---|---|---|---|---|---|\n");
  if (csv != nullptr)
    std::fprintf(csv,
                 "body,resolution,method,triangles,aspect_median,aspect_p99,own_mean_cells,"
                 "own_p99_cells,cut_mean_cells,cut_p99_cells\n");
  for (const int resolution : {32, 64, 128})
    for (const auto method : {SurfaceMethod::dual_contouring, SurfaceMethod::splitting_cubes}) {
      const Quality q = ball_quality(resolution, method);
      std::printf("| %d | %s | %zu | %.2f | %.1f | %.2g, %.2g | %.2g, %.2g |\n", resolution,
                  name(method), q.triangles, q.aspect_median, q.aspect_worst, q.own_mean,
                  q.own_most, q.cut_mean, q.cut_most);
      if (csv != nullptr)
        std::fprintf(csv, "ball,%d,%s,%zu,%.4g,%.4g,%.4g,%.4g,%.4g,%.4g\n", resolution,
                     name(method), q.triangles, q.aspect_median, q.aspect_worst, q.own_mean,
                     q.own_most, q.cut_mean, q.cut_most);
    }
}

struct Body {
  std::string name;
  std::shared_ptr<const Solid> solid;
};

/// One cut on a body: how long the surface takes to follow, and to move.
struct Update {
  std::size_t cells = 0, triangles = 0, links = 0;
  Times update, anew, positions, normals;
};

/// A square blade of `side` cells in the middle of the body; 0: through the whole body.
TriangleMesh square_blade(const Box3& box, const Lattice& lattice, int side) {
  const Vec3d e = box.extent(), c = 0.5 * (box.lo + box.hi) + 0.03 * e;
  const double half = side == 0 ? 2 * std::max({e.x, e.y, e.z}) : 0.5 * side * lattice.spacing;
  const Vec3d u = (half / std::sqrt(1.04)) * Vec3d{0.2, 1, 0}, v{0, 0, half};
  return {{c - u - v, c + u - v, c + u + v, c - u + v}, {{0, 1, 2}, {0, 2, 3}}};
}

Update measure_update(const Body& body, int resolution, int side, SurfaceMethod method,
                      int repeat) {
  const Lattice lattice = make_lattice(body.solid->bounds(), resolution, 2);
  const LinkedOctree uncut(voxelise(*body.solid, lattice), 2);
  Update out;
  LinkedOctree now = uncut;
  const CutEvent event = cut(now, {}, square_blade(body.solid->bounds(), lattice, side), 1);
  out.cells = now.leaf_count();
  out.links = event.disconnected.size();
  for (int i = 0; i <= repeat; ++i) {  // the first run warms up
    Surface surface(uncut, method);
    const double update = milliseconds([&] { surface.update(now, event); });
    const double anew = milliseconds([&] { const Surface other(now, method); });
    out.triangles = surface.store().triangles_used();
    if (i == 0) continue;
    out.update.ms.push_back(update);
    out.anew.ms.push_back(anew);
  }

  Hierarchy hierarchy;
  hierarchy.spacing = lattice.spacing;
  hierarchy.poisson = {0.4};
  hierarchy.levels.push_back(finest_level(now));
  build_vertices(hierarchy.levels[0]);
  hierarchy.levels[0].fixed.assign(hierarchy.levels[0].point.size(), 0);
  hierarchy.values.resize(out.cells, {1, 1, 0});
  const auto backend = make_cpu_backend({});
  backend->load(hierarchy);
  const int u = backend->add_vector();
  Surface surface(now, method);
  surface.bind(now);
  std::vector<Vec3d> positions(surface.view().points.size()), normals(surface.view().normals);
  for (int i = 0; i <= repeat; ++i) {
    const double moved =
        milliseconds([&] { backend->move_points(surface.view().points, u, positions); });
    const double lit =
        milliseconds([&] { backend->surface_normals(surface.view(), positions, normals); });
    if (i == 0) continue;
    out.positions.ms.push_back(moved);
    out.normals.ms.push_back(lit);
  }
  return out;
}

void print_updates(const std::vector<Body>& bodies, int repeat, std::FILE* csv) {
  std::printf(
      "\n### One cut: milliseconds (minimum, median) to follow it, and to move each step\n\n"
      "| body | finest cells across | cut | cells | triangles | links cut | update | update, us a "
      "link | built anew | positions | normals |\n|---|---|---|---|---|---|---|---|---|---|---|\n");
  if (csv != nullptr)
    std::fprintf(csv,
                 "body,resolution,cut,method,cells,triangles,links,update_ms_min,update_ms_median,"
                 "anew_ms_min,anew_ms_median,positions_ms_min,positions_ms_median,normals_ms_min,"
                 "normals_ms_median\n");
  for (const Body& body : bodies)
    for (const int side : {24, 0})
      for (const int resolution : {64, 128, 192}) {
        const auto method = SurfaceMethod::dual_contouring;
        const Update m = measure_update(body, resolution, side, method, repeat);
        const char* cut_name = side == 0 ? "through" : "24 x 24 cells";
        std::printf(
            "| %s | %d | %s | %zu | %zu | %zu | %.2f, %.2f | %.1f | %.1f, %.1f | %.2f, %.2f | "
            "%.2f, "
            "%.2f |\n",
            body.name.c_str(), resolution, cut_name, m.cells, m.triangles, m.links,
            m.update.least(), m.update.median(),
            1e3 * m.update.least() / static_cast<double>(m.links), m.anew.least(), m.anew.median(),
            m.positions.least(), m.positions.median(), m.normals.least(), m.normals.median());
        std::fflush(stdout);
        if (csv != nullptr)
          std::fprintf(csv, "%s,%d,%s,%s,%zu,%zu,%zu,%.3f,%.3f,%.3f,%.3f,%.3f,%.3f,%.3f,%.3f\n",
                       body.name.c_str(), resolution, cut_name, name(method), m.cells, m.triangles,
                       m.links, m.update.least(), m.update.median(), m.anew.least(),
                       m.anew.median(), m.positions.least(), m.positions.median(),
                       m.normals.least(), m.normals.median());
      }
}

std::FILE* open_csv(const std::string& prefix, const char* table) {
  if (prefix.empty()) return nullptr;
  const std::string path = prefix + table + ".csv";
  std::FILE* file = std::fopen(path.c_str(), "w");
  if (file == nullptr) std::fprintf(stderr, "%s: cannot be written\n", path.c_str());
  return file;
}

}  // namespace

int main(int argc, char** argv) {
  std::string mesh, csv;
  int repeat = 7;
  for (int i = 1; i < argc; i += 2) {
    const bool last = i + 1 == argc;
    if (!last && std::strcmp(argv[i], "--mesh") == 0) {
      mesh = argv[i + 1];
    } else if (!last && std::strcmp(argv[i], "--csv") == 0) {
      csv = argv[i + 1];
    } else if (!last && std::strcmp(argv[i], "--repeat") == 0 && std::atoi(argv[i + 1]) > 0) {
      repeat = std::atoi(argv[i + 1]);
    } else {
      std::fprintf(stderr, "usage: %s [--mesh FILE] [--csv PREFIX] [--repeat N]\n", argv[0]);
      return 2;
    }
  }
  try {
    std::vector<Body> bodies{{"box", make_box({{0, 0, 0}, {1, 1, 1}})}};
    if (!mesh.empty()) bodies.push_back({"mesh", make_mesh_solid(read_mesh(mesh), mesh)});
    std::FILE* const quality = open_csv(csv, "surface-quality");
    print_quality(quality);
    if (quality != nullptr) std::fclose(quality);
    std::FILE* const updates = open_csv(csv, "surface-update");
    print_updates(bodies, repeat, updates);
    if (updates != nullptr) std::fclose(updates);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "kerf_bench_surface: %s\n", error.what());
    return 2;
  }
}
