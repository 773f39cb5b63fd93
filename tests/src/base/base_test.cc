#include <sys/stat.h>

#include <atomic>
#include <cmath>
#include <fstream>
#include <limits>
#include <numeric>
#include <set>
#include <stdexcept>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/error.h"
#include "heba/base/failure_code.h"
#include "heba/base/files.h"
#include "heba/base/parallel.h"
#include "heba/base/rng.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "tests/support/input_error.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

struct QuantityCase {
  const char* text;
  Quantity quantity;
  double value;
};

TEST(Units, ReadsEveryUnitInBaseUnits) {
  const QuantityCase cases[] = {{"40 mm", Quantity::kLength, 0.04},
                                {"0.04 m", Quantity::kLength, 0.04},
                                {"4cm", Quantity::kLength, 0.04},
                                {"250 um", Quantity::kLength, 0.00025},
                                {"2 in", Quantity::kLength, 0.0508},
                                {"180 deg", Quantity::kAngle, 3.14159265358979},
                                {"-0.1rad", Quantity::kAngle, -0.1},
                                {"5 mrad", Quantity::kAngle, 0.005},
                                {"+0.3 px", Quantity::kPixels, 0.3},
                                {"2 grey", Quantity::kGreyLevels, 2},
                                {" 1.5e1  mm ", Quantity::kLength, 0.015},
                                {"2e-5 rad/(N m)", Quantity::kCompliance, 2e-5},
                                {"18 deg/(N m)", Quantity::kCompliance, 0.314159265358979},
                                {"250 g", Quantity::kMass, 0.25}};
  for (const QuantityCase& c : cases) {
    const ParsedQuantity parsed = ParseQuantity(c.text, c.quantity);
    EXPECT_EQ(parsed.fault, "") << c.text;
    // The tolerance allows for the rounding of the conversion to base units.
    EXPECT_NEAR(parsed.value, c.value, 1e-14) << c.text;
  }
}

TEST(Units, ReportsFaults) {
  EXPECT_THAT(ParseQuantity("40", Quantity::kLength).fault, HasSubstr("no unit; write a length such as '40 mm'"));
  EXPECT_THAT(ParseQuantity("40 deg", Quantity::kLength).fault, HasSubstr("one of m, cm, mm, um, in is needed"));
  EXPECT_THAT(ParseQuantity("mm", Quantity::kLength).fault, HasSubstr("is not a length"));
  EXPECT_THAT(ParseQuantity("", Quantity::kAngle).fault, HasSubstr("is not an angle"));
  EXPECT_THAT(ParseQuantity("inf m", Quantity::kLength).fault, HasSubstr("not finite"));
  EXPECT_THAT(ParseQuantity("nan rad", Quantity::kAngle).fault, HasSubstr("not finite"));
  EXPECT_THAT(ParseQuantity("1,5 mm", Quantity::kLength).fault, HasSubstr("unit"));
  EXPECT_THAT(ParseQuantity("+-3 mm", Quantity::kLength).fault, HasSubstr("is not a length"));
}

TEST(Units, EveryQuantityHasItsBaseUnit) {
  EXPECT_EQ(BaseUnit(Quantity::kLength), "m");
  EXPECT_EQ(BaseUnit(Quantity::kAngle), "rad");
  EXPECT_EQ(BaseUnit(Quantity::kPixels), "px");
  EXPECT_EQ(BaseUnit(Quantity::kGreyLevels), "grey");
  EXPECT_EQ(BaseUnit(Quantity::kMass), "kg");
  EXPECT_EQ(BaseUnit(Quantity::kCompliance), "rad/(N m)");
}

TEST(Text, SplitsAndJoins) {
  EXPECT_THAT(Split("a,,b,", ','), ElementsAre("a", "", "b", ""));
  EXPECT_THAT(Split("", ','), ElementsAre(""));
  EXPECT_EQ(Join({"a", "", "b"}, ", "), "a, , b");
  EXPECT_EQ(Trim(" \t a b \r\n"), "a b");
  EXPECT_EQ(Trim(" \n"), "");
}

