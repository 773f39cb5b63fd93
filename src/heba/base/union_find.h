// Disjoint sets of numbered elements.
#pragma once

#include <algorithm>
#include <vector>

namespace heba {

// Sets of the elements 0, 1, ...: a union-find forest with path halving (Tarjan and van Leeuwen 1984). A set is
// identified by its smallest element.
template <class Index>
class UnionFind {
 public:
  explicit UnionFind(Index size = 0) {
    for (Index i = 0; i < size; ++i) Add();
  }
  // Adds a set of one element and returns the element: the number of those before it.
  Index Add() {
    parents_.push_back(size());
    return parents_.back();
  }
  Index size() const { return static_cast<Index>(parents_.size()); }
  // Returns the smallest element of the set that contains `element`.
  Index Root(Index element) {
    while (Parent(element) != element) element = Parent(element) = Parent(Parent(element));
    return element;
  }
  // Unites the sets of two elements and returns the smallest element of the union.
  Index Unite(Index a, Index b) {
    const Index root_a = Root(a);
    const Index root_b = Root(b);
    return Parent(std::max(root_a, root_b)) = std::min(root_a, root_b);
  }
  bool IsRoot(Index element) const { return parents_[static_cast<size_t>(element)] == element; }

 private:
  Index& Parent(Index element) { return parents_[static_cast<size_t>(element)]; }

  std::vector<Index> parents_;
};

}  // namespace heba
