// SPDX-License-Identifier: MIT
#include "app/mesh_io.hpp"

#include <assimp/scene.h>

#include <assimp/Importer.hpp>
#include <cctype>
#include <fstream>
#include <iterator>
#include <limits>

#include "app/mesh_parse.hpp"
#include "core/base/error.hpp"

namespace kerf {
namespace {

std::string lower_extension(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

void check_file(const std::filesystem::path& path) {
  namespace fs = std::filesystem;
  const std::string name = path.string();
  std::error_code failure;
  const fs::file_status status = fs::status(path, failure);
  expects(fs::exists(status), text(name, ": no such file"));
  expects(!fs::is_directory(status), text(name, ": is a folder, not a mesh file"));
  expects(fs::is_regular_file(status), text(name, ": is not a regular file"));
  const std::string extension = lower_extension(path);
  expects(extension == ".obj" || extension == ".ply" || extension == ".off" || extension == ".stl",
          text(name, ": unknown kind of mesh '", extension,
               "'; supported are .obj, .ply, .off and .stl"));
  std::ifstream in(path, std::ios::binary);
  expects(in.good(), text(name, ": cannot be opened for reading"));
  expects(in.peek() != std::ifstream::traits_type::eof(), text(name, ": the file is empty"));
}

std::string whole_file(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(in), {}};
  expects(!in.bad(), text(path.string(), ": cannot be read"));
  return bytes;
}

TriangleMesh join(const aiScene& scene, const std::string& name) {
  TriangleMesh mesh;
  constexpr auto kMostPoints = static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max());
  for (unsigned m = 0; m < scene.mNumMeshes; ++m) {
    const aiMesh& part = *scene.mMeshes[m];
    const std::size_t first = mesh.points.size();
    expects(first + part.mNumVertices <= kMostPoints, text(name, ": the mesh is too large"));
    for (unsigned i = 0; i < part.mNumVertices; ++i) {
      const aiVector3D& p = part.mVertices[i];
      mesh.points.push_back(
          {static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)});
    }
    for (unsigned i = 0; i < part.mNumFaces; ++i) {
      const aiFace& face = part.mFaces[i];
      for (unsigned k = 0; k < face.mNumIndices; ++k)
        expects(face.mIndices[k] < part.mNumVertices,
                text(name, ": a face refers to point ", face.mIndices[k], ", but there are ",
                     part.mNumVertices));
      add_polygon(mesh, face.mIndices, face.mNumIndices, first);  // none of points and lines
    }
  }
  return mesh;
}

}  // namespace

TriangleMesh read_mesh(const std::filesystem::path& path) {
  check_file(path);
  const std::string name = path.string(), extension = lower_extension(path);
  TriangleMesh mesh;
  try {
    if (extension == ".off") {
      mesh = parse_off(whole_file(path), name);
    } else if (extension == ".ply") {
      mesh = parse_ply(whole_file(path), name);
    } else {
      Assimp::Importer importer;
      const aiScene* scene = importer.ReadFile(name, 0);  // its own triangulation aborts on some
      expects(scene != nullptr,                           // damaged files: polygons are split here
              text(name, ": cannot be read as a mesh: ", importer.GetErrorString()));
      mesh = join(*scene, name);
    }
  } catch (const Error&) {
    throw;
  } catch (const std::exception& failure) {
    throw Error(ErrorKind::bad_input, text(name, ": cannot be read as a mesh: ", failure.what()));
  }
  expects(!mesh.triangles.empty(), text(name, ": the file holds no triangles"));
  check_finite(mesh, name);
  mesh = weld(mesh);
  expects(!mesh.triangles.empty(), text(name, ": all triangles of the file are degenerate"));
  return mesh;
}

}  // namespace kerf
