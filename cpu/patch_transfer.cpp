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

/// place(n): the block of the n-th one, and its first vertex in `others`.
template <class Place>
void put_blocks(const BlockDraft& from, std::int32_t run, std::int32_t term, const Place& place,
                Transfer& t) {
  put(from.runs, run, t.runs);
  put(from.term_point, term, t.term_point);
  put(from.term_weight, term, t.term_weight);
  std::size_t other = 0;
  for (std::size_t n = 0; n < from.blocks.size(); ++n) {
    const auto [block, others] = place(n);
    *block = from.blocks[n];
    block->first_run += run;
    block->first_term += term;
    const std::size_t count = std::min<std::size_t>(kGroup, from.others.size() - other);
    std::copy_n(from.others.begin() + size_of(other), count, others);
    other += count;
  }
}

/// `before`: the part as it was.
void write_part(const TransferDraft& draft, const TransferPart& part, const TransferPart& before,
                Transfer& t) {
  const bool whole = draft.whole;
  const std::int32_t kept = whole ? 0 : before.points.size;
  if (part.points.first != before.points.first)
    std::copy_n(t.point.begin() + before.points.first, kept, t.point.begin() + part.points.first);
  put(draft.points, part.points.first + kept, t.point);
  put_blocks(
      draft.own, whole ? part.runs.first : part.more_runs.first + before.more_runs.size,
      whole ? part.terms.first : part.more_terms.first + before.more_terms.size,
      [&](std::size_t n) {
        const std::int32_t tile = whole ? part.own.first / kGroup + size_of(n) : draft.tiles[n];
        return std::pair{&t.tiles[tile], t.others.begin() + kGroup * tile};
      },
      t);
  put(draft.lead, part.leads.first, t.lead);
  put_blocks(
      draft.leads, part.lead_runs.first, part.lead_terms.first,
      [&](std::size_t n) {
        return std::pair{&t.lead_blocks[static_cast<std::size_t>(part.lead_blocks.first) + n],
                         t.lead_others.begin() + part.leads.first + kGroup * size_of(n)};
      },
      t);
}

/// What tiles that are made again may take, until all of a part is.
std::int32_t room_for_terms(const Range& own) { return 2 * own.size; }
std::int32_t room_for_runs(const Range& own) { return own.size / 4; }

/// Ends of the arrays, where parts find room.
struct Ends {
  std::int32_t points, runs, terms, leads, blocks;

  explicit Ends(const Transfer& t)
      : points(size_of(t.point.size())),
        runs(size_of(t.runs.size())),
        terms(size_of(t.term_point.size())),
        leads(size_of(t.lead.size())),
        blocks(size_of(t.lead_blocks.size())) {}

  void fit(const TransferDraft& draft, const Range& own, TransferPart& part) {
    if (draft.whole) {
      part.own = own;
      part.points.fit(draft.points.size(), points);
      part.runs.fit(draft.own.runs.size(), runs);
      part.terms.fit(draft.own.term_point.size(), terms);
      part.more_runs.size = part.more_terms.size = 0;
    } else {
      part.own.size = own.size;
      part.points.grow(draft.points.size(), true, points);
      append(draft.own.runs.size(), room_for_runs(own), part.more_runs, runs);
      append(draft.own.term_point.size(), room_for_terms(own), part.more_terms, terms);
    }
    part.leads.fit(draft.lead.size(), leads);
    part.lead_runs.fit(draft.leads.runs.size(), runs);
    part.lead_terms.fit(draft.leads.term_point.size(), terms);
    part.lead_blocks.fit(draft.leads.blocks.size(), blocks);
  }
  void resize(Transfer& t) const {
    t.point.resize(static_cast<std::size_t>(points));
    t.runs.resize(static_cast<std::size_t>(runs));
    t.term_point.resize(static_cast<std::size_t>(terms));
    t.term_weight.resize(t.term_point.size());
    t.lead.resize(static_cast<std::size_t>(leads));
    t.lead_others.resize(static_cast<std::size_t>(leads));
    t.lead_blocks.resize(static_cast<std::size_t>(blocks));
  }

