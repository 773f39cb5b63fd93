#include "targets/images/light_areas.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <utility>

#include <opencv2/core/hal/intrin.hpp>

#include "heba/base/error.h"
#include "heba/base/union_find.h"

namespace heba {
namespace {

// The runs of light pixels in a row, with the area that each belongs to.
struct Row {
  std::vector<int> edges;  // Two per run: its first column and the column after its last.
  std::vector<int> labels;
  size_t num_runs = 0;
};

// Finds the runs of a row in words of 64 pixels. The unused bits of the last word count as dark.
class RowReader {
 public:
  explicit RowReader(int num_columns) : num_columns_(num_columns), words_(static_cast<size_t>(num_columns / 64 + 1)) {}

  // Returns the runs of a row without their labels, in the memory of another row.
  Row Read(const uchar* pixels, int threshold, Row row) {
    FillWords(pixels, threshold);
    int* edge = row.edges.data();
    uint64_t last = 0;
    for (size_t w = 0; w < words_.size(); ++w) {
      // A bit is set if its pixel differs from the previous one.
      uint64_t changes = words_[w] ^ (words_[w] << 1 | last);
      last = words_[w] >> 63;
      const int column = static_cast<int>(64 * w);
      while (changes != 0) {
        *edge++ = column + std::countr_zero(changes);
        changes &= changes - 1;
      }
    }
    row.num_runs = static_cast<size_t>(edge - row.edges.data()) / 2;
    return row;
  }

 private:
  void FillWords(const uchar* pixels, int threshold) {
    constexpr int kLanes = cv::v_uint8x16::nlanes;
    static_assert(64 % kLanes == 0);
    const cv::v_uint8x16 level = cv::v_setall_u8(static_cast<uchar>(threshold));
    for (size_t w = 0; w < words_.size(); ++w) {
      const int column = static_cast<int>(64 * w);
      uint64_t word = 0;
      if (column + 64 <= num_columns_) {
        for (int i = 0; i < 64; i += kLanes) {
          const cv::v_uint8x16 lanes = cv::v_load(pixels + column + i);
          word |= static_cast<uint64_t>(static_cast<uint32_t>(cv::v_signmask(lanes > level))) << i;
        }
      } else {
        for (int i = 0; column + i < num_columns_; ++i) {
          word |= static_cast<uint64_t>(pixels[column + i] > threshold) << i;
        }
      }
      words_[w] = word;
    }
  }

  int num_columns_;
  std::vector<uint64_t> words_;
};

// Areas that grow from row to row: sets of labels of runs. An area is identified by its smallest label, that of the run
// that comes first in reading order.
class Areas {
 public:
  // Returns the row with the area of each of its runs: that of the runs above that it touches, or a new one.
  Row WithLabels(Row row, int row_number, const Row& above) {
    size_t first_above = 0;
    for (size_t i = 0; i < row.num_runs; ++i) {
      const int begin = row.edges[2 * i];
      const int end = row.edges[2 * i + 1];
      while (first_above < above.num_runs && above.edges[2 * first_above + 1] < begin) ++first_above;
      int root = -1;
      for (size_t k = first_above; k < above.num_runs && above.edges[2 * k] <= end; ++k) {
        const int other = labels_.Root(above.labels[k]);
        if (root < 0) {
          Extend(other, row_number, begin, end);
          root = other;
        } else if (other != root) {
          root = Unite(root, other);
        }
      }
      row.labels[i] = root >= 0 ? root : Add(row_number, begin, end);
    }
    return row;
  }
  template <class F>
  void ForEach(const F& f) const {
    for (int i = 0; i < labels_.size(); ++i) {
      if (!labels_.IsRoot(i)) continue;
      const Node& node = nodes_[static_cast<size_t>(i)];
      f(LightArea{cv::Rect(node.begin, node.first_row, node.end - node.begin, node.last_row - node.first_row + 1),
                  cv::Point(node.first_column, node.first_row), node.num_pixels});
    }
  }

