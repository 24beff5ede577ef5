// SPDX-License-Identifier: MIT
//
// Layout  one buffer; each array has a view of its own, so that no stride is needed, and starts at
//         a multiple of 4, as all of them hold numbers of 4 bytes.
// Source  glTF 2.0 specification, sections 3.6 and 3.7.
#include "app/glb.hpp"

#include <tiny_gltf.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>

#include "app/colours.hpp"
#include "app/corner_normals.hpp"
#include "app/output_file.hpp"
#include "app/version.hpp"
#include "core/base/error.hpp"

namespace kerf {
namespace {

constexpr double kRoughness = 0.6;  // moist tissue and rubber: a broad, weak highlight
// Squares of lengths up to this are finite in single precision.
constexpr double kFarthest = 1e15;
// A GLB file counts its bytes in 32 bits; a triangle takes 12, and 24 more for each own vertex.
constexpr std::size_t kMostTriangles = 50'000'000;

/// The middle of the deformed surface, computed in single precision, so that a reader that works in
/// it knows the same middle.
Vec3d middle_of(const SurfaceMesh& surface) {
  constexpr float kHuge = std::numeric_limits<float>::max();
  Vec3f lo{kHuge, kHuge, kHuge}, hi = -lo;
  for (const auto& triangle : surface.triangles)
    for (const std::int32_t p : triangle) {
      const Vec3d place = surface.position(p);
      for (int d = 0; d < 3; ++d) {
        lo[d] = std::min(lo[d], static_cast<float>(place[d]));
        hi[d] = std::max(hi[d], static_cast<float>(place[d]));
      }
    }
  const Vec3f middle = 0.5f * (lo + hi);
  return {middle.x, middle.y, middle.z};
}

/// The vertices and triangles of one cut id.
struct Part {
  std::vector<Vec3f> positions, normals;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// Splits the surface by cut id, and its points where normals differ.
std::map<std::int32_t, Part> split(const SurfaceMesh& surface, const Vec3d& middle) {
  const CornerNormals corners = corner_normals(surface.triangles, triangle_normals(surface));
  std::map<std::int32_t, std::vector<std::size_t>> by_cut;
  for (std::size_t t = 0; t < surface.triangles.size(); ++t) by_cut[surface.cut_id[t]].push_back(t);

  constexpr std::uint32_t kNone = ~0u;
  std::vector<std::uint32_t> vertex_of(corners.point.size(), kNone);  // within one part
  std::map<std::int32_t, Part> parts;
  for (const auto& [id, triangles] : by_cut) {
    Part& part = parts[id];
    std::vector<std::size_t> used;
    for (const std::size_t t : triangles) {
      auto& out = part.triangles.emplace_back();
      for (std::size_t k = 0; k < 3; ++k) {
        const auto pair = static_cast<std::size_t>(corners.triangles[t][k]);
        if (vertex_of[pair] == kNone) {
          vertex_of[pair] = static_cast<std::uint32_t>(used.size());
          used.push_back(pair);
          const Vec3d p = surface.position(corners.point[pair]) - middle;
          part.positions.push_back(
              {static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)});
          part.normals.push_back(corners.normal[pair]);
        }
        out[k] = vertex_of[pair];
      }
    }
    for (const std::size_t pair : used) vertex_of[pair] = kNone;
  }
  return parts;
}

/// Appends an array to the buffer, with its view; returns the accessor's number.
template <class T>
int add_array(tinygltf::Model& model, const std::vector<T>& values, int target, int component,
              int type) {
  auto& bytes = model.buffers[0].data;
  tinygltf::BufferView view;
  view.buffer = 0;
  view.byteOffset = bytes.size();
  view.byteLength = values.size() * sizeof(T);
  view.target = target;
  bytes.resize(bytes.size() + view.byteLength);
  std::memcpy(bytes.data() + view.byteOffset, values.data(), view.byteLength);

  tinygltf::Accessor accessor;
  accessor.bufferView = static_cast<int>(model.bufferViews.size());
  accessor.componentType = component;
  accessor.type = type;
  accessor.count = values.size();
  if (type == TINYGLTF_TYPE_SCALAR) accessor.count *= sizeof(T) / sizeof(std::uint32_t);
  model.bufferViews.push_back(view);
  model.accessors.push_back(accessor);
  return static_cast<int>(model.accessors.size()) - 1;
}

void add_bounds(tinygltf::Accessor& accessor, const std::vector<Vec3f>& positions) {
  Box3 box;
  for (const Vec3f& p : positions) box.add(Vec3d{p.x, p.y, p.z});
  accessor.minValues = {box.lo.x, box.lo.y, box.lo.z};
  accessor.maxValues = {box.hi.x, box.hi.y, box.hi.z};
}

tinygltf::Primitive add_part(tinygltf::Model& model, std::int32_t cut_id, const Part& part) {
  tinygltf::Material material;
  material.name = cut_id == 0 ? "own surface" : text("cut ", cut_id);
  const Vec3f colour = cut_colour(cut_id);
  material.pbrMetallicRoughness.baseColorFactor = {colour.x, colour.y, colour.z, 1};
  material.pbrMetallicRoughness.metallicFactor = 0;
  material.pbrMetallicRoughness.roughnessFactor = kRoughness;

  tinygltf::Primitive primitive;
  primitive.mode = TINYGLTF_MODE_TRIANGLES;
  primitive.material = static_cast<int>(model.materials.size());
  model.materials.push_back(material);
  const int positions = add_array(model, part.positions, TINYGLTF_TARGET_ARRAY_BUFFER,
                                  TINYGLTF_COMPONENT_TYPE_FLOAT, TINYGLTF_TYPE_VEC3);
  add_bounds(model.accessors[static_cast<std::size_t>(positions)], part.positions);
  primitive.attributes["POSITION"] = positions;
  primitive.attributes["NORMAL"] = add_array(model, part.normals, TINYGLTF_TARGET_ARRAY_BUFFER,
                                             TINYGLTF_COMPONENT_TYPE_FLOAT, TINYGLTF_TYPE_VEC3);
  primitive.indices = add_array(model, part.triangles, TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER,
                                TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT, TINYGLTF_TYPE_SCALAR);
  return primitive;
}

}  // namespace

std::string glb_obstacle(const SurfaceMesh& surface) {
  if (surface.triangles.size() > kMostTriangles)
    return text("it has more than ", kMostTriangles, " triangles");
  for (std::size_t p = 0; p < surface.reference.size(); ++p)
    if (!(norm(surface.position(static_cast<std::int32_t>(p))) < kFarthest))
      return "the body reaches too far";
  for (const Vec3d& n : surface.normals)
    if (!(std::abs(norm(n) - 1) < 1e-3)) return "a normal is not of unit length";
  return {};
}

void write_glb(const std::filesystem::path& file, const SurfaceMesh& surface) {
  const std::string obstacle = glb_obstacle(surface);
  expects(obstacle.empty(), text(file.string(), ": cannot be written: ", obstacle));

  tinygltf::Model model;
  model.asset.version = "2.0";
  model.asset.generator = text("kerf ", kVersion);
  model.defaultScene = 0;
  auto& scene = model.scenes.emplace_back();
  scene.name = "kerf";
  if (!surface.triangles.empty()) {  // glTF knows no empty mesh
    const Vec3d middle = middle_of(surface);
    model.buffers.emplace_back();
    tinygltf::Mesh mesh;
    mesh.name = "surface";
    for (const auto& [id, part] : split(surface, middle))
      mesh.primitives.push_back(add_part(model, id, part));
    model.meshes.push_back(mesh);
    tinygltf::Node node;
    node.name = "body";
    node.mesh = 0;
    node.translation = {middle.x, middle.y, middle.z};
    model.nodes.push_back(node);
    scene.nodes = {0};
  }
  write_file(file, [&](std::ostream& out) {
    tinygltf::TinyGLTF().WriteGltfSceneToStream(&model, out, false, true);
  });
}

}  // namespace kerf
