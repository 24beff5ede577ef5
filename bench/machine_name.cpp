// SPDX-License-Identifier: MIT
#include "bench/machine_name.hpp"

#include <cctype>
#include <fstream>
#include <set>
#include <sstream>
#include <thread>

namespace kerf::bench {
namespace {

// The value of the first line of /proc/cpuinfo with that key; empty where there is none.
std::string cpu_info(const std::string& key) {
  std::ifstream in("/proc/cpuinfo");
  for (std::string line; std::getline(in, line);)
    if (line.rfind(key, 0) == 0 && line.find(':') != std::string::npos)
      return line.substr(line.find(':') + 1);
  return "";
}

std::string vector_instructions() {
  std::istringstream flags(cpu_info("flags"));
  std::set<std::string> all;
  for (std::string flag; flags >> flag;) all.insert(flag);
  for (const auto& [flag, name] :
       {std::pair{"avx512f", "-avx512"}, {"avx2", "-avx2"}, {"avx", "-avx"}})
    if (all.contains(flag)) return name;
  return "";
}

}  // namespace

std::string short_processor_name(const std::string& model) {
  const std::set<std::string> idle{"amd", "intel", "cpu", "processor", "core", "with"};
  std::string plain;
  for (std::size_t i = 0; i < model.size() && model[i] != '@'; ++i) {
    if (model[i] == '(') i = std::min(model.find(')', i), model.size() - 1);  // (R), (TM)
    const char c = static_cast<char>(std::tolower(static_cast<unsigned char>(model[i])));
    plain += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : ' ';
  }
  std::istringstream words(plain);
  std::string out;
  for (std::string word; words >> word;)
    if (!idle.contains(word)) out += (out.empty() ? "" : "-") + word;
  return out.empty() ? "unknown" : out;
}

std::string machine_name() {
  return short_processor_name(cpu_info("model name")) + vector_instructions() + "-" +
         std::to_string(std::thread::hardware_concurrency()) + "core";
}

}  // namespace kerf::bench
