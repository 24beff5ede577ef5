// SPDX-License-Identifier: MIT
//
// Surfaces as GLB, read back as a glTF importer would: header, chunks, JSON, then each array
// through its accessor and view.
#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>

#include "app/colours.hpp"
#include "app/glb.hpp"
#include "app/version.hpp"
#include "core/base/error.hpp"
#include "tests/support/files.hpp"
#include "tests/support/surfaces.hpp"

namespace kerf {
namespace {

using Json = nlohmann::json;
using test::two_tetrahedra;

constexpr int kFloat = 5126, kUnsignedInt = 5125, kArrayBuffer = 34962, kElementBuffer = 34963;
// Half a unit in the last place of single precision at the surface's size of half a metre.
constexpr double kSinglePlace = 0.5 / 16777216;

class GlbTest : public test::FolderTest {
 protected:
  void write(const SurfaceMesh& surface) {
    write_glb(root_ / "a.glb", surface);
    const std::string bytes = test::read_all(root_ / "a.glb");
    ASSERT_GE(bytes.size(), 20u);
    EXPECT_EQ(bytes.substr(0, 4), "glTF");
    EXPECT_EQ(word(bytes, 4), 2u);
    EXPECT_EQ(word(bytes, 8), bytes.size());
    const std::size_t length = word(bytes, 12);
    EXPECT_EQ(length % 4, 0u);
    EXPECT_EQ(bytes.substr(16, 4), "JSON");
    ASSERT_LE(20 + length, bytes.size());
    json_ = Json::parse(bytes.substr(20, length));
    binary_.clear();
    if (20 + length == bytes.size()) return;
    const std::size_t chunk = 20 + length;
    ASSERT_LE(chunk + 8, bytes.size());
    EXPECT_EQ(bytes.substr(chunk + 4, 4), std::string("BIN\0", 4));
    EXPECT_EQ(word(bytes, chunk) % 4, 0u);
    EXPECT_EQ(chunk + 8 + word(bytes, chunk), bytes.size());
    binary_ = bytes.substr(chunk + 8);
    EXPECT_EQ(json_["buffers"].size(), 1u);
    EXPECT_LE(json_["buffers"][0]["byteLength"].get<std::size_t>(), binary_.size());
  }

  static std::uint32_t word(const std::string& bytes, std::size_t at) {
    std::uint32_t value = 0;
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
  }

  /// All numbers of an accessor, after checks of what a strict reader asks of it.
  template <class T>
  std::vector<T> numbers(const Json& index, int component, const std::string& type, int target) {
    const Json& accessor = json_["accessors"].at(index.get<std::size_t>());
    const Json& view = json_["bufferViews"].at(accessor["bufferView"].get<std::size_t>());
    EXPECT_EQ(accessor["componentType"], component);
    EXPECT_EQ(accessor["type"], type);
    EXPECT_EQ(view["target"], target);
    EXPECT_FALSE(view.contains("byteStride"));
    const std::size_t begin = view.value("byteOffset", std::size_t{0});
    const std::size_t bytes = view["byteLength"];
    const std::size_t count = accessor["count"].get<std::size_t>() * (type == "VEC3" ? 3 : 1);
    EXPECT_EQ(begin % 4, 0u);
    EXPECT_EQ(bytes, count * sizeof(T));
    EXPECT_LE(begin + bytes, json_["buffers"][0]["byteLength"].get<std::size_t>());
    std::vector<T> values(count);
    std::memcpy(values.data(), binary_.data() + begin, bytes);
    return values;
  }

  /// Points in the world, of one primitive.
  std::vector<Vec3d> positions(const Json& primitive) {
    const Json& index = primitive["attributes"]["POSITION"];
    const auto values = numbers<float>(index, kFloat, "VEC3", kArrayBuffer);
    const Json& accessor = json_["accessors"].at(index.get<std::size_t>());
    const Json& shift = json_["nodes"][0]["translation"];
    std::vector<Vec3d> out(values.size() / 3);
    for (std::size_t d = 0; d < 3; ++d) {
      float lo = std::numeric_limits<float>::max(), hi = -lo;
      for (std::size_t i = 0; i < out.size(); ++i) {
        const float value = values[3 * i + d];
        lo = std::min(lo, value);
        hi = std::max(hi, value);
        out[i][static_cast<int>(d)] = shift[d].get<double>() + value;
      }
      EXPECT_EQ(accessor["min"][d].get<double>(), lo);
      EXPECT_EQ(accessor["max"][d].get<double>(), hi);
    }
    return out;
  }

