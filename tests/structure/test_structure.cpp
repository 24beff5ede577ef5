// SPDX-License-Identifier: MIT
//
// The rules of the source tree that a compiler does not check: who may include whom, what a header
// for a device may use, the licence line.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;

constexpr int kMaxLines = 600;

/// What the files of a folder may include between quotes, and whether Eigen is among its tools.
struct Rule {
  std::set<std::string> folders;
  bool eigen_in_sources = false;
};

const std::map<std::string, Rule> kRules = {
    {"kernels", {{"kernels"}}},
    {"core", {{"kernels", "core"}, true}},
    {"cpu", {{"kernels", "core", "cpu"}}},
    {"gpu", {{"kernels", "core", "gpu"}}},
    {"app", {{"core", "cpu", "gpu", "app", "scenes"}}},
};

bool is_header(const fs::path& path) {
  return path.extension() == ".hpp" || path.extension() == ".cuh";
}

/// All C++ and CUDA files below a folder of the source tree, as paths relative to it.
std::vector<std::string> sources(const std::string& folder) {
  const fs::path root = KERF_SOURCE_DIR;
  std::vector<std::string> found;
  if (!fs::exists(root / folder)) return found;
  for (const auto& entry : fs::recursive_directory_iterator(root / folder)) {
    const std::string extension = entry.path().extension();
    if (extension == ".cpp" || extension == ".cu" || is_header(entry.path()))
      found.push_back(fs::relative(entry.path(), root).generic_string());
  }
  std::sort(found.begin(), found.end());
  return found;
}

std::vector<std::string> all_sources() {
  std::vector<std::string> found;
  for (const char* folder : {"kernels", "core", "cpu", "gpu", "app", "scenes", "tests", "bench"})
    for (auto& file : sources(folder)) found.push_back(std::move(file));
  return found;
}

std::string content(const std::string& file) {
  std::ifstream in(fs::path(KERF_SOURCE_DIR) / file);
  std::ostringstream out;
  out << in.rdbuf();
  return out.str();
}

std::vector<std::string> lines(const std::string& text) {
  std::vector<std::string> out;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) out.push_back(line);
  return out;
}

/// The names that `#include` lines of a text give between `open` and `close`.
std::vector<std::string> includes(const std::string& text, char open, char close) {
  std::vector<std::string> out;
  for (const std::string& line : lines(text)) {
    if (line.rfind("#include", 0) != 0) continue;
    const auto from = line.find(open);
    if (from == std::string::npos) continue;
    const auto to = line.find(close, from + 1);
    if (to != std::string::npos) out.push_back(line.substr(from + 1, to - from - 1));
  }
  return out;
}

std::string top_folder(const std::string& path) { return path.substr(0, path.find('/')); }

/// What a file of `folder` includes against the rules.
std::vector<std::string> wrong_includes(const std::string& folder, bool header,
                                        const std::string& text) {
  const Rule& rule = kRules.at(folder);
  std::vector<std::string> wrong;
  for (const auto& name : includes(text, '"', '"'))
    if (!rule.folders.contains(top_folder(name))) wrong.push_back(name);
  for (const auto& name : includes(text, '<', '>')) {
    const bool eigen = name.rfind("Eigen/", 0) == 0 || name.rfind("unsupported/Eigen", 0) == 0;
    if (eigen && (header || !rule.eigen_in_sources)) wrong.push_back(name);
    if (name == "omp.h" && folder != "cpu") wrong.push_back(name);
  }
  return wrong;
}

TEST(Structure, IncludesFollowTheDirectionOfTheFolders) {
  std::size_t files = 0;
  for (const auto& [folder, rule] : kRules)
    for (const auto& file : sources(folder)) {
      ++files;
      for (const auto& name : wrong_includes(folder, is_header(file), content(file)))
        ADD_FAILURE() << file << " includes " << name;
    }

  EXPECT_GT(files, 20u) << "the sources were not found below " << KERF_SOURCE_DIR;
}

TEST(Structure, WrongIncludesAreFound) {
  EXPECT_EQ(wrong_includes("kernels", true, "#include \"core/setup.hpp\"\n").size(), 1u);
  EXPECT_EQ(wrong_includes("core", false, "#include \"cpu/cpu_backend.hpp\"  // why\n").size(), 1u);
  EXPECT_EQ(wrong_includes("cpu", false, "#include \"gpu/cuda_backend.hpp\"\n").size(), 1u);
  EXPECT_EQ(wrong_includes("core", true, "#include <Eigen/Dense>\n").size(), 1u);
  EXPECT_TRUE(wrong_includes("core", false, "#include <Eigen/Dense>\n").empty());
}

TEST(Structure, KernelsUseOnlyArithmeticHeaders) {
  const std::set<std::string> allowed = {"cmath", "cstddef", "cstdint"};

  for (const auto& file : sources("kernels"))
    for (const auto& name : includes(content(file), '<', '>')) {
      const bool assertion = file == "kernels/host_device.hpp" && name == "cassert";
      EXPECT_TRUE(allowed.contains(name) || assertion) << file << " includes <" << name << ">";
    }
}

TEST(Structure, MacrosAndDeviceSwitchesStandInOneHeader) {
  for (const char* folder : {"kernels", "core", "cpu", "gpu", "app"})
    for (const auto& file : sources(folder)) {
      if (file == "kernels/host_device.hpp") continue;
      for (const auto& line : lines(content(file))) {
        EXPECT_FALSE(line.rfind("#define", 0) == 0 && is_header(file)) << file << ": " << line;
        EXPECT_FALSE(line.rfind("#if", 0) == 0 && line.find("CUDA") != std::string::npos)
            << file << ": " << line;
      }
    }
}

TEST(Structure, CoreAndKernelsAreSerial) {
  for (const char* folder : {"kernels", "core"})
    for (const auto& file : sources(folder))
      EXPECT_EQ(content(file).find("#pragma omp"), std::string::npos) << file;
}

TEST(Structure, EveryFileStartsWithItsLicence) {
  for (const auto& file : all_sources())
    EXPECT_EQ(content(file).rfind("// SPDX-License-Identifier: MIT\n", 0), 0u) << file;
}

TEST(Structure, HeadersAreGuarded) {
  for (const auto& file : all_sources()) {
    if (!is_header(file)) continue;
    EXPECT_NE(content(file).find("\n#pragma once\n"), std::string::npos) << file;
  }
}

TEST(Structure, FilesAreShortEnoughToRead) {
  for (const auto& file : all_sources())
    EXPECT_LE(lines(content(file)).size(), static_cast<std::size_t>(kMaxLines)) << file;
}

TEST(Structure, EveryKernelIsCompiledForADevice) {
  const auto compiled = includes(content("tests/kernels/device_compile.cu"), '"', '"');

  for (const auto& file : sources("kernels"))
    EXPECT_NE(std::find(compiled.begin(), compiled.end(), file), compiled.end()) << file;
}

}  // namespace
