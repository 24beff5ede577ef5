// SPDX-License-Identifier: MIT
//
// Layout  XML header, then "_", then for each array an UInt64 byte count and the bytes.
// Source  VTK File Formats, "XML file formats", appended raw data.
#include <bit>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <span>

#include "app/results.hpp"
#include "core/base/error.hpp"

namespace kerf {
namespace {

static_assert(std::endian::native == std::endian::little,
              "arrays are written as they lie in memory");
static_assert(sizeof(Vec3d) == 3 * sizeof(double) && sizeof(Mat3d) == 9 * sizeof(double));

constexpr std::uint8_t kVtkHexahedron = 12;
/// VTK walks around the bottom face, then around the top face.
constexpr std::array<std::size_t, 8> kVtkCorner{0, 1, 3, 2, 4, 5, 7, 6};

/// Collects the arrays: their XML elements now, their bytes in write().
class AppendedArrays {
 public:
  template <class T>
  std::string element(const char* type, const char* name, int components,
                      const std::vector<T>& values) {
    const std::size_t bytes = values.size() * sizeof(T);
    std::string xml =
        text("        <DataArray type=\"", type, "\" Name=\"", name, "\" NumberOfComponents=\"",
             components, "\" format=\"appended\" offset=\"", offset_, "\"/>\n");
    blocks_.push_back(std::as_bytes(std::span(values)));
    offset_ += sizeof(std::uint64_t) + bytes;
    return xml;
  }

  void write(std::ostream& out) const {
    for (const auto& block : blocks_) {
      const std::uint64_t bytes = block.size();
      out.write(reinterpret_cast<const char*>(&bytes), sizeof bytes);
      out.write(reinterpret_cast<const char*>(block.data()),
                static_cast<std::streamsize>(block.size()));
    }
  }

 private:
  std::vector<std::span<const std::byte>> blocks_;
  std::size_t offset_ = 0;
};

}  // namespace

void write_vtu(const std::filesystem::path& file, const Snapshot& s) {
  std::vector<std::array<std::int32_t, 8>> connectivity(s.cells.size());
  std::vector<std::int64_t> offsets(s.cells.size());
  for (std::size_t c = 0; c < s.cells.size(); ++c) {
    for (std::size_t k = 0; k < 8; ++k) connectivity[c][k] = s.cells[c][kVtkCorner[k]];
    offsets[c] = static_cast<std::int64_t>(8 * (c + 1));
  }
  const std::vector<std::uint8_t> types(s.cells.size(), kVtkHexahedron);

  AppendedArrays arrays;
  std::string xml = text(
      "<?xml version=\"1.0\"?>\n"
      "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" "
      "header_type=\"UInt64\">\n  <UnstructuredGrid>\n    <Piece NumberOfPoints=\"",
      s.points.size(), "\" NumberOfCells=\"", s.cells.size(), "\">\n");
  xml += "      <PointData Vectors=\"displacement\">\n";
  xml += arrays.element("Float64", "displacement", 3, s.displacement);
  xml += arrays.element("Float64", "velocity", 3, s.velocity);
  xml += arrays.element("Float64", "external_force", 3, s.external_force);
  xml += arrays.element("UInt8", "fixed", 1, s.fixed);
  xml += arrays.element("Int32", "masters", 4, s.masters);
  xml += "      </PointData>\n      <CellData Scalars=\"piece\">\n";
  xml += arrays.element("UInt8", "level", 1, s.size_log2);
  xml += arrays.element("Int32", "piece", 1, s.piece);
  xml += arrays.element("Float64", "youngs_modulus", 1, s.young);
  xml += arrays.element("Float64", "poissons_ratio", 1, s.poisson);
  xml += arrays.element("Float64", "density", 1, s.density);
  xml += arrays.element("Float64", "rotation", 9, s.rotation);
  xml += "      </CellData>\n      <Points>\n";
  xml += arrays.element("Float64", "Points", 3, s.points);
  xml += "      </Points>\n      <Cells>\n";
  xml += arrays.element("Int32", "connectivity", 1, connectivity);
  xml += arrays.element("Int64", "offsets", 1, offsets);
  xml += arrays.element("UInt8", "types", 1, types);
  xml += "      </Cells>\n    </Piece>\n  </UnstructuredGrid>\n";
  xml += "  <AppendedData encoding=\"raw\">\n_";

  std::ofstream out(file, std::ios::binary);
  out << xml;
  arrays.write(out);
  out << "\n  </AppendedData>\n</VTKFile>\n";
  out.close();
  if (!out)
    throw Error(ErrorKind::bad_input,
                text(file.string(), ": cannot be written: ", std::strerror(errno)));
}

}  // namespace kerf
