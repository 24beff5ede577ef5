// SPDX-License-Identifier: MIT
//
// How a surface follows its body: which cells its vertices move with, what an update changes, and
// what it leaves in the slots that it frees.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "core/base/error.hpp"
#include "core/body/cut.hpp"
#include "tests/support/scenes.hpp"
#include "tests/support/surface_cases.hpp"

namespace kerf {
namespace {

class SurfaceUpdates : public ::testing::TestWithParam<SurfaceMethod> {};
INSTANTIATE_TEST_SUITE_P(Methods, SurfaceUpdates, ::testing::ValuesIn(test::kMethods),
                         [](const auto& method) { return test::method_name(method.param); });

// ---- Binding.

using Cells = std::set<Vec3i>;

/// Those of `block` that links within it join to `seed`.
Cells joined_within(const LinkedOctree& body, const Cells& block, const Vec3i& seed) {
  Cells found{seed};
  std::vector<Vec3i> front{seed};
  while (!front.empty()) {
    const Vec3i c = front.back();
    front.pop_back();
    for (int axis = 0; axis < 3; ++axis)
      for (int by = -1; by <= 1; by += 2) {
        const Vec3i d = test::plus(c, axis, by);
        if (block.contains(d) && body.connected(by < 0 ? d : c, axis) && found.insert(d).second)
          front.push_back(d);
      }
  }
  return found;
}

/// The finest cells around a grid point; of a grid edge along `axis` those around it.
Cells around(const Vec3i& p, int axis = -1) {
  Cells out;
  for (int o = 0; o < 8; ++o) {
    Vec3i c{p[0] - (o & 1), p[1] - (o >> 1 & 1), p[2] - (o >> 2)};
    if (axis >= 0) c[static_cast<std::size_t>(axis)] = p[static_cast<std::size_t>(axis)];
    out.insert(c);
  }
  return out;
}

Vec3i grid_point(const Lattice& lattice, std::uint64_t key) {
  const auto nx = static_cast<std::uint64_t>(lattice.size[0]) + 1;
  const auto ny = static_cast<std::uint64_t>(lattice.size[1]) + 1;
  return {static_cast<std::int32_t>(key % nx), static_cast<std::int32_t>(key / nx % ny),
          static_cast<std::int32_t>(key / nx / ny)};
}

/// The cell at an end of a link, as 2 link + end.
Vec3i end_cell(const Lattice& lattice, std::uint64_t number) {
  const LinkKey link = number / 2;
  return test::plus(lattice.link_lower(link), Lattice::link_axis(link),
                    static_cast<int>(number % 2));
}

/// The cells that a vertex at a corner of a triangle at `cell` may move with. Knows what keys of
/// vertices say: the kind in the two highest bits, then a number.
Cells candidates(const LinkedOctree& body, SurfaceMethod method, std::uint64_t key,
                 const Vec3i& cell) {
  const std::uint64_t kind = key >> 62, number = key & ((std::uint64_t{1} << 62) - 1);
  const bool dual = method == SurfaceMethod::dual_contouring;
  if (kind == (dual ? 0u : 2u))  // on a sheet: 8 grid point + sheet
    return joined_within(body, around(grid_point(body.lattice(), number / 8)), cell);
  if (kind == 1) {  // around a grid edge: dual contouring has 4 edge + arc, splitting cubes edge
    const std::uint64_t edge = dual ? number / 4 : number;
    return joined_within(
        body, around(grid_point(body.lattice(), edge / 3), static_cast<int>(edge % 3)), cell);
  }
  return {end_cell(body.lattice(), number)};  // at an end of a link
}

/// The cell on whose side of a link triangle t lies.
Vec3i cell_of_triangle(const LinkedOctree& body, SurfaceMethod method, const TriangleStore& store,
                       std::size_t t) {
  if (method == SurfaceMethod::dual_contouring) return end_cell(body.lattice(), store.order[t] / 8);
  for (const std::int32_t v : store.triangles[t]) {
    const std::uint64_t key = store.vertex_key[static_cast<std::size_t>(v)];
    if (key >> 62 == 0) return end_cell(body.lattice(), key);
  }
  ADD_FAILURE() << "a triangle of splitting cubes touches no link";
  return {};
}

double square_distance(const LinkedOctree& body, const Vec3d& x, const Vec3i& cell) {
  const Vec3d away = x - body.lattice().center(cell);
  return dot(away, away);
}

void expect_nearest_cells(const LinkedOctree& body, SurfaceMethod method, const Surface& surface) {
  constexpr double kTie = 1e-9;  // of a squared cell: rounding decides between equal distances
  const TriangleStore& store = surface.store();
  const double h = body.lattice().spacing;
  for (std::size_t t = 0; t < store.triangle_slots(); ++t) {
    if (store.triangles[t][0] == store.triangles[t][1]) continue;
    const Vec3i cell = cell_of_triangle(body, method, store, t);
    for (const std::int32_t v : store.triangles[t]) {
      const auto i = static_cast<std::size_t>(v);
      const Cells allowed = candidates(body, method, store.vertex_key[i], cell);
      const Vec3i bound = store.finest_cell[i];
      // In the component of the cell behind the triangle: never across the cut.
      ASSERT_TRUE(allowed.contains(bound)) << "vertex " << v << ", triangle " << t;
      double least = 1e9;
      for (const Vec3i& c : allowed)
        if (body.leaf_at(c) >= 0)
          least = std::min(least, square_distance(body, store.reference[i], c));
      ASSERT_LE(square_distance(body, store.reference[i], bound), least + kTie * h * h);
    }
  }
}

/// Cell numbers and local places say where the vertex is.
void expect_bound_places(const LinkedOctree& body, const Surface& surface) {
  constexpr double kRounding = 1e-12;  // m, of a body of 1 m
  const NodeList leaves = body.leaves();
  const SurfaceView view = surface.view();
  for (std::size_t v = 0; v < view.points.size(); ++v) {
    const BoundPoint& point = view.points[v];
    ASSERT_EQ(point.cell < 0, surface.store().used[v] == 0);
    if (point.cell < 0) continue;
    const std::int32_t leaf = leaves[static_cast<std::size_t>(point.cell)];
    ASSERT_EQ(leaf, body.leaf_at(surface.store().finest_cell[v]));
    const auto& node = body.nodes()[static_cast<std::size_t>(leaf)];
    const double side = body.lattice().spacing * (1 << node.size_log2);
    EXPECT_LT(norm(body.lattice().point(node.corner) + side * point.local - point.reference),
              kRounding);
    EXPECT_EQ(point.reference, surface.store().reference[v]);
  }
}

TEST_P(SurfaceUpdates, VerticesMoveWithTheNearestCellOfTheirOwnComponent) {
  for (const char* name :
       {"one_cell", "floating", "bar", "octree2", "half_cut", "crossed", "arc", "limbs", "ball"}) {
    SCOPED_TRACE(name);
    const LinkedOctree body = test::scene(name);
    Surface surface(body, GetParam());
    surface.bind(body);

    expect_nearest_cells(body, GetParam(), surface);
    expect_bound_places(body, surface);
  }
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    SCOPED_TRACE(seed);
    const LinkedOctree body = test::randomly_cut(seed);
    Surface surface(body, GetParam());
    surface.bind(body);

    expect_nearest_cells(body, GetParam(), surface);
    expect_bound_places(body, surface);
  }
}

// ---- Updates.

void expect_as_anew(const Surface& surface, const LinkedOctree& body, SurfaceMethod method) {
  const SurfaceMesh found = test::mesh_at_rest(surface, body);
  const SurfaceMesh anew = test::surface_of(body, method);
  EXPECT_EQ(found.reference, anew.reference);
  EXPECT_EQ(found.triangles, anew.triangles);
  EXPECT_EQ(found.normal_of, anew.normal_of);
  EXPECT_EQ(found.cut_id, anew.cut_id);
  EXPECT_EQ(found.piece, anew.piece);
  EXPECT_EQ(found.normals.size(), anew.normals.size());
}

TEST_P(SurfaceUpdates, BladeThatOnlyComesNearerMovesTheSurface) {
  LinkedOctree body(test::box_body({8, 8, 8}), 2);
  const Lattice lattice = body.lattice();
  const auto blade = [&](double x) {
    return test::plane_blade(lattice.origin + lattice.spacing * Vec3d{x, 4, 4}, {1, 0, 0}, 1);
  };
  Surface surface(body, GetParam());
  surface.update(body, cut(body, {}, blade(3.9), 1));
  surface.bind(body);
  const SurfaceMesh before = test::mesh_at_rest(surface, body);

  // Nearer to the low ends, at 3.5, and farther from the high ones.
  const CutEvent event = cut(body, {}, blade(3.6), 2);
  surface.update(body, event);
  surface.bind(body);

  EXPECT_FALSE(event.changed());
  EXPECT_EQ(event.moved.size(), 64u);
  expect_as_anew(surface, body, GetParam());
  const SurfaceMesh after = test::mesh_at_rest(surface, body);
  EXPECT_TRUE(test::is_manifold(after));
  EXPECT_NE(after.reference, before.reference);
  EXPECT_EQ(after.triangles.size(), before.triangles.size());
  // The low side belongs to the second cut and lies on it, the high side keeps the first: what lay
  // between them was no cell's centre, and is gone.
  const std::set<std::int32_t> ids(after.cut_id.begin(), after.cut_id.end());
  EXPECT_EQ(ids, (std::set<std::int32_t>{0, 1, 2}));
  // Of the lost volume: records are floats, and splitting cubes bevels the rims.
  const double tolerance = GetParam() == SurfaceMethod::dual_contouring ? 1e-6 : 0.1;
  const double h = lattice.spacing;
  EXPECT_NEAR((test::rest_volume(before) - test::rest_volume(after)) / (0.3 * h * 64 * h * h), 1,
              tolerance);
}

TEST_P(SurfaceUpdates, CutAfterCutItIsAsBuiltAnew) {
  LinkedOctree body(test::ball_body(20), 2);
  const Lattice lattice = body.lattice();
  const auto at = [&](double x, double y, double z) {
    return lattice.origin + lattice.spacing * Vec3d{x, y, z};
  };
  const TriangleMesh blades[] = {
      test::plane_blade(at(10, 10.2, 9.7), {1, 0.2, 0.1}, 0.4),  // ends inside
      test::plane_blade(at(10, 10.2, 9.7), {1, 0.2, 0.1}, 3),    // goes on to the rim
      test::plane_blade(at(9.9, 10.2, 9.7), {1, 0.2, 0.1}, 3),   // a little nearer to one side
      test::plane_blade(at(10, 10, 10), {0.1, 1, -0.3}, 3),      // across
      test::plane_blade(at(10, 10.9, 10), {0.1, 1, -0.3}, 3),    // a slice a cell thick
      test::stamp_blade(at(10, 10, 10).x, at(10, 10, 10).y, 0.3, 0, 2),
      TriangleMesh{},
  };
  Surface surface(body, GetParam());
  surface.bind(body);
  expect_as_anew(surface, body, GetParam());
  for (std::size_t i = 0; i < std::size(blades); ++i) {
    SCOPED_TRACE(i);

    surface.update(body, cut(body, {}, blades[i], static_cast<std::int32_t>(i) + 1));
    surface.bind(body);

    expect_as_anew(surface, body, GetParam());
    EXPECT_TRUE(test::is_manifold(test::mesh_at_rest(surface, body)));
  }
}

TEST_P(SurfaceUpdates, NothingToUpdateChangesNoSlot) {
  LinkedOctree body = test::scene("half_cut");
  Surface surface(body, GetParam());
  surface.bind(body);
  const auto triangles = surface.store().triangles;

  surface.update(body, CutEvent{});
  surface.bind(body);

  EXPECT_EQ(surface.store().triangles, triangles);
}

// ---- Slots.

void expect_drawable(const Surface& surface) {
  const TriangleStore& store = surface.store();
  const SurfaceView view = surface.view();
  ASSERT_EQ(view.triangles.size(), store.triangle_slots());
  ASSERT_EQ(view.points.size(), store.vertex_slots());
  std::size_t vertices = 0, triangles = 0;
  std::vector<int> corners(store.vertex_slots(), 0);
  std::set<std::uint64_t> keys, orders;
  for (std::size_t v = 0; v < store.vertex_slots(); ++v) {
    if (store.used[v] == 0) {
      EXPECT_EQ(view.first_corner[v], -1);
      continue;
    }
    ++vertices;
    EXPECT_TRUE(keys.insert(store.vertex_key[v]).second);
  }
  for (std::size_t t = 0; t < store.triangle_slots(); ++t) {
    const auto& [a, b, c] = view.triangles[t];
    if (a == b) {
      EXPECT_EQ(view.triangles[t], (std::array<std::int32_t, 3>{0, 0, 0}));
      continue;
    }
    ++triangles;
    EXPECT_TRUE(orders.insert(store.order[t]).second);
    for (const std::int32_t v : view.triangles[t]) {
      ASSERT_GE(v, 0);
      ASSERT_LT(static_cast<std::size_t>(v), store.vertex_slots());
      EXPECT_EQ(store.used[static_cast<std::size_t>(v)], 1);
      ++corners[static_cast<std::size_t>(v)];
    }
  }
  EXPECT_EQ(vertices, store.vertices_used());
  EXPECT_EQ(triangles, store.triangles_used());
  // The list of each vertex holds its corners once each, by group, and in it by normal.
  std::set<std::int32_t> normals;
  for (std::size_t v = 0; v < store.vertex_slots(); ++v) {
    std::int32_t last = -1;
    for (std::int32_t c = view.first_corner[v]; c >= 0; c = view.next_corner[c]) {
      --corners[v];
      ASSERT_EQ(store.triangles[c / 3][static_cast<std::size_t>(c % 3)],
                static_cast<std::int32_t>(v));
      const std::int32_t normal = view.normal_of[c];
      ASSERT_GE(normal, 0);
      ASSERT_LT(static_cast<std::size_t>(normal), view.normals);
      const bool same = last >= 0 && view.normal_of[last] == normal;
      if (last >= 0) {
        EXPECT_LE(store.group[last / 3], store.group[c / 3]);
        if (same) {
          EXPECT_EQ(store.group[last / 3], store.group[c / 3]);
          EXPECT_LE(store.order[last / 3], store.order[c / 3]);
        }
      }
      if (!same) {
        EXPECT_TRUE(normals.insert(normal).second);
      }
      last = c;
    }
    EXPECT_EQ(corners[v], 0);
  }
}

// Links disconnected one by one, in an order that no blade has: sheets split and join, fans and
// tips come and go.
TEST_P(SurfaceUpdates, FreedSlotsStayDrawableAndAreUsedAgain) {
  test::Dice dice(77);
  LinkedOctree body(test::box_body({5, 5, 5}), 0);
  const Lattice lattice = body.lattice();
  Surface surface(body, GetParam());
  bool vertices_freed = false, triangles_freed = false, used_again = false;
  std::size_t free_before = 0;
  for (int step = 0; step < 120; ++step) {
    CutEvent event;
    for (int i = 1 + dice.roll(3); i > 0; --i) {
      const int axis = dice.roll(3);
      Vec3i c{dice.roll(5), dice.roll(5), dice.roll(5)};
      c[static_cast<std::size_t>(axis)] %= 4;
      if (body.disconnect(c, axis, test::halfway(lattice, axis, 1 + step)))
        event.disconnected.push_back(lattice.link_key(c, axis));
    }
    surface.update(body, event);
    surface.bind(body);
    SCOPED_TRACE(step);

    expect_drawable(surface);
    expect_as_anew(surface, body, GetParam());
    const TriangleStore& store = surface.store();
    const std::size_t free = store.vertex_slots() - store.vertices_used() + store.triangle_slots() -
                             store.triangles_used();
    vertices_freed = vertices_freed || store.vertex_slots() > store.vertices_used();
    triangles_freed = triangles_freed || store.triangle_slots() > store.triangles_used();
    used_again = used_again || free < free_before;
    free_before = free;
    if (HasFailure()) return;
  }

  EXPECT_TRUE(vertices_freed);
  EXPECT_TRUE(used_again);
  // Under splitting cubes a link adds two corners to a dual cell and takes two tips at most away,
  // so triangles only become more; their slots are freed and used again within an update.
  EXPECT_EQ(triangles_freed, GetParam() == SurfaceMethod::dual_contouring);
}

TEST_P(SurfaceUpdates, StayTheSameOnceTheyForgotHowToChange) {
  for (const char* const scene : {"half_cut", "octree2"}) {
    const LinkedOctree body = test::scene(scene);
    Surface surface(body, GetParam());
    surface.bind(body);
    const std::vector<Vec3d> at_rest = surface.store().reference;
    const std::vector<Vec3d> normals(surface.view().normals, {1, 0, 0});
    const SurfaceMesh before = test::mesh_at_rest(surface, body);
    const std::size_t bytes = surface.bytes(), used = surface.store().vertices_used();

    surface.forget_changes();

    EXPECT_LT(surface.bytes(), bytes * 2 / 3);
    EXPECT_EQ(surface.store().vertices_used(), used);
    const SurfaceMesh after = surface.mesh(at_rest, normals, label_pieces(body, nullptr));
    EXPECT_EQ(after.reference, before.reference);
    EXPECT_EQ(after.triangles, before.triangles);
    EXPECT_EQ(after.normal_of, before.normal_of);
    EXPECT_EQ(after.cut_id, before.cut_id);
    EXPECT_EQ(after.piece, before.piece);
    EXPECT_THROW(surface.bind(body), Error);
    EXPECT_THROW(surface.update(body, {}), Error);
  }
}

TEST(Surfaces, NeedAMethod) {
  const LinkedOctree body = test::scene("one_cell");

  EXPECT_THROW(Surface(body, SurfaceMethod::none), Error);
}

}  // namespace
}  // namespace kerf
