// SPDX-License-Identifier: MIT
//
// The table of results, as a file. Columns: bench/README.md.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <string>
#include <vector>

namespace kerf::bench {

/// A number that a row does not have is no number, and an empty field of the file.
inline constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

struct Row {
  std::string scene, backend;
  int threads = 1;
  std::string precision;
  double cells = 0, vertices = kNone;
  int levels = 0;  ///< 0: none
  std::string phase;
  double ms_min = 0, ms_median = 0;
  double ns_per_cell = 0;   ///< of the fastest run
  double gb_per_s = kNone;  ///< counted bytes over the fastest run; GFLOP/s of fma-*
  double residual = kNone;
  std::string state_hash;
  double of_ceiling = kNone;  ///< least time by the ceilings over that of the fastest run
  double peak_bytes = kNone;
  double launches = kNone;      ///< of a device, in the last run
  double bytes_copied = kNone;  ///< to a device and from it, in the last run
};

/// What all rows of a run share.
struct Origin {
  std::string commit, build, machine;
};

/// A number as a field; empty if it is none.
std::string csv_field(double value, int digits = 6);
/// Words as a field: between quotes if they hold a comma or a quote.
std::string csv_field(const std::string& words);

/// @throws Error (bad_input) naming `option` if the file cannot be written.
void write_file(const std::filesystem::path& file, const std::string& content,
                const std::string& option);

/// The lines of a file whose first line names its columns.
class CsvReader {
 public:
  /// @throws Error (bad_input) if the file cannot be read or lacks one of the columns.
  CsvReader(const std::filesystem::path& file, const std::vector<std::string>& needed);
  bool next();  ///< false at the end
  /// The field of this line; empty if there is none.
  std::string at(const std::string& column) const;
  /// The same as a number, kNone if it is empty.
  /// @throws Error (bad_input) that names the file and the line.
  double value(const std::string& column) const;
  std::string where() const;  ///< file:line, for errors

 private:
  std::filesystem::path file_;
  std::ifstream in_;
  std::map<std::string, std::size_t> column_;
  std::vector<std::string> fields_;
  int line_ = 1;
};

/// @throws Error (bad_input) if the file cannot be written.
void write_csv(const std::filesystem::path& file, const std::vector<Row>& rows,
               const Origin& origin);

/// The rows of a file that write_csv made, or that has at least the columns of a plot.
/// @throws Error (bad_input) that names the file and the line.
std::vector<Row> read_csv(const std::filesystem::path& file);

}  // namespace kerf::bench
