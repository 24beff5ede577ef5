// SPDX-License-Identifier: MIT
#include "app/ply.hpp"

#include <bit>

#include "app/colours.hpp"
#include "app/corner_normals.hpp"
#include "app/output_file.hpp"
#include "app/version.hpp"
#include "core/base/error.hpp"

namespace kerf {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers are written as they lie");

std::string header(const SurfaceMesh& s) {
  return text("ply\nformat binary_little_endian 1.0\ncomment kerf ", kVersion, ", metres\n",
              "element vertex ", s.reference.size(),
              "\nproperty double x\nproperty double y\nproperty double z\n"
              "property float nx\nproperty float ny\nproperty float nz\n",
              "element face ", s.triangles.size(),
              "\nproperty list uchar int vertex_indices\nproperty int cut_id\nproperty int piece\n"
              "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n");
}

template <class T>
void append(std::string& bytes, const T& value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

}  // namespace

void write_ply(const std::filesystem::path& file, const SurfaceMesh& surface) {
  const std::vector<Vec3f> normals = point_normals(
      corner_normals(surface.triangles, triangle_normals(surface)), surface.reference.size());
  std::string bytes = header(surface);
  for (std::size_t p = 0; p < surface.reference.size(); ++p) {
    append(bytes, surface.position(static_cast<std::int32_t>(p)));
    append(bytes, normals[p]);
  }
  for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
    append(bytes, std::uint8_t{3});
    append(bytes, surface.triangles[t]);
    append(bytes, surface.cut_id[t]);
    append(bytes, surface.piece[static_cast<std::size_t>(surface.triangles[t][0])]);
    append(bytes, cut_colour_bytes(surface.cut_id[t]));
  }
  write_file(file, [&](std::ostream& out) {
    out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  });
}

}  // namespace kerf
