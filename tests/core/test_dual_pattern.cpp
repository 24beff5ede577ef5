// SPDX-License-Identifier: MIT
//
// All 4096 patterns of a dual cell against an oracle that knows the numbering of links and corners
// only: octants are joined by transitive closure, corners by flooding each face on its own.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <set>
#include <vector>

#include "core/geometry/vec.hpp"
#include "core/surface/dual_pattern.hpp"

namespace kerf {
namespace {

constexpr unsigned kPatterns = 4096;
using Joined = std::array<std::array<bool, 8>, 8>;

int bit(int octant, int axis) { return octant >> axis & 1; }

/// The two octants of a link, low end first, from the numbering 4 a + i + 2 j.
std::array<int, 2> ends_of(int link) {
  const int axis = link / 4, i = link % 2, j = link / 2 % 2;
  const int low = i << (axis + 1) % 3 | j << (axis + 2) % 3;
  return {low, low | 1 << axis};
}

int link_between(int a, int b) {
  for (int link = 0; link < 12; ++link)
    if (ends_of(link) == std::array{std::min(a, b), std::max(a, b)}) return link;
  return -1;
}

/// Octants that connected links join, both ends of which `allowed` holds.
Joined closure(unsigned connected, const std::set<int>& allowed) {
  Joined joined{};
  for (const std::size_t o : allowed) joined[o][o] = true;
  for (int link = 0; link < 12; ++link) {
    const auto [a, b] = ends_of(link);
    if ((connected >> link & 1) == 0 || !allowed.contains(a) || !allowed.contains(b)) continue;
    joined[static_cast<std::size_t>(a)][static_cast<std::size_t>(b)] = true;
    joined[static_cast<std::size_t>(b)][static_cast<std::size_t>(a)] = true;
  }
  for (std::size_t k = 0; k < 8; ++k)
    for (std::size_t i = 0; i < 8; ++i)
      for (std::size_t j = 0; j < 8; ++j)
        joined[i][j] = joined[i][j] || (joined[i][k] && joined[k][j]);
  return joined;
}

Vec3d centre_of(int octant) {
  return {bit(octant, 0) - 0.5, bit(octant, 1) - 0.5, bit(octant, 2) - 0.5};
}
/// From octant o along its link.
Vec3d away(int octant, int axis) {
  Vec3d out;
  out[axis] = bit(octant, axis) == 0 ? 1 : -1;
  return out;
}

/// What the surface is, found face by face.
struct Oracle {
  std::array<int, 24> next{}, previous{}, tip{}, sheet{};
  Joined joined{};
  int sheets = 0;

  explicit Oracle(unsigned connected) : joined(closure(connected, {0, 1, 2, 3, 4, 5, 6, 7})) {
    next.fill(-1);
    previous.fill(-1);
    tip.fill(-1);
    sheet.fill(-1);
    for (int axis = 0; axis < 3; ++axis)
      for (int side = 0; side < 2; ++side) visit_face(connected, axis, side);
    for (std::size_t c = 0; c < 24; ++c)
      if (next[c] >= 0 && sheet[c] < 0) flood(c, sheets++);
  }

  void visit_face(unsigned connected, int axis, int side) {
    std::set<int> octants;
    for (int o = 0; o < 8; ++o)
      if (bit(o, axis) == side) octants.insert(o);
    const Joined arcs = closure(connected, octants);
    std::vector<int> corners;  // of disconnected links in this face
    for (const int o : octants)
      for (int a = 0; a < 3; ++a)
        if (a != axis && (connected >> link_between(o, o ^ 1 << a) & 1) == 0)
          corners.push_back(3 * o + a);
    const Vec3d out = (side == 0 ? -1.0 : 1.0) *
                      Vec3d{axis == 0 ? 1.0 : 0, axis == 1 ? 1.0 : 0, axis == 2 ? 1.0 : 0};
    for (const int c : corners)
      for (const int d : corners) {
        if (c == d || !arcs[static_cast<std::size_t>(c / 3)][static_cast<std::size_t>(d / 3)])
          continue;
        // The polygon runs with its inside, the inside of the cube, to the left of its way across
        // the face, seen from outside the material.
        const Vec3d at = centre_of(c / 3) + 0.25 * away(c / 3, c % 3);
        const Vec3d way = 0.5 * out - at;
        if (dot(cross(away(c / 3, c % 3), way), out) > 0) continue;
        EXPECT_EQ(next[static_cast<std::size_t>(c)], -1);
        EXPECT_EQ(previous[static_cast<std::size_t>(d)], -1);
        next[static_cast<std::size_t>(c)] = d;
        previous[static_cast<std::size_t>(d)] = c;
        if (corners.size() == 2) tip[static_cast<std::size_t>(c)] = 2 * axis + side;
      }
  }

