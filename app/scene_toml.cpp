// SPDX-License-Identifier: MIT
#include "app/scene_toml.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

namespace kerf {
namespace {

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replace = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, replace});
    }
  }
  return row.back();
}

const char* type_name(const toml::node& node) {
  switch (node.type()) {
    case toml::node_type::table:
      return "a table";
    case toml::node_type::array:
      return "an array";
    case toml::node_type::string:
      return "a string";
    case toml::node_type::integer:
      return "an integer";
    case toml::node_type::floating_point:
      return "a number";
    case toml::node_type::boolean:
      return "a boolean";
    default:
      return "a date or time";
  }
}

std::string joined(const std::vector<std::string>& names) {
  std::string all;
  for (const auto& name : names) all += (all.empty() ? "" : ", ") + name;
  return all;
}

/// "; did you mean 'young'?", or the list of what would be valid.
std::string hint(std::string_view name, const std::vector<std::string>& names) {
  const std::string near = nearest_name(name, names);
  if (!near.empty()) return text("; did you mean '", near, "'?");
  if (names.empty()) return "";
  return text("; valid are ", joined(names));
}

bool begins_with_part(const std::string& path, const std::string& prefix) {
  return path.size() > prefix.size() && path.compare(0, prefix.size(), prefix) == 0 &&
         (prefix.empty() || path[prefix.size()] == '.');
}

std::vector<std::string> split_path(const std::string& path) {
  std::vector<std::string> parts(1);
  for (const char c : path) {
    if (c == '.')
      parts.emplace_back();
    else
      parts.back() += c;
  }
  return parts;
}

std::optional<std::size_t> parse_index(const std::string& part) {
  std::size_t index = 0;
  const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), index);
  if (part.empty() || error != std::errc{} || end != part.data() + part.size()) return {};
  return index;
}

/// The value of an override as a one-entry table {v = value}; a bare word becomes a string.
toml::table parse_override_value(const std::string& argument, const std::string& value) {
  const auto bad = [&](const std::string& why) {
    return Error(ErrorKind::bad_input, text("--set ", argument, ": ", why));
  };
  if (value.empty()) throw bad("a value is missing after '='");
  if (value.find('\n') != std::string::npos) throw bad("the value must be on one line");
  try {
    return toml::parse("v = " + value);
  } catch (const toml::parse_error& error) {
    if (std::string_view("[{\"'").find(value.front()) != std::string_view::npos)
      throw bad(std::string(error.description()));
  }
  toml::table table;
  table.insert_or_assign("v", value);
  return table;
}

}  // namespace

std::string nearest_name(std::string_view name, const std::vector<std::string>& names) {
  const std::size_t limit =
      std::max<std::size_t>(2, name.size() / 3);  // typing errors, not guesses
  std::size_t best = limit + 1;
  std::string nearest;
  for (const auto& candidate : names) {
    const std::size_t distance = edit_distance(name, candidate);
    if (distance < best && distance < candidate.size()) {
      best = distance;
      nearest = candidate;
    }
  }
  return nearest;
}

SceneSource::SceneSource(const std::string& toml, std::filesystem::path file,
                         const std::vector<std::string>& overrides)
    : file_(std::move(file)) {
  try {
    root_ = toml::parse(toml, file_.string());
  } catch (const toml::parse_error& error) {
    for (const char* mesh : {".obj", ".ply", ".off", ".stl"})
      expects(file_.extension() != mesh,
              text(file_.string(), ": is a mesh, not a scene; name it as body.mesh of a scene"));
    throw Error(ErrorKind::bad_input,
                text(file_.string(), ":", error.source().begin.line, ": ", error.description()));
  }
  for (const auto& argument : overrides) apply(argument);
}

