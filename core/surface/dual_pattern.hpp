// SPDX-License-Identifier: MIT
//
// How the links of one dual cell split it: the look-up table of the surface.
//
// Layout  A dual cell is the cube between the centres of the eight finest cells around a grid
//         point p. Octant o = x + 2y + 4z is the cell p - 1 + (x, y, z). Its edges are twelve
//         links:
//
//           link 4 a + i + 2 j  along axis a, between the octants with bit u = i and bit v = j,
//                               u = (a + 1) % 3, v = (a + 2) % 3
//
//         A corner 3 o + a is octant o's end of its link along a. Where the link is disconnected,
//         the surface passes there, on the side of o.
//
//             2-------3        The xy face of octants 0, 1, 2, 3 with two disconnected links, 0-1
//             |   :   |        and 2-3. Around the face the cells fall into two arcs, {0, 2} and
//             |   :   |        {1, 3}. An arc joins the corners at its ends, (0, x) and (2, x),
//             0---:---1        (1, x) and (3, x); the arcs of all six faces join them to sheets.
//
// Terms   component  octants that links of this dual cell join
//         sheet      a cycle of corners: one sheet of the surface. A component mostly has one; it
//                    has more where the surface passes it twice without meeting itself.
//         tip        an arc around a face with one disconnected link joins its two corners: the
//                    cut ends in that face.
//
// Source  [WWD15] section 2.3.2: material components by a table over the pattern of links. Sheets
//         are ours (docs/decisions/0009-a-vertex-for-each-sheet.md).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace kerf {

inline constexpr int kDualLinks = 12;
inline constexpr int kDualCorners = 24;
inline constexpr int kMostSheets = 8;  ///< of all patterns; the table's maker checks it
inline constexpr std::uint8_t kNoSheet = 255;

constexpr int dual_link(int octant, int axis) {
  return 4 * axis + (octant >> ((axis + 1) % 3) & 1) + 2 * (octant >> ((axis + 2) % 3) & 1);
}
constexpr int dual_corner(int octant, int axis) { return 3 * octant + axis; }

/// The four octants around the face of the dual cell at `side` along `axis`, counter-clockwise seen
/// from +axis. Consecutive ones share a link, along (axis + 1) % 3 first.
constexpr std::array<int, 4> dual_face(int axis, int side) {
  const int u = 1 << (axis + 1) % 3, v = 1 << (axis + 2) % 3, base = side << axis;
  return {base, base + u, base + u + v, base + v};
}
/// Axis of the link from the k-th octant of a face to the next.
constexpr int dual_face_axis(int axis, int k) { return (axis + 1 + k % 2) % 3; }

struct DualPattern {
  std::uint8_t sheets = 0;
  std::array<std::uint8_t, 8> component{};         ///< per octant, numbered by their first octants
  std::array<std::uint8_t, kDualCorners> sheet{};  ///< per corner; kNoSheet: the link is connected
  /// Per corner: the next one of its sheet, counter-clockwise seen from outside the material.
  std::array<std::uint8_t, kDualCorners> next{};
  /// Per corner: whether `next` is the other end of the same link, reached around a tip; then the
  /// face 2 axis + side of the tip, else kNoSheet.
  std::array<std::uint8_t, kDualCorners> tip{};
  std::array<std::uint8_t, kMostSheets> first{};    ///< per sheet: its first corner
  std::array<std::uint8_t, kMostSheets> octants{};  ///< per sheet: its component, a bit per octant
};

/// The pattern of a dual cell; bit l of `connected` says that link l is connected.
/// Needs  connected < 4096.
const DualPattern& dual_pattern(unsigned connected);

}  // namespace kerf
