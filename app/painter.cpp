// SPDX-License-Identifier: MIT
#include "app/painter.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <thread>

#include "core/base/error.hpp"

namespace kerf {
namespace {

constexpr int kFew = 2;          // samples per pixel and direction where there is no edge
constexpr int kSkyRays = 4;      // of each of them
constexpr int kEdgeRays = 2;     // of each sample at an edge
constexpr float kFlat = 0.92f;   // cosine between normals in one pixel; less is an edge
constexpr float kThick = 0.01f;  // diagonals from a sample to the plane of another; more is an edge
constexpr float kThin = 0.004f;  // the same between pixels, for the filter
constexpr int kSteps = 3;        // of the filter, each wider than the last

/// The mean over a pixel. At an edge there is only a colour, and it stands in `light`.
struct Pixel {
  Look look;
  bool edge = false;
};

/// What the filter smooths.
struct Glow {
  Vec3f light, shine;
};

Vec3f times(const Vec3f& a, const Vec3f& b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }

/// A tent over [-1, 1] from a number in [0, 1]: the weight of a sample falls with its distance.
float tent(float u) { return u < 0.5f ? std::sqrt(2 * u) - 1 : 1 - std::sqrt(2 - 2 * u); }

class Painter {
 public:
  Painter(const Studio& studio, const Canvas& canvas)
      : studio_(studio), canvas_(canvas), pixels_(count()) {}

  std::vector<std::uint8_t> paint() {
    each_pixel([&](int x, int y) { pixels_[index(x, y)] = pixel(x, y); });
    smooth();
    std::vector<std::uint8_t> rgb(3 * count());
    each_pixel([&](int x, int y) { encode(index(x, y), &rgb[3 * index(x, y)]); });
    return rgb;
  }

 private:
  std::size_t count() const {
    return static_cast<std::size_t>(canvas_.width) * static_cast<std::size_t>(canvas_.height);
  }
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(canvas_.width) +
           static_cast<std::size_t>(x);
  }
  float across(float x) const { return x / static_cast<float>(canvas_.width); }
  float down(float y) const { return y / static_cast<float>(canvas_.height); }

  template <class Work>
  void each_pixel(const Work& work) const {
    std::atomic<int> next{0};
    const auto rows = [&] {
      for (int y = next++; y < canvas_.height && !gives_up(); y = next++)
        for (int x = 0; x < canvas_.width; ++x) work(x, y);
    };
    const unsigned all = std::max(1u, std::thread::hardware_concurrency());
    std::vector<std::jthread> threads(canvas_.threads > 0 ? static_cast<unsigned>(canvas_.threads)
                                                          : all);
    for (auto& thread : threads) thread = std::jthread(rows);
    threads.clear();  // which waits for them
    if (gives_up()) throw Error(ErrorKind::unavailable, "interrupted");
  }
  bool gives_up() const { return canvas_.stop != nullptr && canvas_.stop(); }

  /// Gives `use` n x n samples of one pixel, each from its own part of it.
  template <class Use>
  void sample(int px, int py, int n, int rays, const Use& use) const {
    PixelSamples samples(static_cast<std::uint32_t>(index(px, py)));
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i) {
        const auto [a, b] = samples.place.next();
        const float u = (static_cast<float>(i) + a) / static_cast<float>(n);
        const float v = (static_cast<float>(j) + b) / static_cast<float>(n);
        const float x = across(static_cast<float>(px) + 0.5f + tent(u));
        const float y = down(static_cast<float>(py) + 0.5f + tent(v));
        const Look look = studio_.look(x, y, rays, samples);
        use(look, studio_.place(x, y, look.distance));
      }
  }

  Pixel pixel(int px, int py) const {
    Pixel mean;
    Look& sum = mean.look;
    Vec3f first;  // place
    int taken = 0;
    sample(px, py, std::min(kFew, canvas_.samples), kSkyRays,
           [&](const Look& look, const Vec3f& place) {
             if (taken++ == 0) {
               sum = look;
               first = place;
               return;
             }
             const bool same = look.cut_id == sum.cut_id &&
                               dot(look.normal, sum.normal) > kFlat * norm(sum.normal) &&
                               std::abs(dot(place - first, look.normal)) < kThick;
             mean.edge = mean.edge || !same;
             sum.base += look.base;
             sum.light += look.light;
             sum.shine += look.shine;
             sum.normal += look.normal;
             sum.distance += look.distance;
           });
    if (mean.edge) return edge_pixel(px, py);
    const float part = 1 / static_cast<float>(taken);
    sum.base *= part;
    sum.light *= part;
    sum.shine *= part;
    sum.distance *= part;
    sum.normal *= 1 / norm(sum.normal);
    return mean;
  }

