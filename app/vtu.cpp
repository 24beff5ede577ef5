// SPDX-License-Identifier: MIT
#include "app/results.hpp"
#include "app/vtk_arrays.hpp"
#include "core/base/error.hpp"

namespace kerf {

void write_vtu(const std::filesystem::path& file, const Snapshot& s) {
  const VtkHexahedra cells(s.cells);
  AppendedArrays arrays;
  std::string xml =
      vtk_begin("UnstructuredGrid") + text("    <Piece NumberOfPoints=\"", s.points.size(),
                                           "\" NumberOfCells=\"", s.cells.size(), "\">\n");
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
  xml += "      </Points>\n" + cells.elements(arrays) + "    </Piece>\n";
  arrays.write(file, xml + vtk_end("UnstructuredGrid"));
}

}  // namespace kerf
