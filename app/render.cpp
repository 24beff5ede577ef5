// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <optional>
#include <system_error>

#include "app/commands.hpp"
#include "app/folder_lock.hpp"
#include "app/interrupt.hpp"
#include "app/preview.hpp"
#include "app/progress.hpp"
#include "app/vtp.hpp"
#include "core/base/error.hpp"

namespace kerf {
namespace {

namespace fs = std::filesystem;

constexpr int kLeastSide = 16, kGreatestSide = 8192;  // pixels

/// The numbers of `text`, which `separator` parts; empty if it is not made of `count` numbers.
std::vector<double> parse_numbers(const std::string& text, char separator, std::size_t count) {
  std::vector<double> numbers;
  const char* at = text.data();
  const char* const end = at + text.size();
  while (numbers.size() < count) {
    double value = 0;
    const auto [rest, fault] = std::from_chars(at, end, value);
    if (fault != std::errc() || !std::isfinite(value)) return {};
    numbers.push_back(value);
    at = rest;
    if (at == end) break;
    if (*at++ != separator) return {};
  }
  if (numbers.size() != count || at != end || text.back() == separator) return {};
  return numbers;
}

PreviewOptions picture_options(const RenderOptions& given) {
  PreviewOptions options;
  options.samples = given.samples;
  if (!given.size.empty()) {
    const auto size = parse_numbers(given.size, 'x', 2);
    const auto whole = [](double side) {
      return side >= kLeastSide && side <= kGreatestSide && side == std::floor(side);
    };
    expects(size.size() == 2 && whole(size[0]) && whole(size[1]),
            text("--size ", given.size, ": must be WIDTHxHEIGHT in pixels from ", kLeastSide,
                 " to ", kGreatestSide, ", such as 1200x900"));
    options.width = static_cast<int>(size[0]);
    options.height = static_cast<int>(size[1]);
  }
  if (!given.view.empty()) {
    const auto view = parse_numbers(given.view, ',', 2);
    expects(
        view.size() == 2 && std::abs(view[1]) <= 90,
        text("--view ", given.view,
             ": must be AZIMUTH,ELEVATION in degrees, elevation from -90 to 90, such as 35,22"));
    options.view = View{view[0], view[1]};
  }
  if (!given.up.empty()) {
    const auto up = parse_numbers(given.up, ',', 3);
    expects(up.size() == 3 && (up[0] != 0 || up[1] != 0 || up[2] != 0),
            text("--up ", given.up, ": must be a direction X,Y,Z, such as 0,0,1"));
    options.up = {up[0], up[1], up[2]};
  }
  return options;
}

/// NNNN of STEM_NNNN.EXT, at least four digits; empty if the name is another.
std::string number_in(const std::string& name, const std::string& stem, const std::string& ext) {
  if (name.size() < stem.size() + ext.size() + 4 || !name.starts_with(stem) || !name.ends_with(ext))
    return {};
  const std::string digits = name.substr(stem.size(), name.size() - stem.size() - ext.size());
  const bool number = digits.find_first_not_of("0123456789") == std::string::npos;
  return number ? digits : std::string();
}

struct Frame {
  std::string number;  ///< as in the name of its surface
  fs::path surface;
};

/// All surfaces in `folder` in the order of their numbers.
/// @throws Error (bad_input) if there is none.
std::vector<Frame> find_series(const fs::path& folder) {
  std::error_code fault;
  expects(fs::is_directory(folder, fault), text(folder.string(), ": no such folder"));
  std::vector<Frame> series;
  fs::directory_iterator entries(folder, fault);
  expects(!fault, text(folder.string(), ": cannot be read: ", fault.message()));
  for (const auto& entry : entries) {
    const std::string number = number_in(entry.path().filename().string(), "surface_", ".vtp");
    if (!number.empty()) series.push_back({number, entry.path()});
  }
  expects(!series.empty(), text(folder.string(),
                                ": holds no surface_NNNN.vtp; run the scene with \"vtp\" in "
                                "output.formats and a surface"));
  std::sort(series.begin(), series.end(), [](const Frame& a, const Frame& b) {
    return a.number.size() != b.number.size() ? a.number.size() < b.number.size()
                                              : a.number < b.number;
  });
  return series;
}

/// Runs `action`; an Error that it throws gets the file in front.
template <class Action>
auto about(const fs::path& file, const Action& action) {
  try {
    return action();
  } catch (const Error& error) {
    throw Error(error.kind(), text(file.string(), ": ", error.what()));
  }
}

void make_folder(const fs::path& folder) {
  std::error_code fault;
  fs::create_directories(folder, fault);
  expects(fs::is_directory(folder),
          text(folder.string(), ": cannot be created: ",
               fault ? fault.message() : std::string("something else is there")));
}

std::string quoted(const fs::path& path) {
  std::string quoted = "'";
  for (const char c : path.string()) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

/// One call of `kerf render`.
class Render {
 public:
  Render(const RenderOptions& options, PreviewOptions picture)
      : quiet_(options.quiet),
        folder_(options.folder),
        out_(options.out.empty() ? options.folder : options.out),
        picture_(std::move(picture)),
        series_(find_series(folder_)),
        bar_(!options.quiet) {}

  int last_picture() {
    const Frame& last = series_.back();
    const SurfaceMesh mesh = read_vtp(last.surface);
    Framing framing = start_framing(last, mesh);
    about(last.surface, [&] { framing.add(mesh); });
    make_folder(out_);
    const FolderLock lock(out_);
    draw("preview.png", mesh, framing);
    say(fmt::format("picture    {}", (out_ / "preview.png").string()));
    return kDone;
  }

  int all_frames() {
    const InterruptGuard guard("interrupted: this picture is finished; again, to quit without");
    bar_.start_frames(static_cast<int>(series_.size()));
    const Framing framing = frame_all();
    make_folder(out_);
    const FolderLock lock(out_);
    std::size_t drawn = 0;
    for (; drawn < series_.size() && !InterruptGuard::asked(); ++drawn) {
      bar_.phase("drawing", 0, 0);
      const auto begin = std::chrono::steady_clock::now();
      draw(frame_name(drawn), read_vtp(series_[drawn].surface), framing);
      bar_.finished_frame(
          std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
    }
    bar_.clear();
    if (drawn < series_.size()) {
      complain(fmt::format("interrupted after frame {} of {}; frames so far are kept", drawn,
                           series_.size()));
      return kInterrupted;
    }
    leave_only_the_series();
    say_end();
    return kDone;
  }

 private:
  void say(const std::string& line) {
    if (!quiet_) std::printf("%s\n", line.c_str());
  }

  void complain(const std::string& line) {
    bar_.clear();
    std::fprintf(stderr, "kerf: %s\n", line.c_str());
  }

  /// All names have as many digits as the last, so that their order is that of the frames.
  std::string frame_name(std::size_t i) const {
    return fmt::format("frame_{:0>{}}.png", series_[i].number, series_.back().number.size());
  }

  /// From where most of the cuts is seen at the end, if the caller does not say.
  Framing start_framing(const Frame& last, const SurfaceMesh& mesh) const {
    const View view = picture_.view
                          ? *picture_.view
                          : about(last.surface, [&] { return choose_view(mesh, picture_); });
    return {view, picture_.up, picture_.aspect()};
  }

  /// Reads all surfaces, which need not fit into memory together.
  Framing frame_all() {
    bar_.phase("reading", 0, 0);
    Framing framing = start_framing(series_.back(), read_vtp(series_.back().surface));
    for (const auto& frame : series_) {
      if (InterruptGuard::asked()) break;
      bar_.phase("reading", 0, 0);
      const SurfaceMesh mesh = read_vtp(frame.surface);
      about(frame.surface, [&] { framing.add(mesh); });
    }
    return framing;
  }

  /// Under a temporary name first: a file with the right one is whole.
  void draw(const std::string& name, const SurfaceMesh& mesh, const Framing& framing) const {
    const fs::path partial = out_ / ("." + name + ".partial");
    std::error_code ignored, fault;
    try {
      draw_preview(partial, mesh, framing, picture_);
    } catch (...) {
      fs::remove(partial, ignored);
      throw;
    }
    fs::rename(partial, out_ / name, fault);
    if (!fault) return;
    fs::remove(partial, ignored);
    throw Error(ErrorKind::bad_input,
                text((out_ / name).string(), ": cannot be written: ", fault.message()));
  }

  /// Frames of another series would get into the film. Only a folder of Kerf's is tidied.
  void leave_only_the_series() {
    std::vector<std::string> ours, others;
    for (std::size_t i = 0; i < series_.size(); ++i) ours.push_back(frame_name(i));
    for (const auto& entry : fs::directory_iterator(out_)) {
      const std::string name = entry.path().filename().string();
      if (number_in(name, "frame_", ".png").empty() &&
          number_in(name, ".frame_", ".png.partial").empty())
        continue;
      if (std::find(ours.begin(), ours.end(), name) == ours.end()) others.push_back(name);
    }
    if (others.empty()) return;
    std::error_code ignored;
    if (fs::exists(out_ / "summary.json")) {
      for (const auto& name : others) fs::remove(out_ / name, ignored);
      return;
    }
    complain(fmt::format(
        "warning: {} also holds {}{} of another series: remove what is not to be in the film",
        out_.string(), *std::min_element(others.begin(), others.end()),
        others.size() > 1 ? fmt::format(" and {} more", others.size() - 1) : std::string()));
  }

  void say_end() {
    const std::size_t count = series_.size();
    say(fmt::format("frames     {} in {}, {}{}", count, out_.string(), frame_name(0),
                    count > 1 ? " to " + frame_name(count - 1) : std::string()));
    // The usual encoding wants even sides.
    const bool odd = picture_.width % 2 != 0 || picture_.height % 2 != 0;
    say(fmt::format(
        "film       ffmpeg -framerate 25 -pattern_type glob -i {} {}-pix_fmt yuv420p {}",
        quoted(out_ / "frame_*.png"), odd ? "-vf 'crop=trunc(iw/2)*2:trunc(ih/2)*2' " : "",
        quoted(out_ / "film.mp4")));
  }

  bool quiet_;
  fs::path folder_, out_;
  PreviewOptions picture_;
  std::vector<Frame> series_;
  ProgressBar bar_;
};

}  // namespace

int render_command(const RenderOptions& options) {
  require_preview();
  let_writes_fail();
  const PreviewOptions picture = picture_options(options);
  Render render(options, picture);
  return options.frames ? render.all_frames() : render.last_picture();
}

}  // namespace kerf