  Pixel edge_pixel(int px, int py) const {
    Pixel mean;
    mean.edge = true;
    int taken = 0;
    sample(px, py, canvas_.samples, kEdgeRays, [&](const Look& look, const Vec3f&) {
      mean.look.light += finished(look);
      ++taken;
    });
    mean.look.light *= 1 / static_cast<float>(taken);
    return mean;
  }

  void smooth() {
    std::vector<Glow> glow(count());
    for (int step = 1; step <= kSteps; ++step) {
      each_pixel([&](int x, int y) {
        const Pixel& pixel = pixels_[index(x, y)];
        glow[index(x, y)] =
            pixel.edge ? Glow{pixel.look.light, pixel.look.shine} : smoothed(x, y, step);
      });
      for (std::size_t i = 0; i < glow.size(); ++i) {
        pixels_[i].look.light = glow[i].light;
        pixels_[i].look.shine = glow[i].shine;
      }
    }
  }

  /// The mean of a pixel and those around it that see the same smooth surface [Dammertz et al.
  /// 2010].
  Glow smoothed(int px, int py, int stride) const {
    const Look& middle = pixels_[index(px, py)].look;
    const Vec3f place = place_of(px, py);
    constexpr std::array<float, 5> kWeight{1, 4, 6, 4, 1};
    Glow sum;
    float total = 0;
    for (std::size_t k = 0; k < 25; ++k) {
      const int x = px + stride * (static_cast<int>(k % 5) - 2);
      const int y = py + stride * (static_cast<int>(k / 5) - 2);
      if (x < 0 || x >= canvas_.width || y < 0 || y >= canvas_.height) continue;
      const Pixel& other = pixels_[index(x, y)];
      if (other.edge || other.look.cut_id != middle.cut_id) continue;
      const float off = dot(place_of(x, y) - place, middle.normal) / kThin;
      float bend = std::max(0.0f, dot(other.look.normal, middle.normal));
      for (int square = 0; square < 5; ++square) bend *= bend;
      const float weight = kWeight[k % 5] * kWeight[k / 5] * bend / (1 + off * off);
      sum.light += weight * other.look.light;
      sum.shine += weight * other.look.shine;
      total += weight;
    }
    if (!(total > 0)) return {middle.light, middle.shine};
    return {sum.light * (1 / total), sum.shine * (1 / total)};
  }

  Vec3f place_of(int px, int py) const {
    return studio_.place(across(static_cast<float>(px) + 0.5f), down(static_cast<float>(py) + 0.5f),
                         pixels_[index(px, py)].look.distance);
  }

  /// The colour of a look. Takes back what is too bright of a surface, and leaves the hue.
  static Vec3f finished(const Look& look) {
    constexpr float kKnee = 0.6f, kRest = 1 - kKnee;
    const Vec3f colour = times(look.base, look.light) + look.shine;
    const float most = std::max({colour.x, colour.y, colour.z});
    if (look.cut_id == Look::kBackdrop || most <= kKnee) return colour;
    return colour * ((kKnee + kRest * (1 - std::exp((kKnee - most) / kRest))) / most);
  }

  void encode(std::size_t i, std::uint8_t* rgb) const {
    const Pixel& pixel = pixels_[i];
    const Vec3f colour = pixel.edge ? pixel.look.light : finished(pixel.look);
    for (int d = 0; d < 3; ++d) {
      const float c = std::min(1.0f, std::max(0.0f, colour[d]));
      const float srgb = c <= 0.0031308f ? 12.92f * c : 1.055f * std::pow(c, 1 / 2.4f) - 0.055f;
      // Noise of one step breaks the bands in what is nearly flat; its weight is a tent.
      const std::uint32_t h =
          Samples::hash(3 * static_cast<std::uint32_t>(i) + static_cast<std::uint32_t>(d));
      const float noise = static_cast<float>((h >> 16) + (h & 0xffffu)) * 0x1p-16f - 1;
      const float byte = std::min(255.0f, std::max(0.0f, 255 * srgb + noise));
      rgb[d] = static_cast<std::uint8_t>(std::lround(byte));
    }
  }

  const Studio& studio_;
  const Canvas& canvas_;
  std::vector<Pixel> pixels_;
};

}  // namespace

std::vector<std::uint8_t> paint(const Studio& studio, const Canvas& canvas) {
  return Painter(studio, canvas).paint();
}

}  // namespace kerf
