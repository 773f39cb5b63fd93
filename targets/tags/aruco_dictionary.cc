#include "targets/tags/aruco_dictionary.h"

#include <bit>
#include <string>
#include <string_view>

#include "heba/base/registry.h"
#include "targets/tags/aruco_codes.h"
#include "targets/tags/tag_codes.h"

namespace heba {
namespace {

constexpr std::string_view kOriginal = "DICT_ARUCO_ORIGINAL";
constexpr std::string_view kAprilTag = "DICT_APRILTAG_";

// Returns the codes of the first markers of ArUco itself. Each of the five rows holds two bits of the number, the
// highest in the first row, as a Hamming code of five bits.
std::vector<uint64_t> OriginalCodes(int num_markers) {
  constexpr uint64_t kRows[] = {0b10000, 0b10111, 0b01001, 0b01110};
  std::vector<uint64_t> codes;
  for (int number = 0; number < num_markers; ++number) {
    uint64_t code = 0;
    for (int shift = 8; shift >= 0; shift -= 2) code = code << 5 | kRows[(number >> shift) & 3];
    codes.push_back(code);
  }
  return codes;
}

// Returns the codes of the first tags of one of libapriltag's families. OpenCV's tags are upside down.
std::vector<uint64_t> AprilTagCodes(const std::string& family_name, int size, int num_markers) {
  const TagFamily family(*FindEntry(kTagFamilies, family_name));
  std::vector<uint64_t> codes;
  for (int number = 0; number < num_markers; ++number) {
    uint64_t code = 0;
    for (uint32_t bit = 0; bit < family->nbits; ++bit) {
      const uint64_t is_white = (family->codes[number] >> (family->nbits - 1 - bit)) & 1u;
      // The first cell inside the border is (1, 1).
      const auto x = static_cast<int>(family->bit_x[bit]) - 1;
      const auto y = static_cast<int>(family->bit_y[bit]) - 1;
      code |= is_white << (y * size + x);
    }
    codes.push_back(code);
  }
  return codes;
}

std::vector<uint64_t> CodesOf(const ArucoDictionaryName& name) {
  const std::string_view text = name.name;
  if (text == kOriginal) return OriginalCodes(name.num_markers);
  if (text.starts_with(kAprilTag)) {
    return AprilTagCodes("tag" + std::string(text.substr(kAprilTag.size())), name.size, name.num_markers);
  }
  const auto first_of = [&](const auto& codes) {
    return std::vector<uint64_t>(codes.begin(), codes.begin() + name.num_markers);
  };
  switch (name.size) {
    case 4:
      return first_of(kArucoCodes4x4);
    case 5:
      return first_of(kArucoCodes5x5);
    case 6:
      return first_of(kArucoCodes6x6);
    default:
      return first_of(kArucoCodes7x7);
  }
}

// Returns the code of a square that is turned clockwise by a quarter.
uint64_t Turned(uint64_t code, int size) {
  uint64_t turned = 0;
  for (int row = 0; row < size; ++row) {
    for (int column = 0; column < size; ++column) {
      // What comes to lie here lay in row size - 1 - column and column `row`; the last cell is bit 0.
      turned = turned << 1 | ((code >> (column * size + size - 1 - row)) & 1u);
    }
  }
  return turned;
}

}  // namespace

const std::array<ArucoDictionaryName, 21> kArucoDictionaries = {{
    {"DICT_4X4_50", 4, 50, 1},        {"DICT_4X4_100", 4, 100, 1},         {"DICT_4X4_250", 4, 250, 1},
    {"DICT_4X4_1000", 4, 1000, 0},    {"DICT_5X5_50", 5, 50, 3},           {"DICT_5X5_100", 5, 100, 3},
    {"DICT_5X5_250", 5, 250, 2},      {"DICT_5X5_1000", 5, 1000, 2},       {"DICT_6X6_50", 6, 50, 6},
    {"DICT_6X6_100", 6, 100, 5},      {"DICT_6X6_250", 6, 250, 5},         {"DICT_6X6_1000", 6, 1000, 4},
    {"DICT_7X7_50", 7, 50, 9},        {"DICT_7X7_100", 7, 100, 8},         {"DICT_7X7_250", 7, 250, 8},
    {"DICT_7X7_1000", 7, 1000, 6},    {"DICT_ARUCO_ORIGINAL", 5, 1024, 0}, {"DICT_APRILTAG_16h5", 4, 30, 0},
    {"DICT_APRILTAG_25h9", 5, 35, 0}, {"DICT_APRILTAG_36h10", 6, 2320, 0}, {"DICT_APRILTAG_36h11", 6, 587, 0},
}};

ArucoDictionary::ArucoDictionary(const ArucoDictionaryName& name)
    : size_(name.size), num_correctable_bits_(name.num_correctable_bits), codes_(CodesOf(name)) {}

void ArucoDictionary::Append(const ArucoDictionary& other) {
  codes_.insert(codes_.end(), other.codes_.begin(), other.codes_.end());
}

bool ArucoDictionary::IsBlack(int index, int row, int column) const {
  if (row == 0 || column == 0 || row > size_ || column > size_) return true;
  const int bit = size_ * size_ - 1 - ((row - 1) * size_ + column - 1);
  return ((codes_[static_cast<size_t>(index)] >> bit) & 1u) == 0;
}

std::optional<IdentifiedMarker> ArucoDictionary::Identify(uint64_t code, int max_bit_errors) const {
  std::array<uint64_t, 4> turned = {code};
  for (size_t turns = 1; turns < turned.size(); ++turns) turned[turns] = Turned(turned[turns - 1], size_);
  for (size_t index = 0; index < codes_.size(); ++index) {
    int least_errors = max_bit_errors + 1;
    IdentifiedMarker marker;
    for (size_t turns = 0; turns < turned.size(); ++turns) {
      const int errors = std::popcount(turned[turns] ^ codes_[index]);
      if (errors >= least_errors) continue;
      least_errors = errors;
      marker = {static_cast<int>(index), static_cast<int>(turns)};
    }
    if (least_errors <= max_bit_errors) return marker;
  }
  return std::nullopt;
}

}  // namespace heba
