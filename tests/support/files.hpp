// SPDX-License-Identifier: MIT
//
// Folders and files for tests, and the arrays of a VTK file as a reader would find them.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <regex>
#include <string>
#include <vector>

namespace kerf::test {

/// A test with an empty folder of its own.
class FolderTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    root_ = std::filesystem::path(testing::TempDir()) /
            ("kerf_" + std::to_string(getpid()) + info->test_suite_name() + info->name());
    std::filesystem::remove_all(root_);
    std::filesystem::create_directories(root_);
  }
  void TearDown() override { std::filesystem::remove_all(root_); }

  static std::vector<std::string> names(const std::filesystem::path& folder) {
    std::vector<std::string> all;
    for (const auto& entry : std::filesystem::directory_iterator(folder))
      all.push_back(entry.path().filename().string());
    std::sort(all.begin(), all.end());
    return all;
  }

  std::filesystem::path root_;
};

inline std::string read_all(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

inline void write_all(const std::filesystem::path& file, const std::string& content) {
  std::ofstream(file, std::ios::binary) << content;
}

/// Where the bytes of an array begin, its count in front: by its offset in the appended data.
inline std::size_t vtk_array_at(const std::string& file, const std::string& section,
                                const std::string& name) {
  std::smatch match;
  const std::string head = file.substr(0, file.find("<AppendedData"));
  const std::size_t begin = head.find("<" + section);
  EXPECT_NE(begin, std::string::npos) << section;
  const std::string part = head.substr(begin, head.find("</" + section) - begin);
  const std::regex pattern("Name=\"" + name + "\"[^>]*offset=\"([0-9]+)\"");
  EXPECT_TRUE(std::regex_search(part, match, pattern)) << name;
  return file.find('_', file.find("<AppendedData")) + 1 + std::stoul(match[1]);
}

/// The values of an array in <section>, such as "PointData".
template <class T>
std::vector<T> vtk_array(const std::string& file, const std::string& section,
                         const std::string& name) {
  const std::size_t at = vtk_array_at(file, section, name);
  std::uint64_t bytes = 0;
  std::memcpy(&bytes, file.data() + at, sizeof bytes);
  std::vector<T> values(bytes / sizeof(T));
  if (bytes > 0) std::memcpy(values.data(), file.data() + at + sizeof bytes, bytes);
  return values;
}

}  // namespace kerf::test
