// SPDX-License-Identifier: MIT
#include "core/body/cut.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "core/base/error.hpp"
#include "core/body/cell_map.hpp"
#include "core/geometry/bvh.hpp"
#include "core/geometry/predicates.hpp"

namespace kerf {
namespace {

constexpr double kMaxBladeRatio = 1e6;
/// A blade of so few triangles is looked at closely wherever something may meet it.
constexpr std::size_t kFewTriangles = 16;

/// A crossing of one part of a link.
struct Hit {
  LinkKey key = 0;
  int end = 0;          ///< whose part it is: 0 the lower cell's
  double distance = 0;  ///< from that cell's centre, m, reference state
  bool apart = false;   ///< the link was cut before
  Vec3f normal{};       ///< unit, reference state
};

/// Two crossings nearer than this are one: records are floats. In cells.
constexpr double kSamePlace = 1e-6;

double largest(const Vec3d& v) { return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}); }

/// A triangle on the integer lattice, and its plane in doubles for quick rejection.
struct BladeTriangle {
  std::array<Vec3d, 3> corners{};
  std::array<Int3, 3> points{};
  Box3 box;        ///< with the margin that covers rounding
  Vec3d normal{};  ///< unit
  Vec3d point{};
  double margin = 0;

  bool near_plane(const Box3& b) const {
    const Vec3d to_center = 0.5 * b.lo + 0.5 * b.hi - point;
    double reach = margin;
    for (int d = 0; d < 3; ++d) reach += 0.5 * std::abs(normal[d]) * (b.hi[d] - b.lo[d]);
    return std::abs(dot(normal, to_center)) <= reach;
  }
};

/// The unit normal of a triangle of integers, exact but for its rounding; 0 if it has no area.
Vec3d unit_normal(const std::array<Int3, 3>& p) {
  std::int64_t u[3], v[3];
  for (std::size_t d = 0; d < 3; ++d) {
    u[d] = p[1][d] - p[0][d];
    v[d] = p[2][d] - p[0][d];
  }
  Vec3d n;
  for (int d = 0; d < 3; ++d) {
    const int i = (d + 1) % 3, j = (d + 2) % 3;
    n[d] = static_cast<double>(static_cast<Int128>(u[i]) * v[j] - static_cast<Int128>(u[j]) * v[i]);
  }
  const double length = norm(n);  // at most 2^84: no overflow, and no underflow of integers
  return length > 0 ? (1 / length) * n : Vec3d{};
}

void inflate(Box3& box, double by) {
  box.lo -= {by, by, by};
  box.hi += {by, by, by};
}

/// Holds a cube of finest cells of a leaf: a trilinear map stays within its corners.
Box3 box_of(const CellMap& cell, const Vec3i& low, std::int32_t size) {
  Box3 box;
  const int step = cell.corners == nullptr ? 7 : 1;  // of an undeformed cube two corners tell
  for (int i = 0; i < 8; i += step)
    box.add(cell.position({2 * (low[0] + (i & 1) * size), 2 * (low[1] + (i >> 1 & 1) * size),
                           2 * (low[2] + (i >> 2) * size)}));
  return box;
}

/// The union of what the quantiser must map, grown in steps of four from the body alone: blades of
/// like size are rounded alike, so that a sweep in parts cuts as the whole sweep does.
Box3 quantiser_box(const Box3& body, const Box3& blade) {
  const Vec3d center = 0.5 * body.lo + 0.5 * body.hi;
  double half = largest(body.extent());
  Box3 box;
  do {
    half *= 4;
    box = {center - Vec3d{half, half, half}, center + Vec3d{half, half, half}};
  } while (!(box.contains(blade.lo) && box.contains(blade.hi)) && std::isfinite(half));
  return box;
}

Box3 bounds_of(const TriangleMesh& blade) {
  Box3 box;
  for (const auto& triangle : blade.triangles)
    for (const std::int32_t p : triangle) box.add(blade.points[static_cast<std::size_t>(p)]);
  return box;
}

/// A leaf whose box the blade's box meets, and which links of it were cut before.
struct NearLeaf {
  CellMap cell;
  Box3 box;
  std::uint8_t mask = 0;
};