void SceneSource::apply(const std::string& argument) {
  const auto bad = [&](const std::string& why) {
    return Error(ErrorKind::bad_input, text("--set ", argument, ": ", why));
  };
  const std::size_t equals = argument.find('=');
  if (equals == std::string::npos) throw bad("expected section.key=value");
  const std::string path = argument.substr(0, equals);
  const std::vector<std::string> parts = split_path(path);
  for (const auto& part : parts)
    if (part.empty()) throw bad("expected section.key=value");
  toml::table value = parse_override_value(argument, argument.substr(equals + 1));

  toml::node* node = &root_;
  std::string walked;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const bool last = i + 1 == parts.size();
    if (auto* array = node->as_array()) {
      const auto index = parse_index(parts[i]);
      if (!index)
        throw bad(text("'", walked, "' is a list; expected a number, not '", parts[i], "'"));
      if (*index >= array->size())
        throw bad(text("'", walked, "' has ", array->size(), " entries, counted from 0"));
      if (last)
        array->replace(array->cbegin() + static_cast<std::ptrdiff_t>(*index), *value.get("v"));
      node = array->get(*index);
    } else if (auto* table = node->as_table()) {
      if (last) {
        table->insert_or_assign(parts[i], *value.get("v"));
      } else if (table->get(parts[i]) == nullptr) {
        if (parse_index(parts[i + 1])) throw bad(text("the scene has no [[", parts[i], "]]"));
        table->insert_or_assign(parts[i], toml::table{});
      }
      node = table->get(parts[i]);
    } else {
      throw bad(text("'", walked, "' is ", type_name(*node), " and has no '", parts[i], "'"));
    }
    walked += (i == 0 ? "" : ".") + parts[i];
  }
  overrides_.emplace_back(path, argument);
}

std::string SceneSource::place(const std::string& path, const toml::source_region& region) const {
  if (path.empty()) return file_.string();
  for (auto it = overrides_.rbegin(); it != overrides_.rend(); ++it)
    if (it->first == path || begins_with_part(path, it->first)) return "--set " + it->second;
  if (region.begin.line > 0) return text(file_.string(), ":", region.begin.line);
  for (auto it = overrides_.rbegin(); it != overrides_.rend(); ++it)
    if (begins_with_part(it->first, path)) return "--set " + it->second;
  return file_.string();
}

void SceneSource::fail(const std::string& path, const toml::source_region& region,
                       const std::string& message) const {
  throw Error(ErrorKind::bad_input, text(place(path, region), ": ", message));
}

void SceneValue::fail(const std::string& message) const {
  source->fail(path, node->source(), text(label, " ", message));
}

std::size_t SceneValue::size() const {
  const auto* array = node->as_array();
  if (array == nullptr) fail(text("must be an array, not ", type_name(*node)));
  return array->size();
}

SceneValue SceneValue::element(std::size_t i) const {
  return {node->as_array()->get(i), source, text(path, ".", i), label};
}

double SceneValue::number(const Range& range) const {
  if (!node->is_number()) fail(text("must be a number, not ", type_name(*node)));
  const double value = *node->value<double>();
  if (!std::isfinite(value)) fail("must be finite, not nan or inf");
  const bool inside =
      range.open ? value > range.lo && value < range.hi : value >= range.lo && value <= range.hi;
  if (!inside) fail(text("must be ", range.text, ", not ", value));
  return value;
}

int SceneValue::integer(int lo, int hi) const {
  if (!node->is_integer()) fail(text("must be an integer, not ", type_name(*node)));
  const auto value = *node->value<std::int64_t>();
  if (value < lo || value > hi) {
    if (hi == std::numeric_limits<int>::max()) fail(text("must be at least ", lo, ", not ", value));
    fail(text("must be from ", lo, " to ", hi, ", not ", value));
  }
  return static_cast<int>(value);
}

bool SceneValue::boolean() const {
  if (!node->is_boolean()) fail(text("must be true or false, not ", type_name(*node)));
  return *node->value<bool>();
}

std::string SceneValue::string() const {
  if (!node->is_string()) fail(text("must be a string, not ", type_name(*node)));
  return *node->value<std::string>();
}

Vec3d SceneValue::vec3() const {
  if (!node->is_array()) fail(text("must be three numbers [x, y, z], not ", type_name(*node)));
  if (size() != 3) fail(text("must be three numbers [x, y, z], not ", size()));
  Vec3d v;
  for (int d = 0; d < 3; ++d) v[d] = element(static_cast<std::size_t>(d)).number(kAnyNumber);
  return v;
}

Box3 SceneValue::box() const {
  if (!node->is_array() || size() != 2) fail("must be two corners [[x, y, z], [x, y, z]]");
  Box3 b;
  b.lo = element(0).vec3();
  b.hi = element(1).vec3();
  if (b.empty()) fail("must give the low corner first, then the high corner");
  return b;
}

SceneTable::SceneTable(const toml::table& table, const SceneSource& source, std::string path,
                       std::string label, std::map<std::string, std::string>& places)
    : table_(&table),
      source_(&source),
      path_(std::move(path)),
      label_(std::move(label)),
      places_(&places) {
  (*places_)[path_] = place();
}

