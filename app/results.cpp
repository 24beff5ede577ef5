// SPDX-License-Identifier: MIT
#include "app/results.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string_view>

#include "app/figures.hpp"
#include "app/glb.hpp"
#include "app/ply.hpp"
#include "app/version.hpp"
#include "app/vtp.hpp"
#include "core/base/error.hpp"

namespace kerf {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kSummary = "summary.json";
constexpr const char* kPartial = ".partial";

std::string partial_name(const std::string& name) { return "." + name + kPartial; }

bool all_digits(std::string_view s) {
  return !s.empty() && std::all_of(s.begin(), s.end(), [](char c) { return c >= '0' && c <= '9'; });
}

/// STEM NNNN EXTENSION with four digits or more.
bool is_numbered(std::string_view name, std::string_view stem, std::string_view extension) {
  if (name.size() < stem.size() + 4 + extension.size()) return false;
  if (!name.starts_with(stem) || !name.ends_with(extension)) return false;
  return all_digits(name.substr(stem.size(), name.size() - stem.size() - extension.size()));
}

/// level_K_NNNN.vtu
bool is_level_file(const std::string& name) {
  constexpr std::string_view kStem = "level_";
  const std::size_t end = name.find('_', kStem.size());
  return end != std::string::npos && name.starts_with(kStem) &&
         all_digits(std::string_view(name).substr(kStem.size(), end - kStem.size())) &&
         is_numbered(name, name.substr(0, end + 1), ".vtu");
}

/// Whether a run, or `kerf render` after it, gives a file this name.
bool is_ours(const std::string& name) {
  for (const char* whole : {"body.pvd", "surface.pvd", "preview.png", kSummary})
    if (name == whole) return true;
  for (const auto& [stem, extension] : {std::pair{"body_", ".vtu"},
                                        {"surface_", ".vtp"},
                                        {"surface_", ".ply"},
                                        {"surface_", ".glb"},
                                        {"links_", ".vtp"},
                                        {"frame_", ".png"}})
    if (is_numbered(name, stem, extension)) return true;
  return is_level_file(name);
}

/// A temporary file of a run that was killed.
bool is_our_partial(const std::string& name) {
  if (!name.starts_with('.') || !name.ends_with(kPartial)) return false;
  return is_ours(name.substr(1, name.size() - 1 - std::strlen(kPartial)));
}

Error cannot_write(const fs::path& path, const std::string& why) {
  return Error(ErrorKind::bad_input, text(path.string(), ": cannot be written: ", why));
}

const char* surface_name(SurfaceMethod method) {
  switch (method) {
    case SurfaceMethod::dual_contouring:
      return "dual-contouring";
    case SurfaceMethod::splitting_cubes:
      return "splitting-cubes";
    case SurfaceMethod::none:
      break;
  }
  return "none";
}

Json step_json(const StepReport& step) {
  Json json;
  json["step"] = step.step;
  json["time"] = step.time;
  json["rotation_updates"] = step.rotation_updates;
  json["cycles"] = step.cycles;
  json["linear_residual"] = step.linear_residual;
  json["residual"] = step.residual;
  json["converged"] = step.converged;
  json["seconds"] = step.seconds;
  json["cells"] = step.cells;
  json["vertices"] = step.vertices;
  json["pieces"] = step.pieces;
  json["cuts"] = Json::array();
  for (const auto& cut : step.cuts)
    json["cuts"].push_back({{"cut", cut.cut_id},
                            {"links_hit", cut.links_hit},
                            {"links_cut", cut.disconnected.size()},
                            {"cells_before", cut.cells_before},
                            {"cells_after", cut.cells_after}});
  return json;
}

}  // namespace

