// SPDX-License-Identifier: MIT
#include "core/levels/piece_labels.hpp"

#include <algorithm>
#include <unordered_map>
#include <utility>

#include "core/base/error.hpp"
#include "core/levels/union_find.hpp"

namespace kerf {

void PieceLabels::build(const Level& finest) {
  cells_ = finest.corner.size();
  piece_.reserve(with_room(cells_));
  piece_.assign(finest.corner.size(), -1);
  count_ = 0;
  sizes_.clear();
  small_.clear();
  std::vector<std::int32_t> next;
  for (std::int32_t c = 0; c < finest.cells(); ++c) {
    if (piece_[c] >= 0) continue;
    const auto number = static_cast<std::int32_t>(count_++);
    piece_[c] = number;
    sizes_.push_back(1);
    next.assign(1, c);
    while (!next.empty()) {
      const std::int32_t cell = next.back();
      next.pop_back();
      for (const std::int32_t item : finest.links_of(cell)) {
        if (piece_[item / 8] >= 0) continue;
        piece_[item / 8] = number;
        ++sizes_.back();
        next.push_back(item / 8);
      }
    }
    list_small(c, finest);
  }
}

void PieceLabels::update(const LinkedOctree& body, const CutEvent& event, const Level& finest,
                         const LevelChange& change) {
  ensures(piece_.size() == cells_, "labels that forgot how to change are asked to");
  for (const std::int32_t origin : change.origin) {
    piece_.push_back(piece_[origin]);
    ++sizes_[piece_[origin]];
  }
  cells_ = piece_.size();
  if (owner_.size() < piece_.size()) owner_.resize(piece_.capacity(), -1);
  std::vector<std::int32_t> ends;
  for (const LinkKey key : event.disconnected) add_ends(body, key, ends);
  start(ends, finest);
  grow_until_known(finest);
  for (const Part& part : parts_) {
    for (const std::int32_t cell : part.cells) owner_[cell] = -1;
    for (const std::int32_t cell : part.done) owner_[cell] = -1;
  }
  for (const std::int32_t cell : ends) list_small(cell, finest);
  for (std::int32_t c = change.cells_before; c < finest.cells(); ++c) list_small(c, finest);
}

/// What the piece of a cell has, if it is small; what it had, if it is so no more.
void PieceLabels::list_small(std::int32_t cell, const Level& finest) {
  const std::int32_t number = piece_[cell];
  if (sizes_[number] > kSmall) {
    if (!small_.empty()) small_.erase(number);
    return;
  }
  std::vector<std::int32_t>& cells = small_[number];
  cells.assign(1, cell);
  for (std::size_t head = 0; head < cells.size(); ++head)
    for (const std::int32_t item : finest.links_of(cells[head]))
      if (std::find(cells.begin(), cells.end(), item / 8) == cells.end()) cells.push_back(item / 8);
  std::sort(cells.begin(), cells.end());
}

// One part for each group of ends that are linked to each other.
void PieceLabels::start(const std::vector<std::int32_t>& ends, const Level& finest) {
  std::vector<std::int32_t> seeds;
  for (const std::int32_t cell : ends) {
    if (owner_[cell] >= 0) continue;
    owner_[cell] = static_cast<std::int32_t>(seeds.size());
    seeds.push_back(cell);
  }
  UnionFind sets(seeds.size());
  for (std::size_t i = 0; i < seeds.size(); ++i)
    for (const std::int32_t item : finest.links_of(seeds[i]))
      if (owner_[item / 8] >= 0) sets.unite(static_cast<std::int32_t>(i), owner_[item / 8]);
  parts_.clear();
  std::vector<std::int32_t> part_of(seeds.size());
  for (std::size_t i = 0; i < seeds.size(); ++i) {
    const std::int32_t first = sets.find(static_cast<std::int32_t>(i));  // the smallest of its set
    if (first == static_cast<std::int32_t>(i)) {
      part_of[i] = static_cast<std::int32_t>(parts_.size());
      parts_.emplace_back();
    }
    part_of[i] = part_of[first];
    parts_[part_of[i]].cells.push_back(seeds[i]);
  }
  for (std::size_t i = 0; i < seeds.size(); ++i) owner_[seeds[i]] = part_of[i];
}

std::int32_t PieceLabels::find(std::int32_t part) const {
  while (parts_[part].joined >= 0) part = parts_[part].joined;
  return part;
}

// The larger part takes in the smaller.
void PieceLabels::join(std::int32_t a, std::int32_t b) {
  const auto size = [&](std::int32_t p) { return parts_[p].done.size() + parts_[p].cells.size(); };
  if (size(a) < size(b)) std::swap(a, b);
  Part &to = parts_[a], &from = parts_[b];
  const auto head = from.cells.begin() + static_cast<std::ptrdiff_t>(from.head);
  to.done.insert(to.done.end(), from.done.begin(), from.done.end());
  to.done.insert(to.done.end(), from.cells.begin(), head);
  to.cells.insert(to.cells.end(), head, from.cells.end());
  from = {{}, 0, {}, a};
}

// Looks at the neighbours of some more cells of a part, the first that came first.
void PieceLabels::grow(std::int32_t part, std::size_t cells, const Level& finest) {
  for (; cells > 0 && !parts_[part].at_end(); --cells) {
    const std::int32_t cell = parts_[part].cells[parts_[part].head++];
    for (const std::int32_t item : finest.links_of(cell)) {
      std::int32_t& owner = owner_[item / 8];
      if (owner < 0) {
        owner = part;
        parts_[part].cells.push_back(item / 8);
        continue;
      }
      const std::int32_t other = find(owner);
      if (other == part) continue;
      join(part, other);
      part = find(part);
    }
  }
}

void PieceLabels::give_number(const Part& part) {
  const auto size = static_cast<std::int32_t>(part.cells.size() + part.done.size());
  sizes_[piece_[part.cells[0]]] -= size;
  sizes_.push_back(size);
  for (const std::int32_t cell : part.cells) piece_[cell] = static_cast<std::int32_t>(count_);
  for (const std::int32_t cell : part.done) piece_[cell] = static_cast<std::int32_t>(count_);
  ++count_;
}

void PieceLabels::grow_until_known(const Level& finest) {
  std::vector<std::int32_t> alive(parts_.size());  // parts that may still meet others
  for (std::size_t i = 0; i < alive.size(); ++i) alive[i] = static_cast<std::int32_t>(i);
  for (std::size_t share = 16; !alive.empty(); share *= 2) {
    std::unordered_map<std::int32_t, int> left;  // alive parts of each old piece
    for (const std::int32_t p : alive) ++left[piece_[parts_[p].cells[0]]];
    std::vector<std::int32_t> growing;
    for (const std::int32_t p : alive) {
      int& rivals = left[piece_[parts_[p].cells[0]]];
      if (rivals == 1) continue;  // it keeps the number
      if (!parts_[p].at_end()) {
        growing.push_back(p);
        continue;
      }
      --rivals;
      give_number(parts_[p]);
    }
    for (const std::int32_t p : growing)
      if (parts_[p].joined < 0) grow(p, share, finest);
    alive.clear();
    for (const std::int32_t p : growing)
      if (parts_[p].joined < 0) alive.push_back(p);
  }
}

std::vector<std::vector<std::int32_t>> PieceLabels::small() const {
  std::vector<std::vector<std::int32_t>> out;
  out.reserve(small_.size());
  for (const auto& [number, cells] : small_) out.push_back(cells);
  return out;
}

void PieceLabels::forget_changes() {
  if (count_ == 1) piece_ = {};
  owner_ = {};
  parts_ = {};
  sizes_ = {};
}

std::size_t PieceLabels::bytes() const {
  std::size_t out = bytes_of(piece_) + bytes_of(owner_) + bytes_of(sizes_);
  for (const auto& [number, cells] : small_) out += sizeof(number) + bytes_of(cells);
  return out;
}

std::vector<std::int32_t> PieceLabels::by_first_cell() const {
  if (piece_.empty()) return std::vector<std::int32_t>(cells_, 0);
  std::vector<std::int32_t> number(count_, -1), out;
  out.reserve(piece_.size());
  std::int32_t next = 0;
  for (const std::int32_t piece : piece_) {
    if (number[piece] < 0) number[piece] = next++;
    out.push_back(number[piece]);
  }
  return out;
}

}  // namespace kerf
