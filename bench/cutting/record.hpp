// SPDX-License-Identifier: MIT
//
// What one scene gave with one method at one size, as a line of JSON. Format: docs/cutting.md.
#pragma once

#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "bench/csv.hpp"
#include "bench/cutting/static_problem.hpp"

namespace kerf::cutting {

/// What a scene does not have is no number, and null in the file.
inline constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
/// What the linear solver leaves of an error is less.
inline constexpr double kSolved = 1e-8;

/// One of several answers: a half, an angle, an order of cuts.
struct Part {
  std::string name;
  double value = 0, exact = kNone;
};

struct Record {
  std::string scene, method;
  int size = 0;          ///< cells along the length that the scene names
  double h = 0;          ///< m
  double value = 0;      ///< the answer of the scene, in the unit that it names
  double exact = kNone;  ///< by the closed form
  double error = kNone;  ///< relative, of the displacement
  double energy = kNone, energy_exact = kNone;  ///< J
  double energy_error = kNone;                  ///< relative
  double spread = kNone;                        ///< (largest - smallest) / mean of the parts
  std::vector<Part> parts;
  Cost cost;
  int threads = 1;
  // Set by `add_orders`.
  double order = kNone, energy_order = kNone;
  double limit = kNone;                 ///< of value, by three sizes, each half of the next
  double order_of_differences = kNone;  ///< of value, by the same

  void set_energy(double value_of_it, double exact_one);
  void set_spread();  ///< from the parts
};

/// Orders from each record and that of the same scene and method with the next smaller size.
void add_orders(std::vector<Record>& records);

std::string json_line(const Record& record, const bench::Origin& origin);
/// @throws Error (bad_input) if the file cannot be written.
void write_json(const std::filesystem::path& file, const std::vector<Record>& records,
                const bench::Origin& origin);
/// @throws Error (bad_input) that names the file and the line.
std::vector<Record> read_json(const std::filesystem::path& file);

}  // namespace kerf::cutting
