// SPDX-License-Identifier: MIT
//
// The inside of a mesh, on a lattice.
//
// If every edge is traversed as often forth as back, the winding number at a centre is the signed
// number of triangles that its line along x crosses, an exact integer W. Otherwise caps close the
// mesh, and W less the field of the caps is the generalised winding number of the mesh alone, which
// passes 1/2 in the holes. Rounded, that is again an integer, and everything else is the same.
#include <cmath>
#include <optional>
#include <utility>

#include "core/base/error.hpp"
#include "core/body/link_walk.hpp"
#include "core/body/mesh_crossings.hpp"
#include "core/body/solid.hpp"
#include "core/body/winding_fill.hpp"
#include "core/geometry/closing.hpp"
#include "core/geometry/winding.hpp"

namespace kerf {
namespace {

// Winding numbers are kept in a byte each; more layers than this are counted as this many.
constexpr int kMostLayers = 127;

std::uint8_t to_byte(int winding) {
  return static_cast<std::uint8_t>(
      static_cast<std::int8_t>(std::clamp(winding, -kMostLayers, kMostLayers)));
}
int from_byte(std::uint8_t byte) { return static_cast<std::int8_t>(byte); }

// The winding number of every cell centre, as a byte, from the crossings along x.
std::vector<std::uint8_t> winding_numbers(const MeshCrossings& found, const Lattice& lattice) {
  std::vector<std::uint8_t> winding(lattice.cells());
  auto next = found.crossings.begin();
  const auto end = found.crossings.end();
  std::size_t cell = 0, row = 0;
  for (std::int32_t z = 0; z < lattice.size[2]; ++z)
    for (std::int32_t y = 0; y < lattice.size[1]; ++y, ++row) {
      int w = found.row_start[row];
      const LinkKey before_row = lattice.link_key({-1, y, z}, 0);
      for (std::int32_t x = 0; x < lattice.size[0]; ++x, ++cell) {
        winding[cell] = to_byte(w);
        const LinkKey link = before_row + 3 * static_cast<LinkKey>(x + 1);
        while (next != end && next->link < link) ++next;
        for (; next != end && next->link == link; ++next) w -= next->leaving;
      }
    }
  return winding;
}

class MeshSolid final : public Solid {
 public:
  MeshSolid(TriangleMesh mesh, std::string name)
      : mesh_(std::move(mesh)),
        name_(std::move(name)),
        report_(inspect(mesh_)),
        bounds_(mesh_.bounds()),
        drawn_(mesh_.triangles.size()) {
    if (report_.unbalanced_edges == 0) return;
    const TriangleMesh caps = closing_caps(mesh_);
    cap_field_.emplace(caps);
    const auto first = static_cast<std::int32_t>(mesh_.points.size());
    mesh_.points.insert(mesh_.points.end(), caps.points.begin(), caps.points.end());
    for (const auto& t : caps.triangles)
      mesh_.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  }

  Box3 bounds() const override { return bounds_; }

  SolidSamples sample(const Lattice& lattice) const override {
    MeshCrossings found = cross_lattice(mesh_, drawn_, lattice);
    SolidSamples out;
    out.inside = winding_numbers(found, lattice);
    std::vector<std::int8_t> field;  // of the caps, rounded
    if (cap_field_) {
      field = rounded_winding(*cap_field_, lattice);
      for (std::size_t i = 0; i < field.size(); ++i)
        out.inside[i] = to_byte(from_byte(out.inside[i]) - field[i]);
    }
    const double turn = settle_orientation(found, out);
    collect(lattice, found, field, turn, out);
    for (std::uint8_t& byte : out.inside) byte = byte != 0 ? 1 : 0;
    return out;
  }

 private:
  // Warns of what is unusual, turns what is inverted, and leaves 0 in out.inside for every centre
  // outside, the winding number for those inside. Returns -1 if the mesh was turned, else 1.
  double settle_orientation(MeshCrossings& found, SolidSamples& out) const {
    warn_of_edges(out);
    int least = 0, most = 0;
    for (const std::uint8_t byte : out.inside) {
      least = std::min(least, from_byte(byte));
      most = std::max(most, from_byte(byte));
    }
    const bool inverted = least < 0 && most <= 0;
    if (inverted) {
      out.warnings.push_back(text(name_, ": the surface faces inwards; it was turned"));
      for (MeshCrossing& c : found.crossings) {
        c.leaving = -c.leaving;
        c.normal = -c.normal;
      }
      for (std::uint8_t& byte : out.inside) byte = to_byte(-from_byte(byte));
      most = -least;
      least = 0;
    }
    if (cap_field_) {
      for (std::uint8_t& byte : out.inside) byte = to_byte(std::max(from_byte(byte), 0));
    } else if (least < 0) {
      out.warnings.push_back(
          text(name_,
               ": some parts face inwards or the surface intersects itself (winding numbers "
               "from ",
               least, " to ", most,
               "); every point with a winding number other than 0 is taken as inside"));
    } else if (most > 1) {
      out.warnings.push_back(text(name_,
                                  ": the surface intersects or encloses itself (winding "
                                  "numbers up to ",
                                  most, "); overlapping parts are taken as one"));
    }
    return inverted ? -1 : 1;
  }

