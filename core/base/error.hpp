// SPDX-License-Identifier: MIT
//
// The one exception type of the library, and the guard of its public face.
#pragma once

#include <source_location>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>

namespace kerf {

enum class ErrorKind {
  bad_input,    ///< the caller must change something; exit status 2
  unavailable,  ///< no such backend, or not enough memory; exit status 4
  internal,     ///< a broken invariant: a bug in Kerf; exit status 1
};

class Error : public std::runtime_error {
 public:
  Error(ErrorKind kind, const std::string& message,
        std::source_location where = std::source_location::current())
      : std::runtime_error(message), kind_(kind), where_(where) {}

  ErrorKind kind() const noexcept { return kind_; }
  const std::source_location& where() const noexcept { return where_; }

 private:
  ErrorKind kind_;
  std::source_location where_;
};

/// Not enough memory of a device: what was there is there still.
class OutOfMemory : public Error {
 public:
  explicit OutOfMemory(const std::string& message,
                       std::source_location where = std::source_location::current())
      : Error(ErrorKind::unavailable, message, where) {}
};

/// Joins anything that a stream can print into one string.
template <class... Parts>
std::string text(const Parts&... parts) {
  std::ostringstream out;
  (out << ... << parts);
  return out.str();
}

/// @throws Error (bad_input) with `remedy`, which says what the caller must change.
inline void expects(bool condition, std::string_view remedy,
                    std::source_location where = std::source_location::current()) {
  if (!condition) throw Error(ErrorKind::bad_input, std::string(remedy), where);
}

/// @throws Error (internal) when an invariant of Kerf itself does not hold.
inline void ensures(bool condition, std::string_view invariant,
                    std::source_location where = std::source_location::current()) {
  if (!condition)
    throw Error(ErrorKind::internal, text("internal error (please report): ", invariant), where);
}

}  // namespace kerf
