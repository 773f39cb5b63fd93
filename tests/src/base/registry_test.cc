// Tests of heba/base/registry.h.
#include "heba/base/registry.h"

#include <array>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace heba {
namespace {

using ::testing::ElementsAre;

struct Format {
  const char* name;
  int number;
};
constexpr Format kFormats[] = {{"first", 1}, {"second", 2}, {"second", 3}};

class Model {
 public:
  explicit Model(std::string name) : name_(std::move(name)) {}
  const std::string& name() const { return name_; }

 private:
  std::string name_;
};

TEST(RegistryTest, ListsNamesInTheOrderOfTheTable) {
  EXPECT_THAT(NamesOf(kFormats), ElementsAre("first", "second", "second"));
  const Model pinhole("pinhole");
  const Model fisheye("fisheye");
  EXPECT_THAT(NamesOf(std::vector<const Model*>{&pinhole, &fisheye}), ElementsAre("pinhole", "fisheye"));
}

TEST(RegistryTest, FindsTheFirstEntryOfAName) {
  ASSERT_NE(FindEntry(kFormats, "second"), nullptr);
  EXPECT_EQ(FindEntry(kFormats, "second")->number, 2);
  EXPECT_EQ(FindEntry(kFormats, "third"), nullptr);
  EXPECT_EQ(FindEntry(kFormats, ""), nullptr);
  const Model pinhole("pinhole");
  const std::vector<const Model*> models = {&pinhole};
  ASSERT_NE(FindEntry(models, "pinhole"), nullptr);
  EXPECT_EQ(*FindEntry(models, "pinhole"), &pinhole);
}

TEST(RegistryTest, FindsTheValueOfAnEnum) {
  enum class Side { kLeft, kRight };
  constexpr std::array<std::string_view, 2> kNames = {"left", "right"};
  EXPECT_EQ(FindValue<Side>(kNames, "right"), Side::kRight);
  EXPECT_EQ(FindValue<Side>(kNames, "middle"), std::nullopt);
}

TEST(UnknownNameTest, ListsTheNamesAndSuggestsTheNearest) {
  EXPECT_EQ(UnknownName("clean", {"show", "clear"}), "'clean' is unknown; did you mean 'clear'? One of: show, clear");
  EXPECT_EQ(UnknownName("remove", {"show", "clear"}), "'remove' is unknown; one of: show, clear");
}

}  // namespace
}  // namespace heba
