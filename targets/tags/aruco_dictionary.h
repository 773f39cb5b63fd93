// The dictionaries of ArUco markers that OpenCV predefines. A marker is a black square with `size` x `size` cells
// inside a border that is one cell wide. Its code has these cells row by row from the top left, white as 1; the last
// cell is the lowest bit.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

namespace heba {

// A dictionary by its name in OpenCV.
struct ArucoDictionaryName {
  const char* name;
  int size;         // The cells along a side, without the border.
  int num_markers;  // Markers are numbered from 0.
  // The wrong cells that OpenCV takes to be correctable: (d - 1) / 2, where any two markers differ in d cells at least,
  // and 0 for tags of AprilTag.
  int num_correctable_bits;
};
// All dictionaries that a target may name. Those with 50, 100 and 250 markers are the beginnings of the one with 1,000
// markers of their size.
extern const std::array<ArucoDictionaryName, 21> kArucoDictionaries;

// A marker that is read in a square of cells.
struct IdentifiedMarker {
  int index = 0;
  int turns = 0;  // The quarter turns, clockwise, that bring the square upright.
};

class ArucoDictionary {
 public:
  explicit ArucoDictionary(const ArucoDictionaryName& name);

  // Returns the cells along a side, without the border.
  int size() const { return size_; }
  int num_markers() const { return static_cast<int>(codes_.size()); }
  int num_correctable_bits() const { return num_correctable_bits_; }

  // Adds the markers of another dictionary of the same size behind these. The number of correctable bits remains.
  void Append(const ArucoDictionary& other);

  // Returns whether a cell of a marker is black. The cell (0, 0) is the top-left one of the border; the rows and the
  // columns are those of size() + 2 cells.
  bool IsBlack(int index, int row, int column) const;

  // Returns the first marker that differs in at most `max_bit_errors` cells from a code in one of its four rotations,
  // and the rotation in which it differs least; nothing if there is none.
  std::optional<IdentifiedMarker> Identify(uint64_t code, int max_bit_errors) const;

 private:
  int size_;
  int num_correctable_bits_;
  std::vector<uint64_t> codes_;
};

}  // namespace heba