 private:
  /// All the room at once; what there is of it is enough.
  static void append(std::size_t count, std::int32_t room, Range& range, std::int32_t& end) {
    if (range.room == 0) {
      range = {end, 0, room};
      end += room;
    }
    range.size += size_of(count);
    ensures(range.size <= range.room, "tiles that are made again have no room");
  }
};

}  // namespace

std::size_t Transfer::bytes() const {
  return bytes_of(parts) + bytes_of(point) + bytes_of(tiles) + bytes_of(lead_blocks) +
         bytes_of(runs) + bytes_of(term_point) + bytes_of(term_weight) + bytes_of(others) +
         bytes_of(lead) + bytes_of(lead_others) + bytes_of(giver_begin) + bytes_of(givers) +
         bytes_of(giver_rows.count);
}

FirstCells::FirstCells(const Level& level) : level_(level) {
  if (!level.incidence_begin.empty()) return;
  first_.assign(level.point.size(), -1);
  for (std::int32_t c = 0; c < level.cells(); ++c)
    for (std::size_t i = 0; i < 8; ++i)
      if (std::int32_t& first = first_[level.slots[c][i]]; first < 0) first = 8 * c + size_of(i);
}

TransferRows::TransferRows(const PatchedLevel& level, const Level& next, const FirstCells& first,
                           const PatchMoves& moves)
    : level_(level), next_(next), first_(first), moves_(moves), local_(next.point.size()) {
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
      point = points_before_ + size_of(out.points.size());
    }
    points[k] = static_cast<std::uint16_t>(point - 1);
    weights[k] = row.weight[k];
  }
  row_begin_.push_back(begin + row.count);
}

