// SPDX-License-Identifier: MIT
//
// What the captions of [DGW11], figures 1, 11, 13, 14 and 15, say of cells and seconds; and whether
// rods of different size bend as differently as beams do.
#include <algorithm>
#include <cmath>

#include "bench/cutting/exact.hpp"
#include "bench/papers/experiments.hpp"
#include "core/base/error.hpp"

namespace kerf::papers {
namespace {

constexpr const char* kPictures = "pictures";

void run_body(Context& context, const BodyInfo& info) {
  const std::optional<SimulationSetup> setup = setup_of(context, info, Grid::adaptive);
  if (!setup) return;
  context.doing(text(kPictures, ": ", info.name));
  std::unique_ptr<Backend> backend = fast_backend(context.threads);
  const Problem problem(*setup, backend.get());
  Machine machine(problem, std::move(backend), 1);
  machine.find_solution(Machine::kRough);
  const double step = machine.step_seconds(default_solver(), context.repeat);
  const auto add = [&](const char* quantity, const char* unit, double printed, double ours,
                       const char* method = "") {
    context.results.add({kPictures, info.name, method, quantity, unit, printed, ours});
  };
  add("cells", "1", info.printed.cells, static_cast<double>(problem.cells_before()));
  add("cells after the cut", "1", info.printed.cut_cells, static_cast<double>(problem.cells()));
  add("cutting and step", "s", info.printed.cut_and_step, problem.cut_times().sum() + step,
      kKerfMethod);
}

// Straight rods on a block, `count` blades in each direction along the grid.
class Rods {
 public:
  Rods(const SimulationSetup& setup, int count)
      : edge_(setup.body.solid->bounds().extent().x), width_(edge_ / (count + 1)), count_(count) {}

  cutting::Beam beam(const Material& material, double acceleration) const {
    return {0.5 * edge_,
            width_,
            width_,
            acceleration * material.density,
            {material.young, material.poisson, material.density}};
  }
  int rods() const { return (count_ + 1) * (count_ + 1); }
  int rod_of(const Vec3d& p) const { return index(p.x) + (count_ + 1) * index(p.z); }
  bool at_tip(double y) const { return std::abs(y - edge_) < kNear * edge_; }
  bool at_root(double y) const { return std::abs(y - 0.5 * edge_) < kNear * edge_; }
  double length() const { return 0.5 * edge_; }

 private:
  static constexpr double kNear = 1e-6;
  int index(double x) const { return std::clamp(static_cast<int>(x / width_), 0, count_); }

  double edge_, width_;
  int count_;
};

// Sums over the vertices of one section of a rod.
struct Section {
  double n = 0, x = 0, u = 0, v = 0, xx = 0, xv = 0;

  void add(double place, double along_x, double along_y) {
    n += 1;
    x += place;
    u += along_x;
    v += along_y;
    xx += place * place;
    xv += place * along_y;
  }
  double mean() const { return u / n; }
  /// By least squares: the turn about z, rad.
  double turn() const { return -(xv - x * v / n) / (xx - x * x / n); }
};

// Mean deflection along x of the tips, each against its own root and the turn of that.
double mean_deflection(const Problem& problem, const std::vector<double>& u, const Rods& rods) {
  std::vector<Section> tip(static_cast<std::size_t>(rods.rods())), root(tip);
  const Level& level = problem.hierarchy().levels[0];
  for (std::int32_t v = 0; v < level.vertices(); ++v) {
    const Vec3d p = problem.lattice().point(level.point[v]);
    const bool is_tip = rods.at_tip(p.y);
    if (!is_tip && !rods.at_root(p.y)) continue;
    const std::int32_t cell = level.incidences_of(v)[0] / 8;
    const double half = 0.5 * (1 << level.size_log2[cell]) * problem.hierarchy().spacing;
    const Vec3d centre = problem.lattice().point(level.corner[cell]) + Vec3d{half, half, half};
    const auto rod = static_cast<std::size_t>(rods.rod_of(centre));
    const std::size_t k = 3 * static_cast<std::size_t>(v);
    (is_tip ? tip : root)[rod].add(p.x, u[k], u[k + 1]);
  }
  double sum = 0;
  for (std::size_t i = 0; i < tip.size(); ++i)
    sum += tip[i].mean() - root[i].mean() - rods.length() * root[i].turn();
  return sum / static_cast<double>(tip.size());
}

// Weight to the side instead of the radial force of figure 11, so that all rods bend alike.
void run_rods(Context& context) {
  constexpr double kSideways = 1;  // m/s^2
  const bool is_small = context.size == bench::Size::small;
  for (const int count : is_small ? std::vector<int>{1, 3} : std::vector<int>{4, 7, 9}) {
    context.doing(text(kPictures, ": rods between ", count, " blades"));
    SimulationSetup setup = cube_with_comb(context.size, 0, count, 0);
    setup.time.mode = TimeMode::statics;
    setup.loads = {Gravity{{kSideways, 0, 0}}};
    const Problem problem(setup);
    Machine machine(problem, fast_backend(context.threads), 0);
    machine.find_solution();
    const Rods rods(setup, count);
    const double exact = rods.beam(setup.material, kSideways).tip();
    const double found = mean_deflection(problem, machine.solution(), rods);
    context.results.add(
        {kPictures, text("rods between ", count, " blades"), "", "deflection", "m", kNone, found});
    context.results.add({kPictures, text("rods between ", count, " blades"), "",
                         "deflection of a clamped beam", "m", kNone, exact});
  }
}

}  // namespace

void run_pictures(Context& context) {
  for (const BodyInfo& info : bodies())
    if (*info.place != '\0' && info.printed.cut_cells > 0 &&
        std::string(info.place) != "tables 1 and 2")
      run_body(context, info);
  run_rods(context);
}

}  // namespace kerf::papers
