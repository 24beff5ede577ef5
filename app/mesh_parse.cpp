// SPDX-License-Identifier: MIT
#include "app/mesh_parse.hpp"

#include <bit>
#include <charconv>
#include <cstring>
#include <utility>

#include "core/base/error.hpp"

namespace kerf {
namespace {

[[noreturn]] void damaged(const std::string& name, const std::string& what) {
  throw Error(ErrorKind::bad_input, text(name, ": ", what));
}

bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }

// Takes the next word off `rest`; empty at the end.
std::string_view take_word(std::string_view& rest) {
  std::size_t begin = 0;
  while (begin < rest.size() && is_space(rest[begin])) ++begin;
  std::size_t end = begin;
  while (end < rest.size() && !is_space(rest[end])) ++end;
  const std::string_view word = rest.substr(begin, end - begin);
  rest.remove_prefix(end);
  return word;
}

// Takes the next line off `rest`, without its end.
std::string_view take_line(std::string_view& rest) {
  const std::size_t end = std::min(rest.find('\n'), rest.size());
  std::string_view line = rest.substr(0, end);
  rest.remove_prefix(std::min(end + 1, rest.size()));
  if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
  return line;
}

double number(std::string_view word, const std::string& name) {
  if (word.empty()) damaged(name, "the file ends too early");
  std::string_view digits = word;
  if (digits.size() > 1 && digits[0] == '+') digits.remove_prefix(1);
  double value = 0;
  const auto [end, failure] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (failure != std::errc() || end != digits.data() + digits.size()) {
    constexpr std::size_t kShown = 20;
    damaged(name, text("'", word.substr(0, kShown), "' is not a number that can be used"));
  }
  return value;
}

// A count or an index.
std::size_t whole(double value, const std::string& name) {
  constexpr double kMost = 2147483647.0;  // points are numbered in 32 bits
  const bool fits = value >= 0 && value <= kMost;
  if (!fits || static_cast<double>(static_cast<std::size_t>(value)) != value)
    damaged(name, text(value, " is not a count, nor the number of a point"));
  return static_cast<std::size_t>(value);
}

// Lines of an OFF file that hold something, without comments.
std::string_view take_content(std::string_view& rest) {
  while (!rest.empty()) {
    std::string_view line = take_line(rest);
    line = line.substr(0, line.find('#'));
    std::string_view words = line;
    if (!take_word(words).empty()) return line;
  }
  return {};
}

}  // namespace

TriangleMesh parse_off(std::string_view bytes, const std::string& name) {
  std::string_view line = take_content(bytes);
  const std::string_view kind = take_word(line);
  if (kind != "OFF" && kind != "COFF" && kind != "NOFF" && kind != "CNOFF")
    damaged(name, "not an OFF file of points in space (it does not begin with OFF)");
  std::string_view first = take_word(line);
  if (first.empty()) {
    line = take_content(bytes);
    first = take_word(line);
  }
  const std::size_t points = whole(number(first, name), name);
  const std::size_t faces = whole(number(take_word(line), name), name);
  TriangleMesh mesh;
  for (std::size_t i = 0; i < points; ++i) {
    line = take_content(bytes);
    Vec3d p{};
    for (int d = 0; d < 3; ++d) p[d] = number(take_word(line), name);
    mesh.points.push_back(p);
  }
  std::vector<std::size_t> polygon;
  for (std::size_t i = 0; i < faces; ++i) {
    line = take_content(bytes);
    const std::size_t corners = whole(number(take_word(line), name), name);
    polygon.clear();
    for (std::size_t k = 0; k < corners; ++k)
      polygon.push_back(whole(number(take_word(line), name), name));
    add_polygon(mesh, polygon.data(), corners, 0);
  }
  return mesh;
}