/// How far the material of finest cell `c` reaches along its link at face 2 axis + side, in cells
/// from the centre: to the shared face, or to where the link was cut before.
double reach_of(const LinkedOctree& body, const Vec3i& c, int face, bool* apart) {
  Vec3i lower = c;
  lower[static_cast<std::size_t>(face / 2)] += face % 2 - 1;
  const LinkCut* record = body.record(lower, face / 2);
  *apart = record != nullptr;
  if (record == nullptr) return 0.5;
  return record->end[1 - face % 2].distance / body.lattice().spacing + kSamePlace;
}
/// The same as a point of a finest leaf, for CellMap.
Vec3d far_end(const LinkedOctree& body, const Vec3i& c, int face) {
  bool apart = false;
  Vec3d q{1, 1, 1};
  q[face / 2] += 2 * (face % 2 == 1 ? 1 : -1) * reach_of(body, c, face, &apart);
  return q;
}

/// Tests links of leaves; several of these may do so at once.
class LinkTests {
 public:
  /// Crossings go to `hits`.
  LinkTests(const LinkedOctree& body, const Quantiser& quantiser, std::vector<Hit>& hits)
      : body_(body), quantiser_(quantiser), hits_(hits) {}

  void test(const NearLeaf& leaf, const BladeTriangle& blade) {
    blade_ = &blade;
    mask_ = leaf.mask;
    test_cube(leaf.cell, {0, 0, 0}, leaf.cell.side, leaf.box);
  }

 private:
  /// Tests the finest cells in a cube of a leaf; `low` counts from the leaf's low corner.
  void test_cube(const CellMap& cell, const Vec3i& low, std::int32_t size, const Box3& box) {
    if (!box.overlaps(blade_->box) || !blade_->near_plane(box)) return;
    if (size == 1) {
      test_finest(cell, low);
      return;
    }
    const std::int32_t half = size / 2;
    for (int i = 0; i < 8; ++i) {
      const Vec3i part{low[0] + (i & 1) * half, low[1] + (i >> 1 & 1) * half,
                       low[2] + (i >> 2) * half};
      test_cube(cell, part, half, box_of(cell, part, half));
    }
  }

  /// Tests the parts of the six links of finest cell `v` of a leaf that move with it.
  void test_finest(const CellMap& cell, const Vec3i& v) {
    const Lattice& lattice = body_.lattice();
    const Vec3i c{cell.corner[0] + v[0], cell.corner[1] + v[1], cell.corner[2] + v[2]};
    const Vec3i center{2 * v[0] + 1, 2 * v[1] + 1, 2 * v[2] + 1};
    const Int3 p = quantiser_(cell.position(center));
    for (int face = 0; face < 6; ++face) {
      const int axis = face / 2, side = face % 2;
      Vec3i neighbour = c, lower = c;
      neighbour[static_cast<std::size_t>(axis)] += 2 * side - 1;
      lower[static_cast<std::size_t>(axis)] += side - 1;
      bool apart = false;
      const double length = (mask_ >> face & 1) != 0 ? reach_of(body_, c, face, &apart) : 0.5;
      Vec3d far{1.0 * center[0], 1.0 * center[1], 1.0 * center[2]};
      far[axis] += (2 * side - 1) * 2 * length;
      double t = 0;
      if (segment_crosses_triangle(p, quantiser_(cell.position_at(far)), blade_->points[0],
                                   blade_->points[1], blade_->points[2], &t) == 0 ||
          body_.leaf_at(neighbour) < 0)
        continue;
      hits_.push_back({lattice.link_key(lower, axis), 1 - side, length * t * lattice.spacing, apart,
                       reference_normal(cell, center)});
    }
  }

  Vec3f reference_normal(const CellMap& cell, const Vec3i& center) const {
    Vec3d n = cell.pull_back(center, blade_->normal);
    const double size = largest(n);
    n = size > 0 && std::isfinite(size) ? (1 / size) * n : blade_->normal;
    n = (1 / norm(n)) * n;
    return {static_cast<float>(n.x), static_cast<float>(n.y), static_cast<float>(n.z)};
  }

  const LinkedOctree& body_;
  const Quantiser& quantiser_;
  const BladeTriangle* blade_ = nullptr;  // the triangle at hand
  std::uint8_t mask_ = 0;                 // of the leaf at hand
  std::vector<Hit>& hits_;
};

/// Finds the links that a blade crosses.
class LinkSearch {
 public:
  LinkSearch(const LinkedOctree& body, const Box3& body_box, const TriangleMesh& blade,
             const Workers& workers)
      : body_(body),
        workers_(workers),
        blade_box_(bounds_of(blade)),
        quantiser_(quantiser_box(body_box, blade_box_)),
        // Small query boxes along a slanted triangle, but not too many if the body has grown.
        reach_(std::max(4 * body.lattice().spacing, largest(body_box.extent()) / 256)),
        margin_(4 * quantiser_.unit() +
                32 * std::numeric_limits<double>::epsilon() *
                    std::max({largest(body_box.lo), largest(body_box.hi), largest(blade_box_.lo),
                              largest(blade_box_.hi)})),
        triangles_(prepare(blade)) {}

