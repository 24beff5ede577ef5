// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>

#include "app/mesh_io.hpp"
#include "core/base/error.hpp"
#include "tests/support/meshes.hpp"

// assimp leaks on damaged files; the leak sanitizer asks this function what to pass over.
extern "C" const char* __lsan_default_suppressions();  // NOLINT(bugprone-reserved-identifier)
extern "C" const char* __lsan_default_suppressions() { return "leak:libassimp"; }  // NOLINT

namespace kerf {
namespace {

namespace fs = std::filesystem;

const Box3 kBox{{1, 2, 3}, {2, 4, 6}};

TriangleMesh box() { return test::box_mesh(kBox, 2); }

std::string obj(const TriangleMesh& mesh) {
  std::ostringstream out;
  out << "# a box\nmtllib missing.mtl\no first\n";
  for (const Vec3d& p : mesh.points) out << "v " << p.x << ' ' << p.y << ' ' << p.z << '\n';
  out << "vn 0 0 1\nvt 0.5 0.5\n";
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    if (i == 7) out << "o second\nusemtl skin\n";
    out << 'f';
    for (const std::int32_t k : mesh.triangles[i]) out << ' ' << k + 1 << "/1/1";
    out << '\n';
  }
  return out.str();
}

std::string off(const TriangleMesh& mesh) {
  std::ostringstream out;
  out << "OFF\n" << mesh.points.size() << ' ' << mesh.triangles.size() << " 0\n";
  for (const Vec3d& p : mesh.points) out << p.x << ' ' << p.y << ' ' << p.z << '\n';
  for (const auto& t : mesh.triangles) out << "3 " << t[0] << ' ' << t[1] << ' ' << t[2] << '\n';
  return out.str();
}

template <class T>
void put(std::string& out, T value) {
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  out.append(bytes, sizeof(T));
}

std::string ply(const TriangleMesh& mesh, bool binary) {
  std::ostringstream head;
  head << "ply\nformat " << (binary ? "binary_little_endian" : "ascii") << " 1.0\nelement vertex "
       << mesh.points.size() << "\nproperty float x\nproperty float y\nproperty float z\n"
       << "element face " << mesh.triangles.size()
       << "\nproperty list uchar int vertex_indices\nend_header\n";
  std::string out = head.str();
  std::ostringstream lines;
  for (const Vec3d& p : mesh.points) {
    lines << p.x << ' ' << p.y << ' ' << p.z << '\n';
    if (binary)
      for (int d = 0; d < 3; ++d) put(out, static_cast<float>(p[d]));
  }
  for (const auto& t : mesh.triangles) {
    lines << "3 " << t[0] << ' ' << t[1] << ' ' << t[2] << '\n';
    if (binary) put(out, static_cast<std::uint8_t>(3));
    if (binary)
      for (const std::int32_t k : t) put(out, k);
  }
  return binary ? out : out + lines.str();
}

std::string stl(const TriangleMesh& mesh, bool binary) {
  std::ostringstream lines;
  lines << "solid box\n";
  std::string out(80, ' ');
  put(out, static_cast<std::uint32_t>(mesh.triangles.size()));
  for (const auto& t : mesh.triangles) {
    lines << "facet normal 0 0 0\nouter loop\n";
    for (int d = 0; d < 3; ++d) put(out, 0.0f);
    for (const std::int32_t k : t) {
      const Vec3d& p = mesh.points[static_cast<std::size_t>(k)];
      lines << "vertex " << p.x << ' ' << p.y << ' ' << p.z << '\n';
      for (int d = 0; d < 3; ++d) put(out, static_cast<float>(p[d]));
    }
    lines << "endloop\nendfacet\n";
    put(out, static_cast<std::uint16_t>(0));
  }
  lines << "endsolid box\n";
  return binary ? out : lines.str();
}

class MeshIo : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::path(::testing::TempDir()) / (std::string("kerf_mesh_io_") + info->name());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  fs::path write(const std::string& name, const std::string& bytes) {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    return folder_ / name;
  }
  std::string error_of(const fs::path& path) {
    try {
      read_mesh(path);
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::bad_input);
      EXPECT_NE(std::string(error.what()).find(path.filename().string()), std::string::npos)
          << error.what();
      return error.what();
    }
    ADD_FAILURE() << path << " was read";
    return "";
  }

  fs::path folder_;
};

TEST_F(MeshIo, EveryFormatGivesTheSameBox) {
  const std::pair<std::string, std::string> files[] = {
      {"a.obj", obj(box())},       {"a.off", off(box())},        {"a.ply", ply(box(), false)},
      {"b.ply", ply(box(), true)}, {"a.stl", stl(box(), false)}, {"b.STL", stl(box(), true)},
  };
  for (const auto& [name, bytes] : files) {
    SCOPED_TRACE(name);

    const TriangleMesh mesh = read_mesh(write(name, bytes));

    EXPECT_EQ(mesh.points.size(), box().points.size());  // sub-meshes and facets are welded
    EXPECT_EQ(mesh.triangles.size(), box().triangles.size());
    EXPECT_TRUE(mesh.bounds().lo == kBox.lo && mesh.bounds().hi == kBox.hi);
    EXPECT_NEAR(inspect(mesh).volume, 6, 1e-12);  // the coordinates are exact in single precision
    EXPECT_TRUE(inspect(mesh).closed() && inspect(mesh).oriented());
  }
}