  void warn_of_edges(SolidSamples& out) const {
    if (report_.boundary_edges + report_.nonmanifold_edges + report_.misoriented_edges == 0) return;
    out.warnings.push_back(text(name_, ": ", report_.boundary_edges, " boundary edges, ",
                                report_.nonmanifold_edges, " non-manifold edges, ",
                                report_.misoriented_edges, " misoriented edges; ",
                                cap_field_ ? "the inside is where the generalised winding number "
                                             "exceeds 1/2"
                                           : "the inside is still well defined"));
  }

  // Records the crossings of all links with an end inside: those of a link's crossings that bound
  // the material, where the inside changes.
  void collect(const Lattice& lattice, const MeshCrossings& found,
               const std::vector<std::int8_t>& field, double turn, SolidSamples& out) const {
    const MeshCrossing* next = found.crossings.data();
    const MeshCrossing* const all = next + found.crossings.size();
    for_each_link(
        lattice, out.inside, [&](LinkKey key, const Vec3i& c, int axis, bool p_in, bool q_in) {
          while (next != all && next->link < key) ++next;
          const MeshCrossing* const begin = next;
          while (next != all && next->link == key) ++next;
          if (begin == next && p_in == q_in) return;
          const auto [first, last] =
              begin == next ? Pair{}
                            : bounding({begin, next}, lattice, c, axis, out.inside, field, turn);
          if (first != nullptr) {
            const auto hit = [](const MeshCrossing& k) {
              return LinkHit{k.at, {k.normal.x, k.normal.y, k.normal.z}};
            };
            out.crossings.emplace_back(key,
                                       make_link_cut(hit(*first), hit(*last), lattice.spacing));
          } else if (p_in != q_in) {
            const LinkHit middle = half_way(axis, p_in);
            out.crossings.emplace_back(key, make_link_cut(middle, middle, lattice.spacing));
          }
        });
  }

  using Pair = std::pair<const MeshCrossing*, const MeshCrossing*>;

  // The first and the last of the crossings [range.first, range.second) of the link from c along
  // `axis` where the inside changes; null if there is none.
  Pair bounding(Pair range, const Lattice& lattice, const Vec3i& c, int axis,
                const std::vector<std::uint8_t>& inside, const std::vector<std::int8_t>& field,
                double turn) const {
    Vec3i d = c;
    ++d[static_cast<unsigned>(axis)];
    bool here = lattice.inside(c) && inside[lattice.index(c)] != 0;
    const bool end_in = lattice.inside(d) && inside[lattice.index(d)] != 0;
    // W before the first crossing, from an end that is inside.
    const std::size_t known = lattice.index(here ? c : d);
    int w = from_byte(inside[known]);
    if (cap_field_) w += static_cast<int>(turn) * field[known];
    if (!here)
      for (const MeshCrossing* k = range.first; k != range.second; ++k) w += k->leaving;
    Pair out{};
    for (const MeshCrossing* k = range.first; k != range.second; ++k) {
      w -= k->leaving;
      bool after = w != 0;
      if (cap_field_ && k + 1 == range.second) {
        after = end_in;
      } else if (cap_field_) {
        Vec3d between = lattice.center(c);
        between[axis] += 0.5 * (k->at + k[1].at) * lattice.spacing;
        after = w - turn * (*cap_field_)(between) > 0.5;
      }
      if (after != here && k->drawn) {
        if (out.first == nullptr) out.first = k;
        out.second = k;
      }
      here = after;
    }
    return out;
  }

  TriangleMesh mesh_;
  std::string name_;
  MeshReport report_;
  Box3 bounds_;
  std::size_t drawn_ = 0;                 // triangles of the mesh; caps follow
  std::optional<WindingTree> cap_field_;  // of the caps, if there are any
};

// Whether all points lie in one plane, but for rounding.
bool is_flat(const TriangleMesh& mesh) {
  Vec3d normal{}, origin{};
  for (const auto& t : mesh.triangles) {
    const Vec3d& a = mesh.points[static_cast<std::size_t>(t[0])];
    const Vec3d n = cross(mesh.points[static_cast<std::size_t>(t[1])] - a,
                          mesh.points[static_cast<std::size_t>(t[2])] - a);
    if (norm(n) > norm(normal)) {
      normal = n;
      origin = a;
    }
  }
  if (norm(normal) == 0) return true;
  normal *= 1 / norm(normal);
  double thickness = 0;
  for (const auto& t : mesh.triangles)
    for (const std::int32_t i : t)
      thickness = std::max(
          thickness, std::abs(dot(normal, mesh.points[static_cast<std::size_t>(i)] - origin)));
  constexpr double kRounding = 1e-12;  // of the size of the mesh
  return thickness <= kRounding * norm(mesh.bounds().extent());
}

}  // namespace

std::unique_ptr<Solid> make_mesh_solid(TriangleMesh mesh, std::string name) {
  expects(!mesh.triangles.empty(), text(name, ": a mesh without triangles has no inside"));
  check_finite(mesh, name);
  TriangleMesh welded = weld(mesh);
  expects(!welded.triangles.empty() && !is_flat(welded),
          text(name, ": the mesh is flat and encloses no volume"));
  return std::make_unique<MeshSolid>(std::move(welded), std::move(name));
}

}  // namespace kerf