  /// All crossings, by link. `corners` holds eight for each leaf of `numbers`, or none in the
  /// reference state.
  std::vector<Hit> run(std::span<const std::int32_t> numbers, std::span<const Vec3d> corners) {
    Box3 blade_box = blade_box_;
    inflate(blade_box, margin_);
    std::vector<Found> found(workers_.parts_of(numbers.size()));
    workers_.share(numbers.size(), [&](std::size_t part, std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i)
        look_at(numbers[i], corners.empty() ? nullptr : corners.data() + 8 * i, blade_box,
                found[part]);
    });
    std::vector<Hit> hits;
    std::vector<NearLeaf> near;
    for (Found& part : found) {
      hits.insert(hits.end(), part.hits.begin(), part.hits.end());
      near.insert(near.end(), part.near.begin(), part.near.end());
    }
    if (!are_few()) hits = search_tree(near);
    std::stable_sort(hits.begin(), hits.end(),
                     [](const Hit& a, const Hit& b) { return a.key < b.key; });
    return hits;
  }

 private:
  /// Of some leaves: what the blade crosses, if its triangles are few; else those that it may.
  struct Found {
    std::vector<Hit> hits;
    std::vector<NearLeaf> near;
  };

  /// The triangles that have an area.
  std::vector<BladeTriangle> prepare(const TriangleMesh& blade) const {
    std::vector<BladeTriangle> out;
    for (const auto& indices : blade.triangles) {
      BladeTriangle t;
      for (std::size_t i = 0; i < 3; ++i) {
        t.corners[i] = blade.points[static_cast<std::size_t>(indices[i])];
        t.points[i] = quantiser_(t.corners[i]);
        t.box.add(t.corners[i]);
      }
      t.normal = unit_normal(t.points);
      if (t.normal == Vec3d{}) continue;
      t.point = quantiser_.position(t.points[0]);
      t.margin = margin_;
      inflate(t.box, margin_);
      out.push_back(t);
    }
    return out;
  }

  /// Each leaf is tested against each of a few triangles; of many, only against those near it.
  bool are_few() const { return triangles_.size() <= kFewTriangles; }

  void look_at(std::int32_t number, const Vec3d* corners, const Box3& blade_box,
               Found& found) const {
    const std::int32_t leaf = body_.leaves()[static_cast<std::size_t>(number)];
    const LinkedOctree::Node& node = body_.nodes()[static_cast<std::size_t>(leaf)];
    NearLeaf near{{&body_.lattice(), node.corner, 1 << node.size_log2, corners}, {}, 0};
    near.box = box_of(near.cell, {0, 0, 0}, near.cell.side);
    if (node.size_log2 == 0) near.mask = node.cut_mask;
    // Parts of links that were cut may reach beyond the cell.
    for (int face = 0; face < 6; ++face)
      if ((near.mask >> face & 1) != 0)
        near.box.add(near.cell.position_at(far_end(body_, node.corner, face)));
    if (!near.box.overlaps(blade_box)) return;
    if (!are_few()) return found.near.push_back(near);
    LinkTests tests(body_, quantiser_, found.hits);
    for (const BladeTriangle& triangle : triangles_) tests.test(near, triangle);
  }

  std::vector<Hit> search_tree(const std::vector<NearLeaf>& near) const {
    std::vector<Box3> boxes;
    boxes.reserve(near.size());
    for (const NearLeaf& leaf : near) boxes.push_back(leaf.box);
    const Bvh tree(std::move(boxes));
    std::vector<std::size_t> tested(near.size());  // the last triangle, from 1
    std::vector<Hit> hits;
    LinkTests tests(body_, quantiser_, hits);
    for (std::size_t n = 0; n < triangles_.size(); ++n)
      search(tree, triangles_[n].corners, [&](std::int32_t leaf) {
        const auto i = static_cast<std::size_t>(leaf);
        if (std::exchange(tested[i], n + 1) != n + 1) tests.test(near[i], triangles_[n]);
      });
    return hits;
  }

  /// Queries the tree along a part of the triangle; parts are halved until their boxes are tight.
  template <class Body>
  void search(const Bvh& tree, const std::array<Vec3d, 3>& part, const Body& body) const {
    Box3 box;
    for (const Vec3d& p : part) box.add(p);
    inflate(box, margin_);
    if (!box.overlaps(tree.bounds())) return;
    std::size_t longest = 0;  // edge i is opposite to point i
    double length = -1;
    for (std::size_t i = 0; i < 3; ++i) {
      const double l = largest(part[(i + 1) % 3] - part[(i + 2) % 3]);
      if (l > length) {
        longest = i;
        length = l;
      }
    }
    if (length <= reach_) return tree.query(box, body);
    const Vec3d &a = part[(longest + 1) % 3], &b = part[(longest + 2) % 3];
    const Vec3d middle = 0.5 * a + 0.5 * b;
    search(tree, {part[longest], a, middle}, body);
    search(tree, {part[longest], middle, b}, body);
  }

  const LinkedOctree& body_;
  const Workers& workers_;
  Box3 blade_box_;
  Quantiser quantiser_;
  double reach_;   // of the parts of a triangle that are searched at a time, m
  double margin_;  // covers the rounding of every box, m
  std::vector<BladeTriangle> triangles_;
};

