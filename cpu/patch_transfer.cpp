// SPDX-License-Identifier: MIT
#include "cpu/patch_transfer.hpp"

#include <algorithm>
#include <memory>
#include <numeric>

#include "core/base/error.hpp"
#include "kernels/transfer.hpp"

namespace kerf::cpu {
namespace {

constexpr float kUnit = 64;  // a weight is a mean of at most 8 corners, each of at most 8

std::int32_t size_of(std::size_t n) { return static_cast<std::int32_t>(n); }

/// Lists of points by vertex from nothing.
void list_givers(std::size_t vertices, Transfer& t) {
  t.giver_rows = {};
  t.giver_begin.assign(vertices + 1, 0);
  for (const TransferPart& part : t.parts)
    for (std::int32_t k = part.points.first; k < part.points.end(); ++k)
      ++t.giver_begin[static_cast<std::size_t>(t.point[k]) + 1];
  std::partial_sum(t.giver_begin.begin(), t.giver_begin.end(), t.giver_begin.begin());
  std::vector<std::int32_t> next(t.giver_begin.begin(), t.giver_begin.end() - 1);
  t.givers.resize(static_cast<std::size_t>(t.giver_begin.back()));
  for (const TransferPart& part : t.parts)
    for (std::int32_t k = part.points.first; k < part.points.end(); ++k)
      t.givers[next[t.point[k]]++] = k;
}

/// The terms by point.
void transpose(TransferDraft& draft) {
  draft.point_terms.assign(draft.points.size(), 0);
  for (const std::uint16_t point : draft.term_point) ++draft.point_terms[point];
  std::vector<std::uint32_t> next(draft.points.size());
  std::exclusive_scan(draft.point_terms.begin(), draft.point_terms.end(), next.begin(), 0U);
  draft.given_row.resize(draft.term_point.size());
  draft.given_weight.resize(draft.term_point.size());
  // Through pointers of their own, because a byte that is written might be any of theirs.
  const std::uint16_t* point = draft.term_point.data();
  const std::uint8_t* weight = draft.term_weight.data();
  std::uint32_t* const at = next.data();
  std::uint16_t* const given_row = draft.given_row.data();
  std::uint8_t* const given_weight = draft.given_weight.data();
  std::uint16_t row = 0;
  for (const auto* terms : {&draft.terms, &draft.lead_terms})
    for (const std::uint8_t count : *terms) {
      for (const std::uint16_t* const end = point + count; point < end; ++point, ++weight) {
        const std::uint32_t to = at[*point]++;
        given_row[to] = row;
        given_weight[to] = *weight;
      }
      ++row;
    }
}

template <class T>
void put(const std::vector<T>& from, std::int32_t first, std::vector<T>& to) {
  std::copy(from.begin(), from.end(), to.begin() + first);
}

void write_part(const TransferDraft& draft, const Patch& patch, const TransferPart& part,
                Transfer& t) {
  put(draft.points, part.points.first, t.point);
  put(draft.term_point, part.terms.first, t.term_point);
  put(draft.term_weight, part.terms.first, t.term_weight);
  put(draft.lead, part.leads.first, t.lead);
  put(draft.lead_terms, part.leads.first, t.lead_terms);
  put(draft.terms, patch.own.first, t.terms);
  put(draft.point_terms, part.points.first, t.point_terms);
  put(draft.given_row, part.terms.first, t.given_row);
  put(draft.given_weight, part.terms.first, t.given_weight);
  for (std::size_t n = 0; n < draft.first_term.size(); ++n)
    t.first_term[static_cast<std::size_t>(patch.own.first / kGroup) + n] =
        part.terms.first + draft.first_term[n];
}

}  // namespace

std::size_t Transfer::bytes() const {
  const auto of = [](const auto& array) { return array.capacity() * sizeof(array[0]); };
  return of(parts) + of(point) + of(term_point) + of(term_weight) + of(first_term) + of(terms) +
         of(lead) + of(lead_terms) + of(point_terms) + of(given_row) + of(given_weight) +
         of(giver_begin) + of(givers) + of(giver_rows.count);
}

FirstCells::FirstCells(const Level& level) : level_(level) {
  if (!level.incidence_begin.empty()) return;
  first_.assign(level.point.size(), -1);
  for (std::int32_t c = 0; c < level.cells(); ++c)
    for (std::size_t i = 0; i < 8; ++i)
      if (std::int32_t& first = first_[level.slots[c][i]]; first < 0) first = 8 * c + size_of(i);
}

TransferRows::TransferRows(const PatchedLevel& level, const Level& next, const FirstCells& first)
    : level_(level), next_(next), first_(first), local_(next.point.size()) {
  for (int place = 0; place <= kernels::kPassed; ++place)
    regular_[static_cast<std::size_t>(place)] =
        terms_of(kernels::FoldCode{0}, place, kernels::FoldCode{0});
}

TransferRows::SlotTerms TransferRows::terms_of(std::uint16_t child, int place,
                                               std::uint16_t parent) {
  float w[8][8];
  kernels::transfer_weights(child, place, parent, w);
  SlotTerms out{};
  for (std::size_t i = 0; i < 8; ++i)
    for (std::size_t m = 0; m < 8; ++m)
      if (const auto weight = static_cast<std::uint8_t>(kUnit * w[i][m]); weight != 0) {
        out[i].slot[out[i].count] = static_cast<std::uint8_t>(m);
        out[i].weight[out[i].count++] = weight;
      }
  return out;
}

const TransferRows::SlotTerms& TransferRows::terms(std::uint16_t child, int place,
                                                   std::uint16_t parent) {
  if (!kernels::has_hanging(child) && !kernels::has_hanging(parent))
    return regular_[static_cast<std::size_t>(place)];
  const std::uint64_t key = std::uint64_t{child} | std::uint64_t{parent} << 16 |
                            std::uint64_t(static_cast<unsigned>(place)) << 32;
  const auto [entry, added] = others_.try_emplace(key);
  if (added) entry->second = terms_of(child, place, parent);
  return entry->second;
}

std::uint8_t TransferRows::add_row(std::int32_t vertex, TransferDraft& out) {
  const Level& level = *level_.level;
  const std::int32_t first = first_[vertex];
  const std::int32_t child = first / 8, parent = level.parent[child];
  const RowTerms& row = terms(level.fold[child], level.place[child],
                              next_.fold[parent])[static_cast<std::size_t>(first % 8)];
  const auto& slots = next_.slots[parent];
  std::uint16_t* const points = points_.data() + count_;
  std::uint8_t* const weights = weights_.data() + count_;
  for (std::size_t k = 0; k < row.count; ++k) {
    const std::int32_t taken = slots[row.slot[k]];
    std::int32_t& point = local_[taken];
    if (point == 0) {
      out.points.push_back(taken);
      point = size_of(out.points.size());
    }
    points[k] = static_cast<std::uint16_t>(point - 1);
    weights[k] = row.weight[k];
  }
  count_ += row.count;
  return row.count;
}

TransferDraft TransferRows::operator()(std::int32_t n) {
  const Patch& patch = level_.patches[n];
  TransferDraft out;
  const auto most = 8 * static_cast<std::size_t>(patch.own.size + patch.copies.size);
  if (points_.size() < most) points_.resize(most), weights_.resize(most);
  count_ = 0;
  out.terms.reserve(static_cast<std::size_t>(patch.own.size));
  for (std::int32_t v = patch.own.first; v < patch.own.end(); ++v) {
    if (v % kGroup == 0) out.first_term.push_back(size_of(count_));
    out.terms.push_back(level_.vertex[v] < 0 ? std::uint8_t{0} : add_row(level_.vertex[v], out));
  }
  out.first_lead_term = size_of(count_);
  for (std::int32_t k = patch.copies.first; k < patch.copies.end(); ++k) {
    const std::int32_t v = level_.vertex[level_.copy_vertex[k]];
    if (level_.patch_of_cell(first_[v] / 8) != n) continue;
    out.lead.push_back(level_.copy_vertex[k]);
    out.lead_terms.push_back(add_row(v, out));
  }
  for (const std::int32_t taken : out.points) local_[taken] = 0;
  constexpr std::size_t kMost = 0x10000;
  ensures(out.points.size() <= kMost && out.terms.size() + out.lead.size() <= kMost,
          "a patch has too many vertices for its transfers");
  const auto count = static_cast<std::ptrdiff_t>(count_);
  out.term_point.assign(points_.begin(), points_.begin() + count);
  out.term_weight.assign(weights_.begin(), weights_.begin() + count);
  transpose(out);
  return out;
}

void place_transfers(const std::vector<std::int32_t>& patches, const Level& next, int threads,
                     PatchedLevel& level) {
  Transfer& t = level.transfer;
  const bool anew = t.parts.empty();
  const auto count = size_of(patches.size());
  const FirstCells first(*level.level);
  std::vector<TransferDraft> drafts(patches.size());
  for_patches(
      0, count, threads, [&] { return std::make_unique<TransferRows>(level, next, first); },
      [&](std::int32_t i, TransferRows& rows) { drafts[i] = rows(patches[i]); });
  t.parts.resize(level.patches.size());
  if (!anew) {
    Rows givers(t.giver_begin, t.givers, t.giver_rows);
    for (const std::int32_t p : patches)
      for (std::int32_t k = t.parts[p].points.first; k < t.parts[p].points.end(); ++k)
        givers.remove(t.point[k], k);
    while (size_of(t.giver_begin.size()) - 1 < next.vertices()) givers.append({});
  }
  std::int32_t points = size_of(t.point.size()), terms = size_of(t.term_point.size()),
               leads = size_of(t.lead.size());
  for (std::size_t i = 0; i < drafts.size(); ++i) {
    TransferPart& part = t.parts[patches[i]];
    part.points.fit(drafts[i].points.size(), points);
    part.terms.fit(drafts[i].term_point.size(), terms);
    part.leads.fit(drafts[i].lead.size(), leads);
    part.first_lead_term = part.terms.first + drafts[i].first_lead_term;
  }
  t.point.resize(static_cast<std::size_t>(points));
  t.point_terms.resize(t.point.size());
  t.term_point.resize(static_cast<std::size_t>(terms));
  t.term_weight.resize(t.term_point.size());
  t.given_row.resize(t.term_point.size());
  t.given_weight.resize(t.term_point.size());
  t.lead.resize(static_cast<std::size_t>(leads));
  t.lead_terms.resize(static_cast<std::size_t>(leads));
  t.terms.resize(level.vertices());
  t.first_term.resize(level.tiles());
#pragma omp parallel for num_threads(threads) schedule(static) if (count > 1)
  for (std::int32_t i = 0; i < count; ++i)
    write_part(drafts[i], level.patches[patches[i]], t.parts[patches[i]], t);
  if (anew) return list_givers(next.point.size(), t);
  Rows givers(t.giver_begin, t.givers, t.giver_rows);
  for (const std::int32_t p : patches)
    for (std::int32_t k = t.parts[p].points.first; k < t.parts[p].points.end(); ++k)
      givers.insert(t.point[k], k);
  givers.pack_if_wasteful();
}

}  // namespace kerf::cpu
