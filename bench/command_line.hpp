// SPDX-License-Identifier: MIT
//
// What the command lines of the benches have in common.
#pragma once

#include <algorithm>
#include <charconv>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "bench/csv.hpp"
#include "core/base/error.hpp"

namespace kerf::bench {

using Names = std::vector<std::string>;

/// The parts between commas.
Names split(std::string_view list);

template <class Table>
Names names_of(const Table& table) {
  Names out;
  for (const auto& entry : table) out.emplace_back(entry.name);
  return out;
}

/// What is wrong with a name, and the nearest one that is known.
std::string unknown(const std::string& kind, const std::string& name, const Names& known);

/// The names of a list, each once, in the order of `known`; all of them for "all".
/// @throws Error (bad_input) for a name that is not known.
Names choose(const std::string& option, const std::string& kind, const std::string& list,
             const Names& known);

/// @throws Error (bad_input) if `value` is no number from `least` to `most`.
template <class Number>
Number number(const std::string& option, const std::string& value, Number least, Number most) {
  Number out{};
  const char* const end = value.data() + value.size();
  const auto [stop, error] = std::from_chars(value.data(), end, out);
  expects(error == std::errc() && stop == end && out >= least && out <= most,
          text(option, " must be a number from ", least, " to ", most, ", not '", value, "'"));
  return out;
}

/// Numbers of a list from 1 to `most`, ascending, each once.
std::vector<int> numbers(const std::string& option, const std::string& list, int most);

int cores();  ///< of this machine, at least 1

/// Hands each option that takes a value to its setter; --list and --help set options.list and
/// .help.
/// @throws Error (bad_input) for an unknown option, or one without its value.
template <class Options>
void read_arguments(
    int argc, const char* const* argv,
    const std::map<std::string, std::function<void(Options&, const std::string&)>>& setters,
    Options& options) {
  for (int i = 1; i < argc; ++i) {
    const std::string name = argv[i];
    if (name == "--list" || name == "--help" || name == "-h") {
      (name == "--list" ? options.list : options.help) = true;
      continue;
    }
    const auto setter = setters.find(name);
    if (setter == setters.end()) {
      Names known{"--list", "--help"};
      for (const auto& [option, set] : setters) known.push_back(option);
      throw Error(ErrorKind::bad_input, unknown("option", name, known));
    }
    expects(i + 1 < argc && argv[i + 1][0] != '\0', name + " needs a value");
    setter->second(options, argv[++i]);
  }
}

/// The origin of results; `machine` empty: named after the processor.
Origin origin_of(const std::string& machine);

/// A number by a format of printf, "-" where it is none.
std::string formatted(const char* format, double value);

/// The exit status of run(); what it throws goes to standard error. `remedy`: when memory is out.
int run_program(const char* name, const char* remedy, const std::function<int()>& run);

}  // namespace kerf::bench
