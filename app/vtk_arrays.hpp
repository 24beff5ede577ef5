// SPDX-License-Identifier: MIT
//
// What the VTK files have in common: arrays of raw bytes behind the XML, and hexahedra.
//
// Layout  XML header, then "_", then for each array an UInt64 byte count and the bytes, little
//         endian; then the closing tags.
// Source  VTK File Formats, "XML file formats", appended raw data.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/geometry/vec.hpp"

namespace kerf {

static_assert(std::endian::native == std::endian::little,
              "arrays are written as they lie in memory");
static_assert(sizeof(Vec3d) == 3 * sizeof(double) && sizeof(Vec3f) == 3 * sizeof(float) &&
              sizeof(Mat3d) == 9 * sizeof(double));

/// The lines before the arrays of a data set and behind them.
std::string vtk_begin(std::string_view type);  ///< type: "PolyData", "UnstructuredGrid"
std::string vtk_end(std::string_view type);
inline constexpr std::string_view kVtkTail = "\n  </AppendedData>\n</VTKFile>\n";

/// Collects the arrays: their XML elements now, their bytes in write(). The arrays must live until
/// then.
class AppendedArrays {
 public:
  template <class T>
  std::string element(std::string_view type, std::string_view name, int components,
                      const std::vector<T>& values) {
    blocks_.push_back(std::as_bytes(std::span(values)));
    return add(type, name, components);
  }

  /// Writes `xml`, from vtk_begin() to vtk_end(), with the bytes of all arrays behind it.
  /// @throws Error (bad_input) if the file cannot be written.
  void write(const std::filesystem::path& file, const std::string& xml) const;

 private:
  std::string add(std::string_view type, std::string_view name, int components);

  std::vector<std::span<const std::byte>> blocks_;
  std::size_t offset_ = 0;  // of the next array
};

/// Hexahedra given by corners x + 2y + 4z as VTK numbers them: around the bottom face, then around
/// the top face.
struct VtkHexahedra {
  explicit VtkHexahedra(const std::vector<std::array<std::int32_t, 8>>& cells);
  std::string elements(AppendedArrays& arrays) const;  ///< <Cells>

  std::vector<std::array<std::int32_t, 8>> connectivity;
  std::vector<std::int64_t> offsets;
  std::vector<std::uint8_t> types;
};

}  // namespace kerf
