// SPDX-License-Identifier: MIT
//
// Which instruction set the fast backend uses: the best that was built and that the processor has,
// or the one that is wished for.
#include <algorithm>
#include <cstdlib>

#include "core/base/error.hpp"
#include "cpu/fast_backend.hpp"
#include "cpu/fast_variant.hpp"
#include "cpu/instruction_set.hpp"

namespace kerf {
namespace {

constexpr const char* kVariable = "KERF_INSTRUCTION_SET";
constexpr const char* kKnown[] = {"baseline", "avx2", "avx512"};

struct Variant {
  const char* name;
  Backend* (*make)(const FastOptions&);
  bool runs_here;
};

/// Those that were built, the best last. The first has the flags of the tree, which all else here
/// has too, so no question is asked of it.
std::vector<Variant> variants() {
  std::vector<Variant> out{{cpu::kInstructionSet, kerf_fast_baseline, true}};
#ifdef KERF_WITH_AVX2
  out.push_back({"avx2", kerf_fast_avx2, __builtin_cpu_supports("x86-64-v3") > 0});
#endif
#ifdef KERF_WITH_AVX512
  out.push_back({"avx512", kerf_fast_avx512, __builtin_cpu_supports("x86-64-v4") > 0});
#endif
  return out;
}

std::string joined(const std::vector<std::string>& names) {
  std::string out;
  for (const std::string& name : names) out += (out.empty() ? "" : ", ") + name;
  return out;
}

/// Why a wish is not granted.
Error refusal(const std::string& wish) {
  const bool known = std::find(std::begin(kKnown), std::end(kKnown), wish) != std::end(kKnown);
  const std::string there = joined(fast_instruction_sets());
  const std::string asked = text("instruction set \"", wish, "\" (", kVariable, "): ");
  if (!known) return {ErrorKind::bad_input, text(asked, "not a name of one; there is ", there)};
  for (const Variant& variant : variants())
    if (wish == variant.name)
      return {ErrorKind::unavailable, text(asked, "this processor has none; there is ", there)};
  return {ErrorKind::unavailable,
          text(asked, "this build of kerf has no such code; there is ", there)};
}

}  // namespace

std::vector<std::string> fast_instruction_sets() {
  std::vector<std::string> out;
  for (const Variant& variant : variants())
    if (variant.runs_here) out.emplace_back(variant.name);
  return out;
}

std::unique_ptr<Backend> make_fast_backend(const FastOptions& options) {
  std::string wish = options.instruction_set;
  if (wish.empty())
    if (const char* value = std::getenv(kVariable)) wish = value;
  const Variant* chosen = nullptr;
  const std::vector<Variant> all = variants();
  for (const Variant& variant : all)
    if (variant.runs_here && (wish.empty() || wish == variant.name)) chosen = &variant;
  if (chosen == nullptr) throw refusal(wish);
  return std::unique_ptr<Backend>(chosen->make(options));
}

}  // namespace kerf