std::string to_json(const Summary& s) {
  Json json;
  json["scene"] = s.scene;
  json["title"] = s.title;
  json["cells"] = s.cells;
  json["cells_before_cuts"] = s.cells_before_cuts;
  json["vertices"] = s.vertices;
  json["unknowns"] = s.unknowns;
  json["hanging"] = s.hanging;
  json["levels"] = s.level_cells.size();
  json["level_cells"] = s.level_cells;
  json["level_vertices"] = s.level_vertices;
  json["pieces"] = s.pieces;
  json["links_cut"] = s.links_cut;
  json["surface"] = {{"method", surface_name(s.surface)},
                     {"points", s.surface_points},
                     {"triangles", s.surface_triangles}};
  json["converged"] = s.converged;
  json["interrupted"] = s.interrupted;
  json["seconds"] = Json::object();
  for (const auto& [phase, seconds] : s.seconds) json["seconds"][phase] = seconds;
  json["seconds"]["total"] = s.seconds_total;
  json["peak_bytes"] = s.peak_bytes;
  json["bytes_per_cell"] =
      s.cells > 0 ? static_cast<double>(s.bytes) / static_cast<double>(s.cells) : 0.0;
  json["backend"] = s.backend;
  json["instruction_set"] = s.instruction_set;
  json["threads"] = s.threads;
  json["precision"] = s.precision;
  json["version"] = kVersion;
  json["commit"] = kCommit;
  json["state_hash"] = fmt::format("{:016x}", s.state_hash);
  json["warnings"] = s.warnings;
  json["steps"] = Json::array();
  for (const auto& step : s.steps) json["steps"].push_back(step_json(step));
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

ResultsFolder::ResultsFolder(fs::path folder, OutputSettings settings)
    : folder_(std::move(folder)), settings_(settings) {
  std::error_code error;
  const fs::file_status status = fs::status(folder_, error);
  if (fs::exists(status) && !fs::is_directory(status))
    throw cannot_write(folder_, "it is a file, not a folder");
  // Remember which folders are new, innermost first, to take them back if the run fails.
  for (fs::path p = fs::absolute(folder_).lexically_normal(); !p.empty() && p != p.root_path();
       p = p.parent_path())
    if (!p.filename().empty() && !fs::exists(p, error)) created_.push_back(p);
  fs::create_directories(folder_, error);
  if (error) {
    const std::string why = error.message();
    for (const auto& p : created_) fs::remove(p, error);
    throw cannot_write(folder_, why);
  }
  lock_.emplace(folder_);
  const fs::path probe = folder_ / partial_name(kSummary);
  std::ofstream out(probe);
  const int reason = errno;
  out.close();
  if (!out) {
    for (const auto& p : created_) fs::remove(p, error);
    throw cannot_write(folder_, std::strerror(reason));
  }
  fs::remove(probe, error);
}

ResultsFolder::~ResultsFolder() {
  if (committed_ || !lock_->is_in_place()) return;
  std::error_code error;
  for (const auto& name : files_) fs::remove(folder_ / partial_name(name), error);
  fs::remove(folder_ / partial_name(kSummary), error);
  for (const auto& p : created_) fs::remove(p, error);  // fails, as it should, if not empty
}

// Else another run may be at work under the same name.
void ResultsFolder::expect_in_place() const {
  if (!lock_->is_in_place())
    throw cannot_write(folder_, "the folder that this run began in was moved or removed");
}

fs::path ResultsFolder::add_file(const std::string& name) {
  expect_in_place();
  files_.push_back(name);
  return folder_ / partial_name(name);
}

void ResultsFolder::drop_file(const std::string& name) {
  std::error_code error;
  fs::remove(folder_ / partial_name(name), error);
  std::erase(files_, name);
}

void ResultsFolder::write_text(const std::string& name, const std::string& content) {
  const fs::path path = folder_ / partial_name(name);
  std::ofstream out(path, std::ios::binary);
  out << content;
  out.close();
  if (!out) throw cannot_write(folder_ / name, std::strerror(errno));
}

void ResultsFolder::add_snapshot(int step, double time, const Snapshot& snapshot) {
  if (!settings_.vtu) return;
  const std::string name = fmt::format("body_{:04}.vtu", step);
  const fs::path path = add_file(name);
  write_vtu(path, snapshot);
  bodies_.emplace_back(time, name);
}

std::string ResultsFolder::add_surface(int step, double time, const SurfaceMesh& surface) {
  const std::string stem = fmt::format("surface_{:04}", step);
  if (settings_.vtp) {
    write_vtp(add_file(stem + ".vtp"), surface);
    surfaces_.emplace_back(time, stem + ".vtp");
  }
  if (settings_.ply) write_ply(add_file(stem + ".ply"), surface);
  if (!settings_.glb) return {};
  const std::string obstacle = glb_obstacle(surface);
  if (!obstacle.empty()) return "no " + stem + ".glb: " + obstacle;
  write_glb(add_file(stem + ".glb"), surface);
  return {};
}

void ResultsFolder::add_figures(int step, const LinkedOctree& body, const Hierarchy& hierarchy,
                                std::span<const Vec3d> corners) {
  if (settings_.levels)
    for (std::size_t level = 0; level < hierarchy.levels.size(); ++level)
      write_level(add_file(fmt::format("level_{}_{:04}.vtu", level, step)),
                  level_figure(body, hierarchy, level, corners));
  if (settings_.links)
    write_links(add_file(fmt::format("links_{:04}.vtp", step)), links_figure(body));
}

void ResultsFolder::write_series(const std::string& name, const Series& series) {
  std::string pvd =
      "<?xml version=\"1.0\"?>\n"
      "<VTKFile type=\"Collection\" version=\"1.0\" byte_order=\"LittleEndian\">\n"
      "  <Collection>\n";
  for (const auto& [time, file] : series)
    pvd += fmt::format("    <DataSet timestep=\"{:.9g}\" part=\"0\" file=\"{}\"/>\n", time, file);
  pvd += "  </Collection>\n</VTKFile>\n";
  add_file(name);
  write_text(name, pvd);
}

// Files of an earlier run that this one did not write again. Where no summary was, none was ours.
void ResultsFolder::remove_stale(bool earlier_run) const {
  std::error_code error;
  std::vector<fs::path> stale;
  for (const auto& entry : fs::directory_iterator(folder_, error)) {
    const std::string name = entry.path().filename().string();
    const bool written = std::find(files_.begin(), files_.end(), name) != files_.end();
    const bool left_over = earlier_run && is_ours(name) && !written && name != kSummary;
    if ((left_over || is_our_partial(name)) && entry.is_regular_file(error))
      stale.push_back(entry.path());
  }
  for (const auto& path : stale) fs::remove(path, error);
}

void ResultsFolder::commit(const Summary& summary) {
  expect_in_place();
  if (settings_.pvd && settings_.vtu) write_series("body.pvd", bodies_);
  if (settings_.pvd && settings_.vtp) write_series("surface.pvd", surfaces_);
  write_text(kSummary, to_json(summary));

  // Nothing may stand in the way of a file once the renaming has begun.
  std::error_code error;
  const auto expect_free = [&](const std::string& name) {
    const fs::file_status status = fs::symlink_status(folder_ / name, error);
    if (fs::exists(status) && !fs::is_regular_file(status))
      throw cannot_write(folder_ / name, "something that is no file has this name; move it away");
  };
  for (const auto& name : files_) {
    expect_free(name);
    if (!fs::exists(folder_ / partial_name(name), error))
      throw cannot_write(folder_ / name,
                         "its temporary file is gone: something else emptied the "
                         "folder while the run wrote to it");
  }
  expect_free(kSummary);
  const bool earlier_run = fs::exists(folder_ / kSummary, error);
  // The old summary goes first and the new one comes last: a summary means that all is there.
  fs::remove(folder_ / kSummary, error);
  for (const auto& name : files_) {
    fs::rename(folder_ / partial_name(name), folder_ / name, error);
    if (error) throw cannot_write(folder_ / name, error.message());
  }
  fs::rename(folder_ / partial_name(kSummary), folder_ / kSummary, error);
  if (error) throw cannot_write(folder_ / kSummary, error.message());
  committed_ = true;
  remove_stale(earlier_run);
}

}  // namespace kerf
