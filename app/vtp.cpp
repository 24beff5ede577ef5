// SPDX-License-Identifier: MIT
#include "app/vtp.hpp"

#include <charconv>
#include <fstream>
#include <optional>

#include "app/corner_normals.hpp"
#include "app/vtk_arrays.hpp"
#include "core/base/error.hpp"

namespace kerf {
namespace {

namespace fs = std::filesystem;

/// The arrays of a file that a SurfaceMesh does not hold as they are written.
struct DerivedArrays {
  std::vector<Vec3f> normals;                        // per point
  std::vector<std::array<Vec3f, 3>> corner_normals;  // per triangle
  std::vector<std::int32_t> piece;                   // per triangle
  std::vector<std::int64_t> offsets;
};
static_assert(sizeof(std::array<Vec3f, 3>) == 9 * sizeof(float));

// Bytes of the arrays below, of one point and of one triangle, and how many arrays there are.
constexpr std::uint64_t kPointBytes = 24 + 12 + 4 + 24;
constexpr std::uint64_t kTriangleBytes = 4 + 36 + 4 + 12 + 8;
constexpr std::uint64_t kArrays = 9;

/// Everything before the arrays. read_arrays() follows the same order.
std::string head(const SurfaceMesh& s, const DerivedArrays& d, AppendedArrays& arrays) {
  std::string xml = vtk_begin("PolyData") +
                    text("    <Piece NumberOfPoints=\"", s.reference.size(),
                         "\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" "
                         "NumberOfPolys=\"",
                         s.triangles.size(), "\">\n");
  xml += "      <PointData Vectors=\"displacement\" Normals=\"normals\">\n";
  xml += arrays.element("Float64", "displacement", 3, s.displacement);
  xml += arrays.element("Float32", "normals", 3, d.normals);
  xml += arrays.element("Int32", "piece", 1, s.piece);
  xml += "      </PointData>\n      <CellData Scalars=\"cut_id\">\n";
  xml += arrays.element("Int32", "cut_id", 1, s.cut_id);
  xml += arrays.element("Float32", "corner_normals", 9, d.corner_normals);
  xml += arrays.element("Int32", "piece", 1, d.piece);
  xml += "      </CellData>\n      <Points>\n";
  xml += arrays.element("Float64", "Points", 3, s.reference);
  xml += "      </Points>\n      <Polys>\n";
  xml += arrays.element("Int32", "connectivity", 1, s.triangles);
  xml += arrays.element("Int64", "offsets", 1, d.offsets);
  return xml + "      </Polys>\n    </Piece>\n" + vtk_end("PolyData");
}

/// Reads one file of known size, array by array.
class Reader {
 public:
  explicit Reader(const fs::path& file) : file_(file) {
    std::error_code error;
    if (fs::is_regular_file(file, error)) in_.open(file, std::ios::binary);
    if (!in_.is_open()) fail("cannot be read; is the path right?");
    size_ = fs::file_size(file, error);
    if (error) fail("cannot be read: " + error.message());
  }

  template <class... Parts>
  [[noreturn]] void fail(const Parts&... parts) const {
    throw Error(ErrorKind::bad_input, text(file_.string(), ": ", parts...));
  }
  [[noreturn]] void fail_foreign() const {
    fail("is not a surface that this version of Kerf wrote");
  }

  /// The text up to where the arrays begin; empty if there is no such place.
  std::string read_head() {
    constexpr std::size_t kLongest = 4096;
    const std::string mark = vtk_end("PolyData");
    std::string start = read_text(std::min<std::uint64_t>(size_, kLongest));
    const std::size_t at = start.find(mark);
    if (at == std::string::npos) return {};
    start.resize(at + mark.size());
    in_.seekg(static_cast<std::streamoff>(start.size()));
    return start;
  }

  std::string read_text(std::size_t bytes) {
    std::string found(bytes, '\0');
    in_.read(found.data(), static_cast<std::streamsize>(bytes));
    if (!in_) fail("cannot be read to its end");
    return found;
  }

  template <class T>
  void read_array(const char* name, std::vector<T>& values) {
    std::uint64_t bytes = 0;
    in_.read(reinterpret_cast<char*>(&bytes), sizeof bytes);
    const std::uint64_t expected = values.size() * sizeof(T);
    if (in_ && bytes != expected)
      fail("is damaged: array '", name, "' has ", bytes, " bytes instead of ", expected);
    in_.read(reinterpret_cast<char*>(values.data()), static_cast<std::streamsize>(expected));
    if (!in_) fail("cannot be read to its end");
  }

