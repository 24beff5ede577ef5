// SPDX-License-Identifier: MIT
#include "core/surface/surface.hpp"

#include <algorithm>
#include <utility>

#include "core/base/array.hpp"
#include "core/base/error.hpp"
#include "core/surface/surface_builder.hpp"

namespace kerf {
namespace {

std::unique_ptr<SurfaceBuilder> make_builder(SurfaceMethod method) {
  switch (method) {
    case SurfaceMethod::dual_contouring:
      return make_dual_contouring();
    case SurfaceMethod::splitting_cubes:
      return make_splitting_cubes();
    case SurfaceMethod::none:
      break;
  }
  throw Error(ErrorKind::bad_input, "a surface needs a method other than none");
}

/// Appends the dual cells around a link.
void add_points(const Lattice& lattice, LinkKey link, std::vector<GridKey>& points) {
  for (const Vec3i& p : face_points(lattice.link_lower(link), Lattice::link_axis(link)))
    points.push_back(point_key(lattice, p));
}

}  // namespace

Surface::Surface(const LinkedOctree& body, SurfaceMethod method) : builder_(make_builder(method)) {
  std::vector<GridKey> points;
  points.reserve(4 * body.records().size());
  for (const auto& [link, cut] : body.records()) add_points(body.lattice(), link, points);
  rebuild(body, std::move(points));
}
Surface::~Surface() = default;
Surface::Surface(Surface&&) noexcept = default;
Surface& Surface::operator=(Surface&&) noexcept = default;

void Surface::update(const LinkedOctree& body, const CutEvent& event) {
  std::vector<GridKey> points;
  points.reserve(4 * (event.disconnected.size() + event.moved.size()));
  for (const LinkKey link : event.disconnected) add_points(body.lattice(), link, points);
  for (const LinkKey link : event.moved) add_points(body.lattice(), link, points);
  rebuild(body, std::move(points));
}

void Surface::forget_changes() {
  builder_.reset();
  store_.forget_changes();
  points_.shrink_to_fit();
  in_larger_ = {};
}

void Surface::rebuild(const LinkedOctree& body, std::vector<GridKey> points) {
  std::sort(points.begin(), points.end());
  points.erase(std::unique(points.begin(), points.end()), points.end());
  ensures(builder_ != nullptr, "a surface that forgot how to change is asked to");
  builder_->rebuild(body, points, store_);
  store_.finish();
}

void Surface::bind(const LinkedOctree& body) {
  ensures(builder_ != nullptr, "a surface that forgot how to change is asked to be bound");
  points_.resize(store_.vertex_slots());
  for (const std::int32_t v : store_.take_moved()) bind_vertex(body, v);
  for (; splits_seen_ < body.splits().size(); ++splits_seen_) {
    const auto split = in_larger_.extract(body.splits()[splits_seen_]);
    if (split.empty()) continue;
    for (const std::int32_t v : split.mapped()) bind_vertex(body, v);
  }
}

void Surface::bind_vertex(const LinkedOctree& body, std::int32_t v) {
  points_[v] = {};
  if (store_.used[v] == 0) return;
  const std::int32_t leaf = body.leaf_at(store_.finest_cell[v]);
  const LinkedOctree::Node& node = body.nodes()[leaf];
  const double side = body.lattice().spacing * (1 << node.size_log2);
  const Vec3d& x = store_.reference[v];
  points_[v] = {x, (1 / side) * (x - body.lattice().point(node.corner)), body.leaf_number(leaf)};
  if (node.size_log2 > 0) in_larger_[points_[v].cell].push_back(v);
}

SurfaceView Surface::view() const {
  return {points_,          store_.triangles,     store_.first_corner, store_.next_corner,
          store_.normal_of, store_.normal_slots()};
}

std::size_t Surface::bytes() const {
  return store_.bytes() + (builder_ ? builder_->bytes() : 0) + bytes_of(points_);
}

SurfaceMesh Surface::mesh(std::span<const Vec3d> positions, std::span<const Vec3d> normals,
                          std::span<const std::int32_t> piece) const {
  SurfaceMesh out;
  std::vector<std::int32_t> order, number(store_.vertex_slots(), -1);
  for (std::size_t v = 0; v < number.size(); ++v)
    if (store_.used.empty() || store_.used[v] != 0) order.push_back(static_cast<std::int32_t>(v));
  if (!store_.vertex_key.empty())
    std::sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) {
      return store_.vertex_key[a] < store_.vertex_key[b];
    });
  for (const std::int32_t v : order) {
    number[v] = static_cast<std::int32_t>(out.reference.size());
    out.reference.push_back(points_[v].reference);
    out.displacement.push_back(positions[v] - points_[v].reference);
    out.piece.push_back(piece[points_[v].cell]);
  }

  order.clear();
  for (std::size_t t = 0; t < store_.triangle_slots(); ++t)
    if (store_.triangles[t][0] != store_.triangles[t][1])
      order.push_back(static_cast<std::int32_t>(t));
  if (!store_.order.empty())
    std::sort(order.begin(), order.end(),
              [&](std::int32_t a, std::int32_t b) { return store_.order[a] < store_.order[b]; });
  std::vector<std::int32_t> normal_number(store_.normal_slots(), -1);
  for (const std::int32_t t : order) {
    std::array<std::int32_t, 3> corners, normal;
    for (std::size_t k = 0; k < 3; ++k) {
      corners[k] = number[store_.triangles[t][k]];
      const std::int32_t n = store_.normal_of[3 * static_cast<std::size_t>(t) + k];
      if (normal_number[n] < 0) {
        normal_number[n] = static_cast<std::int32_t>(out.normals.size());
        out.normals.push_back(normals[n]);
      }
      normal[k] = normal_number[n];
    }
    out.triangles.push_back(corners);
    out.normal_of.push_back(normal);
    out.cut_id.push_back(store_.group.empty() ? 0 : store_.group[t]);
  }
  return out;
}

}  // namespace kerf
