// SPDX-License-Identifier: MIT
#include "core/surface/triangle_store.hpp"

#include <algorithm>
#include <limits>

#include "core/base/array.hpp"
#include "core/base/error.hpp"

namespace kerf {
namespace {

/// An index that was freed, or the next one at the end of an array that holds `size`.
std::int32_t take(std::vector<std::int32_t>& free, std::size_t size) {
  if (!free.empty()) {
    const std::int32_t i = free.back();
    free.pop_back();
    return i;
  }
  if (size >= static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max()) / 3)
    throw Error(ErrorKind::unavailable,
                "the surface has more than 7e8 triangles: lower the resolution");
  return static_cast<std::int32_t>(size);
}

}  // namespace

std::int32_t TriangleStore::add_vertex(std::uint64_t key, const Vertex& vertex) {
  const std::int32_t v = take(free_vertices_, reference.size());
  if (static_cast<std::size_t>(v) == reference.size()) {
    reference.emplace_back();
    finest_cell.emplace_back();
    vertex_key.push_back(0);
    first_corner.push_back(-1);
    used.push_back(0);
    first_normal_.push_back(-1);
    is_changed_.push_back(0);
  }
  used[v] = 1;
  vertex_key[v] = key;
  set_vertex(v, vertex);
  return v;
}

void TriangleStore::set_vertex(std::int32_t v, const Vertex& vertex) {
  reference[v] = vertex.reference;
  finest_cell[v] = vertex.cell;
  moved_.push_back(v);
}

void TriangleStore::remove_vertex(std::int32_t v) {
  ensures(used[v] != 0 && first_corner[v] < 0, "a vertex is removed under its triangles");
  used[v] = 0;
  mark(v);  // its normals are to be freed
  moved_.push_back(v);
  free_vertices_.push_back(v);
}

bool TriangleStore::comes_before(std::int32_t a, std::int32_t b) const {
  const std::int32_t s = a / 3, t = b / 3;
  return group[s] != group[t] ? group[s] < group[t] : order[s] < order[t];
}

void TriangleStore::mark(std::int32_t v) {
  if (is_changed_[v] != 0) return;
  is_changed_[v] = 1;
  changed_.push_back(v);
}

std::int32_t TriangleStore::add_triangle(const std::array<std::int32_t, 3>& vertices,
                                         std::int32_t group_of_all, const Vec3f& normal,
                                         std::uint64_t place) {
  const std::int32_t t = take(free_triangles_, triangles.size());
  if (static_cast<std::size_t>(t) == triangles.size()) {
    triangles.emplace_back();
    group.push_back(0);
    true_normal.emplace_back();
    order.push_back(0);
    next_corner.resize(next_corner.size() + 3, -1);
    normal_of.resize(normal_of.size() + 3, -1);
  }
  triangles[t] = vertices;
  group[t] = group_of_all;
  true_normal[t] = normal;
  order[t] = place;
  for (int k = 0; k < 3; ++k) {
    const std::int32_t corner = 3 * t + k, v = vertices[static_cast<std::size_t>(k)];
    std::int32_t* at = &first_corner[v];
    while (*at >= 0 && comes_before(*at, corner)) at = &next_corner[*at];
    next_corner[corner] = *at;
    *at = corner;
    mark(v);
  }
  return t;
}

void TriangleStore::remove_triangle(std::int32_t t) {
  for (int k = 0; k < 3; ++k) {
    const std::int32_t corner = 3 * t + k, v = triangles[t][static_cast<std::size_t>(k)];
    std::int32_t* at = &first_corner[v];
    while (*at != corner) at = &next_corner[*at];
    *at = next_corner[corner];
    mark(v);
  }
  triangles[t] = {0, 0, 0};
  free_triangles_.push_back(t);
}

/// Brings the corners of a vertex into the order of the list, and their smooth parts to around_.
void TriangleStore::part_at_creases(std::int32_t v) {
  constexpr float kCrease =
      0.64F;  // cosine of 50 degrees: an edge of the object, not its curvature
  around_.clear();
  for (std::int32_t c = first_corner[v]; c >= 0; c = next_corner[c]) around_.push_back({c, 0});
  std::sort(around_.begin(), around_.end(),
            [&](const Around& a, const Around& b) { return comes_before(a.corner, b.corner); });
  parts_.clear();  // the first triangle of each
  std::size_t of_group = 0;
  for (Around& a : around_) {
    const std::int32_t t = a.corner / 3;
    if (!parts_.empty() && group[t] != group[parts_.back()]) of_group = parts_.size();
    std::size_t part = of_group;
    while (part < parts_.size() && !(dot(true_normal[parts_[part]], true_normal[t]) > kCrease))
      ++part;
    if (part == parts_.size()) parts_.push_back(t);
    a.part = static_cast<std::int32_t>(part);
  }
  std::stable_sort(around_.begin(), around_.end(),
                   [](const Around& a, const Around& b) { return a.part < b.part; });
  std::int32_t* link = &first_corner[v];
  for (const Around& a : around_) {
    *link = a.corner;
    link = &next_corner[a.corner];
  }
  *link = -1;
}

std::int32_t TriangleStore::take_normal(std::int32_t v) {
  const std::int32_t normal = take(free_normals_, normals_);
  if (static_cast<std::size_t>(normal) == normals_) {
    ++normals_;
    next_normal_.push_back(-1);
  }
  next_normal_[normal] = first_normal_[v];
  first_normal_[v] = normal;
  return normal;
}

void TriangleStore::finish() {
  for (const std::int32_t v : changed_)
    while (first_normal_[v] >= 0) {
      free_normals_.push_back(first_normal_[v]);
      first_normal_[v] = next_normal_[first_normal_[v]];
    }
  for (const std::int32_t v : changed_) {
    is_changed_[v] = 0;
    part_at_creases(v);
    std::int32_t normal = -1;
    for (std::size_t i = 0; i < around_.size(); ++i) {
      if (i == 0 || around_[i].part != around_[i - 1].part) normal = take_normal(v);
      normal_of[around_[i].corner] = normal;
    }
  }
  changed_.clear();
}

void TriangleStore::forget_changes() {
  const auto forget = [](auto&... arrays) { ((arrays = {}), ...); };
  forget(reference, finest_cell, true_normal, first_normal_, next_normal_, changed_, moved_,
         is_changed_, around_, parts_);
  if (free_vertices_.empty() && free_triangles_.empty() &&
      std::is_sorted(vertex_key.begin(), vertex_key.end()) &&
      std::is_sorted(order.begin(), order.end()))
    forget(vertex_key, order, used);
  if (std::all_of(group.begin(), group.end(), [](std::int32_t g) { return g == 0; })) forget(group);
  const auto fit = [](auto&... arrays) { (arrays.shrink_to_fit(), ...); };
  fit(vertex_key, first_corner, used, triangles, group, order, next_corner, normal_of,
      free_vertices_, free_triangles_, free_normals_);
}

std::size_t TriangleStore::bytes() const {
  const auto sum = [](const auto&... arrays) { return (bytes_of(arrays) + ...); };
  return sum(reference, finest_cell, vertex_key, first_corner, triangles, group, true_normal, order,
             next_corner, normal_of, used, first_normal_, next_normal_, free_vertices_,
             free_triangles_, free_normals_, changed_, moved_, is_changed_, around_, parts_);
}

}  // namespace kerf
