// SPDX-License-Identifier: MIT
//
// What every element must pass: constant strain is exact, and rigid motion costs nothing, over
// level jumps, at hanging corners, and beside cuts.
// Source  Irons, Razzaque 1972, the patch test; here in the frame of any rotation.
#include <gtest/gtest.h>

#include <ostream>
#include <set>

#include "core/body/cut.hpp"
#include "core/solve/linear_solver.hpp"
#include "tests/support/blades.hpp"
#include "tests/support/physics.hpp"

namespace kerf {
namespace {

using test::Rotation;
using test::turn;

constexpr double kPi = 3.14159265358979323846;
const Material kRubber{3.0e5, 0.4, 1000, 0, 0};

// Sums of some hundred products, each rounded: well above 1e-16, far below any real mistake.
constexpr double kRounding = 1e-12;
// A linear solve to kRounding, times the condition of these small bodies (some thousand).
constexpr double kSolved = 1e-9;

Vec3i cube(int n) { return {n, n, n}; }

/// Interior cells of side 4, a skin of finest cells: level jumps all around.
LinkedOctree graded_box(int n) { return LinkedOctree(test::box_body(cube(n)), 2); }

/// The same with a slit in the middle, normal along z, that reaches no side.
LinkedOctree slit_box(int n) {
  LinkedOctree body = graded_box(n);
  const Lattice& lattice = body.lattice();
  const Vec3d middle = lattice.point({n / 2, n / 2, n / 2}) + Vec3d{0, 0, 0.1 * lattice.spacing};
  const CutEvent event =
      cut(body, {}, test::plane_blade(middle, {0, 0, 1}, 2.2 * lattice.spacing), 1);
  EXPECT_GT(event.disconnected.size(), 0u);
  EXPECT_GT(event.cells_after, event.cells_before);
  return body;
}

/// u = Q (I + strain) x - x.
struct Affine {
  Rotation rotation;
  Mat3d strain;
  Vec3d operator()(const Vec3d& x) const {
    return kernels::to_matrix(rotation) * (x + strain * x) - x;
  }
};

Mat3d general_strain(double size) {
  const double e[3][3] = {{1.0, 0.4, -0.3}, {0.4, -0.7, 0.5}, {-0.3, 0.5, 0.6}};
  Mat3d out;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) out[i][j] = size * e[i][j];
  return out;
}

/// No stress on planes normal to z.
Mat3d plane_stress(double size, double poisson) {
  Mat3d out = general_strain(size);
  out[0][2] = out[1][2] = out[2][0] = out[2][1] = 0;
  out[2][2] = -poisson / (1 - poisson) * (out[0][0] + out[1][1]);
  return out;
}

struct Case {
  const char* name;
  bool slit;
  double angle;
};
std::ostream& operator<<(std::ostream& out, const Case& c) { return out << c.name; }

class PatchTest : public testing::TestWithParam<Case> {
 protected:
  PatchTest()
      : body(GetParam().slit ? slit_box(24) : graded_box(16)),
        hierarchy(test::one_material(body, kRubber)),
        field{turn({1, -2, 0.5}, GetParam().angle),
              GetParam().slit ? plane_stress(0.02, kRubber.poisson) : general_strain(0.02)} {
    Level& level = hierarchy.levels[0];
    for (std::size_t v = 0; v < level.point.size(); ++v)
      if (test::on_outside(body.lattice(), level.point[v])) level.fixed[v] = 7;
    exact = test::at_vertices(body, level, field);
    extent = norm(body.lattice().spacing * Vec3d{24, 24, 24});
  }

