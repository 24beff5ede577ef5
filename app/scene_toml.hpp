// SPDX-License-Identifier: MIT
//
// Typed access to the tables of a scene file. Every error says where and what would be right.
//
// A key that is read becomes a valid name of its table; finish() rejects all others. So the list
// of valid names cannot differ from what the reader understands.
#pragma once

#include <toml++/toml.h>

#include <filesystem>
#include <initializer_list>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/base/error.hpp"
#include "core/geometry/vec.hpp"

namespace kerf {

/// The name among `names` with the smallest edit distance to `name`; empty if none is near.
std::string nearest_name(std::string_view name, const std::vector<std::string>& names);

/// An interval with a description for messages.
struct Range {
  double lo = -std::numeric_limits<double>::infinity();
  double hi = std::numeric_limits<double>::infinity();
  bool open = true;  ///< whether the ends are excluded
  std::string_view text = "finite";
};
inline constexpr double kUnlimited = std::numeric_limits<double>::infinity();
inline constexpr Range kAnyNumber{};
inline constexpr Range kPositive{0, kUnlimited, true, "greater than 0"};
inline constexpr Range kNotNegative{0, kUnlimited, false, "0 or greater"};

/// A parsed scene with its overrides, and the way from a key to its place.
class SceneSource {
 public:
  SceneSource(const std::string& toml, std::filesystem::path file,
              const std::vector<std::string>& overrides);

  const toml::table& root() const { return root_; }
  std::filesystem::path folder() const { return file_.parent_path(); }

  /// "FILE:LINE" or "--set ARGUMENT" of the value at `path`, a dotted path from the root.
  std::string place(const std::string& path, const toml::source_region& region) const;
  [[noreturn]] void fail(const std::string& path, const toml::source_region& region,
                         const std::string& message) const;

 private:
  void apply(const std::string& argument);

  std::filesystem::path file_;
  toml::table root_;
  std::vector<std::pair<std::string, std::string>> overrides_;  // dotted path, argument
};

/// A value and its place.
struct SceneValue {
  const toml::node* node;
  const SceneSource* source;
  std::string path;   // "cut.0.lines.1"
  std::string label;  // "'lines' in [[cut]]", for messages

  [[noreturn]] void fail(const std::string& message) const;
  std::string place() const { return source->place(path, node->source()); }
  SceneValue element(std::size_t i) const;  ///< of an array
  std::size_t size() const;                 ///< of an array; fails for anything else

  double number(const Range& range) const;
  int integer(int lo, int hi) const;
  bool boolean() const;
  std::string string() const;
  Vec3d vec3() const;
  Box3 box() const;  ///< [[x, y, z], [x, y, z]], low corner first
};

/// One table, and the keys that were asked for.
class SceneTable {
 public:
  /// `label` is how messages call it: "[material]".
  SceneTable(const toml::table& table, const SceneSource& source, std::string path,
             std::string label, std::map<std::string, std::string>& places);

  /// The value of `key` if it is given. Makes `key` a valid name.
  std::optional<SceneValue> find(std::string_view key);
  SceneValue require(std::string_view key);

  void read(std::string_view key, double& out, const Range& range);
  void read(std::string_view key, int& out, int lo, int hi = std::numeric_limits<int>::max());
  void read(std::string_view key, bool& out);
  void read(std::string_view key, std::string& out);
  void read(std::string_view key, Vec3d& out);

  template <class Choice>
  void read_choice(std::string_view key, Choice& out,
                   std::initializer_list<std::pair<const char*, Choice>> choices) {
    const auto value = find(key);
    if (!value) return;
    const std::string given = value->string();
    std::vector<std::string> names;
    for (const auto& [name, choice] : choices) {
      if (given == name) {
        out = choice;
        return;
      }
      names.push_back(name);
    }
    fail_choice(*value, given, names);
  }

  /// A table inside this one; null if it is not given.
  std::optional<SceneTable> table(std::string_view key, std::string label);
  /// The tables of an array of tables.
  std::vector<SceneTable> tables(std::string_view key, const std::string& label);

  /// @throws Error for the first key that no call above asked for.
  void finish() const;
  [[noreturn]] void fail(const std::string& message) const;
  [[noreturn]] void fail(std::string_view key, const std::string& message) const;

  const SceneSource& source() const { return *source_; }
  const std::string& path() const { return path_; }
  const std::string& label() const { return label_; }
  std::string place() const { return source_->place(path_, table_->source()); }

 private:
  [[noreturn]] static void fail_choice(const SceneValue& value, const std::string& given,
                                       const std::vector<std::string>& names);
  std::string key_path(std::string_view key) const;

  const toml::table* table_;
  const SceneSource* source_;
  std::string path_, label_;
  std::map<std::string, std::string>* places_;
  std::vector<std::string> known_;
};

}  // namespace kerf
