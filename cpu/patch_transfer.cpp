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

template <class T, class To>
void put(const std::vector<T>& from, std::int32_t first, To& to) {
  std::copy(from.begin(), from.end(), to.begin() + first);
}

void put_blocks(const std::vector<TransferBlock>& from, const TransferPart& part,
                std::int32_t first, std::vector<TransferBlock>& to) {
  for (std::size_t n = 0; n < from.size(); ++n) {
    TransferBlock& block = to[static_cast<std::size_t>(first) + n];
    block = from[n];
    block.first_run += part.runs.first;
    block.first_term += part.terms.first;
  }
}

void write_part(const TransferDraft& draft, const Patch& patch, const TransferPart& part,
                Transfer& t) {
  put(draft.points, part.points.first, t.point);
  put(draft.runs, part.runs.first, t.runs);
  put(draft.term_point, part.terms.first, t.term_point);
  put(draft.term_weight, part.terms.first, t.term_weight);
  put(draft.terms, patch.own.first, t.terms);
  put(draft.lead, part.leads.first, t.lead);
  put(draft.lead_terms, part.leads.first, t.lead_terms);
  put_blocks(draft.tiles, part, patch.own.first / kGroup, t.tiles);
  put_blocks(draft.lead_blocks, part, part.lead_blocks.first, t.lead_blocks);
}

}  // namespace