  LinkedOctree body;
  Hierarchy hierarchy;
  Affine field;
  std::vector<double> exact;
  double extent = 0;
};

TEST_P(PatchTest, HasJumpsHangingCornersAndWhatItsNameSays) {
  const Level& level = hierarchy.levels[0];

  EXPECT_GT(test::count_folded(level), 100u);
  EXPECT_EQ(*std::min_element(level.size_log2.begin(), level.size_log2.end()), 0);
  EXPECT_EQ(*std::max_element(level.size_log2.begin(), level.size_log2.end()), 2);
  std::set<Vec3i> places(level.point.begin(), level.point.end());
  EXPECT_EQ(places.size() < level.point.size(), GetParam().slit);  // vertices that share a place
}

TEST_P(PatchTest, ConstantStrainLeavesInteriorVerticesInBalance) {
  const Level& level = hierarchy.levels[0];
  const auto backend = test::cpu();
  backend->load(hierarchy);
  backend->write(0, kSolution, exact);

  backend->rotate_cells(kSolution);
  backend->elastic_force(kSolution, kResidual);

  const std::vector<double> force = test::read(*backend, kResidual, level.point.size());
  // The force on one face of a finest cell under this strain.
  const double unit = kRubber.young * 0.02 * hierarchy.spacing * hierarchy.spacing;
  double outside = 0;
  for (std::size_t v = 0; v < level.point.size(); ++v) {
    const double f = norm(test::vertex_value(force, v));
    if (level.fixed[v] == 0)
      ASSERT_LT(f, kSolved * unit) << "vertex " << v;
    else
      outside = std::max(outside, f);
  }
  EXPECT_GT(outside, 0.1 * unit);  // the field does strain the body

  std::vector<double> rotations(4 * hierarchy.values.size());
  backend->read_rotations(rotations);
  const Rotation& q = field.rotation;
  for (std::size_t c = 0; c < hierarchy.values.size(); ++c) {
    const double* r = rotations.data() + 4 * c;
    ASSERT_NEAR(std::abs(r[0] * q.w + r[1] * q.x + r[2] * q.y + r[3] * q.z), 1, kRounding);
  }
}

TEST_P(PatchTest, PrescribedOutsideRecoversTheFieldInside) {
  build_coarse_levels(hierarchy, {200, 0, true});
  const Level& level = hierarchy.levels[0];
  ASSERT_GE(hierarchy.levels.size(), 2u);
  const auto backend = test::cpu();
  SolverSetup setup;
  setup.tolerance = kRounding;
  LinearSolver solver(*backend, setup);
  const int u = backend->add_vector(), right = backend->add_vector(), d = backend->add_vector();
  backend->load(hierarchy);
  solver.set_structure(hierarchy);
  std::vector<double> start = exact, rotations;
  for (std::size_t v = 0; v < level.point.size(); ++v)
    if (level.fixed[v] == 0) std::fill_n(start.begin() + static_cast<std::ptrdiff_t>(3 * v), 3, 0);
  for (std::size_t c = 0; c < hierarchy.values.size(); ++c)
    rotations.insert(rotations.end(),
                     {field.rotation.w, field.rotation.x, field.rotation.y, field.rotation.z});
  backend->write_rotations(rotations);
  backend->write(0, u, start);
  backend->elastic_force(u, right);
  backend->combine(0, 0, right, -1, right);
  backend->mask(0, right);
  backend->set_operator({1, 0});

  solver.refresh();
  const SolveStats stats = solver.solve(right, d, setup.tolerance);
  backend->add(0, 1, d, u);

  EXPECT_TRUE(stats.converged) << stats.residual;
  const std::vector<double> found = test::read(*backend, u, level.point.size());
  for (std::size_t i = 0; i < exact.size(); ++i)
    ASSERT_NEAR(found[i], exact[i], kSolved * 0.02 * extent) << "component " << i;
}

INSTANTIATE_TEST_SUITE_P(All, PatchTest,
                         testing::Values(Case{"JumpUpright", false, 0},
                                         Case{"JumpTurned", false, 2.5},
                                         Case{"SlitUpright", true, 0},
                                         Case{"SlitTurned", true, -1.1}),
                         testing::PrintToStringParamName());

// A blade across a graded ball: hanging corners, duplicated vertices, a voxelised surface.
LinkedOctree cut_ball() {
  LinkedOctree body(test::ball_body(24), 2);
  const Lattice& lattice = body.lattice();
  const Vec3d middle = lattice.point({12, 12, 12});
  const CutEvent event =
      cut(body, {},
          test::plane_blade(middle + 5 * lattice.spacing * Vec3d{1, 1, 1}, {1, 0.3, 0.2}, 0.4), 1);
  EXPECT_GT(event.disconnected.size(), 0u);
  return body;
}

TEST(RigidMotion, OfAnyAngleFeelsNoForce) {
  const LinkedOctree body = cut_ball();
  const Hierarchy hierarchy = test::one_material(body, kRubber);
  const Level& level = hierarchy.levels[0];
  ASSERT_GT(test::count_folded(level), 100u);
  const auto backend = test::cpu();
  const Vec3d axes[] = {{0, 0, 1}, {1, 1, 1}, {-0.2, 1, 0.7}};
  const double size = 24 * hierarchy.spacing;

  for (const Vec3d& axis : axes)
    for (int degrees = 0; degrees <= 360; degrees += 45) {
      // From identity: each rotation is found in one go, half turns included.
      backend->load(hierarchy);
      const Mat3d Q = kernels::to_matrix(turn(axis, degrees * kPi / 180));
      backend->write(0, kSolution, test::at_vertices(body, level, [&](const Vec3d& x) {
                       return Q * x - x + Vec3d{0.3, -2, 0.7};
                     }));
      backend->rotate_cells(kSolution);
      backend->elastic_force(kSolution, kResidual);

      const std::vector<double> force = test::read(*backend, kResidual, level.point.size());
      for (const double f : force)
        ASSERT_LT(std::abs(f), kRounding * kRubber.young * hierarchy.spacing * size)
            << degrees << " degrees";
    }
}

TEST(RigidMotion, AddsNothingToTheForceOfAStrain) {
  const LinkedOctree body = cut_ball();
  const Hierarchy hierarchy = test::one_material(body, kRubber);
  const Level& level = hierarchy.levels[0];
  const auto backend = test::cpu();
  const auto bend = [&](const Vec3d& x) {
    return Vec3d{0.3 * x.y * x.y, 0.1 * x.x, 0.2 * x.x * x.z};
  };
  const Mat3d Q = kernels::to_matrix(turn({0.3, 1, -0.4}, 2.0));
  const auto force_of = [&](const auto& field) {
    backend->load(hierarchy);
    backend->write(0, kSolution, test::at_vertices(body, level, field));
    backend->rotate_cells(kSolution);
    backend->elastic_force(kSolution, kResidual);
    return test::read(*backend, kResidual, level.point.size());
  };

  const std::vector<double> still = force_of(bend);
  const std::vector<double> turned =
      force_of([&](const Vec3d& x) { return Q * (x + bend(x)) - x; });

  double largest = 0;
  for (const double f : still) largest = std::max(largest, std::abs(f));
  ASSERT_GT(largest, 0);
  for (std::size_t v = 0; v < level.point.size(); ++v)
    ASSERT_LT(norm(test::vertex_value(turned, v) - Q * test::vertex_value(still, v)),
              1e-10 * largest);  // differences of positions lose two digits
}

}  // namespace
}  // namespace kerf