std::string SceneTable::key_path(std::string_view key) const {
  return path_.empty() ? std::string(key) : text(path_, ".", key);
}

std::optional<SceneValue> SceneTable::find(std::string_view key) {
  if (std::find(known_.begin(), known_.end(), key) == known_.end()) known_.emplace_back(key);
  const toml::node* node = table_->get(key);
  if (node == nullptr) return {};
  SceneValue value{node, source_, key_path(key),
                   path_.empty() ? text("'", key, "'") : text("'", key, "' in ", label_)};
  (*places_)[value.path] = value.place();
  return value;
}

SceneValue SceneTable::require(std::string_view key) {
  auto value = find(key);
  if (!value) {
    for (const auto& [given, node] : *table_)  // a mistyped name is the likelier cause
      if (edit_distance(given.str(), key) <= 2 &&
          std::find(known_.begin(), known_.end(), given.str()) == known_.end())
        source_->fail(
            key_path(given.str()), given.source(),
            text("unknown key '", given.str(), "' in ", label_, "; did you mean '", key, "'?"));
    fail(text(label_, " needs '", key, "'"));
  }
  return *value;
}

void SceneTable::read(std::string_view key, double& out, const Range& range) {
  if (const auto value = find(key)) out = value->number(range);
}
void SceneTable::read(std::string_view key, int& out, int lo, int hi) {
  if (const auto value = find(key)) out = value->integer(lo, hi);
}
void SceneTable::read(std::string_view key, bool& out) {
  if (const auto value = find(key)) out = value->boolean();
}
void SceneTable::read(std::string_view key, std::string& out) {
  if (const auto value = find(key)) out = value->string();
}
void SceneTable::read(std::string_view key, Vec3d& out) {
  if (const auto value = find(key)) out = value->vec3();
}

std::optional<SceneTable> SceneTable::table(std::string_view key, std::string label) {
  const auto value = find(key);
  if (!value) return {};
  const auto* inner = value->node->as_table();
  if (inner == nullptr)
    source_->fail(
        value->path, value->node->source(),
        value->node->is_array_of_tables()
            ? text(label, " may be given only once; write ", label, " instead of [", label, "]")
            : text(label, " must be a table, not ", type_name(*value->node)));
  return SceneTable(*inner, *source_, value->path, std::move(label), *places_);
}

std::vector<SceneTable> SceneTable::tables(std::string_view key, const std::string& label) {
  std::vector<SceneTable> all;
  const auto value = find(key);
  if (!value) return all;
  if (value->node->is_table())
    source_->fail(value->path, value->node->source(),
                  text("write ", label, " instead of [", key, "]: there may be several"));
  for (std::size_t i = 0; i < value->size(); ++i) {
    const SceneValue item = value->element(i);
    const auto* inner = item.node->as_table();
    if (inner == nullptr)
      source_->fail(item.path, item.node->source(),
                    text(label, " must be a table, not ", type_name(*item.node)));
    all.emplace_back(*inner, *source_, item.path, label, *places_);
  }
  return all;
}

void SceneTable::finish() const {
  for (const auto& [key, node] : *table_) {
    if (std::find(known_.begin(), known_.end(), key.str()) != known_.end()) continue;
    const bool section = path_.empty() && (node.is_table() || node.is_array_of_tables());
    const std::string where = path_.empty() ? "" : text(" in ", label_);
    // A section's own line is that of its header; the line of a key is where the key stands.
    const auto& region = key.source().begin.line > 0 ? key.source() : node.source();
    source_->fail(key_path(key.str()), region,
                  text(section ? "unknown section '" : "unknown key '", key.str(), "'", where,
                       hint(key.str(), known_)));
  }
}

void SceneTable::fail(const std::string& message) const {
  source_->fail(path_, table_->source(), message);
}

void SceneTable::fail(std::string_view key, const std::string& message) const {
  const toml::node* node = table_->get(key);
  source_->fail(key_path(key), node != nullptr ? node->source() : table_->source(), message);
}

void SceneTable::fail_choice(const SceneValue& value, const std::string& given,
                             const std::vector<std::string>& names) {
  const std::string near = nearest_name(given, names);
  std::string quoted;
  for (const auto& name : names) quoted += text(quoted.empty() ? "\"" : ", \"", name, "\"");
  value.fail(text("must be one of ", quoted, ", not \"", given, "\"",
                  near.empty() ? "" : text("; did you mean \"", near, "\"?")));
}

}  // namespace kerf