  Json json_;
  std::string binary_;
};

TEST_F(GlbTest, HasOnePrimitivePerCutTheOwnSurfaceFirst) {
  write(two_tetrahedra());

  EXPECT_EQ(json_["asset"]["version"], "2.0");
  EXPECT_EQ(json_["asset"]["generator"], std::string("kerf ") + kVersion);
  EXPECT_EQ(json_["scenes"][json_["scene"].get<std::size_t>()]["nodes"], Json({0}));
  EXPECT_EQ(json_["nodes"][0]["mesh"], 0);
  ASSERT_EQ(json_["meshes"].size(), 1u);
  const Json& primitives = json_["meshes"][0]["primitives"];
  ASSERT_EQ(primitives.size(), 3u);
  const char* names[] = {"own surface", "cut 1", "cut 2"};
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(primitives[i].value("mode", 4), 4);
    const Json& material = json_["materials"].at(primitives[i]["material"].get<std::size_t>());
    EXPECT_EQ(material["name"], names[i]);
    const Json& surface = material["pbrMetallicRoughness"];
    EXPECT_EQ(surface["metallicFactor"], 0);
    EXPECT_GT(surface["roughnessFactor"], 0.5);
    const Vec3f colour = cut_colour(static_cast<std::int32_t>(i));
    for (int d = 0; d < 3; ++d)
      EXPECT_EQ(surface["baseColorFactor"][static_cast<std::size_t>(d)].get<float>(), colour[d]);
    EXPECT_EQ(surface["baseColorFactor"][3], 1);
  }
}

/// One normal for all: points are split by cut alone.
SurfaceMesh smooth_tetrahedra() {
  SurfaceMesh s = two_tetrahedra();
  for (auto& n : s.normals) n = {0, 0, 1};
  return s;
}

TEST_F(GlbTest, TrianglesAreThoseOfTheDeformedSurface) {
  // Far away, single precision knows no millimetres.
  for (const SurfaceMesh& s :
       {two_tetrahedra(), two_tetrahedra({3.1e6, -2e6, 1e5}), smooth_tetrahedra()}) {
    write(s);
    for (const Json& shift : json_["nodes"][0]["translation"])
      EXPECT_EQ(shift.get<double>(), shift.get<float>()) << "known to single precision too";
    // Doubles far away have places of their own.
    const double place = kSinglePlace + 1e-15 * norm(s.reference[0]);
    for (std::int32_t id = 0; id < 3; ++id) {
      const Json& primitive = json_["meshes"][0]["primitives"].at(static_cast<std::size_t>(id));
      const auto points = positions(primitive);
      const auto normals =
          numbers<float>(primitive["attributes"]["NORMAL"], kFloat, "VEC3", kArrayBuffer);
      ASSERT_EQ(normals.size(), 3 * points.size());
      const auto corners =
          numbers<std::uint32_t>(primitive["indices"], kUnsignedInt, "SCALAR", kElementBuffer);
      std::size_t corner = 0;
      for (std::size_t t = 0; t < s.triangles.size(); ++t) {
        if (s.cut_id[t] != id) continue;
        for (std::size_t k = 0; k < 3; ++k, ++corner) {
          ASSERT_LT(corner, corners.size());
          const std::size_t v = corners[corner];
          ASSERT_LT(v, points.size());
          EXPECT_LT(norm(points[v] - s.position(s.triangles[t][k])), 2 * place);
          const Vec3d& n = s.normals[static_cast<std::size_t>(s.normal_of[t][k])];
          EXPECT_EQ((Vec3d{normals[3 * v], normals[3 * v + 1], normals[3 * v + 2]}), n);
        }
      }
      EXPECT_EQ(corner, corners.size());
    }
  }
}

TEST_F(GlbTest, PointsAreSplitOnlyWhereNormalsDiffer) {
  write(two_tetrahedra());
  const Json sharp = json_["meshes"][0]["primitives"][0];
  EXPECT_EQ(positions(sharp).size(), 18u) << "three triangles of three corners, twice";

  write(smooth_tetrahedra());
  const Json smooth = json_["meshes"][0]["primitives"][0];
  EXPECT_EQ(positions(smooth).size(), 8u);
}

TEST_F(GlbTest, NoSurfaceIsAFileWithoutAMesh) {
  write({});
  EXPECT_FALSE(json_.contains("meshes"));
  EXPECT_FALSE(json_.contains("buffers"));
  EXPECT_FALSE(json_["scenes"][0].contains("nodes")) << "an empty list is not glTF";
  EXPECT_TRUE(binary_.empty());
}

TEST_F(GlbTest, WhatSinglePrecisionCannotHoldIsAnError) {
  EXPECT_EQ(glb_obstacle(two_tetrahedra()), "");
  for (const double far : {std::numeric_limits<double>::quiet_NaN(), 1e200}) {
    SurfaceMesh s = two_tetrahedra();
    s.displacement[2].y = far;
    EXPECT_EQ(glb_obstacle(s), "the body reaches too far");
    EXPECT_THROW(write_glb(root_ / "b.glb", s), Error);
    EXPECT_FALSE(std::filesystem::exists(root_ / "b.glb"));
  }
  SurfaceMesh s = two_tetrahedra();
  s.normals[1] = {};
  EXPECT_EQ(glb_obstacle(s), "a normal is not of unit length");
}

TEST_F(GlbTest, AFolderThatIsNotThereIsAnError) {
  try {
    write_glb(root_ / "none" / "a.glb", two_tetrahedra());
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::bad_input);
    EXPECT_EQ(error.what(), (root_ / "none" / "a.glb").string() +
                                ": cannot be written: No such file or directory");
  }
}

}  // namespace
}  // namespace kerf
