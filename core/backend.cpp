// SPDX-License-Identifier: MIT
#include "core/backend.hpp"

#include "core/base/error.hpp"

namespace kerf {
namespace {

constexpr const char* kNoUpdates = "a backend without updates is asked for one";

}  // namespace

void Backend::update(const Hierarchy&, const HierarchyChange&) { ensures(false, kNoUpdates); }

void Backend::write_some(int, int, std::span<const std::int32_t>, std::span<const double>) {
  ensures(false, kNoUpdates);
}

void Backend::read_some(int, int, std::span<const std::int32_t>, std::span<double>) const {
  ensures(false, kNoUpdates);
}

NearCells Backend::find_near(int, const BladeReach&, std::span<const std::int32_t>) const {
  ensures(false, kNoUpdates);
  return {};
}

}  // namespace kerf