std::size_t Transfer::bytes() const {
  const auto of = [](const auto& array) { return array.capacity() * sizeof(array[0]); };
  return of(parts) + of(point) + of(tiles) + of(lead_blocks) + of(runs) + of(term_point) +
         of(term_weight) + of(terms) + of(lead) + of(lead_terms) + of(giver_begin) + of(givers) +
         of(giver_rows.count);
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

void TransferRows::add_row(std::int32_t vertex, TransferDraft& out) {
  const Level& level = *level_.level;
  const std::int32_t first = first_[vertex];
  const std::int32_t child = first / 8, parent = level.parent[child];
  const RowTerms& row = terms(level.fold[child], level.place[child],
                              next_.fold[parent])[static_cast<std::size_t>(first % 8)];
  const auto& slots = next_.slots[parent];
  const std::uint32_t begin = row_begin_.back();
  std::uint16_t* const points = points_.data() + begin;
  std::uint8_t* const weights = weights_.data() + begin;
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
  row_begin_.push_back(begin + row.count);
}

/// Points from the order in which they were met to that of their places, so that they follow each
/// other along x; those of a patch that spans more than 16 bits count stay as they are.
void TransferRows::sort_points(TransferDraft& out) {
  for (const std::int32_t v : out.points) local_[v] = 0;
  if (out.points.empty()) return;
  Vec3i low = next_.point[out.points[0]], high = low;
  for (const std::int32_t v : out.points)
    for (int d = 0; d < 3; ++d) {
      low[d] = std::min(low[d], next_.point[v][d]);
      high[d] = std::max(high[d], next_.point[v][d]);
    }
  for (int d = 0; d < 3; ++d)
    if (high[d] - low[d] > 0xFFFF) return;
  order_.resize(out.points.size());
  met_ = out.points;
  for (std::size_t k = 0; k < order_.size(); ++k) {
    const Vec3i& p = next_.point[met_[k]];
    const auto at = [&](int d) { return static_cast<std::uint64_t>(p[d] - low[d]); };
    order_[k] = at(2) << 48 | at(1) << 32 | at(0) << 16 | k;
  }
  std::sort(order_.begin(), order_.end());
  rank_.resize(order_.size());
  for (std::size_t n = 0; n < order_.size(); ++n) {
    const std::size_t k = order_[n] & 0xFFFF;
    rank_[k] = static_cast<std::uint16_t>(n);
    out.points[n] = met_[k];
  }
  for (std::uint32_t k = 0; k < row_begin_.back(); ++k) points_[k] = rank_[points_[k]];
}

bool TransferRows::Row::has_weights(int of_all) const {
  for (int k = 0; k < count; ++k)
    if (weight[k] != of_all) return false;
  return true;
}

/// The run from a row on that is of one kind; how far it goes.
TransferRun TransferRows::run_of_kind(std::size_t first, std::size_t end, int rows,
                                      bool between) const {
  TransferRun run;
  run.rows = static_cast<std::uint8_t>(rows);
  run.between = between ? 1 : 0;
  const Row start = row(first);
  for (int r = 0; r < rows; ++r) run.point[r] = start.point[between ? 2 * r : r];
  if (rows == TransferRun::kIdentity) run.point[0] = start.point[0];
  const auto unit = static_cast<int>(kUnit);
  const auto matches = [&](const Row& one, int n) {
    if (rows == TransferRun::kIdentity)
      return one.count == 1 && one.has_weights(unit) && one.point[0] == run.point[0] + n;
    const int place = n + run.between, k = place / 2, of_row = 1 + place % 2;
    if (one.count != of_row * rows || !one.has_weights(unit / one.count)) return false;
    for (int r = 0; r < rows; ++r)
      for (int i = 0; i < of_row; ++i)
        if (one.point[of_row * r + i] != run.point[r] + k + i) return false;
    return true;
  };
  while (first + run.size < end && matches(row(first + run.size), run.size)) ++run.size;
  return run;
}

TransferRun TransferRows::longest_run(std::size_t first, std::size_t end) const {
  TransferRun best;
  const int count = row(first).count;
  const auto attempt = [&](int rows, bool between) {
    const TransferRun run = run_of_kind(first, end, rows, between);
    if (run.size > best.size) best = run;
  };
  for (const int rows : {1, 2, 4}) {
    if (count == rows) attempt(rows, false);
    if (count == 2 * rows) attempt(rows, true);
  }
  if (count == 1) attempt(TransferRun::kIdentity, false);
  return best;
}

/// Some vertices: runs of them, and the terms of the others.
TransferBlock TransferRows::add_block(std::size_t first, std::size_t count, TransferDraft& out,
                                      std::vector<std::uint8_t>& terms) {
  constexpr std::size_t kShortest = 8;  // of fewer, terms are as fast
  TransferBlock block;
  block.first_run = size_of(out.runs.size());
  block.first_term = size_of(out.term_point.size());
  const std::size_t end = first + count;
  for (std::size_t n = first; n < end;) {
    TransferRun run;
    if (n + kShortest <= end) run = longest_run(n, end);
    if (run.size >= kShortest) {
      run.first = static_cast<std::uint8_t>(n - first);
      out.runs.push_back(run);
      terms.insert(terms.end(), run.size, std::uint8_t{0});
      ++block.runs;
      n += run.size;
      continue;
    }
    // What ends a run soon ends those soon that start within it.
    for (const std::size_t stop = n + std::max<std::size_t>(run.size, 1); n < stop; ++n) {
      const Row one = row(n);
      const auto unit = static_cast<int>(kUnit);
      const bool alike =
          one.count > 0 && unit % one.count == 0 && one.has_weights(unit / one.count);
      terms.push_back(static_cast<std::uint8_t>(one.count + (alike ? Transfer::kMean : 0)));
      out.term_point.insert(out.term_point.end(), one.point, one.point + one.count);
      out.term_weight.insert(out.term_weight.end(), one.weight, one.weight + one.count);
      (one.count > 0 ? block.others : block.gaps) = true;
    }
  }
  return block;
}

TransferDraft TransferRows::operator()(std::int32_t n) {
  const Patch& patch = level_.patches[n];
  TransferDraft out;
  const auto most = 8 * static_cast<std::size_t>(patch.own.size + patch.copies.size);
  if (points_.size() < most) points_.resize(most), weights_.resize(most);
  row_begin_.assign(1, 0);
  for (std::int32_t v = patch.own.first; v < patch.own.end(); ++v)
    if (level_.vertex[v] >= 0)
      add_row(level_.vertex[v], out);
    else
      row_begin_.push_back(row_begin_.back());
  for (std::int32_t k = patch.copies.first; k < patch.copies.end(); ++k) {
    const std::int32_t v = level_.vertex[level_.copy_vertex[k]];
    if (level_.patch_of_cell(first_[v] / 8) != n) continue;
    out.lead.push_back(level_.copy_vertex[k]);
    add_row(v, out);
  }
  constexpr std::size_t kMost = 0x10000;
  ensures(out.points.size() <= kMost, "a patch has too many vertices for its transfers");
  sort_points(out);
  const auto own = static_cast<std::size_t>(patch.own.size), all = own + out.lead.size();
  out.terms.reserve(own);
  out.tiles.reserve(own / kGroup);
  out.runs.reserve(all / 8);
  out.term_point.reserve(all);
  out.term_weight.reserve(all);
  for (std::size_t first = 0; first < own; first += kGroup)
    out.tiles.push_back(add_block(first, kGroup, out, out.terms));
  for (std::size_t first = own; first < all; first += kGroup)
    out.lead_blocks.push_back(
        add_block(first, std::min<std::size_t>(kGroup, all - first), out, out.lead_terms));
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
  std::int32_t points = size_of(t.point.size()), runs = size_of(t.runs.size()),
               terms = size_of(t.term_point.size()), leads = size_of(t.lead.size()),
               blocks = size_of(t.lead_blocks.size());
  for (std::size_t i = 0; i < drafts.size(); ++i) {
    TransferPart& part = t.parts[patches[i]];
    part.points.fit(drafts[i].points.size(), points);
    part.runs.fit(drafts[i].runs.size(), runs);
    part.terms.fit(drafts[i].term_point.size(), terms);
    part.leads.fit(drafts[i].lead.size(), leads);
    part.lead_blocks.fit(drafts[i].lead_blocks.size(), blocks);
  }
  t.point.resize(static_cast<std::size_t>(points));
  t.runs.resize(static_cast<std::size_t>(runs));
  t.term_point.resize(static_cast<std::size_t>(terms));
  t.term_weight.resize(t.term_point.size());
  t.lead.resize(static_cast<std::size_t>(leads));
  t.lead_terms.resize(static_cast<std::size_t>(leads));
  t.lead_blocks.resize(static_cast<std::size_t>(blocks));
  t.terms.resize(level.vertices());
  t.tiles.resize(level.tiles());
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
