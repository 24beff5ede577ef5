// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <algorithm>
#include <iterator>
#include <limits>
#include <numeric>
#include <set>

#include "core/base/error.hpp"
#include "core/body/cut.hpp"
#include "core/body/pieces.hpp"
#include "tests/support/blades.hpp"
#include "tests/support/bodies.hpp"
#include "tests/support/cut_oracle.hpp"
#include "tests/support/octree_invariants.hpp"

namespace kerf {
namespace {

using test::arc_lines;
using test::ball_body;
using test::box_body;
using test::corners_of;
using test::invariants_hold;
using test::plane_blade;

// Distances are kept in single precision, and the two sides of a comparison round differently.
constexpr double kDistance = 1e-6;  // in units of the spacing
constexpr float kNormal = 1e-5f;

/// A place in units of finest cells from the low corner of the lattice.
Vec3d at(const Lattice& lattice, double x, double y, double z) {
  return lattice.origin + lattice.spacing * Vec3d{x, y, z};
}

std::size_t pieces(const LinkedOctree& body) {
  std::size_t count = 0;
  label_pieces(body, &count);
  return count;
}

/// Disconnected links between two inside cells.
std::set<LinkKey> cut_links(const LinkedOctree& body) {
  std::set<LinkKey> out;
  for (const auto& entry : body.records()) {
    const Vec3i c = body.lattice().link_lower(entry.first);
    if (body.leaf_at(c) >= 0 &&
        body.leaf_at(test::plus(c, Lattice::link_axis(entry.first), 1)) >= 0)
      out.insert(entry.first);
  }
  return out;
}

void expect_same_cuts(const LinkedOctree& a, const LinkedOctree& b) {
  ASSERT_EQ(cut_links(a), cut_links(b));
  const double h = a.lattice().spacing;
  for (const LinkKey key : cut_links(a))
    for (int end = 0; end < 2; ++end) {
      const LinkEnd &p = a.records().at(key).end[end], &q = b.records().at(key).end[end];
      EXPECT_NEAR(p.distance, q.distance, kDistance * h);
      EXPECT_LT(norm(p.normal - q.normal), kNormal);
      EXPECT_EQ(p.cut_id, q.cut_id);
    }
}

void expect_oracle(const LinkedOctree& body,
                   const std::map<LinkKey, std::array<double, 2>>& expected) {
  std::set<LinkKey> keys;
  for (const auto& entry : expected) keys.insert(entry.first);
  ASSERT_FALSE(keys.empty());
  ASSERT_EQ(cut_links(body), keys);
  for (const auto& [key, distance] : expected)
    for (int end = 0; end < 2; ++end)
      EXPECT_NEAR(body.records().at(key).end[end].distance, distance[static_cast<std::size_t>(end)],
                  kDistance * body.lattice().spacing);
}

TriangleMesh mapped(TriangleMesh mesh, const std::function<Vec3d(const Vec3d&)>& map) {
  for (Vec3d& p : mesh.points) p = map(p);
  return mesh;
}

TEST(Cut, PlaneBetweenCentresCutsOneLayerAndRecordsIt) {
  const Voxels voxels = box_body({8, 8, 8});
  for (const int refinement : {0, 1, 2}) {
    LinkedOctree body(voxels, refinement);
    const Vec3d center = at(body.lattice(), 3.8, 4, 4);  // 0.3 cells past the centres of x = 3

    const CutEvent event = cut(body, {}, plane_blade(center, {1, 0, 0}, 1), 5);

    EXPECT_EQ(event.cut_id, 5);
    EXPECT_EQ(event.links_hit, 64u);
    EXPECT_EQ(event.disconnected.size(), 64u);
    EXPECT_TRUE(std::is_sorted(event.disconnected.begin(), event.disconnected.end()));
    EXPECT_EQ(event.cells_after, body.leaf_count());
    EXPECT_TRUE(event.changed());
    EXPECT_EQ(pieces(body), 2u);
    for (const LinkKey key : event.disconnected) {
      EXPECT_EQ(body.lattice().link_lower(key)[0], 3);
      EXPECT_EQ(Lattice::link_axis(key), 0);
      const LinkCut& record = body.records().at(key);
      EXPECT_NEAR(record.end[0].distance, 0.3 * 0.07, kDistance * 0.07);
      EXPECT_NEAR(record.end[1].distance, 0.7 * 0.07, kDistance * 0.07);
      for (const LinkEnd& end : record.end) {
        EXPECT_LT(norm(end.normal - Vec3f{1, 0, 0}), kNormal);
        EXPECT_EQ(end.cut_id, 5);
      }
    }
    EXPECT_TRUE(invariants_hold(body, voxels.label));
  }
}

TEST(Cut, BladeThroughCentresOrGridPointsCutsOneLayer) {
  const Voxels voxels = box_body({8, 8, 8});
  for (const int refinement : {0, 2})
    for (int axis = 0; axis < 3; ++axis)
      for (const double place : {4.0, 3.5, 4.5}) {
        LinkedOctree body(voxels, refinement);
        Vec3d center = at(body.lattice(), 4, 4, 4), normal;
        center[axis] = at(body.lattice(), place, place, place)[axis];
        normal[axis] = 1;
        // Corners of the blade lie at grid points, its diagonal runs along links.
        TriangleMesh blade = plane_blade(center, normal, 10 * body.lattice().spacing);

        const CutEvent event = cut(body, {}, blade, 1);

        EXPECT_EQ(event.disconnected.size(), 64u) << "axis " << axis << " at " << place;
        EXPECT_EQ(pieces(body), 2u);
        EXPECT_TRUE(invariants_hold(body, voxels.label));
      }
}

TEST(Cut, SlantedBladeThroughCentresAndEdgesSeparatesExactlyByItsSides) {
  Voxels voxels = box_body({8, 8, 8});
  voxels.lattice.origin = {0, 0, 0};  // with a spacing of 1/16 all places are exact
  voxels.lattice.spacing = 0.0625;
  for (const Vec3d normal : {Vec3d{1, 1, 0}, Vec3d{1, 0, -1}, Vec3d{-1, 1, 1}, Vec3d{1, 2, 0}}) {
    LinkedOctree body(voxels, 2);
    const Vec3d through = at(body.lattice(), 3.5, 4.5, 4.5);
    const Vec3d u = normal.z == 0 ? Vec3d{0, 0, 4} : cross(normal, Vec3d{0, 1, 0});
    const Vec3d v = cross(normal, u);
    const TriangleMesh blade{{through - 4 * u - 4 * v, through + 4 * u - 4 * v,
                              through + 4 * u + 4 * v, through - 4 * u + 4 * v},
                             {{0, 1, 2}, {0, 2, 3}}};

    cut(body, {}, blade, 1);

    // Cells on the plane count to the side that x grows to.
    std::size_t cut_by_sides = 0;
    const auto side = [&](const Vec3i& c) {
      const double s = dot(normal, body.lattice().center(c) - through);
      return s != 0 ? s > 0 : normal.x > 0;
    };
    for (std::size_t i = 0; i < body.lattice().cells(); ++i)
      for (int axis = 0; axis < 3; ++axis) {
        const Vec3i c = body.lattice().cell(i), d = test::plus(c, axis, 1);
        if (body.leaf_at(d) < 0) continue;
        EXPECT_EQ(body.connected(c, axis), side(c) == side(d));
        cut_by_sides += side(c) != side(d) ? 1 : 0;
      }
    EXPECT_EQ(cut_links(body).size(), cut_by_sides);
    EXPECT_EQ(pieces(body), 2u);
    EXPECT_TRUE(invariants_hold(body, voxels.label));
  }
}

TEST(Cut, BladeThroughGridPointsOfAnyLatticeLeavesTwoPieces) {
  const Voxels voxels = box_body({8, 8, 8});
  for (const Vec3d normal :
       {Vec3d{1, 1, 0}, Vec3d{1, 1, 1}, Vec3d{0, 1, -1}, Vec3d{1, -2, 0}, Vec3d{3, 1, -2}})
    for (const double place : {4.0, 4.5}) {
      LinkedOctree body(voxels, 1);

      cut(body, {}, plane_blade(at(body.lattice(), place, place, place), normal, 2), 1);

      EXPECT_EQ(pieces(body), 2u);
      EXPECT_TRUE(invariants_hold(body, voxels.label));
    }
}

TEST(Cut, OctreeIsCutAsTheUniformGridIs) {
  const Voxels voxels = ball_body(24);
  const Vec3d middle = at(voxels.lattice, 12, 12, 12);
  const TriangleMesh blades[] = {
      plane_blade(middle, {1, 0, 0}, 2), plane_blade(middle, {0.3, 1, -0.6}, 2),
      plane_blade(middle, {1, 1, 1}, 0.3), sweep(arc_lines(middle, 0.4, 0.7, 17))};
  for (const TriangleMesh& blade : blades) {
    LinkedOctree uniform(voxels, 0);
    cut(uniform, {}, blade, 1);
    for (const int refinement : {1, 2, 3}) {
      LinkedOctree body(voxels, refinement);

      const CutEvent event = cut(body, {}, blade, 1);

      EXPECT_GT(event.disconnected.size(), 50u);
      EXPECT_GT(event.cells_after, event.cells_before);
      expect_same_cuts(body, uniform);
      EXPECT_TRUE(invariants_hold(body, voxels.label));
    }
  }
}

TEST(Cut, SweepInStepsIsTheWholeSweep) {
  const Voxels voxels = ball_body(24);
  const auto lines = arc_lines(at(voxels.lattice, 11, 12, 12), 0.5, 0.9, 12);
  LinkedOctree at_once(voxels, 2), in_steps(voxels, 2);

  cut(at_once, {}, sweep(lines), 1);
  for (std::size_t i = 0; i + 1 < lines.size(); ++i) {
    cut(in_steps, {}, sweep({lines[i], lines[i + 1]}), 1);
    EXPECT_TRUE(invariants_hold(in_steps, voxels.label));
  }

  expect_same_cuts(at_once, in_steps);
  EXPECT_EQ(at_once.leaf_count(), in_steps.leaf_count());
}

TEST(Cut, RotatedBodyIsCutAsThePulledBackBladeCutsIt) {
  const Voxels voxels = ball_body(24);
  const Vec3d middle = at(voxels.lattice, 12, 12, 12);
  // A rotation by 1.1 about (1, 2, 2) / 3 by Rodrigues' formula, and a shift.
  const auto turn = [&](const Vec3d& x) {
    const Vec3d axis{1.0 / 3, 2.0 / 3, 2.0 / 3}, r = x - middle;
    return std::cos(1.1) * r + std::sin(1.1) * cross(axis, r) +
           ((1 - std::cos(1.1)) * dot(axis, r)) * axis + Vec3d{3, -1, 2};
  };
  for (const TriangleMesh& blade :
       {plane_blade(middle, {0.31, 1, -0.64}, 2), sweep(arc_lines(middle, 0.4, 0.7, 17))}) {
    LinkedOctree reference(voxels, 2), turned(voxels, 2);

    cut(reference, {}, blade, 1);
    cut(turned, corners_of(turned, turn), mapped(blade, turn), 1);

    expect_same_cuts(turned, reference);
    EXPECT_TRUE(invariants_hold(turned, voxels.label));
  }
}

TEST(Cut, AffinelyDeformedBodyIsCutAsThePulledBackBladeCutsIt) {
  const Voxels voxels = ball_body(24);
  const auto stretch = [](const Vec3d& x) {
    return Vec3d{1.4 * x.x + 0.5 * x.y - 2, 0.8 * x.y + 0.3 * x.z, 0.1 * x.x + 1.1 * x.z + 4};
  };
  const TriangleMesh blade = sweep(arc_lines(at(voxels.lattice, 12, 12, 12), 0.4, 0.7, 17));
  LinkedOctree reference(voxels, 2), stretched(voxels, 2);

  cut(reference, {}, blade, 1);
  cut(stretched, corners_of(stretched, stretch), mapped(blade, stretch), 1);

  expect_same_cuts(stretched, reference);
}

TEST(Cut, BentBodyIsCutAsAllPairsSay) {
  const Voxels voxels = box_body({32, 16, 16});
  const Vec3d middle = at(voxels.lattice, 16, 8, 8);
  // The long axis becomes an arc of radius 0.9 m: about 140 degrees.
  const auto bend = [&](const Vec3d& x) {
    const double angle = (x.x - middle.x) / 0.9, r = 0.9 + (x.z - middle.z);
    return Vec3d{r * std::sin(angle), x.y, r * std::cos(angle)};
  };
  for (const int refinement : {0, 2})
    for (const TriangleMesh& blade :
         {plane_blade(bend(middle), {0.83, 0.1, 0.3}, 0.41),
          plane_blade(bend(middle), {0.05, 0.12, 1}, 3),
          sweep(arc_lines(bend(middle) + Vec3d{0.013, 0.02, 0.01}, 0.45, 0.73, 17))}) {
      LinkedOctree body(voxels, refinement);
      const std::vector<Vec3d> corners = corners_of(body, bend);
      const auto expected = test::crossed_links(body, corners, blade);

      const CutEvent event = cut(body, corners, blade, 1);

      EXPECT_EQ(event.links_hit, expected.size());
      expect_oracle(body, expected);
      EXPECT_TRUE(invariants_hold(body, voxels.label));
    }
}

TEST(Cut, NormalsAreCarriedToTheReferenceState) {
  LinkedOctree body(box_body({8, 8, 8}), 1);
  const auto shear = [](const Vec3d& x) { return Vec3d{x.x + 0.7 * x.z, x.y, x.z}; };
  const Vec3d middle = at(body.lattice(), 3.8, 4, 4);

  cut(body, corners_of(body, shear), mapped(plane_blade(middle, {1, 0, 0}, 1), shear), 1);

  ASSERT_EQ(cut_links(body).size(), 64u);
  for (const LinkKey key : cut_links(body))
    EXPECT_LT(norm(body.records().at(key).end[1].normal - Vec3f{1, 0, 0}), kNormal);
}

TEST(Cut, TwoBladesThroughOneLinkLeaveEachEndItsOwnNearest) {
  for (const bool in_one_pass : {false, true}) {
    const Voxels voxels = box_body({8, 8, 8});
    LinkedOctree body(voxels, 1);
    const TriangleMesh low = plane_blade(at(body.lattice(), 3.6, 4, 4), {1, 0, 0.1}, 0.05);
    const TriangleMesh high = plane_blade(at(body.lattice(), 4.3, 4, 4), {1, 0.2, 0}, 0.05);

    if (in_one_pass) {
      cut(body, {}, test::joined(high, low), 1);
    } else {
      cut(body, {}, high, 2);
      cut(body, {}, low, 1);
    }

    const LinkCut* record = body.record({3, 3, 3}, 0);
    ASSERT_NE(record, nullptr);
    // The link lies at y = z = 3.5: the planes meet it at 3.6 + 0.05 and at 4.3 + 0.1.
    EXPECT_NEAR(record->end[0].distance, 0.15 * 0.07, kDistance * 0.07);
    EXPECT_NEAR(record->end[1].distance, 0.10 * 0.07, kDistance * 0.07);
    EXPECT_EQ(record->end[0].cut_id, 1);
    EXPECT_EQ(record->end[1].cut_id, in_one_pass ? 1 : 2);
    EXPECT_GT(record->end[0].normal.z, 0.05f);
    EXPECT_GT(record->end[1].normal.y, 0.1f);
  }
}

TEST(Cut, RepeatedCutChangesNothing) {
  const Voxels voxels = ball_body(24);
  const TriangleMesh blade = sweep(arc_lines(at(voxels.lattice, 12, 12, 12), 0.4, 0.7, 9));
  LinkedOctree once(voxels, 2), twice(voxels, 2);
  const CutEvent first = cut(once, {}, blade, 1);
  cut(twice, {}, blade, 1);

  const CutEvent second = cut(twice, {}, blade, 2);

  EXPECT_EQ(second.links_hit, first.links_hit);
  EXPECT_TRUE(second.disconnected.empty());
  EXPECT_TRUE(second.moved.empty());
  EXPECT_FALSE(second.changed());
  expect_same_cuts(once, twice);
}

/// Links that were cut before, and whose record at some end is now another one.
std::vector<LinkKey> changed_records(const LinkedOctree& before, const LinkedOctree& after) {
  std::set<LinkKey> keys;
  for (const LinkKey key : cut_links(before))
    for (int end = 0; end < 2; ++end)
      if (before.records().at(key).end[end].distance != after.records().at(key).end[end].distance)
        keys.insert(key);
  return {keys.begin(), keys.end()};
}

TEST(Cut, TellsWhichLinksItOnlyPassesNearer) {
  const Voxels voxels = ball_body(20);
  for (const int refinement : {0, 2}) {
    LinkedOctree body(voxels, refinement);
    const auto plane = [&](double x, const Vec3d& normal) {
      return plane_blade(at(voxels.lattice, x, 10, 10), normal, 2);
    };
    cut(body, {}, plane(9.9, {1, 0, 0}), 1);

    // Through half of the links nearer to one end, through the others nearer to the other, and
    // through links along y and z that were connected.
    const LinkedOctree before = body;
    const CutEvent tilted = cut(body, {}, plane(9.9, {1, 0.05, 0.01}), 2);
    EXPECT_FALSE(tilted.moved.empty());
    EXPECT_FALSE(tilted.disconnected.empty());
    EXPECT_EQ(tilted.moved, changed_records(before, body));
    EXPECT_LE(tilted.moved.size() + tilted.disconnected.size(), tilted.links_hit);
    std::vector<LinkKey> both;
    std::set_intersection(tilted.moved.begin(), tilted.moved.end(), tilted.disconnected.begin(),
                          tilted.disconnected.end(), std::back_inserter(both));
    EXPECT_TRUE(both.empty());
  }
}

TEST(Cut, BetweenTwoCutsMovesNothing) {
  LinkedOctree body(box_body({8, 8, 8}), 1);
  const auto plane = [&](double x) {
    return plane_blade(at(body.lattice(), x, 4, 4), {1, 0, 0}, 1);
  };
  cut(body, {}, plane(3.6), 1);

  // The first leaves the high ends to the second; between the two, links have no material.
  const CutEvent second = cut(body, {}, plane(4.3), 2), third = cut(body, {}, plane(3.9), 3);

  EXPECT_EQ(second.moved.size(), 64u);
  EXPECT_TRUE(second.disconnected.empty());
  EXPECT_FALSE(second.changed());
  EXPECT_EQ(third.links_hit, 0u);
  EXPECT_TRUE(third.moved.empty());
}

TEST(Cut, OpenCutIsMetWhereItsMaterialIs) {
  constexpr double kFloat = 1e-5;  // of a cell: records are floats
  LinkedOctree body(box_body({4, 4, 4}), 0);
  const double h = body.lattice().spacing;
  const auto plane = [&](double x) {
    return plane_blade(at(body.lattice(), x, 2, 2), {1, 0, 0}, 1);
  };
  cut(body, {}, plane(1.7), 1);  // 0.2 cells from the lower centres
  std::vector<Vec3d> apart = test::corners_of(body, [](const Vec3d& x) { return x; });
  for (std::size_t i = 0; i < apart.size(); i += 8) {
    const bool high = apart[i].x > at(body.lattice(), 1.5, 0, 0).x;
    for (std::size_t k = 0; high && k < 8; ++k) apart[i + k].x += 2.5 * h;
  }

  // The material ends at 1.7 and begins again at 1.7 + 2.5. The lower cells end at 2.
  const CutEvent air = cut(body, apart, plane(1.9), 2);
  const CutEvent far_side = cut(body, apart, plane(4.3), 3);

  EXPECT_EQ(air.links_hit, 0u);
  EXPECT_TRUE(air.moved.empty());
  EXPECT_EQ(far_side.moved.size(), 16u);
  EXPECT_TRUE(far_side.disconnected.empty());
  for (const LinkKey key : far_side.moved) {
    const LinkCut& record = body.records().at(key);
    EXPECT_NEAR(record.end[0].distance, 0.2 * h, kFloat * h);
    EXPECT_EQ(record.end[0].cut_id, 1);
    EXPECT_NEAR(record.end[1].distance, 0.7 * h, kFloat * h);
    EXPECT_EQ(record.end[1].cut_id, 3);
  }
}

TEST(Cut, FourStampsPunchFourPieces) {
  const Voxels voxels = box_body({32, 32, 12});
  LinkedOctree body(voxels, 2);
  TriangleMesh stamps;
  for (const double x : {8.2, 23.7})
    for (const double y : {8.1, 23.9}) {
      const Vec3d c = at(body.lattice(), x, y, 0);
      stamps = test::joined(stamps, test::stamp_blade(c.x, c.y, 0.3, c.z - 0.1, c.z + 1));
    }

  cut(body, {}, stamps, 1);

  EXPECT_EQ(pieces(body), 5u);
  EXPECT_TRUE(invariants_hold(body, voxels.label));
}

TEST(Cut, ClosedBladeInsideTheBodyFreesItsInside) {
  const Voxels voxels = box_body({16, 16, 16});
  LinkedOctree body(voxels, 2);
  const Vec3d c = at(body.lattice(), 8.1, 7.9, 8.2);
  const double r = 0.3;
  // An octahedron.
  const TriangleMesh blade{
      {c + Vec3d{r, 0, 0}, c - Vec3d{r, 0, 0}, c + Vec3d{0, r, 0}, c - Vec3d{0, r, 0},
       c + Vec3d{0, 0, r}, c - Vec3d{0, 0, r}},
      {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}}};

