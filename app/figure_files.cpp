// SPDX-License-Identifier: MIT
#include <numeric>

#include "app/figures.hpp"
#include "app/vtk_arrays.hpp"
#include "core/base/error.hpp"

namespace kerf {

void write_level(const std::filesystem::path& file, const LevelFigure& figure) {
  std::vector<std::array<std::int32_t, 8>> own(figure.size.size());
  std::int32_t point = 0;
  for (auto& cell : own)
    for (auto& corner : cell) corner = point++;
  const VtkHexahedra cells(own);
  AppendedArrays arrays;
  std::string xml =
      vtk_begin("UnstructuredGrid") + text("    <Piece NumberOfPoints=\"", figure.points.size(),
                                           "\" NumberOfCells=\"", own.size(), "\">\n");
  if (!figure.displacement.empty())
    xml += "      <PointData Vectors=\"displacement\">\n" +
           arrays.element("Float64", "displacement", 3, figure.displacement) +
           "      </PointData>\n";
  xml += "      <CellData Scalars=\"duplicates\">\n";
  xml += arrays.element("Int32", "size", 1, figure.size);
  xml += arrays.element("Int32", "duplicates", 1, figure.copies);
  xml += arrays.element("Int32", "copy", 1, figure.copy);
  xml += arrays.element("Int32", "piece", 1, figure.piece);
  xml += arrays.element("Float64", "fill", 1, figure.fill);
  xml += "      </CellData>\n      <Points>\n";
  xml += arrays.element("Float64", "Points", 3, figure.points);
  xml += "      </Points>\n" + cells.elements(arrays) + "    </Piece>\n";
  arrays.write(file, xml + vtk_end("UnstructuredGrid"));
}

void write_links(const std::filesystem::path& file, const LinksFigure& figure) {
  const std::size_t lines = figure.segments.size();
  std::vector<std::int32_t> connectivity(2 * lines);
  std::iota(connectivity.begin(), connectivity.end(), 0);
  std::vector<std::int64_t> offsets(lines);
  for (std::size_t i = 0; i < lines; ++i) offsets[i] = static_cast<std::int64_t>(2 * (i + 1));
  AppendedArrays arrays;
  std::string xml = vtk_begin("PolyData") + text("    <Piece NumberOfPoints=\"", 2 * lines,
                                                 "\" NumberOfVerts=\"0\" NumberOfLines=\"", lines,
                                                 "\" NumberOfStrips=\"0\" NumberOfPolys=\"0\">\n");
  xml += "      <CellData Scalars=\"state\">\n";
  xml += arrays.element("UInt8", "state", 1, figure.state);
  xml += arrays.element("Int32", "cut_id", 1, figure.cut_id);
  xml += "      </CellData>\n      <Points>\n";
  xml += arrays.element("Float64", "Points", 3, figure.segments);
  xml += "      </Points>\n      <Lines>\n";
  xml += arrays.element("Int32", "connectivity", 1, connectivity);
  xml += arrays.element("Int64", "offsets", 1, offsets);
  arrays.write(file, xml + "      </Lines>\n    </Piece>\n" + vtk_end("PolyData"));
}

}  // namespace kerf