TEST(Text, ShortensAtTheStart) {
  EXPECT_EQ(ShortenedAtStart("run_12", 6), "run_12");
  EXPECT_EQ(ShortenedAtStart("long_run_12", 6), "..n_12");
  // Characters of two and three bytes are counted as one and are not cut.
  EXPECT_EQ(NumCharacters("M\xC3\xA4\xE2\x82\xAC"), 3u);
  EXPECT_EQ(ShortenedAtStart("\xC3\xA4\xC3\xA4\xC3\xA4", 3), "\xC3\xA4\xC3\xA4\xC3\xA4");
  EXPECT_EQ(ShortenedAtStart("abc\xC3\xA4\xE2\x82\xAC", 4), "..\xC3\xA4\xE2\x82\xAC");
  EXPECT_EQ(ShortenedAtStart("abc", 2), "..");
}

TEST(Text, PadsToAWidthInCharacters) {
  EXPECT_EQ(PadLeft("\xC3\xA4", 3), "  \xC3\xA4");
  EXPECT_EQ(PadRight("\xC3\xA4", 3), "\xC3\xA4  ");
  EXPECT_EQ(PadRight("abcd", 3), "abcd");
}

TEST(Text, QuotesOnOneShortLine) {
  EXPECT_EQ(Quoted("a b"), "'a b'");
  EXPECT_EQ(Quoted("a\nb\x1b[1m"), "'a?b?[1m'");
  EXPECT_EQ(Quoted(std::string(60, 'x')), "'" + std::string(60, 'x') + "'");
  EXPECT_EQ(Quoted(std::string(61, 'x')), "'" + std::string(60, 'x') + "...'");
  // A two-byte UTF-8 character is not cut in half.
  EXPECT_EQ(Quoted(std::string(59, 'x') + "\xC3\xA4."), "'" + std::string(59, 'x') + "...'");
}

TEST(Text, WritesNumbers) {
  EXPECT_EQ(Fixed(1.005, 1), "1.0");
  EXPECT_EQ(Fixed(-2, 3), "-2.000");
  EXPECT_EQ(Significant(0.00123456, 3), "0.00123");
  EXPECT_EQ(Significant(123456, 3), "123456");
  EXPECT_EQ(Significant(1234567, 3), "1.23e+06");
  EXPECT_EQ(Significant(1.5e-9, 2), "1.5e-09");
  EXPECT_EQ(Significant(0, 3), "0");
  EXPECT_EQ(ShownPValue(0.0321), "0.03");
  EXPECT_EQ(ShownPValue(4e-288), "< 1e-6");
  EXPECT_EQ(Significant(-std::numeric_limits<double>::infinity(), 3), "-inf");
  EXPECT_EQ(RoundTrip(0.1), "0.1");
}

TEST(Text, WrapsLongLinesAtBlanks) {
  EXPECT_EQ(Wrapped("a table  1.0   2.0\nremark: much is to be said\n", 18),
            "a table  1.0   2.0\nremark: much is to\n  be said\n");
  EXPECT_EQ(Wrapped("  in from the left, on and on", 14), "  in from the\n    left, on\n    and on");
  EXPECT_EQ(Wrapped("a/very/long/word/that/stays and more", 10), "a/very/long/word/that/stays\n  and more");
  EXPECT_EQ(Wrapped("\x1b[1mbold\x1b[0m text", 9), "\x1b[1mbold\x1b[0m text");
  EXPECT_EQ(Wrapped("", 10), "");
}

TEST(Text, Base64FollowsRfc4648) {
  const std::pair<std::string, std::string> vectors[] = {{"", ""},
                                                         {"f", "Zg=="},
                                                         {"fo", "Zm8="},
                                                         {"foo", "Zm9v"},
                                                         {"foob", "Zm9vYg=="},
                                                         {"fooba", "Zm9vYmE="},
                                                         {"foobar", "Zm9vYmFy"}};
  for (const auto& [bytes, text] : vectors) {
    EXPECT_EQ(ToBase64(bytes), text);
    EXPECT_EQ(FromBase64(text), bytes);
  }
  std::string all;
  for (int i = 0; i < 256; ++i) all += static_cast<char>(i);
  EXPECT_EQ(FromBase64(ToBase64(all)), all);
}

