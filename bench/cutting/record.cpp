// SPDX-License-Identifier: MIT
#include "bench/cutting/record.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "core/base/error.hpp"

namespace kerf::cutting {
namespace {

using Json = nlohmann::ordered_json;

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

double number_of(const Json& from) { return from.is_null() ? kNone : from.get<double>(); }

const Record* find(const std::vector<Record>& all, const Record& like, int below) {
  const Record* out = nullptr;
  for (const Record& r : all)
    if (r.scene == like.scene && r.method == like.method && r.size < below &&
        (out == nullptr || r.size > out->size))
      out = &r;
  return out;
}

// Errors that the linear solver leaves have no order.
double order_between(double coarse, double fine, double ratio) {
  return coarse > kSolved && fine > kSolved ? std::log(coarse / fine) / std::log(ratio) : kNone;
}

Json cost_of(const Record& r) {
  const Cost& c = r.cost;
  return {{"octree", c.octree}, {"cut", c.cut},     {"structure", c.structure},
          {"values", c.values}, {"solve", c.solve}, {"all", c.seconds()}};
}

Record record_of(const Json& j) {
  Record r;
  j.at("scene").get_to(r.scene);
  j.at("method").get_to(r.method);
  j.at("size").get_to(r.size);
  const std::pair<const char*, double Record::*> numbers[] = {
      {"h", &Record::h},           {"value", &Record::value},
      {"exact", &Record::exact},   {"error", &Record::error},
      {"energy", &Record::energy}, {"energy_exact", &Record::energy_exact},
      {"spread", &Record::spread}, {"energy_error", &Record::energy_error}};
  for (const auto& [name, member] : numbers) r.*member = number_of(j.at(name));
  for (const Json& part : j.at("parts"))
    r.parts.push_back({part.at("name").get<std::string>(), number_of(part.at("value")),
                       number_of(part.at("exact"))});
  j.at("cells").get_to(r.cost.cells);
  j.at("unknowns").get_to(r.cost.unknowns);
  const Json& seconds = j.at("seconds");
  seconds.at("octree").get_to(r.cost.octree);
  seconds.at("cut").get_to(r.cost.cut);
  seconds.at("structure").get_to(r.cost.structure);
  seconds.at("values").get_to(r.cost.values);
  seconds.at("solve").get_to(r.cost.solve);
  j.at("cycles").get_to(r.cost.cycles);
  j.at("bytes").get_to(r.cost.bytes);
  j.at("peak_bytes").get_to(r.cost.peak_bytes);
  j.at("removed").get_to(r.cost.removed);
  return r;
}

}  // namespace

void Record::set_energy(double value_of_it, double exact_one) {
  energy = value_of_it;
  energy_exact = exact_one;
  energy_error = std::abs(value_of_it - exact_one) / std::abs(exact_one);
}

void Record::set_spread() {
  double low = kNone, high = kNone, sum = 0;
  for (const Part& part : parts) {
    low = std::fmin(low, part.value);
    high = std::fmax(high, part.value);
    sum += part.value;
  }
  spread = (high - low) * static_cast<double>(parts.size()) / std::abs(sum);
}

void add_orders(std::vector<Record>& records) {
  for (Record& r : records) {
    const Record* half = find(records, r, r.size);
    if (half == nullptr) continue;
    const double ratio = half->h / r.h;
    r.order = order_between(half->error, r.error, ratio);
    r.energy_order = order_between(half->energy_error, r.energy_error, ratio);
    const Record* quarter = find(records, r, half->size);
    // Where the closed form is read at other places for each size, the answers have no limit.
    const auto same = [&](const Record* other) {
      return std::abs(other->exact - r.exact) <= 1e-12 * std::abs(r.exact);
    };
    if (quarter == nullptr || !same(half) || !same(quarter) || 2 * half->size != r.size ||
        2 * quarter->size != half->size)
      continue;
    const double first = half->value - quarter->value, second = r.value - half->value;
    r.order_of_differences = order_between(std::abs(first), std::abs(second), 2);
    if (first * second > 0 && std::abs(second) < std::abs(first))
      r.limit = r.value + second * second / (first - second);
  }
}

std::string json_line(const Record& r, const bench::Origin& origin) {
  Json parts = Json::array();
  for (const Part& part : r.parts)
    parts.push_back(
        {{"name", part.name}, {"value", number(part.value)}, {"exact", number(part.exact)}});
  const Json out = {{"scene", r.scene},
                    {"method", r.method},
                    {"size", r.size},
                    {"h", r.h},
                    {"value", number(r.value)},
                    {"exact", number(r.exact)},
                    {"error", number(r.error)},
                    {"order", number(r.order)},
                    {"limit", number(r.limit)},
                    {"order_of_differences", number(r.order_of_differences)},
                    {"energy", number(r.energy)},
                    {"energy_exact", number(r.energy_exact)},
                    {"energy_error", number(r.energy_error)},
                    {"energy_order", number(r.energy_order)},
                    {"spread", number(r.spread)},
                    {"parts", parts},
                    {"cells", r.cost.cells},
                    {"vertices", r.cost.vertices},
                    {"unknowns", r.cost.unknowns},
                    {"levels", r.cost.levels},
                    {"pieces", r.cost.pieces},
                    {"removed", r.cost.removed},
                    {"seconds", cost_of(r)},
                    {"cycles", r.cost.cycles},
                    {"residual", r.cost.residual},
                    {"bytes", r.cost.bytes},
                    {"peak_bytes", r.cost.peak_bytes},
                    {"threads", r.threads},
                    {"commit", origin.commit},
                    {"build", origin.build},
                    {"machine", origin.machine}};
  return out.dump();
}

void write_json(const std::filesystem::path& file, const std::vector<Record>& records,
                const bench::Origin& origin) {
  std::ofstream stream(file);
  for (const Record& r : records) stream << json_line(r, origin) << '\n';
  stream.close();
  expects(stream.good(), text("--json ", file.string(), ": cannot be written"));
}

std::vector<Record> read_json(const std::filesystem::path& file) {
  std::ifstream in(file);
  expects(in.good(), text(file.string(), ": cannot be read"));
  std::vector<Record> out;
  int number_of_line = 0;
  for (std::string line; std::getline(in, line);) {
    ++number_of_line;
    if (line.empty()) continue;
    try {
      out.push_back(record_of(Json::parse(line)));
    } catch (const nlohmann::json::exception& error) {
      throw Error(ErrorKind::bad_input,
                  text(file.string(), ":", number_of_line, ": ", error.what()));
    }
  }
  expects(!out.empty(), text(file.string(), ": has no line"));
  add_orders(out);
  return out;
}

}  // namespace kerf::cutting
