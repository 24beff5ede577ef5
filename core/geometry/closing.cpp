// SPDX-License-Identifier: MIT
#include "core/geometry/closing.hpp"

#include <unordered_map>

#include "core/base/error.hpp"

namespace kerf {
namespace {

// Edges traversed more often one way than back, by the point they start from. As the boundary of
// a surface they leave every point as often as they reach it, so any walk along them closes.
std::vector<std::vector<std::int32_t>> open_edges(const TriangleMesh& mesh) {
  std::unordered_map<std::uint64_t, std::int32_t> net;  // forth less back, lower point first
  net.reserve(2 * mesh.triangles.size());
  for (const auto& t : mesh.triangles)
    for (unsigned i = 0; i < 3; ++i) {
      const auto a = static_cast<std::uint32_t>(t[i]),
                 b = static_cast<std::uint32_t>(t[(i + 1) % 3]);
      const std::uint64_t low = std::min(a, b), high = std::max(a, b);
      if (low != high) net[low << 32 | high] += a < b ? 1 : -1;
    }
  std::vector<std::pair<std::uint64_t, std::int32_t>> sorted;  // the map's order is not ours
  for (const auto& edge : net)
    if (edge.second != 0) sorted.push_back(edge);
  std::sort(sorted.begin(), sorted.end());
  std::vector<std::vector<std::int32_t>> leaving(sorted.empty() ? 0 : mesh.points.size());
  for (const auto& [key, count] : sorted) {
    const auto low = static_cast<std::int32_t>(key >> 32);
    const auto high = static_cast<std::int32_t>(key & 0xffffffffu);
    for (std::int32_t k = 0; k < std::abs(count); ++k)
      leaving[static_cast<std::size_t>(count > 0 ? low : high)].push_back(count > 0 ? high : low);
  }
  return leaving;
}

void add_fan(const TriangleMesh& mesh, const std::int32_t* begin, const std::int32_t* end,
             TriangleMesh& caps) {
  const auto count = static_cast<std::int32_t>(end - begin);
  const auto first = static_cast<std::int32_t>(caps.points.size());
  Box3 box;
  Vec3d middle{};
  for (const std::int32_t* i = begin; i != end; ++i) {
    const Vec3d& p = mesh.points[static_cast<std::size_t>(*i)];
    caps.points.push_back(p);
    box.add(p);
    middle += (1.0 / count) * p;
  }
  const Vec3d off{0.00061237, 0.00054773, 0.00070711};  // of the loop's size, in no simple ratio
  caps.points.push_back(middle + norm(box.extent()) * off);
  for (std::int32_t i = 0; i < count; ++i)
    caps.triangles.push_back({first + (i + 1) % count, first + i, first + count});
}

}  // namespace

TriangleMesh closing_caps(const TriangleMesh& mesh) {
  std::vector<std::vector<std::int32_t>> leaving = open_edges(mesh);
  TriangleMesh caps;
  constexpr std::int32_t kOff = -1;
  std::vector<std::int32_t> place(leaving.size(), kOff);  // of a point on the path
  std::vector<std::int32_t> path;
  for (std::size_t start = 0; start < leaving.size(); ++start) {
    if (leaving[start].empty()) continue;
    path.assign(1, static_cast<std::int32_t>(start));
    place[start] = 0;
    while (!leaving[static_cast<std::size_t>(path.back())].empty()) {
      auto& choices = leaving[static_cast<std::size_t>(path.back())];
      const std::int32_t next = choices.back();
      choices.pop_back();
      std::int32_t& at = place[static_cast<std::size_t>(next)];
      if (at == kOff) {
        at = static_cast<std::int32_t>(path.size());
        path.push_back(next);
        continue;
      }
      add_fan(mesh, path.data() + at, path.data() + path.size(), caps);
      while (static_cast<std::int32_t>(path.size()) > at + 1) {
        place[static_cast<std::size_t>(path.back())] = kOff;
        path.pop_back();
      }
    }
    ensures(path.size() == 1, "the open edges of a mesh form loops");
    place[start] = kOff;
  }
  return caps;
}

}  // namespace kerf