/// The box of the body as it lies. @throws Error if a position is not finite.
Box3 bounds_of(const LinkedOctree& body, std::span<const Vec3d> corners) {
  Box3 box;
  if (corners.empty()) {
    box.add(body.lattice().point({0, 0, 0}));
    box.add(body.lattice().point(body.lattice().size));
  }
  for (const Vec3d& p : corners) {
    expects(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z),
            "the deformed positions of the body are not finite: the simulation has diverged");
    box.add(p);
  }
  return box;
}

/// The leaves near the blade in the reference state, ascending.
std::vector<std::int32_t> leaves_at_rest(const LinkedOctree& body, const Box3& blade) {
  const Lattice& lattice = body.lattice();
  Vec3i low, high;
  for (int d = 0; d < 3; ++d) {
    const auto k = static_cast<std::size_t>(d);
    // One cell more for links that reach beyond theirs, and one for rounding.
    const auto cell = [&](double x, int more) {
      const double at = std::floor((x - lattice.origin[d]) / lattice.spacing) + more;
      return static_cast<std::int32_t>(std::clamp(at, -1.0, 1.0 * lattice.size[k]));
    };
    low[k] = cell(blade.lo[d], -2);
    high[k] = cell(blade.hi[d], 2);
  }
  std::vector<std::int32_t> numbers;
  body.add_leaves_between(low, high, numbers);
  if (!std::is_sorted(numbers.begin(), numbers.end())) std::sort(numbers.begin(), numbers.end());
  return numbers;
}

/// Each end keeps the nearest of the crossings of one link. A link that was cut before may stand
/// open: then a crossing counts for the end whose material it is in alone, if it is nearer than
/// what is recorded.
LinkCut nearest(std::span<const Hit> hits, double spacing, std::int32_t cut_id,
                const LinkCut* before) {
  LinkCut cut = before == nullptr ? LinkCut{} : *before;
  double best[2] = {std::numeric_limits<double>::infinity(),
                    std::numeric_limits<double>::infinity()};
  if (before != nullptr)
    for (int end = 0; end < 2; ++end) best[end] = before->end[end].distance - kSamePlace * spacing;
  for (const Hit& hit : hits) {
    for (int end = 0; end < 2; ++end) {
      if (hit.apart && end != hit.end) continue;
      const double distance = end == hit.end ? hit.distance : spacing - hit.distance;
      if (!(distance < best[end])) continue;
      best[end] = distance;
      cut.end[end] = {static_cast<float>(distance), hit.normal, cut_id};
    }
  }
  return cut;
}

/// Whether `cut` passes nearer to an end of its link than what is recorded.
bool comes_nearer(const LinkCut& cut, const LinkCut& recorded) {
  return cut.end[0].distance < recorded.end[0].distance ||
         cut.end[1].distance < recorded.end[1].distance;
}

/// What the blade pass of `leaves` does to the body. Needs  a blade with triangles.
CutEvent cut_leaves(LinkedOctree& body, const Box3& body_box, std::span<const std::int32_t> numbers,
                    std::span<const Vec3d> corners, const TriangleMesh& blade, CutEvent event,
                    const Workers& workers) {
  const std::vector<Hit> hits = LinkSearch(body, body_box, blade, workers).run(numbers, corners);

  // From here on the body changes, and nothing in the input can be wrong any more.
  const Lattice lattice = body.lattice();
  const std::size_t splits_before = body.splits().size();
  for (std::size_t begin = 0, end = 0; begin < hits.size(); begin = end) {
    const LinkKey key = hits[begin].key;
    while (end < hits.size() && hits[end].key == key) ++end;
    const Vec3i lower = lattice.link_lower(key);
    const int axis = Lattice::link_axis(key);
    // The bit is cheaper to look up than that there is no record.
    const LinkCut* before = body.connected(lower, axis) ? nullptr : body.record(lower, axis);
    const LinkCut record =
        nearest({hits.data() + begin, end - begin}, lattice.spacing, event.cut_id, before);
    ++event.links_hit;
    if (before != nullptr && comes_nearer(record, *before)) event.moved.push_back(key);
    if (body.disconnect(lower, axis, record)) event.disconnected.push_back(key);
  }
  event.split.assign(body.splits().begin() + static_cast<std::ptrdiff_t>(splits_before),
                     body.splits().end());
  event.cells_after = body.leaf_count();
  return event;
}