TEST_F(MeshIo, PolygonsAreSplitIntoTriangles) {
  const fs::path path =
      write("quads.obj",
            "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n"
            "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n");

  const TriangleMesh mesh = read_mesh(path);

  EXPECT_EQ(mesh.triangles.size(), 12u);
  EXPECT_NEAR(inspect(mesh).volume, 1, 1e-15);
}

TEST_F(MeshIo, UnusableFilesAreNamed) {
  EXPECT_NE(error_of(folder_ / "absent.obj").find("no such file"), std::string::npos);
  fs::create_directories(folder_ / "folder.obj");
  EXPECT_NE(error_of(folder_ / "folder.obj").find("folder"), std::string::npos);
  EXPECT_NE(error_of(write("empty.ply", "")).find("empty"), std::string::npos);
  const std::string kinds = error_of(write("mesh.xyz", off(box())));
  for (const char* kind : {".obj", ".ply", ".off", ".stl"})
    EXPECT_NE(kinds.find(kind), std::string::npos);
  error_of(write("none", off(box())));
}

TEST_F(MeshIo, FilesWithoutTrianglesAreRefused) {
  error_of(write("points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n"));
  error_of(write("points.off", "OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n"));
  error_of(write("points.ply", ply({box().points, {}}, false)));
  error_of(write("nothing.stl", "solid nothing\nendsolid nothing\n"));
  error_of(write("flat.obj", "v 0 0 0\nv 1 0 0\nv 0 0 0\nf 1 2 3\n"));
}

TEST_F(MeshIo, CoordinatesThatAreNotFiniteAreRefused) {
  for (const std::string word : {"nan", "inf", "-inf", "1e999"}) {
    SCOPED_TRACE(word);
    const auto spoil = [&](std::string file, const std::string& at) {
      const std::size_t where = file.find(at);
      EXPECT_NE(where, std::string::npos);
      const std::size_t number = where + at.size();
      return file.replace(number, file.find_first_of(" \n", number) - number, word);
    };
    error_of(write("bad.obj", spoil(obj(box()), "\nv ")));
    error_of(write("bad.off", spoil(off(box()), " 0\n")));
    error_of(write("bad.ply", spoil(ply(box(), false), "end_header\n")));
    error_of(write("bad.stl", spoil(stl(box(), false), "vertex ")));
  }
  for (const float value : {std::nanf(""), std::numeric_limits<float>::infinity()}) {
    std::string bytes = stl(box(), true);
    std::memcpy(bytes.data() + 84 + 12, &value, sizeof value);
    error_of(write("bad_binary.stl", bytes));
    bytes = ply(box(), true);
    std::memcpy(bytes.data() + bytes.find("end_header\n") + 11, &value, sizeof value);
    error_of(write("bad_binary.ply", bytes));
  }
}

// Reads the file; whatever it holds, the answer is a mesh that makes sense or an Error.
void expect_mesh_or_error(const fs::path& path) {
  try {
    const TriangleMesh mesh = read_mesh(path);
    EXPECT_FALSE(mesh.triangles.empty());
    EXPECT_NO_THROW(check_finite(mesh, "read"));
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::bad_input) << error.what();
  }
}

TEST_F(MeshIo, DamagedFilesNeitherHangNorCrash) {
  const std::pair<std::string, std::string> files[] = {
      {"a.obj", obj(box())},       {"a.off", off(box())},        {"a.ply", ply(box(), false)},
      {"b.ply", ply(box(), true)}, {"a.stl", stl(box(), false)}, {"b.stl", stl(box(), true)},
  };
  std::mt19937 engine(1);
  for (const auto& [name, bytes] : files) {
    SCOPED_TRACE(name);
    for (int n = 0; n < 60; ++n)  // cut short
      expect_mesh_or_error(write(name, bytes.substr(0, engine() % bytes.size())));
    for (int n = 0; n < 60; ++n) {  // a few bytes changed
      std::string damaged = bytes;
      for (int k = 0; k < 4; ++k) damaged[engine() % damaged.size()] = static_cast<char>(engine());
      expect_mesh_or_error(write(name, damaged));
    }
    for (int n = 0; n < 60; ++n) {  // nothing but noise, behind the right first bytes or none
      std::string noise = n % 2 == 0 ? bytes.substr(0, engine() % 100) : "";
      for (auto k = engine() % 2000; k > 0; --k) noise += static_cast<char>(engine());
      expect_mesh_or_error(write(name, noise));
    }
  }
}

TEST_F(MeshIo, CountsThatTheFileCannotHoldAreRefused) {
  error_of(write("huge.off", "OFF\n4000000000 4000000000 0\n0 0 0\n"));
  error_of(write("negative.off", "OFF\n-1 -1 0\n0 0 0\n"));
  std::string bytes = stl(box(), true);
  const std::uint32_t many = 0xfffffff0u;
  std::memcpy(bytes.data() + 80, &many, sizeof many);
  error_of(write("huge.stl", bytes));
  for (const char* format : {"ascii", "binary_little_endian"})
    error_of(write("huge.ply", std::string("ply\nformat ") + format +
                                   " 1.0\nelement vertex 4000000000\nproperty float x\nproperty "
                                   "float y\nproperty float z\nelement face 4000000000\nproperty "
                                   "list uchar int vertex_indices\nend_header\n0 0 0\n"));
  error_of(write("far.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4000000000\n"));
  error_of(write("far.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 77\n"));
}

}  // namespace
}  // namespace kerf