TEST(Text, RoundTripIsExact) {
  Rng rng(3);
  for (int i = 0; i < 1000; ++i) {
    const double value = rng.Normal() * std::pow(10.0, rng.Uniform(-30, 30));
    double read = 0;
    ASSERT_TRUE(ParseDouble(RoundTrip(value), &read));
    EXPECT_EQ(read, value);
  }
}

TEST(Text, ParsesWholeNumbersOnly) {
  double value = 0;
  EXPECT_TRUE(ParseDouble("+1.5e-3", &value));
  EXPECT_EQ(value, 1.5e-3);
  EXPECT_TRUE(ParseDouble("7.", &value));  // OpenCV writes numbers like this.
  EXPECT_EQ(value, 7);
  EXPECT_TRUE(ParseDouble("-inf", &value));
  for (const char* text : {"", " 1", "1 ", "1,5", "0x10", "+-1", "--1", "+", "1e", "one", "1e999"}) {
    EXPECT_FALSE(ParseDouble(text, &value)) << text;
  }
}

TEST(Text, SuggestsTheNearestName) {
  const std::vector<std::string> known = {"rows", "columns", "spacing"};
  EXPECT_EQ(DidYouMean("colums", known), "; did you mean 'columns'?");
  EXPECT_EQ(DidYouMean("rwos", known), "; did you mean 'rows'?");
  EXPECT_EQ(DidYouMean("something_else", known), "");
  EXPECT_EQ(DidYouMean("rows", {}), "");
  // Two characters that both differ are no typing error.
  EXPECT_EQ(DidYouMean("px", {"mm", "cm"}), "");
  EXPECT_EQ(DidYouMean("nm", {"mm", "deg"}), "; did you mean 'mm'?");
  // The table of the edit distance would have 1e6 rows.
  EXPECT_EQ(DidYouMean(std::string(1000000, 'r'), known), "");
}

TEST(OutcomeTest, HoldsAValueOrAReason) {
  const Outcome<int> value = 3;
  EXPECT_TRUE(value.ok());
  EXPECT_EQ(*value, 3);
  EXPECT_EQ(value.reason(), "");
  const Outcome<int> failure = Failure{"too few"};
  EXPECT_FALSE(failure);
  EXPECT_EQ(failure.reason(), "too few");
  EXPECT_DEATH(static_cast<void>(*failure), "too few");
  EXPECT_EQ(Outcome<int>().failure().code, "not_run");
}

TEST(FailureTest, WithoutWordsIsShownAsItsCodeWithFiguresNamesAndCauses) {
  const Failure cause{FailureCode("few_captures"), {{"captures", 2}}};
  const Failure failure{FailureCode("of_camera"), {}, {{"camera", "left"}}, {cause}};
  EXPECT_EQ(failure.ToString(), "of_camera (camera left): few_captures (captures 2)");
  EXPECT_TRUE(Failure().empty());
  EXPECT_FALSE(cause.empty());
}

void Write(const fs::path& path, const std::string& content) { std::ofstream(path, std::ios::binary) << content; }

TEST(Files, ReadsContentsUnchanged) {
  const TempFolder folder;
  const std::string content("a\r\n\0b", 5);
  Write(folder / "a.txt", content);
  EXPECT_EQ(ReadTextFile(folder / "a.txt"), content);
  Write(folder / "empty.txt", "");
  EXPECT_EQ(ReadTextFile(folder / "empty.txt"), "");
}