/// Whether the blade can meet the body at all. @throws Error if it makes no sense.
bool meets(const Box3& body, const TriangleMesh& blade) {
  check_finite(blade, "the blade");
  if (blade.triangles.empty()) return false;
  const Box3 blade_box = bounds_of(blade);
  const double body_size = largest(body.extent()), blade_size = largest(blade_box.extent());
  expects(blade_size <= kMaxBladeRatio * body_size,
          text("the blade is ", blade_size, " m large and the body ", body_size,
               " m: check the units of the blade"));
  return body.overlaps(blade_box);
}

CutEvent begin_event(const LinkedOctree& body, std::int32_t cut_id) {
  expects(cut_id > 0, "a blade needs a cut id of at least 1; 0 is the body's own surface");
  CutEvent event;
  event.cut_id = cut_id;
  event.cells_before = event.cells_after = body.leaf_count();
  return event;
}

}  // namespace

BladeReach::BladeReach(const TriangleMesh& blade, const Vec3d& origin) {
  constexpr double kRounding = 1e-10;  // the integers of a blade are 2^40 to some times its size
  box_ = bounds_of(blade);
  margin_ = kRounding * (largest(box_.extent()) + largest(box_.lo) + largest(box_.hi));
  inflate(box_, margin_);
  box_ = {box_.lo - origin, box_.hi - origin};
  for (std::size_t t = 0; t < blade.triangles.size() && blade.triangles.size() <= kFewTriangles;
       ++t) {
    Vec3d p[3];
    Box3 box;
    for (std::size_t i = 0; i < 3; ++i) {
      p[i] = blade.points[static_cast<std::size_t>(blade.triangles[t][i])] - origin;
      box.add(p[i]);
    }
    inflate(box, margin_);
    const Vec3d n = cross(p[1] - p[0], p[2] - p[0]);
    // A normal of a needle is mostly rounding, and one of zero lets all pass.
    const double area = norm(n), longest = largest(box.extent());
    const bool is_needle = !(area > 1e-6 * longest * longest);
    slabs_.push_back({box.lo, box.hi, is_needle ? Vec3d{} : (1 / area) * n, p[0]});
  }
}

kernels::BladeNeighbourhood BladeReach::neighbourhood() const {
  return {box_.lo, box_.hi, margin_, static_cast<std::int32_t>(slabs_.size()), slabs_.data()};
}

bool BladeReach::may_meet(const Box3& leaf, bool has_cut_links) const {
  return kernels::may_meet(neighbourhood(), leaf.lo, leaf.hi, has_cut_links ? kBeyond : 0);
}

CutEvent cut(LinkedOctree& body, std::span<const Vec3d> corners, const TriangleMesh& blade,
             std::int32_t cut_id) {
  const CutEvent event = begin_event(body, cut_id);
  expects(corners.empty() || corners.size() == 8 * body.leaf_count(),
          "the deformed positions must number eight for each leaf of the body");
  const Box3 body_box = bounds_of(body, corners);
  if (!meets(body_box, blade)) return event;
  std::vector<std::int32_t> numbers;
  if (corners.empty()) {
    numbers = leaves_at_rest(body, bounds_of(blade));
  } else {
    numbers.resize(body.leaf_count());
    std::iota(numbers.begin(), numbers.end(), 0);
  }
  return cut_leaves(body, body_box, numbers, corners, blade, event, {});
}

CutEvent cut_near(LinkedOctree& body, const DeformedLeaves& leaves, const TriangleMesh& blade,
                  std::int32_t cut_id, const Workers& workers) {
  const CutEvent event = begin_event(body, cut_id);
  expects(leaves.corners.size() == 8 * leaves.numbers.size(),
          "the deformed positions must number eight for each leaf near the blade");
  if (!meets(leaves.bounds, blade)) return event;
  return cut_leaves(body, leaves.bounds, leaves.numbers, leaves.corners, blade, event, workers);
}

}  // namespace kerf