namespace {

enum class PlyType { i8, u8, i16, u16, i32, u32, f32, f64 };

struct PlyProperty {
  std::string_view name;
  PlyType type{};
  bool list = false;
  PlyType count{};
};

struct PlyElement {
  std::string_view name;
  std::size_t count = 0;
  std::vector<PlyProperty> properties;
};

PlyType ply_type(std::string_view word, const std::string& name) {
  constexpr std::pair<std::string_view, PlyType> kTypes[] = {
      {"char", PlyType::i8},     {"int8", PlyType::i8},     {"uchar", PlyType::u8},
      {"uint8", PlyType::u8},    {"short", PlyType::i16},   {"int16", PlyType::i16},
      {"ushort", PlyType::u16},  {"uint16", PlyType::u16},  {"int", PlyType::i32},
      {"int32", PlyType::i32},   {"uint", PlyType::u32},    {"uint32", PlyType::u32},
      {"float", PlyType::f32},   {"float32", PlyType::f32}, {"double", PlyType::f64},
      {"float64", PlyType::f64},
  };
  for (const auto& [type_name, type] : kTypes)
    if (word == type_name) return type;
  damaged(name, "the PLY header names an unknown type of number");
}

// Reads the values of a PLY file one after the other; throws at its end.
class PlyReader {
 public:
  PlyReader(std::string_view bytes, const std::string& name) : rest_(bytes), name_(name) {
    if (take_line(rest_) != "ply") damaged(name, "not a PLY file (it does not begin with ply)");
    bool has_format = false;
    while (true) {
      if (rest_.empty()) damaged(name, "the PLY header has no end");
      std::string_view line = take_line(rest_);
      const std::string_view key = take_word(line);
      if (key == "end_header") break;
      if (key == "format") {
        set_format(take_word(line));
        has_format = true;
      } else if (key == "element") {
        const std::string_view element = take_word(line);
        elements_.push_back({element, whole(number(take_word(line), name), name), {}});
      } else if (key == "property") {
        if (elements_.empty()) damaged(name, "the PLY header has a property without an element");
        elements_.back().properties.push_back(property(line));
      }
    }
    if (!has_format) damaged(name, "the PLY header names no format");
  }

  const std::vector<PlyElement>& elements() const { return elements_; }

  double value(PlyType type) {
    if (ascii_) return number(take_word(rest_), name_);
    switch (type) {
      case PlyType::i8:
        return take<std::int8_t>();
      case PlyType::u8:
        return take<std::uint8_t>();
      case PlyType::i16:
        return take<std::int16_t>();
      case PlyType::u16:
        return take<std::uint16_t>();
      case PlyType::i32:
        return take<std::int32_t>();
      case PlyType::u32:
        return take<std::uint32_t>();
      case PlyType::f32:
        return static_cast<double>(take<float>());
      case PlyType::f64:
        return take<double>();
    }
    return 0;
  }

 private:
  void set_format(std::string_view format) {
    ascii_ = format == "ascii";
    const bool little = format == "binary_little_endian", big = format == "binary_big_endian";
    if (!ascii_ && !little && !big) damaged(name_, "the PLY header names an unknown format");
    swap_ = !ascii_ && little != (std::endian::native == std::endian::little);
  }

  PlyProperty property(std::string_view line) const {
    PlyProperty out;
    std::string_view type = take_word(line);
    if (type == "list") {
      out.list = true;
      out.count = ply_type(take_word(line), name_);
      type = take_word(line);
    }
    out.type = ply_type(type, name_);
    out.name = take_word(line);
    return out;
  }

  template <class T>
  T take() {
    if (rest_.size() < sizeof(T)) damaged(name_, "the file ends too early");
    char bytes[sizeof(T)];
    for (std::size_t i = 0; i < sizeof(T); ++i) bytes[i] = rest_[swap_ ? sizeof(T) - 1 - i : i];
    rest_.remove_prefix(sizeof(T));
    T out{};
    std::memcpy(&out, bytes, sizeof(T));
    return out;
  }

  std::string_view rest_;
  const std::string& name_;
  std::vector<PlyElement> elements_;
  bool ascii_ = true;
  bool swap_ = false;
};

// One item of an element. Its numbers x, y, z go to `point`, its list of corners to `polygon`.
void read_item(PlyReader& reader, const PlyElement& element, const std::string& name, Vec3d& point,
               std::vector<std::size_t>& polygon) {
  for (const PlyProperty& property : element.properties) {
    if (!property.list) {
      const double value = reader.value(property.type);
      for (int d = 0; d < 3; ++d)
        if (property.name == std::string_view("xyz").substr(static_cast<std::size_t>(d), 1))
          point[d] = value;
      continue;
    }
    const bool corners = property.name == "vertex_indices" || property.name == "vertex_index";
    for (std::size_t k = whole(reader.value(property.count), name); k > 0; --k) {
      const double value = reader.value(property.type);
      if (corners && element.name == "face") polygon.push_back(whole(value, name));
    }
  }
}

}  // namespace

TriangleMesh parse_ply(std::string_view bytes, const std::string& name) {
  PlyReader reader(bytes, name);
  TriangleMesh mesh;
  std::vector<std::size_t> polygon;
  for (const PlyElement& element : reader.elements()) {
    if (element.properties.empty()) continue;
    for (std::size_t i = 0; i < element.count; ++i) {
      Vec3d point{};
      polygon.clear();
      read_item(reader, element, name, point, polygon);
      if (element.name == "vertex") mesh.points.push_back(point);
      add_polygon(mesh, polygon.data(), polygon.size(), 0);
    }
  }
  return mesh;
}

}  // namespace kerf