TEST(Files, AMissingFileIsComparedWithThoseBesideIt) {
  const TempFolder folder;
  Write(folder / "config.yaml", "");
  Write(folder / "007.png", "");
  EXPECT_EQ(FileMeant(folder / "confg.yaml"), "; did you mean 'config.yaml'?");
  EXPECT_EQ(FileMeant(folder / "0007.png"), "");  // Other numbers belong to other files.
  EXPECT_EQ(FileMeant(folder / "007.jpg"), "; did you mean '007.png'?");
  EXPECT_EQ(FileMeant(folder.path() / "none" / "config.yaml"), "");
  EXPECT_THAT(InputErrorOf([&] { ReadTextFile(folder / "confg.yaml"); }), HasSubstr("did you mean 'config.yaml'?"));
}

TEST(Files, RefusesMissingFoldersAndLargeFiles) {
  const TempFolder folder;
  Write(folder / "large.txt", std::string((1 << 20) + 1, 'x'));
  EXPECT_THAT(InputErrorOf([&] { ReadTextFile(folder / "none.txt"); }), HasSubstr("none.txt: there is no such file"));
  EXPECT_THAT(InputErrorOf([&] { ReadTextFile(folder.path()); }), HasSubstr("this is a folder"));
  EXPECT_THAT(InputErrorOf([&] { ReadTextFile(folder / "large.txt", 1 << 20); }), HasSubstr("larger than 1 MiB"));
  EXPECT_EQ(ReadTextFile(folder / "large.txt", (1 << 20) + 1).size(), (1u << 20) + 1);
}

TEST(Files, WritesWholeFiles) {
  const TempFolder folder;
  Write(folder / "a.txt", "a longer older content");
  WriteFileAtomically(folder / "a.txt", "new");
  EXPECT_EQ(ReadTextFile(folder / "a.txt"), "new");
  // No temporary file is left behind.
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), fs::directory_iterator()), 1);
}

TEST(Files, WritesAPlainNameIntoTheWorkingFolder) {
  const TempFolder folder;
  const fs::path before = fs::current_path();
  fs::current_path(folder.path());
  WriteFileAtomically("plain.txt", "x");
  fs::current_path(before);
  EXPECT_EQ(ReadTextFile(folder / "plain.txt"), "x");
}

TEST(Files, LeavesNoFileIfWritingFails) {
  const TempFolder folder;
  EXPECT_THAT(InputErrorOf([&] { WriteFileAtomically(folder / "none/a.txt", "x"); }), HasSubstr("cannot be written"));
  // A folder cannot be replaced by a file of the same name.
  fs::create_directories(folder / "taken/inside");
  EXPECT_THAT(InputErrorOf([&] { WriteFileAtomically(folder / "taken", "x"); }), HasSubstr("is a folder"));
  EXPECT_TRUE(fs::exists(folder / "taken/inside"));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), fs::directory_iterator()), 1);
}

TEST(Files, ReadsAndReplacesRegularFilesOnly) {
  const TempFolder folder;
  ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
  EXPECT_THAT(InputErrorOf([&] { ReadTextFile(folder / "pipe"); }), HasSubstr("is not a regular file"));
  EXPECT_THAT(InputErrorOf([&] { ReadTextFile("/dev/zero"); }), HasSubstr("is not a regular file"));
  EXPECT_THAT(InputErrorOf([&] { WriteFileAtomically(folder / "pipe", "x"); }), HasSubstr("is not a regular file"));
  EXPECT_TRUE(fs::is_fifo(folder / "pipe"));
  Write(folder / "kept.txt", "kept");
  fs::create_symlink(folder / "kept.txt", folder / "link");
  EXPECT_THAT(InputErrorOf([&] { WriteFileAtomically(folder / "link", "x"); }), HasSubstr("is not a regular file"));
  EXPECT_TRUE(fs::is_symlink(folder / "link"));
  EXPECT_EQ(ReadTextFile(folder / "kept.txt"), "kept");
}

TEST(Parallel, CallsEveryIndexOnce) {
  for (const int num_threads : {0, 1, 2, 7}) {
    std::vector<std::atomic<int>> calls(100);
    ParallelFor(100, num_threads, [&](int i) { ++calls[static_cast<size_t>(i)]; });
    for (const std::atomic<int>& count : calls) EXPECT_EQ(count, 1);
  }
  ParallelFor(0, 4, [](int) { FAIL() << "there is nothing to do"; });
}

