// SPDX-License-Identifier: MIT
#include "core/surface/dual_pattern.hpp"

#include <vector>

#include "core/base/error.hpp"

namespace kerf {
namespace {

bool is_connected(unsigned connected, int octant, int axis) {
  return (connected >> dual_link(octant, axis) & 1) != 0;
}

void label_components(unsigned connected, DualPattern& out) {
  out.component.fill(kNoSheet);
  std::uint8_t components = 0;
  for (int seed = 0; seed < 8; ++seed) {
    if (out.component[seed] != kNoSheet) continue;
    int stack[8] = {seed}, size = 1;
    out.component[seed] = components;
    while (size > 0) {
      const int o = stack[--size];
      for (int axis = 0; axis < 3; ++axis) {
        const int other = o ^ 1 << axis;
        if (out.component[other] != kNoSheet || !is_connected(connected, o, axis)) continue;
        out.component[other] = components;
        stack[size++] = other;
      }
    }
    ++components;
  }
}

/// Joins the two corners at the ends of each arc around one face.
void join_arcs(unsigned connected, int axis, int side, DualPattern& out) {
  const std::array<int, 4> ring = dual_face(axis, side);
  const auto cut_after = [&](int k) {
    return !is_connected(connected, ring[k], dual_face_axis(axis, k));
  };
  for (int k = 0; k < 4; ++k) {
    if (!cut_after(k)) continue;
    // The arc from ring[k + 1] on, to the first octant that is cut from its successor.
    int last = (k + 1) % 4;
    while (!cut_after(last)) last = (last + 1) % 4;
    const int from = dual_corner(ring[(k + 1) % 4], dual_face_axis(axis, k));
    const int to = dual_corner(ring[last], dual_face_axis(axis, last));
    // Octant 0 alone has corners x, y, z, in this order seen from outside. Its arc around the low
    // face along z begins at y and ends at x, and mirrored for high faces.
    const auto a = static_cast<std::uint8_t>(side == 0 ? to : from);
    const auto b = static_cast<std::uint8_t>(side == 0 ? from : to);
    ensures(out.next[a] == kNoSheet, "two arcs leave one corner of a dual cell");
    out.next[a] = b;
    if (last == k) out.tip[a] = static_cast<std::uint8_t>(2 * axis + side);
  }
}

void number_sheets(DualPattern& out) {
  for (int corner = 0; corner < kDualCorners; ++corner) {
    if (out.next[corner] == kNoSheet || out.sheet[corner] != kNoSheet) continue;
    ensures(out.sheets < kMostSheets, "a dual cell has more than eight sheets");
    const std::uint8_t component = out.component[corner / 3];
    out.first[out.sheets] = static_cast<std::uint8_t>(corner);
    for (int o = 0; o < 8; ++o)
      if (out.component[o] == component)
        out.octants[out.sheets] = static_cast<std::uint8_t>(out.octants[out.sheets] | 1 << o);
    for (int at = corner; out.sheet[at] == kNoSheet; at = out.next[at]) out.sheet[at] = out.sheets;
    ++out.sheets;
  }
}

DualPattern make_pattern(unsigned connected) {
  DualPattern out;
  label_components(connected, out);
  out.sheet.fill(kNoSheet);
  out.next.fill(kNoSheet);
  out.tip.fill(kNoSheet);
  for (int axis = 0; axis < 3; ++axis)
    for (int side = 0; side < 2; ++side) join_arcs(connected, axis, side, out);
  number_sheets(out);
  return out;
}

}  // namespace

const DualPattern& dual_pattern(unsigned connected) {
  static const std::vector<DualPattern> table = [] {
    std::vector<DualPattern> all(1u << kDualLinks);
    for (unsigned pattern = 0; pattern < all.size(); ++pattern)
      all[pattern] = make_pattern(pattern);
    return all;
  }();
  return table[connected];
}

}  // namespace kerf