/// Points from the order in which they were met to that of their places, so that they follow each
/// other along x; those of a patch that spans more than 16 bits count stay as they are.
void TransferRows::sort_points(TransferDraft& out) {
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

/// Of a vertex in no run; the last one has weights.
int TransferRows::class_of(const Row& row) const {
  const auto unit = static_cast<int>(kUnit);
  for (int n = 0; n < TransferBlock::kMeans; ++n)
    if (row.count == 1 << n && row.has_weights(unit >> n)) return n;
  return TransferBlock::kMeans;
}

/// Some vertices: runs of them, and the terms of the others.
void TransferRows::add_block(std::size_t first, std::size_t count, BlockDraft& out) {
  constexpr std::size_t kShortest = 8;  // of fewer, terms are as fast
  TransferBlock block;
  block.first_run = size_of(out.runs.size());
  block.first_term = size_of(out.term_point.size());
  for (auto& rows : classes_) rows.clear();
  const std::size_t end = first + count;
  for (std::size_t n = first; n < end;) {
    TransferRun run;
    if (n + kShortest <= end) run = longest_run(n, end);
    if (run.size >= kShortest) {
      run.first = static_cast<std::uint8_t>(n - first);
      out.runs.push_back(run);
      ++block.runs;
      n += run.size;
      continue;
    }
    // What ends a run soon ends those soon that start within it.
    for (const std::size_t stop = n + std::max<std::size_t>(run.size, 1); n < stop; ++n)
      if (row(n).count > 0)
        classes_[static_cast<std::size_t>(class_of(row(n)))].push_back(n);
      else
        block.gaps = true;
  }
  const std::size_t whole = out.others.size() + count;
  for (std::size_t k = 0; k < classes_.size(); ++k) {
    (k < TransferBlock::kMeans ? block.means[k] : block.weighted) =
        static_cast<std::uint8_t>(classes_[k].size());
    for (const std::size_t n : classes_[k]) {
      const Row one = row(n);
      out.others.push_back(TransferVertex::of(size_of(n - first), one.count));
      out.term_point.insert(out.term_point.end(), one.point, one.point + one.count);
      out.term_weight.insert(out.term_weight.end(), one.weight, one.weight + one.count);
    }
  }
  out.others.resize(whole);
  out.blocks.push_back(block);
}

void TransferRows::start_rows(std::int32_t most_rows) {
  const auto most = 8 * static_cast<std::size_t>(most_rows);
  if (points_.size() < most) points_.resize(most), weights_.resize(most);
  row_begin_.assign(1, 0);
}

/// The rows of a tile.
void TransferRows::add_tile(std::int32_t tile, TransferDraft& out) {
  for (std::int32_t at = kGroup * tile; at < kGroup * (tile + 1); ++at)
    if (level_.vertex[at] >= 0)
      add_row(level_.vertex[at], out);
    else
      row_begin_.push_back(row_begin_.back());
}

/// The leads of a patch, and their rows.
void TransferRows::add_leads(std::int32_t n, TransferDraft& out) {
  const Range& copies = level_.patches[n].copies;
  for (std::int32_t k = copies.first; k < copies.end(); ++k) {
    const std::int32_t v = level_.vertex[level_.copy_vertex[k]];
    if (level_.patch_of_cell(first_[v] / 8) != n) continue;
    out.lead.push_back(level_.copy_vertex[k]);
    add_row(v, out);
  }
}

/// Their blocks, from the row of the first one on.
void TransferRows::add_lead_blocks(std::size_t first, TransferDraft& out) {
  const std::size_t all = first + out.lead.size();
  for (; first < all; first += kGroup)
    add_block(first, std::min<std::size_t>(kGroup, all - first), out.leads);
}

constexpr std::size_t kMostPoints = 0x10000;  // of a part

TransferDraft TransferRows::make(std::int32_t n) {
  const Range& own = level_.patches[n].own;
  TransferDraft out;
  start_rows(own.size + level_.patches[n].copies.size);
  points_before_ = 0;
  for (std::int32_t tile = own.first / kGroup; tile < own.end() / kGroup; ++tile)
    add_tile(tile, out);
  const auto rows = static_cast<std::size_t>(own.size);
  add_leads(n, out);
  for (const std::int32_t v : out.points) local_[v] = 0;
  ensures(out.points.size() <= kMostPoints, "a patch has too many vertices for its transfers");
  sort_points(out);
  out.own.others.reserve(rows);
  out.own.blocks.reserve(rows / kGroup);
  out.own.runs.reserve(rows / 8);
  out.own.term_point.reserve(rows);
  out.own.term_weight.reserve(rows);
  for (std::size_t first = 0; first < rows; first += kGroup) add_block(first, kGroup, out.own);
  add_lead_blocks(rows, out);
  return out;
}

/// Tiles with other vertices or other rows, and those that the patch has not had.
std::vector<std::int32_t> TransferRows::tiles_to_make(const Patch& patch,
                                                      const TransferPart& part) const {
  std::vector<std::int32_t> out;
  for (std::int32_t tile = patch.own.first / kGroup; tile < patch.own.end() / kGroup; ++tile) {
    const bool touched =
        static_cast<std::size_t>(tile) < moves_.tiles.size() && moves_.tiles[tile] != 0;
    if (touched || kGroup * tile >= part.own.end()) out.push_back(tile);
  }
  return out;
}

/// False where all has to be made.
bool TransferRows::make_some(std::int32_t n, TransferDraft& out) {
  if (static_cast<std::size_t>(n) >= level_.transfer.parts.size()) return false;
  const TransferPart& part = level_.transfer.parts[n];
  const Patch& patch = level_.patches[n];
  if (part.own.size == 0 || part.own.first != patch.own.first || part.own.size > patch.own.size)
    return false;
  out.whole = false;
  out.tiles = tiles_to_make(patch, part);
  if (4 * kGroup * size_of(out.tiles.size()) > 3 * patch.own.size) return false;
  start_rows(kGroup * size_of(out.tiles.size()) + patch.copies.size);
  points_before_ = part.points.size;
  for (std::int32_t k = 0; k < part.points.size; ++k)
    local_[level_.transfer.point[part.points.first + k]] = k + 1;
  for (const std::int32_t tile : out.tiles) add_tile(tile, out);
  add_leads(n, out);
  for (std::int32_t k = 0; k < part.points.size; ++k)
    local_[level_.transfer.point[part.points.first + k]] = 0;
  for (const std::int32_t v : out.points) local_[v] = 0;
  if (static_cast<std::size_t>(part.points.size) + out.points.size() > kMostPoints) return false;
  const std::size_t rows = kGroup * out.tiles.size();
  for (std::size_t first = 0; first < rows; first += kGroup) add_block(first, kGroup, out.own);
  add_lead_blocks(rows, out);
  const auto fits = [](const Range& range, std::size_t count, std::int32_t room) {
    return range.size + size_of(count) <= (range.room > 0 ? range.room : room);
  };
  return fits(part.more_runs, out.own.runs.size(), room_for_runs(patch.own)) &&
         fits(part.more_terms, out.own.term_point.size(), room_for_terms(patch.own));
}

TransferDraft TransferRows::operator()(std::int32_t patch) {
  if (TransferDraft some; make_some(patch, some)) return some;
  return make(patch);
}

void place_transfers(const std::vector<std::int32_t>& patches, const PatchMoves& moves,
                     const Level& next, int threads, PatchedLevel& level) {
  Transfer& t = level.transfer;
  const bool anew = t.parts.empty();
  const auto count = size_of(patches.size());
  const FirstCells first(*level.level);
  std::vector<TransferDraft> drafts(patches.size());
  for_parts(
      0, count, threads, [&] { return std::make_unique<TransferRows>(level, next, first, moves); },
      [&](std::int32_t i, TransferRows& rows) { drafts[i] = rows(patches[i]); });
  t.parts.resize(level.patches.size());
  std::vector<TransferPart> before;
  for (const std::int32_t p : patches) before.push_back(t.parts[p]);
  Ends ends(t);
  for (std::size_t i = 0; i < drafts.size(); ++i)
    ends.fit(drafts[i], level.patches[patches[i]].own, t.parts[patches[i]]);
  // Points that stay where they are stay on the lists.
  const auto points_kept = [&](std::size_t i) {
    const bool stay =
        !drafts[i].whole && t.parts[patches[i]].points.first == before[i].points.first;
    return stay ? before[i].points.size : 0;
  };
  if (!anew) {
    Rows givers(t.giver_begin, t.givers, t.giver_rows);
    for (std::size_t i = 0; i < drafts.size(); ++i)
      for (std::int32_t k = points_kept(i); k < before[i].points.size; ++k)
        givers.remove(t.point[before[i].points.first + k], before[i].points.first + k);
    while (size_of(t.giver_begin.size()) - 1 < next.vertices()) givers.append({});
  }
  ends.resize(t);
  t.others.resize(level.vertices());
  t.tiles.resize(level.tiles());
#pragma omp parallel for num_threads(threads) schedule(static) if (count > 1)
  for (std::int32_t i = 0; i < count; ++i) write_part(drafts[i], t.parts[patches[i]], before[i], t);
  if (anew) return list_givers(next.point.size(), t);
  Rows givers(t.giver_begin, t.givers, t.giver_rows);
  for (std::size_t i = 0; i < drafts.size(); ++i) {
    const Range& points = t.parts[patches[i]].points;
    for (std::int32_t k = points_kept(i); k < points.size; ++k)
      givers.insert(t.point[points.first + k], points.first + k);
  }
  givers.pack_if_wasteful();
}

}  // namespace kerf::cpu