TEST(Parallel, ThrowsTheErrorOfTheSmallestIndexAfterAllWorkIsDone) {
  for (const int num_threads : {1, 4}) {
    std::atomic<int> done{0};
    std::string message;
    try {
      ParallelFor(50, num_threads, [&](int i) {
        // Index 3 throws later than index 4.
        if (i == 3) std::this_thread::sleep_for(std::chrono::milliseconds(20));
        if (i == 3 || i == 4 || i == 40) throw std::runtime_error("index " + std::to_string(i));
        ++done;
      });
    } catch (const std::runtime_error& error) {
      message = error.what();
    }
    EXPECT_EQ(message, "index 3");
    EXPECT_EQ(done, 47);
  }
}

TEST(Parallel, FindsAtLeastOneProcessor) { EXPECT_GE(NumProcessors(), 1); }

TEST(RngTest, IsTheSameOnEveryMachine) {
  // The C++ standard fixes the sequence of mt19937_64. This is its first output for the default seed, so the test
  // pins how Rng uses the generator.
  Rng rng(5489);
  EXPECT_EQ(rng.Uniform(), static_cast<double>(14514284786278117030ULL >> 11) * 0x1.0p-53);
  Rng again(5489);
  Rng same(5489);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(again.Normal(), same.Normal());
}

TEST(RngTest, StreamsAreIndependent) {
  std::set<double> firsts;
  for (uint64_t seed = 0; seed < 30; ++seed) {
    for (uint64_t index = 0; index < 30; ++index) firsts.insert(Rng(seed, index).Uniform());
  }
  EXPECT_EQ(firsts.size(), 900u);
  EXPECT_EQ(Rng(1, 2).Uniform(), Rng(1, 2).Uniform());
}

TEST(RngTest, MomentsMatchTheDistributions) {
  Rng rng(11);
  constexpr int kCount = 100000;
  double uniform_sum = 0;
  double sum = 0;
  double sum_squares = 0;
  Eigen::Vector3d directions = Eigen::Vector3d::Zero();
  for (int i = 0; i < kCount; ++i) {
    const double uniform = rng.Uniform(-1, 3);
    ASSERT_GE(uniform, -1);
    ASSERT_LT(uniform, 3);
    uniform_sum += uniform;
    const double normal = rng.Normal();
    sum += normal;
    sum_squares += normal * normal;
    const Eigen::Vector3d direction = rng.Direction3();
    ASSERT_NEAR(direction.norm(), 1, 1e-12);
    directions += direction;
    const int index = rng.Index(3);
    ASSERT_GE(index, 0);
    ASSERT_LT(index, 3);
  }
  // The tolerances are five standard errors, which one seed in a million exceeds; the seed is fixed.
  const double root = std::sqrt(static_cast<double>(kCount));
  EXPECT_NEAR(uniform_sum / kCount, 1.0, 5 * (4 / std::sqrt(12.0)) / root);
  EXPECT_NEAR(sum / kCount, 0.0, 5 / root);
  EXPECT_NEAR(sum_squares / kCount, 1.0, 5 * std::sqrt(2.0) / root);
  EXPECT_LT((directions / kCount).cwiseAbs().maxCoeff(), 5 / std::sqrt(3.0) / root);
}

TEST(TextTest, RecognisesUtf8) {
  EXPECT_TRUE(IsUtf8(""));
  EXPECT_TRUE(IsUtf8("a\xc3\xa4\xe6\x9c\xba\xf0\x9f\xa4\x96"));
  for (const char* text : {"\xff", "\x80", "\xc3", "\xc3(", "\xe6\x9c", "\xf0\x9f\xa4", "\xc0\xaf", "a\x99"}) {
    EXPECT_FALSE(IsUtf8(text)) << text;
  }
}

}  // namespace
}  // namespace heba