  std::uint64_t size() const { return size_; }

 private:
  fs::path file_;
  std::ifstream in_;
  std::uint64_t size_ = 0;
};

/// The number behind NAME=" in `head`; points and triangles are counted in 32 bits.
std::optional<std::uint64_t> count_of(const std::string& head, const std::string& name) {
  const std::string mark = name + "=\"";
  const std::size_t at = head.find(mark);
  if (at == std::string::npos) return {};
  std::int32_t value = -1;
  const auto result =
      std::from_chars(head.data() + at + mark.size(), head.data() + head.size(), value);
  if (result.ec != std::errc() || value < 0) return {};
  return static_cast<std::uint64_t>(value);
}

void resize(SurfaceMesh& s, DerivedArrays& d, std::size_t points, std::size_t triangles) {
  s.reference.resize(points);
  s.displacement.resize(points);
  s.piece.resize(points);
  d.normals.resize(points);
  s.triangles.resize(triangles);
  s.cut_id.resize(triangles);
  d.corner_normals.resize(triangles);
  d.piece.resize(triangles);
  d.offsets.resize(triangles);
}

void read_arrays(Reader& reader, SurfaceMesh& s, DerivedArrays& d) {
  reader.read_array("displacement", s.displacement);
  reader.read_array("normals", d.normals);
  reader.read_array("piece", s.piece);
  reader.read_array("cut_id", s.cut_id);
  reader.read_array("corner_normals", d.corner_normals);
  reader.read_array("piece", d.piece);
  reader.read_array("Points", s.reference);
  reader.read_array("connectivity", s.triangles);
  reader.read_array("offsets", d.offsets);
}

void check(const Reader& reader, const SurfaceMesh& s, const DerivedArrays& d) {
  for (std::size_t t = 0; t < s.triangles.size(); ++t) {
    for (const std::int32_t p : s.triangles[t])
      if (p < 0 || static_cast<std::size_t>(p) >= s.reference.size())
        reader.fail("is damaged: triangle ", t, " names point ", p, " of ", s.reference.size());
    if (s.cut_id[t] < 0) reader.fail("is damaged: triangle ", t, " has cut id ", s.cut_id[t]);
    if (d.offsets[t] != static_cast<std::int64_t>(3 * (t + 1)))
      reader.fail("is damaged: triangle ", t, " ends at corner ", d.offsets[t]);
  }
}

}  // namespace

void write_vtp(const fs::path& file, const SurfaceMesh& surface) {
  DerivedArrays derived;
  derived.corner_normals = triangle_normals(surface);
  derived.normals = point_normals(corner_normals(surface.triangles, derived.corner_normals),
                                  surface.reference.size());
  for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
    derived.piece.push_back(surface.piece[static_cast<std::size_t>(surface.triangles[t][0])]);
    derived.offsets.push_back(static_cast<std::int64_t>(3 * (t + 1)));
  }
  AppendedArrays arrays;
  const std::string xml = head(surface, derived, arrays);
  arrays.write(file, xml);
}

SurfaceMesh read_vtp(const fs::path& file) {
  Reader reader(file);
  const std::string found = reader.read_head();
  const auto points = count_of(found, "NumberOfPoints");
  const auto triangles = count_of(found, "NumberOfPolys");
  if (!points || !triangles) reader.fail_foreign();
  // The counts are believed, and memory is taken, only if the file is as long as they say.
  const std::uint64_t expected = found.size() + kArrays * sizeof(std::uint64_t) +
                                 kPointBytes * *points + kTriangleBytes * *triangles +
                                 kVtkTail.size();
  if (reader.size() != expected)
    reader.fail("is damaged: ", *points, " points and ", *triangles, " triangles take ", expected,
                " bytes, but the file has ", reader.size());
  SurfaceMesh surface;
  DerivedArrays derived;
  resize(surface, derived, *points, *triangles);
  AppendedArrays arrays;
  if (found != head(surface, derived, arrays)) reader.fail_foreign();
  read_arrays(reader, surface, derived);
  if (reader.read_text(kVtkTail.size()) != kVtkTail) reader.fail_foreign();
  check(reader, surface, derived);

  CornerNormals corners = corner_normals(surface.triangles, derived.corner_normals);
  surface.normal_of = std::move(corners.triangles);
  for (const Vec3f& n : corners.normal) surface.normals.push_back({n.x, n.y, n.z});
  return surface;
}

}  // namespace kerf
