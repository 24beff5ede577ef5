// SPDX-License-Identifier: MIT
//
// The pieces of the body, kept up to date while blades pass.
//
// After a blade the search starts at both ends of every link that was cut. Parts of one old piece
// grow in turns, and grow together where they meet, until one is left over or all but one have
// come to an end: those are new pieces. So the search costs what the smaller pieces hold, and where
// nothing came off, the way around the rim of the cut.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "core/base/array.hpp"
#include "core/body/cut.hpp"
#include "core/levels/hierarchy.hpp"
#include "core/levels/update.hpp"

namespace kerf {

class PieceLabels {
 public:
  void build(const Level& finest);
  void update(const LinkedOctree& body, const CutEvent& event, const Level& finest,
              const LevelChange& change);

  std::size_t count() const { return count_; }
  /// Per cell of level 0, numbered from 0 by their first cell. Linear time.
  std::vector<std::int32_t> by_first_cell() const;
  /// The cells, ascending, of each piece that has at most kSmall. In an order that depends on what
  /// was cut when.
  std::vector<std::vector<std::int32_t>> small() const;
  static constexpr std::int32_t kSmall = 4;
  /// No blade is to come: gives back what only changes ask for.
  void forget_changes();
  std::size_t bytes() const;

 private:
  /// A part of a piece, as far as it has grown.
  struct Part {
    std::vector<std::int32_t> cells;  ///< those from `head` on are still to be looked at
    std::size_t head = 0;
    std::vector<std::int32_t> done;  ///< of parts that it took in
    std::int32_t joined = -1;        ///< the part that took it in
    bool at_end() const { return head == cells.size(); }
  };

  void start(const std::vector<std::int32_t>& ends, const Level& finest);
  void grow(std::int32_t part, std::size_t cells, const Level& finest);
  void join(std::int32_t a, std::int32_t b);
  std::int32_t find(std::int32_t part) const;
  void grow_until_known(const Level& finest);
  void give_number(const Part& part);
  void list_small(std::int32_t cell, const Level& finest);

  std::size_t cells_ = 0;
  std::vector<std::int32_t> piece_;  // per cell, but empty where there is one piece for ever;
                                     // numbers are never used again
  std::size_t count_ = 0;
  std::vector<std::int32_t> sizes_;                          // cells of each piece
  std::map<std::int32_t, std::vector<std::int32_t>> small_;  // cells of small pieces
  std::vector<std::int32_t> owner_;  // per cell: part, or -1; of the update under way
  std::vector<Part> parts_;
};

}  // namespace kerf
