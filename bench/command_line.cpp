// SPDX-License-Identifier: MIT
#include "bench/command_line.hpp"

#include <cctype>
#include <cmath>
#include <cstdio>
#include <new>
#include <thread>

#include "app/commands.hpp"
#include "app/scene_toml.hpp"
#include "app/version.hpp"
#include "bench/machine_name.hpp"

namespace kerf::bench {

Names split(std::string_view list) {
  Names out(1);
  for (const char c : list) {
    if (c == ',')
      out.emplace_back();
    else
      out.back() += c;
  }
  return out;
}

std::string unknown(const std::string& kind, const std::string& name, const Names& known) {
  const std::string near = nearest_name(name, known);
  if (!near.empty()) return text("no ", kind, " '", name, "'; did you mean '", near, "'?");
  std::string all;
  for (const std::string& one : known) all += (all.empty() ? "" : ", ") + one;
  return text("no ", kind, " '", name, "'; there are: ", all);
}

Names choose(const std::string& option, const std::string& kind, const std::string& list,
             const Names& known) {
  if (list == "all") return known;
  const Names given = split(list);
  for (const std::string& name : given)
    expects(std::find(known.begin(), known.end(), name) != known.end(),
            text(option, ": ", unknown(kind, name, known)));
  Names out;
  for (const std::string& name : known)
    if (std::find(given.begin(), given.end(), name) != given.end()) out.push_back(name);
  return out;
}

std::vector<int> numbers(const std::string& option, const std::string& list, int most) {
  std::vector<int> out;
  for (const std::string& one : split(list)) out.push_back(number(option, one, 1, most));
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

int cores() { return std::max(1, static_cast<int>(std::thread::hardware_concurrency())); }

Origin origin_of(const std::string& machine) {
  std::string build = kBuildType;
  for (char& c : build) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return {kCommit, build, machine.empty() ? machine_name() : machine};
}

std::string formatted(const char* format, double value) {
  if (std::isnan(value)) return "-";
  char out[32];
  std::snprintf(out, sizeof out, format, value);
  return out;
}

int run_program(const char* name, const char* remedy, const std::function<int()>& run) {
  const auto complain = [&](const char* what, int status) {
    std::fflush(stdout);
    std::fprintf(stderr, "%s: error: %s\n", name, what);
    return status;
  };
  try {
    return run();
  } catch (const Error& error) {
    const bool bad_input = error.kind() == ErrorKind::bad_input;
    const bool unavailable = error.kind() == ErrorKind::unavailable;
    return complain(error.what(), bad_input ? kBadInput : unavailable ? kUnavailable : kInternal);
  } catch (const std::bad_alloc&) {
    return complain(text("out of memory; ", remedy).c_str(), kUnavailable);
  } catch (const std::exception& error) {
    return complain(error.what(), kInternal);
  }
}

}  // namespace kerf::bench
