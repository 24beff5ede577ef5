// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <random>

#include "core/base/error.hpp"
#include "core/body/voxelise.hpp"
#include "core/geometry/winding.hpp"
#include "tests/support/meshes.hpp"

namespace kerf {
namespace {

using test::append;
using test::box_mesh;
using test::flipped;
using test::sphere_mesh;
using test::torus_mesh;

Lattice unit_lattice(const Vec3i& size) { return {{0, 0, 0}, 1.0, size}; }

std::size_t count(const std::vector<std::uint8_t>& inside) {
  std::size_t n = 0;
  for (const std::uint8_t b : inside) n += b != 0;
  return n;
}

bool in(const Lattice& lattice, const std::vector<std::uint8_t>& inside, const Vec3i& c) {
  return lattice.inside(c) && inside[lattice.index(c)] != 0;
}

using Crossings = std::map<LinkKey, LinkCut>;

// What every solid promises; returns the crossings by key.
Crossings check_samples(const Lattice& lattice, const SolidSamples& s) {
  EXPECT_EQ(s.inside.size(), lattice.cells());
  Crossings out;
  for (std::size_t i = 0; i < s.crossings.size(); ++i) {
    const auto& [key, cut] = s.crossings[i];
    EXPECT_TRUE(i == 0 || s.crossings[i - 1].first < key);
    out[key] = cut;
    for (const LinkEnd& end : cut.end) {
      constexpr float kSingle = 1e-5f;  // rounding of unit vectors in single precision
      EXPECT_NEAR(norm(end.normal), 1, kSingle);
      EXPECT_GE(end.distance, 0);
      EXPECT_LE(end.distance, lattice.spacing * (1 + 1e-6));
      EXPECT_EQ(end.cut_id, 0);
    }
  }
  Vec3i c;
  for (c[2] = -1; c[2] < lattice.size[2]; ++c[2])
    for (c[1] = -1; c[1] < lattice.size[1]; ++c[1])
      for (c[0] = -1; c[0] < lattice.size[0]; ++c[0])
        for (unsigned axis = 0; axis < 3; ++axis) {
          Vec3i d = c;
          ++d[axis];
          const bool a = in(lattice, s.inside, c), b = in(lattice, s.inside, d);
          const bool recorded = out.count(lattice.link_key(c, static_cast<int>(axis))) != 0;
          EXPECT_TRUE(recorded || a == b) << c[0] << ' ' << c[1] << ' ' << c[2] << ' ' << axis;
          EXPECT_TRUE(!recorded || a || b) << c[0] << ' ' << c[1] << ' ' << c[2] << ' ' << axis;
        }
  return out;
}

std::size_t expected_count(const Lattice& lattice,
                           const std::function<bool(const Vec3d&)>& inside) {
  std::size_t n = 0;
  for (std::size_t i = 0; i < lattice.cells(); ++i) n += inside(lattice.center(lattice.cell(i)));
  return n;
}

TEST(Lattice, StartsAtTheBoxAndFillsWholeBlocks) {
  const Lattice plain = make_lattice({{1, 2, 3}, {1.3, 2.2, 3.1}}, 30, 0);
  const Lattice blocks = make_lattice({{1, 2, 3}, {1.3, 2.2, 3.1}}, 30, 2);

  EXPECT_EQ(plain.size, (Vec3i{30, 20, 10}));
  EXPECT_EQ(blocks.size, (Vec3i{32, 20, 12}));
  EXPECT_TRUE(plain.origin == (Vec3d{1, 2, 3}));
  EXPECT_NEAR(plain.spacing, 0.01, 1e-15);
}

TEST(Lattice, BadRequestsNameTheRemedy) {
  const Box3 box{{0, 0, 0}, {1, 1, 1}};
  EXPECT_THROW(make_lattice(box, 0, 0), Error);
  EXPECT_THROW(make_lattice(box, 8, -1), Error);
  EXPECT_THROW(make_lattice(Box3{}, 8, 0), Error);
  EXPECT_THROW(make_lattice({{0, 0, 0}, {0, 0, 0}}, 8, 0), Error);
  EXPECT_THROW(make_lattice({{0, 0, 0}, {1, std::nan(""), 1}}, 8, 0), Error);
  EXPECT_NO_THROW(make_lattice(box, 64, 0, std::size_t{1} << 30));
  try {
    make_lattice(box, 1000, 0, std::size_t{1} << 30);
    FAIL() << "4 GB do not fit in 1 GiB";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::unavailable);
    const std::string message = error.what();
    EXPECT_NE(message.find("GiB"), std::string::npos);
    EXPECT_NE(message.find("reduce the resolution"), std::string::npos);
  }
  EXPECT_THROW(make_lattice(box, std::numeric_limits<int>::max(), 0), Error);
}

TEST(Shapes, BoxEqualsItsCentresAndFaces) {
  const Lattice lattice = unit_lattice({8, 7, 6});
  const Box3 box{{0.5, 1.25, 2}, {5.5, 4.0, 4.75}};  // x faces pass through centres

  const SolidSamples s = make_box(box)->sample(lattice);

  const Crossings found = check_samples(lattice, s);
  EXPECT_EQ(count(s.inside), 6u * 3u * 3u);
  const LinkCut low_y = found.at(lattice.link_key({1, 0, 3}, 1));
  EXPECT_FLOAT_EQ(low_y.end[0].distance, 0.75f);
  EXPECT_FLOAT_EQ(low_y.end[1].distance, 0.25f);
  EXPECT_FLOAT_EQ(low_y.end[0].normal.y, -1);
  const LinkCut high_x = found.at(lattice.link_key({5, 2, 3}, 0));
  EXPECT_FLOAT_EQ(high_x.end[0].distance, 0);
  EXPECT_FLOAT_EQ(high_x.end[1].distance, 1);
  EXPECT_FLOAT_EQ(high_x.end[1].normal.x, 1);
}

TEST(Shapes, EllipsoidCrossesWhereItsEquationSays) {
  const Lattice lattice = unit_lattice({20, 16, 14});
  const Vec3d center{9.7, 8.1, 7.3}, radii{8, 6, 5};

  const SolidSamples s = make_ellipsoid(center, radii)->sample(lattice);

  check_samples(lattice, s);
  const auto value = [&](const Vec3d& p) {
    double sum = 0;
    for (int d = 0; d < 3; ++d)
      sum += (p[d] - center[d]) * (p[d] - center[d]) / radii[d] / radii[d];
    return sum;
  };
  EXPECT_EQ(count(s.inside),
            expected_count(lattice, [&](const Vec3d& p) { return value(p) <= 1; }));
  for (const auto& [key, cut] : s.crossings) {
    const int axis = Lattice::link_axis(key);
    Vec3d p = lattice.center(lattice.link_lower(key));
    p[axis] += static_cast<double>(cut.end[0].distance);
    constexpr double kSingle = 1e-6;  // distances are kept in single precision
    EXPECT_NEAR(value(p), 1, kSingle);
    EXPECT_NEAR(cut.end[0].distance + cut.end[1].distance, 1, kSingle);
    Vec3d n;
    for (int d = 0; d < 3; ++d) n[d] = (p[d] - center[d]) / radii[d] / radii[d];
    EXPECT_NEAR((n.x * static_cast<double>(cut.end[0].normal.x) +
                 n.y * static_cast<double>(cut.end[0].normal.y) +
                 n.z * static_cast<double>(cut.end[0].normal.z)) /
                    norm(n),
                1, 1e-5);  // single precision again
  }
}

TEST(Shapes, ShellHasItsHollow) {
  const Lattice lattice = unit_lattice({20, 10, 20});
  const double thickness = 3;

  const SolidSamples s = make_cylinder_shell({{0, 1, 0}, {20, 9, 20}}, thickness)->sample(lattice);

  check_samples(lattice, s);
  EXPECT_EQ(count(s.inside), expected_count(lattice, [&](const Vec3d& p) {
              const double r = std::hypot(p.x - 10, p.z - 10);
              return r <= 10 && r >= 7 && p.y >= 1 && p.y <= 9;
            }));
}

TEST(Shapes, HollowThinnerThanACellDisconnects) {
  const Lattice lattice = unit_lattice({8, 4, 8});  // the axis x = z = 4 lies between centres
  // Inner radii: 0.6 along x and along z, so that only links at distance 0.5 meet the hollow.
  const SolidSamples s = make_cylinder_shell({{0, 0, 0}, {8, 4, 8}}, 3.4)->sample(lattice);

  const Crossings found = check_samples(lattice, s);

  const LinkKey through = lattice.link_key({3, 1, 3}, 0);  // centres 3.5 and 4.5, z = 3.5
  ASSERT_EQ(found.count(through), 1u);
  EXPECT_TRUE(in(lattice, s.inside, {3, 1, 3}) && in(lattice, s.inside, {4, 1, 3}));
  const double half = std::sqrt(0.36 - 0.25);
  const LinkCut cut = found.at(through);
  constexpr double kSingle = 1e-6;
  EXPECT_NEAR(cut.end[0].distance, 0.5 - half, kSingle);
  EXPECT_NEAR(cut.end[1].distance, 0.5 - half, kSingle);
  EXPECT_GT(cut.end[0].normal.x, 0);  // out of the material, into the hollow
  EXPECT_LT(cut.end[1].normal.x, 0);
  EXPECT_EQ(found.count(lattice.link_key({2, 1, 3}, 0)), 0u);
}

TEST(Shapes, BadSizesAreRefused) {
  EXPECT_THROW(make_box({{0, 0, 0}, {1, 0, 1}}), Error);
  EXPECT_THROW(make_box({{0, 0, 0}, {1, std::nan(""), 1}}), Error);
  EXPECT_THROW(make_ellipsoid({0, 0, 0}, {1, -1, 1}), Error);
  EXPECT_THROW(make_cylinder_shell({{0, 0, 0}, {2, 2, 2}}, 1), Error);
  EXPECT_THROW(make_cylinder_shell({{0, 0, 0}, {2, 2, 2}}, 0), Error);
}

TEST(MeshSolid, EqualsTheShapeItTraces) {
  const Box3 box{{0.3, 1.25, 2}, {5.6, 4.0, 4.75}};
  const Lattice lattice = unit_lattice({8, 7, 6});

  const SolidSamples mesh = make_mesh_solid(box_mesh(box, 5), "box")->sample(lattice);
  const SolidSamples shape = make_box(box)->sample(lattice);

  check_samples(lattice, mesh);
  EXPECT_TRUE(mesh.warnings.empty());
  EXPECT_EQ(mesh.inside, shape.inside);
  ASSERT_EQ(mesh.crossings.size(), shape.crossings.size());
  for (std::size_t i = 0; i < mesh.crossings.size(); ++i) {
    EXPECT_EQ(mesh.crossings[i].first, shape.crossings[i].first);
    for (int e = 0; e < 2; ++e) {
      const LinkEnd &a = mesh.crossings[i].second.end[e], &b = shape.crossings[i].second.end[e];
      EXPECT_NEAR(a.distance, b.distance, 1e-6);  // single precision, and 2^-24 of a cell
      for (int d = 0; d < 3; ++d) EXPECT_NEAR(a.normal[d], b.normal[d], 1e-6);
    }
  }
}

// Centres within this of the surface are left out of comparisons in floating point.
constexpr double kNearSurface = 1e-6;

// The oracle: direct summation. Where it is not close to an integer it says nothing.
void expect_winding(const TriangleMesh& mesh, const Lattice& lattice, const SolidSamples& s) {
  for (std::size_t i = 0; i < lattice.cells(); ++i) {
    const double w = winding_number(mesh, lattice.center(lattice.cell(i)));
    if (std::abs(w - std::round(w)) > kNearSurface) continue;
    EXPECT_EQ(s.inside[i] != 0, w > 0.5) << "cell " << i;
  }
}

TEST(MeshSolid, TorusEqualsDirectSummation) {
  const TriangleMesh torus = torus_mesh({0.01, 0.02, -0.01}, 1, 0.35, 48, 24);
  const Lattice lattice = make_lattice(torus.bounds(), 40, 0);

  const SolidSamples s = make_mesh_solid(torus, "torus")->sample(lattice);

  check_samples(lattice, s);
  EXPECT_TRUE(s.warnings.empty());
  EXPECT_GT(count(s.inside), 1000u);
  expect_winding(torus, lattice, s);
}

TEST(MeshSolid, SphereVolumeIsThatOfItsMesh) {
  const TriangleMesh sphere = sphere_mesh({0.1, 0.2, 0.3}, 1, 64);
  const Lattice lattice = make_lattice(sphere.bounds(), 64, 0);

  const SolidSamples s = make_mesh_solid(sphere, "sphere")->sample(lattice);

  const double cell = lattice.spacing * lattice.spacing * lattice.spacing;
  constexpr double kCounting = 0.005;  // error of counting 137 K lattice points in a ball
  EXPECT_NEAR(static_cast<double>(count(s.inside)) * cell / inspect(sphere).volume, 1, kCounting);
  check_samples(lattice, s);
}

TEST(MeshSolid, EdgesAndCornersOnCentreLinesLeaveNoHoles) {
  // Faces, edges and corners of the mesh, and the diagonals of its quads, meet centres exactly.
  const Lattice lattice = unit_lattice({12, 12, 12});
  for (const int parts : {1, 2, 4, 8}) {
    const TriangleMesh mesh = box_mesh({{1.5, 1.5, 1.5}, {9.5, 9.5, 9.5}}, parts);

    const SolidSamples s = make_mesh_solid(mesh, "box")->sample(lattice);

    check_samples(lattice, s);
    EXPECT_TRUE(s.warnings.empty());
    // Centres are moved up by an infinitesimal: the low faces are inside, the high ones are not.
    EXPECT_EQ(count(s.inside), 8u * 8u * 8u);
    EXPECT_TRUE(in(lattice, s.inside, {1, 1, 1}));
    EXPECT_FALSE(in(lattice, s.inside, {9, 5, 5}));
  }
}

TEST(MeshSolid, TiltedFacesThroughCentresLeaveNoHoles) {
  // An octahedron whose corners, edges and faces |x| + |y| + |z| = 4 run through centres.
  TriangleMesh mesh;
  const Vec3d m{6.5, 6.5, 6.5};
  for (int d = 0; d < 3; ++d)
    for (const double side : {-4.0, 4.0}) {
      Vec3d p = m;
      p[d] += side;
      mesh.points.push_back(p);  // 2 d + (side > 0)
    }
  for (std::int32_t sx = 0; sx < 2; ++sx)
    for (std::int32_t sy = 0; sy < 2; ++sy)
      for (std::int32_t sz = 0; sz < 2; ++sz) {
        std::array<std::int32_t, 3> t{sx, 2 + sy, 4 + sz};
        if ((sx + sy + sz) % 2 == 0) std::swap(t[1], t[2]);
        mesh.triangles.push_back(t);
      }
  const Lattice lattice = unit_lattice({13, 13, 13});

  const SolidSamples s = make_mesh_solid(mesh, "octahedron")->sample(lattice);

  check_samples(lattice, s);
  EXPECT_TRUE(s.warnings.empty());
  EXPECT_EQ(count(s.inside), expected_count(lattice, [&](const Vec3d& p) {
              const double sum = std::abs(p.x - m.x) + std::abs(p.y - m.y) + std::abs(p.z - m.z);
              return sum < 4 || (sum == 4 && p.x < m.x);  // moved by an infinitesimal along +x
            }));
}

TEST(MeshSolid, InvertedMeshIsTurned) {
  const TriangleMesh torus = torus_mesh({0, 0, 0}, 1, 0.35, 30, 16);
  const Lattice lattice = make_lattice(torus.bounds(), 24, 0);

  const SolidSamples straight = make_mesh_solid(torus, "torus")->sample(lattice);
  const SolidSamples turned = make_mesh_solid(flipped(torus), "torus")->sample(lattice);

  EXPECT_EQ(turned.inside, straight.inside);
  ASSERT_EQ(turned.warnings.size(), 1u);
  EXPECT_NE(turned.warnings[0].find("inwards"), std::string::npos);
  ASSERT_EQ(turned.crossings.size(), straight.crossings.size());
  for (std::size_t i = 0; i < turned.crossings.size(); ++i) {
    const Vec3f &a = turned.crossings[i].second.end[0].normal,
                &b = straight.crossings[i].second.end[0].normal;
    EXPECT_NEAR(dot(a, b), 1, 1e-5);  // outward again
  }
}

TEST(MeshSolid, OverlappingCubesAreOneSolidWithoutInnerWalls) {
  TriangleMesh cubes = box_mesh({{1.1, 1.1, 1.1}, {6.1, 6.1, 6.1}});
  append(cubes, box_mesh({{4.2, 4.2, 4.2}, {9.2, 9.2, 9.2}}));
  const Lattice lattice = unit_lattice({10, 10, 10});

  const SolidSamples s = make_mesh_solid(cubes, "cubes")->sample(lattice);

  check_samples(lattice, s);
  EXPECT_EQ(count(s.inside), 2u * 125u - 8u);
  ASSERT_EQ(s.warnings.size(), 1u);
  EXPECT_NE(s.warnings[0].find("winding numbers up to 2"), std::string::npos);
  for (const auto& [key, cut] : s.crossings) {
    const Vec3i c = lattice.link_lower(key);
    Vec3i d = c;
    ++d[static_cast<unsigned>(Lattice::link_axis(key))];
    EXPECT_NE(in(lattice, s.inside, c), in(lattice, s.inside, d));
  }
}

TEST(MeshSolid, PartlyInvertedPartsStillCount) {
  TriangleMesh cubes = box_mesh({{1.1, 1.1, 1.1}, {4.1, 4.1, 4.1}});
  append(cubes, flipped(box_mesh({{5.2, 5.2, 5.2}, {9.2, 9.2, 9.2}})));
  const Lattice lattice = unit_lattice({10, 10, 10});

  const SolidSamples s = make_mesh_solid(cubes, "cubes")->sample(lattice);

  check_samples(lattice, s);
  EXPECT_EQ(count(s.inside), 27u + 64u);
  ASSERT_EQ(s.warnings.size(), 1u);
  EXPECT_NE(s.warnings[0].find("face inwards"), std::string::npos);
}

TEST(MeshSolid, CavityIsOutside) {
  TriangleMesh shell = box_mesh({{1.1, 1.1, 1.1}, {8.1, 8.1, 8.1}});
  append(shell, flipped(box_mesh({{3.2, 3.2, 3.2}, {6.2, 6.2, 6.2}})));
  const Lattice lattice = unit_lattice({10, 10, 10});

  const SolidSamples s = make_mesh_solid(shell, "shell")->sample(lattice);

  check_samples(lattice, s);
  EXPECT_TRUE(s.warnings.empty());
  EXPECT_EQ(count(s.inside), 343u - 27u);
}

TEST(MeshSolid, GapThinnerThanACellKeepsTwoLimbsApart) {
  for (const double gap : {0.25, 0.0}) {  // 0: two cubes that touch; welded, they share edges
    TriangleMesh limbs = box_mesh({{1.1, 1.1, 1.1}, {4.9, 5.1, 5.1}});
    append(limbs, box_mesh({{4.9 + gap, 1.1, 1.1}, {8.9, 5.1, 5.1}}));
    const Lattice lattice = unit_lattice({10, 7, 7});

    const SolidSamples s = make_mesh_solid(limbs, "limbs")->sample(lattice);

    const Crossings found = check_samples(lattice, s);
    for (std::int32_t y = 1; y < 5; ++y)
      for (std::int32_t z = 1; z < 5; ++z) {
        ASSERT_TRUE(in(lattice, s.inside, {4, y, z}) && in(lattice, s.inside, {5, y, z}));
        const auto at = found.find(lattice.link_key({4, y, z}, 0));
        ASSERT_NE(at, found.end());
        EXPECT_NEAR(at->second.end[0].distance, 0.4, 1e-6);  // single precision
        EXPECT_NEAR(at->second.end[1].distance, 0.6 - gap, 1e-6);
        EXPECT_FLOAT_EQ(at->second.end[0].normal.x, 1);
        EXPECT_FLOAT_EQ(at->second.end[1].normal.x, -1);
      }
    EXPECT_EQ(s.warnings.empty(), gap > 0);  // the shared edges are worth a word
  }
}

TEST(MeshSolid, OpenMeshIsFilledByItsWindingNumber) {
  TriangleMesh bowl = sphere_mesh({0, 0, 0}, 1, 24);
  std::erase_if(bowl.triangles,
                [&](const auto& t) { return bowl.points[static_cast<std::size_t>(t[0])].z > 0.6; });
  const Lattice lattice = make_lattice({{-1.1, -1.1, -1.1}, {1.1, 1.1, 1.1}}, 24, 0);
  std::vector<double> w(lattice.cells());
  for (std::size_t i = 0; i < w.size(); ++i)
    w[i] = winding_number(bowl, lattice.center(lattice.cell(i)));
  for (const bool inverted : {false, true}) {
    const SolidSamples s =
        make_mesh_solid(inverted ? flipped(bowl) : bowl, "bowl")->sample(lattice);

    check_samples(lattice, s);
    ASSERT_EQ(s.warnings.size(), inverted ? 2u : 1u);
    EXPECT_NE(s.warnings[0].find(text(inspect(bowl).boundary_edges, " boundary edges")),
              std::string::npos);
    constexpr double kFarFieldError = 0.02;  // of the tree over the cap
    std::size_t undecided = 0;
    for (std::size_t i = 0; i < w.size(); ++i) {
      const bool near_half = std::abs(w[i] - 0.5) < kFarFieldError;
      undecided += near_half;
      EXPECT_TRUE(near_half || (s.inside[i] != 0) == (w[i] > 0.5)) << i;
    }
    EXPECT_LT(undecided, 250u);  // less than one layer of cells over the hole
  }
}

TEST(MeshSolid, HoleInALatticePlaneIsNoTrap) {
  // The open side lies exactly in a plane of centres.
  TriangleMesh tub = box_mesh({{1.5, 1.5, 1.5}, {8.5, 8.5, 6.5}}, 7);
  std::erase_if(tub.triangles, [&](const auto& t) {
    for (const std::int32_t i : t)
      if (tub.points[static_cast<std::size_t>(i)].z != 6.5) return false;
    return true;
  });
  const Lattice lattice = unit_lattice({10, 10, 12});

  const SolidSamples s = make_mesh_solid(tub, "tub")->sample(lattice);

  check_samples(lattice, s);
  std::size_t compared = 0;
  for (std::size_t i = 0; i < lattice.cells(); ++i) {
    const Vec3d p = lattice.center(lattice.cell(i));
    const bool on_wall = (p.x == 1.5 || p.x == 8.5 || p.y == 1.5 || p.y == 8.5) && p.z <= 6.5;
    if (on_wall || (p.z == 1.5)) continue;  // on the surface itself: either answer will do
    const double w = winding_number(tub, p);
    if (std::abs(w - 0.5) < 0.02) continue;
    EXPECT_EQ(s.inside[i] != 0, w > 0.5) << p.x << ' ' << p.y << ' ' << p.z << ' ' << w;
    ++compared;
  }
  EXPECT_GT(compared, 800u);
}

TEST(MeshSolid, MisorientedTrianglesAreCountedAndSurvived) {
  TriangleMesh sphere = sphere_mesh({0, 0, 0}, 1, 24);
  for (std::size_t i = 300; i < 306; ++i) std::swap(sphere.triangles[i][0], sphere.triangles[i][1]);
  const Lattice lattice = make_lattice(sphere.bounds(), 24, 0);

  const SolidSamples s = make_mesh_solid(sphere, "sphere")->sample(lattice);

  check_samples(lattice, s);
  ASSERT_EQ(s.warnings.size(), 1u);
  EXPECT_NE(s.warnings[0].find("misoriented"), std::string::npos);
  const double cell = lattice.spacing * lattice.spacing * lattice.spacing;
  EXPECT_NEAR(static_cast<double>(count(s.inside)) * cell / 4.16, 1, 0.03);  // 4/3 pi, tessellated
}

TEST(MeshSolid, LatticeSmallerThanTheMeshIsCutOff) {
  const Lattice lattice{{3, 3, 3}, 1.0, {4, 4, 4}};

  for (const bool open : {false, true}) {
    TriangleMesh mesh = box_mesh({{0.2, 0.2, 0.2}, {9.2, 9.2, 5.2}}, 3);
    if (open) mesh.triangles.pop_back();
    const SolidSamples s = make_mesh_solid(mesh, "box")->sample(lattice);

    const Crossings found = check_samples(lattice, s);
    EXPECT_EQ(count(s.inside), 4u * 4u * 2u);
    EXPECT_FLOAT_EQ(found.at(lattice.link_key({-1, 1, 1}, 0)).end[1].distance, 0.5f);
    EXPECT_FLOAT_EQ(found.at(lattice.link_key({1, 1, 1}, 2)).end[0].distance, 0.7f);
  }
}

TEST(MeshSolid, MeshesWithoutVolumeAreRefused) {
  TriangleMesh nan = box_mesh({{0, 0, 0}, {1, 1, 1}});
  nan.points[0].x = std::nan("");
  TriangleMesh triangle{{{0, 0, 0}, {1, 0.3, 0.1}, {0, 1, 2}}, {{0, 1, 2}, {2, 1, 0}}};
  TriangleMesh point{{{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}, {{0, 1, 2}}};

  EXPECT_THROW(make_mesh_solid({}, "nothing"), Error);
  EXPECT_THROW(make_mesh_solid(nan, "nan"), Error);
  EXPECT_THROW(make_mesh_solid(triangle, "flat"), Error);
  EXPECT_THROW(make_mesh_solid(point, "point"), Error);
}

TEST(Voxelise, LaterRegionsWin) {
  const Box3 box{{0, 0, 0}, {8, 8, 8}};
  const Lattice lattice = make_lattice(box, 8, 0);
  const std::vector<std::shared_ptr<const Solid>> regions{
      make_box({{0, 0, 0}, {4, 8, 8}}),
      make_mesh_solid(box_mesh({{2, -1, -1}, {6, 9, 4}}), "slab")};

  const Voxels voxels = voxelise(*make_box(box), lattice, regions);

  EXPECT_EQ(voxels.label[lattice.index({7, 7, 7})], 1);
  EXPECT_EQ(voxels.label[lattice.index({1, 1, 1})], 2);
  EXPECT_EQ(voxels.label[lattice.index({3, 1, 1})], 3);
  EXPECT_EQ(voxels.label[lattice.index({3, 1, 7})], 2);
  EXPECT_EQ(voxels.crossings.size(), 6u * 64u);
  EXPECT_TRUE(voxels.warnings.empty());
}

TEST(Voxelise, NothingInsideIsAnError) {
  const Lattice lattice = make_lattice({{0, 0, 0}, {1, 1, 1}}, 4, 0);

  EXPECT_THROW(voxelise(*make_box({{0, 0, 0}, {1, 1, 0.1}}), lattice), Error);
}

}  // namespace
}  // namespace kerf