 private:
  int Add(int row, int begin, int end) {
    nodes_.push_back({begin, end, row, row, begin, end - begin});
    return labels_.Add();
  }
  void Extend(int root, int row, int begin, int end) {
    Node& node = NodeOf(root);
    node.begin = std::min(node.begin, begin);
    node.end = std::max(node.end, end);
    node.last_row = row;
    node.num_pixels += end - begin;
  }
  // Merges two areas, which are identified by their roots.
  int Unite(int a, int b) {
    const int root = labels_.Unite(a, b);
    Node& node = NodeOf(root);
    const Node& other = NodeOf(root == a ? b : a);
    node.begin = std::min(node.begin, other.begin);
    node.end = std::max(node.end, other.end);
    node.last_row = std::max(node.last_row, other.last_row);
    node.num_pixels += other.num_pixels;
    return root;
  }

  struct Node {
    int begin;  // Columns of the bounding box: [begin, end).
    int end;
    int first_row;
    int last_row;
    int first_column;  // First column in the first row.
    int num_pixels;
  };
  Node& NodeOf(int root) { return nodes_[static_cast<size_t>(root)]; }

  UnionFind<int> labels_;
  std::vector<Node> nodes_;
};

}  // namespace

std::vector<LightArea> FindLightAreas(const cv::Mat& grey, int threshold, int min_side_px, int max_side_px) {
  CHECK_EQ(grey.type(), CV_8UC1);
  CHECK(threshold >= 0 && threshold <= 255) << threshold;
  const auto most_edges = static_cast<size_t>(grey.cols) + 2;
  Row above{std::vector<int>(most_edges), std::vector<int>(most_edges), 0};
  Row row = above;
  RowReader reader(grey.cols);
  Areas found;
  for (int y = 0; y < grey.rows; ++y) {
    row = found.WithLabels(reader.Read(grey.ptr<uchar>(y), threshold, std::move(row)), y, above);
    std::swap(above, row);
  }
  std::vector<LightArea> areas;
  found.ForEach([&](const LightArea& area) {
    const cv::Rect& box = area.box;
    const int side_px = std::max(box.width, box.height);
    if (side_px < min_side_px || side_px > max_side_px) return;
    if (box.x <= 0 || box.y <= 0 || box.x + box.width >= grey.cols || box.y + box.height >= grey.rows) return;
    areas.push_back(area);
  });
  return areas;
}

std::optional<std::vector<cv::Point>> TraceOutline(const cv::Mat& grey, int threshold, const cv::Point& first,
                                                   size_t max_points) {
  // The eight directions are listed clockwise in the image, starting with the one to the right.
  constexpr std::array<int, 8> kColumns = {1, 1, 0, -1, -1, -1, 0, 1};
  constexpr std::array<int, 8> kRows = {0, 1, 1, 1, 0, -1, -1, -1};
  const auto stride = static_cast<std::ptrdiff_t>(grey.step[0]);
  std::array<std::ptrdiff_t, 8> steps;
  for (size_t d = 0; d < 8; ++d) steps[d] = kRows[d] * stride + kColumns[d];
  // Returns the first direction with a light pixel, clockwise from `from`, or from + 8 if there is none.
  const auto next = [&](const uchar* pixel, unsigned from) {
    unsigned d = from;
    while (d < from + 8 && pixel[steps[d % 8]] <= threshold) ++d;
    return d;
  };
  std::vector<cv::Point> outline = {first};
  const uchar* const first_pixel = grey.ptr<uchar>(first.y) + first.x;
  constexpr unsigned kLeft = 4;
  const unsigned first_found = next(first_pixel, kLeft);
  if (first_found == kLeft + 8) return outline;
  const unsigned first_direction = first_found % 8;
  cv::Point at = first;
  const uchar* pixel = first_pixel;
  for (unsigned direction = first_direction;;) {
    at.x += kColumns[direction];
    at.y += kRows[direction];
    pixel += steps[direction];
    // The search resumes two directions back, at a pixel that is known to be dark.
    const unsigned onward = next(pixel, direction + 6) % 8;
    if (pixel == first_pixel && onward == first_direction) return outline;
    if (outline.size() == max_points) return std::nullopt;
    outline.push_back(at);
    direction = onward;
  }
}

}  // namespace heba
