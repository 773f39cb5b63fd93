#include "heba/io/npy_file.h"

#include <cstdint>
#include <cstring>
#include <map>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/io/python_literal.h"

namespace heba {
namespace {

template <typename Number>
double NumberAt(const char* bytes) {
  Number number;
  std::memcpy(&number, bytes, sizeof(number));
  return static_cast<double>(number);
}

struct NumberType {
  size_t size;
  double (*read)(const char* bytes);
};

// Returns the number type for a name of NumPy without the byte order mark; null if it is unknown.
const NumberType* FindNumberType(const std::string& name) {
  static const std::map<std::string, NumberType> types = {
      {"f4", {4, NumberAt<float>}},   {"f8", {8, NumberAt<double>}},   {"i1", {1, NumberAt<int8_t>}},
      {"i2", {2, NumberAt<int16_t>}}, {"i4", {4, NumberAt<int32_t>}},  {"i8", {8, NumberAt<int64_t>}},
      {"u1", {1, NumberAt<uint8_t>}}, {"u2", {2, NumberAt<uint16_t>}}, {"u4", {4, NumberAt<uint32_t>}}};
  const auto found = types.find(name);
  return found == types.end() ? nullptr : &found->second;
}

// Returns the index of an element in column-major (Fortran) order; `place` is its index in row-major order.
size_t FortranPlace(size_t place, const std::vector<size_t>& shape) {
  size_t fortran = 0;
  size_t stride = 1;
  std::vector<size_t> index(shape.size());
  for (size_t axis = shape.size(); axis-- > 0;) {
    index[axis] = place % shape[axis];
    place /= shape[axis];
  }
  for (size_t axis = 0; axis < shape.size(); ++axis) {
    fortran += index[axis] * stride;
    stride *= shape[axis];
  }
  return fortran;
}

}  // namespace

NumberArray ParseNpy(const std::string& bytes, const std::filesystem::path& name) {
  const auto fail = [&](const std::string& fault) { throw InputError(name.string() + ": " + fault); };
  constexpr std::string_view kMagic = "\x93NUMPY";
  constexpr size_t kVersionAt = 6;
  constexpr size_t kLengthAt = 8;
  if (!bytes.starts_with(kMagic) || bytes.size() < kLengthAt + 4) fail("is not a NumPy array (.npy)");
  const bool is_first_version = bytes[kVersionAt] == 1;
  const size_t header_at = kLengthAt + (is_first_version ? 2 : 4);
  size_t header_size = 0;
  for (size_t i = header_at; i-- > kLengthAt;) header_size = 256 * header_size + static_cast<unsigned char>(bytes[i]);
  if (header_size > bytes.size() - header_at) fail("is truncated");
  constexpr size_t kLargestHeader = 65536;
  if (header_size > kLargestHeader) fail("has a huge header");
  const PythonValue header = ParsePythonLiteral(bytes.substr(header_at, header_size), name);
  const PythonValue* type_name = header.Find("descr");
  const PythonValue* order = header.Find("fortran_order");
  const PythonValue* shape = header.Find("shape");
  if (type_name == nullptr || order == nullptr || shape == nullptr || shape->kind != PythonValue::Kind::kList) {
    fail("has no descr, fortran_order and shape in its header");
  }
  const std::string& descr = type_name->text;
  const NumberType* type = descr.empty() ? nullptr : FindNumberType(descr.substr(1));
  if (type == nullptr || descr[0] == '>') {
    fail("holds " + Quoted(descr) + "; an array of little-endian floats or integers is needed");
  }
  constexpr size_t kMostAxes = 32;  // NumPy has the same limit.
  if (shape->items.size() > kMostAxes) fail("has more than 32 axes");
  NumberArray array;
  const size_t num_bytes = bytes.size() - header_at - header_size;
  size_t count = 1;
  for (const PythonValue& size : shape->items) {
    constexpr double kMostEntries = 1e8;
    if (!(size.number >= 1 && size.number <= kMostEntries)) fail("has an empty or a huge shape");
    array.shape.push_back(static_cast<size_t>(size.number));
    count *= array.shape.back();
    if (count > num_bytes) fail("is truncated");
  }
  if (count * type->size > num_bytes) fail("is truncated");
  const char* data = bytes.data() + header_at + header_size;
  const bool is_fortran = order->text == "True";
  for (size_t i = 0; i < count; ++i) {
    array.numbers.push_back(type->read(data + type->size * (is_fortran ? FortranPlace(i, array.shape) : i)));
  }
  return array;
}

NumberArray ReadNpyFile(const std::filesystem::path& path) { return ParseNpy(ReadTextFile(path), path); }

}  // namespace heba