  void flood(std::size_t corner, int number) {
    if (sheet[corner] == number) return;
    sheet[corner] = number;
    flood(static_cast<std::size_t>(next[corner]), number);
    flood(static_cast<std::size_t>(previous[corner]), number);
  }
};

TEST(DualPattern, LinksAndCornersAreNumberedAsTheHeaderSays) {
  for (int o = 0; o < 8; ++o)
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_EQ(dual_link(o, axis), link_between(o, o ^ 1 << axis));
      EXPECT_EQ(dual_corner(o, axis), 3 * o + axis);
    }
  for (int axis = 0; axis < 3; ++axis)
    for (int side = 0; side < 2; ++side) {
      const std::array<int, 4> ring = dual_face(axis, side);
      Vec3d sum;  // twice the area along the normal
      for (std::size_t k = 0; k < 4; ++k) {
        EXPECT_EQ(bit(ring[k], axis), side);
        EXPECT_EQ(ring[k] ^ ring[(k + 1) % 4], 1 << dual_face_axis(axis, static_cast<int>(k)));
        sum += cross(centre_of(ring[k]), centre_of(ring[(k + 1) % 4]));
      }
      EXPECT_EQ(sum[axis], 2);
    }
}

TEST(DualPattern, ComponentsAreTheTransitiveClosureOfTheLinks) {
  for (unsigned connected = 0; connected < kPatterns; ++connected) {
    SCOPED_TRACE(connected);
    const DualPattern& p = dual_pattern(connected);
    const Joined joined = closure(connected, {0, 1, 2, 3, 4, 5, 6, 7});

    int seen = 0;
    for (std::size_t a = 0; a < 8; ++a) {
      for (std::size_t b = 0; b < 8; ++b) ASSERT_EQ(p.component[a] == p.component[b], joined[a][b]);
      ASSERT_LE(p.component[a], seen);  // numbered by their first octants
      seen = std::max(seen, p.component[a] + 1);
    }
  }
}

TEST(DualPattern, CornersFollowEachOtherAsFaceByFaceFloodingSays) {
  for (unsigned connected = 0; connected < kPatterns; ++connected) {
    SCOPED_TRACE(connected);
    const DualPattern& p = dual_pattern(connected);
    const Oracle oracle(connected);

    std::array<int, 24> entered{};
    for (std::size_t c = 0; c < 24; ++c) {
      const int link = link_between(static_cast<int>(c) / 3, static_cast<int>(c) / 3 ^ 1 << c % 3);
      const bool cut = (connected >> link & 1) == 0;
      ASSERT_EQ(p.sheet[c] != kNoSheet, cut);
      ASSERT_EQ(oracle.next[c] >= 0 && oracle.previous[c] >= 0, cut);
      if (!cut) continue;
      ASSERT_EQ(p.next[c], oracle.next[c]) << "corner " << c;
      ASSERT_EQ(p.tip[c], oracle.tip[c] < 0 ? kNoSheet : oracle.tip[c]) << "corner " << c;
      ++entered[p.next[c]];
    }
    for (std::size_t c = 0; c < 24; ++c) ASSERT_EQ(entered[c], p.sheet[c] != kNoSheet ? 1 : 0);
  }
}

TEST(DualPattern, SheetsAreTheCyclesOfCornersWithinOneComponent) {
  int most = 0;
  for (unsigned connected = 0; connected < kPatterns; ++connected) {
    SCOPED_TRACE(connected);
    const DualPattern& p = dual_pattern(connected);
    const Oracle oracle(connected);

    ASSERT_EQ(p.sheets, oracle.sheets);
    most = std::max(most, oracle.sheets);
    for (std::size_t a = 0; a < 24; ++a)
      for (std::size_t b = 0; b < 24; ++b)
        if (oracle.sheet[a] >= 0 && oracle.sheet[b] >= 0) {
          ASSERT_EQ(p.sheet[a] == p.sheet[b], oracle.sheet[a] == oracle.sheet[b]);
        }
    for (std::size_t s = 0; s < p.sheets; ++s) {
      const std::size_t first = p.first[s];
      ASSERT_EQ(p.sheet[first], s);
      for (std::size_t c = 0; c < first; ++c) ASSERT_NE(p.sheet[c], s);
      unsigned octants = 0;
      for (std::size_t o = 0; o < 8; ++o)
        if (oracle.joined[first / 3][o]) octants |= 1u << o;
      ASSERT_EQ(p.octants[s], octants);
    }
  }
  EXPECT_EQ(most, kMostSheets);  // all links cut: eight lone octants
}

TEST(DualPattern, TipsLieOnFacesWithOneDisconnectedLink) {
  for (unsigned connected = 0; connected < kPatterns; ++connected) {
    SCOPED_TRACE(connected);
    const DualPattern& p = dual_pattern(connected);
    std::array<int, 6> tips{};
    for (std::size_t c = 0; c < 24; ++c) {
      if (p.tip[c] == kNoSheet) continue;
      ++tips[p.tip[c]];
      EXPECT_EQ(p.next[c] / 3, static_cast<int>(c) / 3 ^ 1 << c % 3);
      EXPECT_EQ(p.next[c] % 3, static_cast<int>(c) % 3);
    }

    for (int face = 0; face < 6; ++face) {
      int cut = 0;
      for (int link = 0; link < 12; ++link) {
        const auto [a, b] = ends_of(link);
        if (bit(a, face / 2) == face % 2 && bit(b, face / 2) == face % 2)
          cut += (connected >> link & 1) == 0 ? 1 : 0;
      }
      ASSERT_EQ(tips[static_cast<std::size_t>(face)], cut == 1 ? 1 : 0);
    }
  }
}

/// A permutation of axes, with mirrors: where octants and axes go.
struct Symmetry {
  std::array<int, 3> axis{0, 1, 2};  // axis d becomes axis[d]
  int mirror = 0;                    // bit of the new axis

