#include "tools/run/digest.h"

#include <fstream>
#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/input_error.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
using ::testing::HasSubstr;
using ::testing::MatchesRegex;

// The reference values of XXH3 with 128 bits and seed 0. Digests are kept in caches, so they must not change.
TEST(DigestTest, IsThatOfTheReferenceImplementation) { EXPECT_EQ(DigestOf(""), "99aa06d3014798d86001c324468d497f"); }

TEST(DigestTest, Is32HexadecimalDigits) {
  for (const char* content : {"", "a", "a longer text"}) {
    EXPECT_THAT(DigestOf(content), MatchesRegex("[0-9a-f]{32}")) << content;
  }
}

TEST(DigestTest, DistinguishesContents) {
  std::set<std::string> digests;
  std::string content;
  for (int length = 0; length < 300; ++length) {
    digests.insert(DigestOf(content));
    content += '\0';
  }
  content[0] = 'a';
  digests.insert(DigestOf(content));
  EXPECT_EQ(digests.size(), 301u);
}

// The file is read in blocks of 64 KiB.
TEST(DigestOfFileTest, IsTheDigestOfItsContent) {
  const TempFolder folder;
  for (const size_t size : {0, 1, 65535, 65536, 65537, 200000}) {
    std::string content(size, 'x');
    for (size_t i = 0; i < size; ++i) content[i] = static_cast<char>(i * i % 251);
    std::ofstream(folder / "file", std::ios::binary) << content;
    EXPECT_EQ(DigestOfFile(folder / "file"), DigestOf(content)) << size;
  }
}

TEST(DigestOfFileTest, RefusesWhatIsNoFile) {
  const TempFolder folder;
  EXPECT_THAT(InputErrorOf([&] { DigestOfFile(folder.path()); }), HasSubstr("is not a regular file"));
  EXPECT_THAT(InputErrorOf([&] { DigestOfFile(folder / "absent"); }),
              HasSubstr("absent: cannot be read (No such file"));
}

}  // namespace
}  // namespace heba
