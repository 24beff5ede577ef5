// SPDX-License-Identifier: MIT
#include "app/vtk_arrays.hpp"

#include "app/output_file.hpp"
#include "core/base/error.hpp"

namespace kerf {
namespace {

constexpr std::uint8_t kVtkHexahedron = 12;
constexpr std::array<std::size_t, 8> kVtkCorner{0, 1, 3, 2, 4, 5, 7, 6};

}  // namespace

std::string vtk_begin(std::string_view type) {
  return text("<?xml version=\"1.0\"?>\n<VTKFile type=\"", type,
              "\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n  <", type,
              ">\n");
}

std::string vtk_end(std::string_view type) {
  return text("  </", type, ">\n  <AppendedData encoding=\"raw\">\n_");
}

std::string AppendedArrays::add(std::string_view type, std::string_view name, int components) {
  std::string xml =
      text("        <DataArray type=\"", type, "\" Name=\"", name, "\" NumberOfComponents=\"",
           components, "\" format=\"appended\" offset=\"", offset_, "\"/>\n");
  offset_ += sizeof(std::uint64_t) + blocks_.back().size();
  return xml;
}

void AppendedArrays::write(const std::filesystem::path& file, const std::string& xml) const {
  write_file(file, [&](std::ostream& out) {
    out << xml;
    for (const auto& block : blocks_) {
      const std::uint64_t bytes = block.size();
      out.write(reinterpret_cast<const char*>(&bytes), sizeof bytes);
      out.write(reinterpret_cast<const char*>(block.data()),
                static_cast<std::streamsize>(block.size()));
    }
    out << kVtkTail;
  });
}

VtkHexahedra::VtkHexahedra(const std::vector<std::array<std::int32_t, 8>>& cells)
    : connectivity(cells.size()), offsets(cells.size()), types(cells.size(), kVtkHexahedron) {
  for (std::size_t c = 0; c < cells.size(); ++c) {
    for (std::size_t k = 0; k < 8; ++k) connectivity[c][k] = cells[c][kVtkCorner[k]];
    offsets[c] = static_cast<std::int64_t>(8 * (c + 1));
  }
}

std::string VtkHexahedra::elements(AppendedArrays& arrays) const {
  return "      <Cells>\n" + arrays.element("Int32", "connectivity", 1, connectivity) +
         arrays.element("Int64", "offsets", 1, offsets) +
         arrays.element("UInt8", "types", 1, types) + "      </Cells>\n";
}

}  // namespace kerf