  int octant(int o) const {
    int out = 0;
    for (int d = 0; d < 3; ++d) out |= bit(o, d) << axis[static_cast<std::size_t>(d)];
    return out ^ mirror;
  }
  std::size_t corner(std::size_t c) const {
    return static_cast<std::size_t>(3 * octant(static_cast<int>(c) / 3) + axis[c % 3]);
  }
  unsigned pattern(unsigned connected) const {
    unsigned out = 0;
    for (int link = 0; link < 12; ++link) {
      const auto [a, b] = ends_of(link);
      out |= (connected >> link & 1) << link_between(octant(a), octant(b));
    }
    return out;
  }
  bool turns_inside_out() const {
    int odd = (mirror & 1) + (mirror >> 1 & 1) + (mirror >> 2);
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = i + 1; j < 3; ++j) odd += axis[i] > axis[j] ? 1 : 0;
    return odd % 2 == 1;
  }
};

TEST(DualPattern, TurnedAndMirroredCubesHaveTurnedAndMirroredSheets) {
  Symmetry symmetry;
  int symmetries = 0;
  do {
    for (symmetry.mirror = 0; symmetry.mirror < 8; ++symmetry.mirror, ++symmetries)
      for (unsigned connected = 0; connected < kPatterns; ++connected) {
        const DualPattern& p = dual_pattern(connected);
        const DualPattern& q = dual_pattern(symmetry.pattern(connected));
        ASSERT_EQ(p.sheets, q.sheets);
        for (std::size_t c = 0; c < 24; ++c) {
          const std::size_t image = symmetry.corner(c);
          ASSERT_EQ(p.sheet[c] == kNoSheet, q.sheet[image] == kNoSheet);
          if (p.sheet[c] == kNoSheet) continue;
          const std::size_t then = symmetry.corner(p.next[c]);
          if (symmetry.turns_inside_out())
            ASSERT_EQ(q.next[then], image);
          else
            ASSERT_EQ(q.next[image], then);
          ASSERT_EQ(q.sheet[image], q.sheet[then]);
        }
      }
  } while (std::next_permutation(symmetry.axis.begin(), symmetry.axis.end()));
  EXPECT_EQ(symmetries, 48);
}