  cut(body, {}, blade, 1);

  EXPECT_EQ(pieces(body), 2u);
  for (std::size_t i = 0; i < body.lattice().cells(); ++i)
    for (int axis = 0; axis < 3; ++axis) {
      const Vec3i a = body.lattice().cell(i), b = test::plus(a, axis, 1);
      if (body.leaf_at(b) < 0) continue;
      const auto inside = [&](const Vec3i& k) {
        const Vec3d d = body.lattice().center(k) - c;
        return std::abs(d.x) + std::abs(d.y) + std::abs(d.z) < r;
      };
      if (inside(a) == inside(b)) continue;
      EXPECT_FALSE(body.connected(a, axis));
    }
  EXPECT_TRUE(invariants_hold(body, voxels.label));
}

TEST(Cut, ThinSlicesComeOffWhereTheyHoldACentre) {
  const Voxels voxels = box_body({12, 8, 8});
  LinkedOctree one_cell(voxels, 2), no_cell(voxels, 2);
  const auto slice = [&](double from, double to) {
    return test::joined(plane_blade(at(voxels.lattice, from, 4, 4), {1, 0, 0}, 1),
                        plane_blade(at(voxels.lattice, to, 4, 4), {1, 0, 0}, 1));
  };

  cut(one_cell, {}, slice(5.1, 5.9), 1);
  cut(no_cell, {}, slice(5.6, 5.9), 1);

  EXPECT_EQ(pieces(one_cell), 3u);
  EXPECT_EQ(pieces(no_cell), 2u);
  EXPECT_TRUE(invariants_hold(one_cell, voxels.label));
  EXPECT_TRUE(invariants_hold(no_cell, voxels.label));
}

TEST(Cut, CrossingCutsLeaveFourPieces) {
  const Voxels voxels = ball_body(20);
  LinkedOctree body(voxels, 2);
  const Vec3d middle = at(voxels.lattice, 10.1, 9.8, 10.2);

  cut(body, {}, plane_blade(middle, {1, 0.2, 0}, 2), 1);
  cut(body, {}, plane_blade(middle, {-0.3, 1, 0.1}, 2), 2);

  EXPECT_EQ(pieces(body), 4u);
  EXPECT_TRUE(invariants_hold(body, voxels.label));
}

TEST(Cut, TrianglesWithoutAreaCutNothing) {
  const Voxels voxels = box_body({8, 8, 8});
  LinkedOctree body(voxels, 1), plain(voxels, 1);
  const Vec3d a = at(voxels.lattice, 1, 3.9, 3.5), b = at(voxels.lattice, 7, 4.1, 3.5);
  const Vec3d middle = 0.5 * a + 0.5 * b;
  const TriangleMesh flat{{a, b, middle}, {{0, 0, 0}, {0, 1, 1}, {0, 1, 0}, {0, 1, 2}, {2, 2, 1}}};
  const TriangleMesh blade = plane_blade(at(voxels.lattice, 4, 4, 3.8), {0.1, 0.2, 1}, 0.1);

  EXPECT_FALSE(cut(body, {}, flat, 1).changed());
  cut(body, {}, test::joined(flat, blade), 1);
  cut(plain, {}, blade, 1);

  expect_same_cuts(body, plain);
}

TEST(Cut, BladeInAGapThatIsOpenAlreadyChangesOnlyNearerPoints) {
  const Voxels voxels = test::two_limb_body({16, 8, 16});
  LinkedOctree body(voxels, 2);
  const std::set<LinkKey> before = cut_links(body);
  const TriangleMesh blade = plane_blade(at(voxels.lattice, 7.9, 4, 12), {1, 0, 0}, 0.1);

  const CutEvent event = cut(body, {}, blade, 3);

  EXPECT_GT(event.links_hit, 0u);
  EXPECT_FALSE(event.changed());
  EXPECT_EQ(cut_links(body), before);
  const LinkCut* record = body.record({7, 4, 12}, 0);
  ASSERT_NE(record, nullptr);
  EXPECT_EQ(record->end[0].cut_id, 3);  // at 0.4 cells, nearer than the surface halfway
  EXPECT_EQ(record->end[1].cut_id, 0);
  EXPECT_TRUE(invariants_hold(body, voxels.label));
}

TEST(Cut, BladeThatMissesOrIsEmptyChangesNothing) {
  const Voxels voxels = box_body({8, 8, 8});
  LinkedOctree body(voxels, 1);

  EXPECT_FALSE(cut(body, {}, TriangleMesh{}, 1).changed());
  EXPECT_FALSE(cut(body, {}, plane_blade({50, 0, 0}, {1, 0, 0}, 1), 1).changed());
  // Beside the lattice, and between the rim and the outermost centres.
  EXPECT_EQ(cut(body, {}, plane_blade(at(voxels.lattice, -1, 4, 4), {1, 0, 0}, 1), 1).links_hit,
            0u);
  EXPECT_EQ(cut(body, {}, plane_blade(at(voxels.lattice, 0.3, 4, 4), {1, 0, 0}, 1), 1).links_hit,
            0u);
  EXPECT_EQ(cut_links(body).size(), 0u);
}

TEST(Cut, RejectsBadInputAndLeavesTheBodyAsItWas) {
  const Voxels voxels = box_body({8, 8, 8});
  LinkedOctree body(voxels, 1);
  const std::size_t cells = body.leaf_count();
  const TriangleMesh good = plane_blade(at(voxels.lattice, 4, 4, 4), {1, 0.1, 0.2}, 1);
  std::vector<Vec3d> corners = corners_of(body, [](const Vec3d& x) { return x; });
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

  TriangleMesh not_finite = good;
  not_finite.points[2].y = kNan;
  EXPECT_THROW(cut(body, {}, not_finite, 1), Error);
  TriangleMesh beyond = good;
  beyond.triangles.push_back({0, 1, 9});
  EXPECT_THROW(cut(body, {}, beyond, 1), Error);
  EXPECT_THROW(cut(body, {}, good, 0), Error);
  EXPECT_THROW(cut(body, std::span(corners).first(8), good, 1), Error);
  corners[5].x = kNan;
  EXPECT_THROW(cut(body, corners, good, 1), Error);
  try {
    cut(body, {}, plane_blade(at(voxels.lattice, 4, 4, 4), {1, 0.1, 0.2}, 1e6), 1);
    FAIL() << "a blade of 2e6 m was taken";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::bad_input);
    EXPECT_NE(std::string(error.what()).find("units"), std::string::npos);
  }

  EXPECT_EQ(body.leaf_count(), cells);
  EXPECT_TRUE(cut_links(body).empty());
  EXPECT_TRUE(invariants_hold(body, voxels.label));
}

TEST(Cut, HugeBladeCutsAsASmallOneDoes) {
  const Voxels voxels = ball_body(16);
  const Vec3d middle = at(voxels.lattice, 8, 8, 8), normal{0.3, 1, -0.6};
  LinkedOctree small(voxels, 2), huge(voxels, 2);

  cut(small, {}, plane_blade(middle, normal, 2), 1);
  cut(huge, {}, plane_blade(middle, normal, 1e5), 1);

  EXPECT_EQ(cut_links(small), cut_links(huge));
  EXPECT_EQ(pieces(huge), 2u);
}

}  // namespace
}  // namespace kerf
