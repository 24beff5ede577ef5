// SPDX-License-Identifier: MIT
//
// Surfaces as VTP and PLY: every bit comes back, and no damaged file is believed.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <sstream>

#include "app/colours.hpp"
#include "app/ply.hpp"
#include "app/vtp.hpp"
#include "core/base/error.hpp"
#include "tests/support/files.hpp"
#include "tests/support/surfaces.hpp"

namespace kerf {
namespace {

namespace fs = std::filesystem;
using test::read_all;
using test::two_tetrahedra;
using test::vtk_array;
using test::write_all;

constexpr double kSingle = 1e-6;  // a few roundings in single precision

template <class T>
void expect_same_bits(const std::vector<T>& a, const std::vector<T>& b, const char* what) {
  ASSERT_EQ(a.size(), b.size()) << what;
  EXPECT_TRUE(a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0) << what;
}

void expect_same_bits(const SurfaceMesh& a, const SurfaceMesh& b) {
  expect_same_bits(a.reference, b.reference, "reference");
  expect_same_bits(a.displacement, b.displacement, "displacement");
  expect_same_bits(a.piece, b.piece, "piece");
  expect_same_bits(a.triangles, b.triangles, "triangles");
  expect_same_bits(a.normal_of, b.normal_of, "normal_of");
  expect_same_bits(a.cut_id, b.cut_id, "cut_id");
  expect_same_bits(a.normals, b.normals, "normals");
}

/// Two triangles that share an edge; at its points their normals differ, or are opposite.
SurfaceMesh folded(const Vec3d& first, const Vec3d& second) {
  SurfaceMesh s;
  s.reference = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
  s.displacement.resize(4);
  s.piece.resize(4, 0);
  s.triangles = {{0, 1, 2}, {2, 1, 3}};
  s.normals = {test::float_normal(first), test::float_normal(second)};
  s.normal_of = {{0, 0, 0}, {1, 1, 1}};
  s.cut_id = {0, 1};
  return s;
}

class VtpTest : public test::FolderTest {
 protected:
  std::string written(const SurfaceMesh& surface) {
    write_vtp(file_(), surface);
    return read_all(file_());
  }
  /// What read_vtp says of a file with this content; fails if it says nothing.
  std::string complaint(const std::string& content) {
    write_all(file_(), content);
    try {
      read_vtp(file_());
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::bad_input);
      const std::string what = error.what(), path = file_().string() + ": ";
      EXPECT_EQ(what.rfind(path, 0), 0u) << what;
      return what.substr(std::min(path.size(), what.size()));
    }
    ADD_FAILURE() << "a damaged file was read";
    return {};
  }
  fs::path file_() const { return root_ / "surface_0001.vtp"; }
};

TEST_F(VtpTest, EveryBitComesBack) {
  SurfaceMesh s = two_tetrahedra();
  s.reference[3].x = -0.0;
  s.displacement[1] = {std::numeric_limits<double>::denorm_min(), 1e300, -1.0 / 3};
  s.displacement[2].y = std::numeric_limits<double>::quiet_NaN();

  written(s);

  expect_same_bits(read_vtp(file_()), s);
}

TEST_F(VtpTest, NoSurfaceComesBackToo) {
  written({});
  expect_same_bits(read_vtp(file_()), {});
}

TEST_F(VtpTest, ReadingAndWritingAgainGivesTheSameFile) {
  SurfaceMesh s = two_tetrahedra();
  for (std::size_t i = 0; i < s.normals.size(); ++i) {  // no longer single precision
    const auto t = static_cast<double>(i);
    s.normals[i] = {std::cos(t), std::sin(t) * std::cos(3 * t), std::sin(t) * std::sin(3 * t)};
  }
  const std::string first = written(s);

  const SurfaceMesh read = read_vtp(file_());

  EXPECT_EQ(written(read), first);
}

TEST_F(VtpTest, CornersOfOnePointWithEqualNormalsShareAnEntry) {
  SurfaceMesh s = folded({0, 0, 1}, {0, 0, 1});
  written(s);
  const SurfaceMesh same = read_vtp(file_());
  EXPECT_EQ(same.normals.size(), 4u) << "one for each point";
  EXPECT_EQ(same.normal_of[0][1], same.normal_of[1][1]);

  for (int d = 0; d < 3; ++d) {
    const Vec3d n{2, 3, 6};
    Vec3d mirrored = n;
    mirrored[d] = -n[d];
    written(folded(n, mirrored));
    const SurfaceMesh sharp = read_vtp(file_());
    EXPECT_EQ(sharp.normals.size(), 6u) << "two for each point of the edge";
    EXPECT_NE(sharp.normal_of[0][1], sharp.normal_of[1][1]);
  }
}

TEST_F(VtpTest, PointsAreSharedAndAtRest) {
  const SurfaceMesh s = two_tetrahedra();
  const std::string vtp = written(s);

  EXPECT_NE(vtp.find("NumberOfPoints=\"8\""), std::string::npos);
  EXPECT_NE(vtp.find("NumberOfPolys=\"8\""), std::string::npos);
  const auto points = vtk_array<double>(vtp, "Points", "Points");
  ASSERT_EQ(points.size(), 24u);
  EXPECT_EQ(points[3], s.reference[1].x);
  EXPECT_EQ(vtk_array<double>(vtp, "PointData", "displacement")[4], s.displacement[1].y);
  EXPECT_EQ(vtk_array<std::int32_t>(vtp, "PointData", "piece")[7], 1);
  EXPECT_EQ(vtk_array<std::int32_t>(vtp, "CellData", "cut_id"),
            (std::vector<std::int32_t>{0, 0, 0, 2, 0, 0, 0, 1}));
  EXPECT_EQ(vtk_array<std::int32_t>(vtp, "CellData", "piece"),
            (std::vector<std::int32_t>{0, 0, 0, 0, 1, 1, 1, 1}));
  EXPECT_EQ(vtk_array<float>(vtp, "CellData", "corner_normals").size(), 72u);
  const auto corners = vtk_array<std::int32_t>(vtp, "Polys", "connectivity");
  std::vector<std::array<std::int32_t, 3>> triangles(8);
  ASSERT_EQ(corners.size(), 24u);
  for (std::size_t i = 0; i < corners.size(); ++i) triangles[i / 3][i % 3] = corners[i];
  EXPECT_TRUE(test::is_closed(triangles));
  EXPECT_EQ(vtk_array<std::int64_t>(vtp, "Polys", "offsets").back(), 24);
}

TEST_F(VtpTest, APointsNormalIsTheSumOfItsNormalsOrTheFirst) {
  const auto middle =
      vtk_array<float>(written(folded({0, 0, 1}, {0, 1, 0})), "PointData", "normals");
  ASSERT_EQ(middle.size(), 12u);
  EXPECT_FLOAT_EQ(middle[4], std::sqrt(0.5f));
  EXPECT_FLOAT_EQ(middle[5], std::sqrt(0.5f));
  EXPECT_EQ(middle[2], 1) << "the point beside the edge";

  const auto opposite =
      vtk_array<float>(written(folded({1, 2, 2}, {-1, -2, -2})), "PointData", "normals");
  EXPECT_FLOAT_EQ(opposite[3], 1 / 3.0f);
}

TEST_F(VtpTest, ATruncatedFileIsAnError) {
  const std::string whole = written(two_tetrahedra());
  for (std::size_t length = 0; length < whole.size(); length += 97)
    EXPECT_NE(complaint(whole.substr(0, length)), "") << length;
  EXPECT_NE(complaint(whole.substr(0, whole.size() - 1)).find("is damaged: 8 points"),
            std::string::npos);
  EXPECT_NE(complaint(whole + "x").find("is damaged: 8 points"), std::string::npos);
}

TEST_F(VtpTest, AChangedHeaderIsAnError) {
  const std::string whole = written(two_tetrahedra());
  const std::size_t head = whole.find("\n_");
  for (std::size_t at = 0; at < head; ++at) {
    if (whole[at] < '0' || whole[at] > '9') continue;
    std::string changed = whole;
    changed[at] = whole[at] == '9' ? '1' : static_cast<char>(whole[at] + 1);
    EXPECT_NE(complaint(changed), "") << whole.substr(at - 10, 20);
  }
  // More than memory holds, and more than a count.
  for (const char* count : {"2147483647", "99999999999999999999", "-8", ""}) {
    std::string changed = whole;
    changed.replace(changed.find("Points=\"8\"") + 8, 1, count);
    EXPECT_NE(complaint(changed), "") << count;
  }
}

TEST_F(VtpTest, AnIndexOutOfRangeIsAnError) {
  const std::string whole = written(two_tetrahedra());
  const auto with = [&](const char* section, const char* name, std::size_t offset, auto value) {
    std::string changed = whole;
    std::memcpy(changed.data() + test::vtk_array_at(whole, section, name) + offset, &value,
                sizeof value);
    return changed;
  };
  constexpr std::size_t kCount = 8;  // bytes in front of each array
  EXPECT_EQ(complaint(with("Polys", "connectivity", kCount + 4 * 5, std::int32_t{8})),
            "is damaged: triangle 1 names point 8 of 8");
  EXPECT_EQ(complaint(with("Polys", "connectivity", kCount, std::int32_t{-1})),
            "is damaged: triangle 0 names point -1 of 8");
  EXPECT_EQ(complaint(with("Polys", "offsets", kCount + 8 * 7, std::int64_t{23})),
            "is damaged: triangle 7 ends at corner 23");
  EXPECT_EQ(complaint(with("CellData", "cut_id", kCount + 4 * 2, std::int32_t{-4})),
            "is damaged: triangle 2 has cut id -4");
  EXPECT_EQ(complaint(with("Points", "Points", 0, std::uint64_t{1} << 60)),
            "is damaged: array 'Points' has 1152921504606846976 bytes instead of 192");
}

TEST_F(VtpTest, ForeignFilesAreRefused) {
  std::string turned = written(two_tetrahedra());
  turned.replace(turned.find("LittleEndian"), 12, "GiantEndian ");
  EXPECT_EQ(complaint(turned), "is not a surface that this version of Kerf wrote");
  EXPECT_EQ(complaint(""), "is not a surface that this version of Kerf wrote");
  EXPECT_EQ(complaint("<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\">\n"),
            "is not a surface that this version of Kerf wrote");
  for (const fs::path& path : {root_ / "none.vtp", root_}) try {
      read_vtp(path);
      FAIL() << path;
    } catch (const Error& error) {
      EXPECT_EQ(error.what(), path.string() + ": cannot be read; is the path right?");
    }
}

/// A PLY file as its header describes it: numbers by property name, one list per face.
struct PlyFile {
  std::string comment;
  std::map<std::string, std::vector<double>> vertex, face;
  std::vector<std::array<std::int32_t, 3>> triangles;
};

class PlyTest : public test::FolderTest {
 protected:
  PlyFile parse(const std::string& bytes) {
    std::size_t at = bytes.find("end_header\n") + 11;
    const auto take = [&](const std::string& type) -> double {
      const auto as = [&](auto value) {
        EXPECT_LE(at + sizeof value, bytes.size());
        std::memcpy(&value, bytes.data() + at, sizeof value);
        at += sizeof value;
        return static_cast<double>(value);
      };
      if (type == "double") return as(double{});
      if (type == "float") return as(float{});
      if (type == "int") return as(std::int32_t{});
      EXPECT_EQ(type, "uchar");
      return as(std::uint8_t{});
    };
    struct Element {
      std::string name;
      int count;
      std::vector<std::vector<std::string>> properties;
    };
    std::vector<Element> elements;
    PlyFile out;
    std::istringstream header(bytes.substr(0, at));
    for (std::string line, word; std::getline(header, line);) {
      std::istringstream words(line);
      words >> word;
      if (word == "comment") out.comment = line.substr(8);
      if (word == "element") words >> elements.emplace_back().name >> elements.back().count;
      if (word != "property") continue;
      elements.back().properties.emplace_back();
      while (words >> word) elements.back().properties.back().push_back(word);
    }
    for (const Element& element : elements)
      for (int i = 0; i < element.count; ++i)
        for (const auto& property : element.properties) {
          auto& columns = element.name == "vertex" ? out.vertex : out.face;
          if (property[0] != "list") {
            columns[property[1]].push_back(take(property[0]));
            continue;
          }
          EXPECT_EQ(take(property[1]), 3);
          auto& triangle = out.triangles.emplace_back();
          for (auto& corner : triangle) corner = static_cast<std::int32_t>(take(property[2]));
        }
    EXPECT_EQ(at, bytes.size()) << "nothing may follow the faces";
    return out;
  }
};

TEST_F(PlyTest, HoldsTheDeformedSurface) {
  const SurfaceMesh s = two_tetrahedra();
  write_ply(root_ / "a.ply", s);
  const std::string bytes = read_all(root_ / "a.ply");
  ASSERT_EQ(bytes.rfind("ply\nformat binary_little_endian 1.0\n", 0), 0u);
  const PlyFile ply = parse(bytes);

  ASSERT_EQ(ply.vertex.at("x").size(), 8u);
  for (std::size_t p = 0; p < 8; ++p) {
    EXPECT_EQ(ply.vertex.at("x")[p], s.reference[p].x + s.displacement[p].x);
    EXPECT_EQ(ply.vertex.at("y")[p], s.reference[p].y + s.displacement[p].y);
    EXPECT_EQ(ply.vertex.at("z")[p], s.reference[p].z + s.displacement[p].z);
    const Vec3d n{ply.vertex.at("nx")[p], ply.vertex.at("ny")[p], ply.vertex.at("nz")[p]};
    EXPECT_NEAR(norm(n), 1, kSingle);
  }
  EXPECT_EQ(ply.triangles, s.triangles);
  EXPECT_TRUE(test::is_closed(ply.triangles));
  for (std::size_t t = 0; t < 8; ++t) {
    EXPECT_EQ(ply.face.at("cut_id")[t], s.cut_id[t]);
    EXPECT_EQ(ply.face.at("piece")[t], t < 4 ? 0 : 1);
    const auto colour = cut_colour_bytes(s.cut_id[t]);
    EXPECT_EQ(ply.face.at("red")[t], colour[0]);
    EXPECT_EQ(ply.face.at("green")[t], colour[1]);
    EXPECT_EQ(ply.face.at("blue")[t], colour[2]);
  }
}

TEST_F(PlyTest, AFolderThatIsNotThereIsAnError) {
  try {
    write_ply(root_ / "none" / "a.ply", two_tetrahedra());
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::bad_input);
    EXPECT_EQ(error.what(), (root_ / "none" / "a.ply").string() +
                                ": cannot be written: No such file or directory");
  }
}

TEST(Colours, CutsDifferFromEachOtherAndFromTheBody) {
  constexpr float kLeast = 0.03f;  // of linear light; about what an eye tells apart side by side
  for (std::int32_t a = 0; a < 40; ++a)
    for (std::int32_t b = 0; b < a; ++b)
      EXPECT_GT(norm(cut_colour(a) - cut_colour(b)), kLeast) << a << " and " << b;
}

TEST(Colours, AreWithinTheRangeOfAByte) {
  for (const std::int32_t id : {0, 1, 6, 7, 8, 1000, std::numeric_limits<std::int32_t>::max()})
    for (int d = 0; d < 3; ++d) {
      EXPECT_GE(cut_colour(id)[d], 0.0f) << id;
      EXPECT_LE(cut_colour(id)[d], 1.0f) << id;
    }
  // By the definition of sRGB: 0.6 -> 203, 0.475 -> 183, 0.36 -> 162.
  EXPECT_EQ(cut_colour_bytes(0), (std::array<std::uint8_t, 3>{203, 183, 162}));
}

}  // namespace
}  // namespace kerf