/// All links are connected but those that `is_cut` names by their ends.
template <class IsCut>
const DualPattern& pattern_without(const IsCut& is_cut) {
  unsigned connected = 0;
  for (int link = 0; link < 12; ++link)
    if (!is_cut(ends_of(link)[0], ends_of(link)[1])) connected |= 1u << link;
  return dual_pattern(connected);
}

TEST(DualPattern, OctantAloneHasItsThreeCornersInOrder) {
  const DualPattern& p = pattern_without([](int low, int) { return low == 0; });

  EXPECT_EQ(p.sheets, 2);  // of the octant, and of the other seven
  EXPECT_EQ(p.octants[0], 1);
  EXPECT_EQ(p.octants[1], 0xfe);
  // From outside, (1, 1, 1), x, y, z turn counter-clockwise.
  EXPECT_EQ(p.next[dual_corner(0, 0)], dual_corner(0, 1));
  EXPECT_EQ(p.next[dual_corner(0, 1)], dual_corner(0, 2));
  EXPECT_EQ(p.next[dual_corner(0, 2)], dual_corner(0, 0));
  // The others see it from the other side.
  EXPECT_EQ(p.next[dual_corner(1, 0)], dual_corner(4, 2));
  EXPECT_EQ(p.next[dual_corner(4, 2)], dual_corner(2, 1));
}

TEST(DualPattern, PlaneBetweenOctantsHasASheetOnEachSide) {
  const DualPattern& p =
      pattern_without([](int low, int high) { return bit(low, 2) != bit(high, 2); });

  EXPECT_EQ(p.sheets, 2);
  EXPECT_EQ(p.octants[0], 0x0f);
  EXPECT_EQ(p.octants[1], 0xf0);
  // The lower side looks up: counter-clockwise from above.
  EXPECT_EQ(p.next[dual_corner(0, 2)], dual_corner(1, 2));
  EXPECT_EQ(p.next[dual_corner(1, 2)], dual_corner(3, 2));
  EXPECT_EQ(p.next[dual_corner(4, 2)], dual_corner(6, 2));
  for (const std::uint8_t tip : p.tip) EXPECT_EQ(tip, kNoSheet);
}

TEST(DualPattern, TipOfACutJoinsItsTwoSides) {
  // Two links along z are cut, at x = 0: the cut enters at the low x side and ends inside.
  const DualPattern& p = pattern_without(
      [](int low, int high) { return bit(low, 2) != bit(high, 2) && bit(low, 0) == 0; });

  EXPECT_EQ(p.sheets, 1);
  EXPECT_EQ(p.octants[0], 0xff);
  EXPECT_EQ(std::count(p.sheet.begin(), p.sheet.end(), 0), 4);
  EXPECT_EQ(std::count(p.tip.begin(), p.tip.end(), kNoSheet), 22);
  EXPECT_EQ(p.next[dual_corner(2, 2)] == dual_corner(6, 2) ? p.tip[dual_corner(2, 2)]
                                                           : p.tip[dual_corner(6, 2)],
            2 * 1 + 1);
  EXPECT_EQ(p.next[dual_corner(0, 2)] == dual_corner(4, 2) ? p.tip[dual_corner(0, 2)]
                                                           : p.tip[dual_corner(4, 2)],
            2 * 1 + 0);
}

TEST(DualPattern, TwoVoidsAtOppositeCornersGiveOneComponentTwoSheets) {
  const DualPattern& p = pattern_without([](int low, int high) { return low == 0 || high == 7; });

  EXPECT_EQ(p.sheets, 4);
  std::vector<int> octants(p.octants.begin(), p.octants.begin() + 4);
  std::sort(octants.begin(), octants.end());
  EXPECT_EQ(octants, (std::vector<int>{0x01, 0x7e, 0x7e, 0x80}));
}

TEST(DualPattern, ConnectedDualCellHasNoSurface) {
  const DualPattern& p = dual_pattern(kPatterns - 1);

  EXPECT_EQ(p.sheets, 0);
  for (const std::uint8_t sheet : p.sheet) EXPECT_EQ(sheet, kNoSheet);
}

}  // namespace
}  // namespace kerf
