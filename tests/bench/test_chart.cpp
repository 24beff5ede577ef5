// SPDX-License-Identifier: MIT
//
// Charts: what is drawn, where, and what is left out.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <regex>
#include <stack>

#include "bench/chart.hpp"
#include "core/base/error.hpp"
#include "tests/support/files.hpp"

namespace kerf::bench {
namespace {

constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();

int count(const std::string& svg, const std::string& words) {
  int out = 0;
  for (std::size_t at = 0; (at = svg.find(words, at)) != std::string::npos; at += words.size())
    ++out;
  return out;
}

Chart one_panel(std::vector<ChartSeries> series, bool log_x = true, bool log_y = true) {
  return {"A chart", {{"Panel", "size", "error", log_x, log_y, std::move(series)}}};
}

int tool_tips(const std::string& svg) { return count(svg, "<title>"); }

TEST(Chart, DrawsLinesMarkersCrossesAndLegends) {
  const std::string svg =
      chart_svg(one_panel({{"first", {{1, 1, "tip"}, {10, 2}, {100, 3}}, "scene"},
                           {"second", {{1, 2}, {10, 3}}, "", true, false, {{5, 5, "cross"}}}}));

  for (const char* words : {">A chart<", ">Panel<", ">size<", ">error<", ">first<", ">second<",
                            ">scene<", "<title>tip</title>", "<title>cross</title>", "#0072b2"})
    EXPECT_NE(svg.find(words), std::string::npos) << words;
  EXPECT_EQ(count(svg, "stroke-width=\"1.2\""), 2);  // lines
  EXPECT_EQ(count(svg, "stroke-width=\"1.3\""), 4);  // three points, and the shape in the legend
  EXPECT_EQ(count(svg, "stroke-width=\"2.0\""), 1);  // the cross
}

// Not finite, or not positive where the axis is logarithmic.
TEST(Chart, LeavesOutPointsThatHaveNoPlace) {
  const ChartSeries series{"a",
                           {{1, 1, "1"},
                            {0, 1, "2"},
                            {-2, 1, "3"},
                            {2, kNothing, "4"},
                            {INFINITY, 1, "5"},
                            {2, 0, "6"},
                            {2, 2, "7"}}};

  EXPECT_EQ(tool_tips(chart_svg(one_panel({series}))), 2);
  EXPECT_EQ(tool_tips(chart_svg(one_panel({series}, false, true))), 4);
  EXPECT_EQ(tool_tips(chart_svg(one_panel({series}, false, false))), 5);
  EXPECT_EQ(chart_svg(one_panel({series}, false, false)).find("nan"), std::string::npos);
}

TEST(Chart, NothingToPlotIsRefused) {
  EXPECT_THROW(chart_svg({}), Error);
  EXPECT_THROW(chart_svg(one_panel({{"a", {{0, 1}}}})), Error);
}

TEST(Chart, TicksAreTidy) {
  const std::string decades = chart_svg(one_panel({{"a", {{2, 2e-6}, {3000, 0.3}}}}));
  for (const char* tick : {">10<", ">100<", ">1k<", ">1e-5<", ">1e-4<", ">0.1<"})
    EXPECT_NE(decades.find(tick), std::string::npos) << tick;
  EXPECT_EQ(decades.find(">20<"), std::string::npos);

  const std::string narrow = chart_svg(one_panel({{"a", {{30, 0.61}, {300, 0.79}}}}));
  for (const char* tick : {">50<", ">100<", ">200<", ">0.7<"})
    EXPECT_NE(narrow.find(tick), std::string::npos) << tick;

  const std::string linear = chart_svg(one_panel({{"a", {{-1, 0}, {0.9, 1e7}}}}, false, false));
  for (const char* tick : {">-0.5<", ">0<", ">0.5<", ">2M<", ">1e-5<"})
    EXPECT_EQ(linear.find(tick) != std::string::npos, tick != std::string(">1e-5<")) << tick;
}

TEST(Chart, CountsHaveNoTicksBetweenThemAndMayStartAtZero) {
  Chart chart = one_panel({{"a", {{2, 5}, {3, 6}}}}, false, false);
  EXPECT_EQ(chart_svg(chart).find(">2.5<"), std::string::npos);
  EXPECT_EQ(chart_svg(chart).find(">0<"), std::string::npos);

  chart.panels[0].from_zero = true;
  EXPECT_NE(chart_svg(chart).find(">0<"), std::string::npos);
}

TEST(Chart, ASingleValueHasARange) {
  for (const bool log : {false, true}) {
    const std::string svg = chart_svg(one_panel({{"a", {{3, 3, "tip"}}}}, log, log));
    EXPECT_EQ(svg.find("nan"), std::string::npos);
    EXPECT_NE(svg.find(">3<"), std::string::npos);
  }
}

// A point at the end of one panel is at the same place as in the other.
TEST(Chart, PanelsShareTheirAxesIfAsked) {
  Chart chart;
  chart.panels = {{"a", "x", "y", true, true, {{"s", {{1, 1}, {1000, 1000}}}}},
                  {"b", "x", "y", true, true, {{"s", {{1, 1}}}}}};
  const auto first_of_lines = [](const std::string& svg) {
    std::vector<double> out;  // y of each first point
    const std::regex pattern("<path d=\"M[0-9.]+ ([0-9.]+)[^\"]*\" fill=\"none\"");
    for (std::sregex_iterator i(svg.begin(), svg.end(), pattern), end; i != end; ++i)
      out.push_back(std::stod((*i)[1]));
    return out;
  };

  std::vector<double> apart = first_of_lines(chart_svg(chart));
  chart.same_axes = true;
  std::vector<double> shared = first_of_lines(chart_svg(chart));

  ASSERT_EQ(apart.size(), 2u);
  ASSERT_EQ(shared.size(), 2u);
  EXPECT_NE(apart[0], apart[1]);
  EXPECT_EQ(shared[0], shared[1]);
  chart.panels[1].log_x = false;
  EXPECT_THROW(chart_svg(chart), Error);
}

// Each tag is closed in its turn, and names cannot open one.
TEST(Chart, IsWellFormed) {
  Chart chart = one_panel({{"<a & \"b\">", {{1, 1, "x < y\x01"}, {2, 2}}, "'s'"}});
  chart.panels.push_back({"empty", "", "", true, true, {}});
  const std::string svg = chart_svg(chart);

  EXPECT_NE(svg.find("&lt;a &amp; &quot;b&quot;&gt;"), std::string::npos);
  EXPECT_EQ(svg.find('\x01'), std::string::npos);
  std::stack<std::string> open;
  const std::regex tag("<(/?)([a-z]+)( [a-zA-Z0-9-]+=\"[^\"<]*\"| xmlns=\"[^\"]*\")*(/?)>");
  int tags = 0;
  for (std::sregex_iterator i(svg.begin(), svg.end(), tag), end; i != end; ++i, ++tags) {
    if ((*i)[1] == "/") {
      ASSERT_FALSE(open.empty());
      EXPECT_EQ(open.top(), (*i)[2]);
      open.pop();
    } else if ((*i)[4] != "/") {
      open.push((*i)[2]);
    }
  }
  EXPECT_TRUE(open.empty());
  EXPECT_EQ(tags, count(svg, "<"));
}

class ChartFiles : public test::FolderTest {};

TEST_F(ChartFiles, WritesAreChecked) {
  write_svg("<svg/>", root_ / "a.svg", "--svg");
  EXPECT_EQ(test::read_all(root_ / "a.svg"), "<svg/>");

  try {
    write_svg("<svg/>", root_ / "none" / "a.svg", "--svg");
    ADD_FAILURE() << "was written";
  } catch (const Error& error) {
    EXPECT_EQ(error.what(), "--svg " + (root_ / "none" / "a.svg").string() + ": cannot be written");
  }
}

}  // namespace
}  // namespace kerf::bench
