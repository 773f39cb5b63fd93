// Runs and examinations of recorded pairs of poses without images (cases/pairs), each with one fault.
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/pipeline/cli.h"
#include "tests/support/data_sets.h"

namespace heba {
namespace {
namespace fs = std::filesystem;
using Json = nlohmann::json;
using testing::HasSubstr;

class PosePairsTest : public testing::Test {
 protected:
  void SetUp() override {
    HEBA_SKIP_WITHOUT(DataDir() / "cases" / "pairs");
    folder_ = TestFolder("pose_pairs");
  }
  static std::string Config(const std::string& name) {
    return (DataDir() / "cases" / "pairs" / name / "config.yaml").string();
  }
  Json Run(const std::string& name, const std::vector<std::string>& settings = {}) {
    std::vector<std::string> arguments = {"run", Config(name), "--out", (folder_ / name).string(), "--quiet"};
    for (const std::string& setting : settings) arguments.insert(arguments.end(), {"--set", setting});
    const CommandResult run = RunHeba(arguments);
    EXPECT_EQ(run.status, 0) << run.err;
    return Json::parse(ReadAll(folder_ / name / "result.json"));
  }
  fs::path folder_;
};

TEST_F(PosePairsTest, PoseOfManyThatIsTurnedIsLeftOutAndNamed) {
  const Json result = Run("innns_1flip");
  int num_left_out = 0;
  for (const Json& capture : result["captures"]) {
    if (capture["used"].get<bool>()) continue;
    ++num_left_out;
    EXPECT_THAT(capture["reason"].get<std::string>(), HasSubstr("contradicts the other captures"));
  }
  EXPECT_EQ(num_left_out, 1);
}

TEST_F(PosePairsTest, BothReadingsOfInvertedTargetPosesAreNamed) {
  const CommandResult doctor = RunHeba({"doctor", Config("inv_target"), "--quiet"});
  EXPECT_THAT(doctor.out, HasSubstr("pose_direction"));
  EXPECT_THAT(doctor.out, HasSubstr("poses_are"));
  const Json result = Run("inv_target");
  EXPECT_NE(result["verdict"]["grade"], "good");
  EXPECT_EQ(result["verdict"]["findings"][0]["code"], "pose_direction");
}

TEST_F(PosePairsTest, UnitOfTheTargetPosesIsFound) {
  const CommandResult doctor = RunHeba({"doctor", Config("mm_target"), "--quiet"});
  EXPECT_THAT(doctor.out, HasSubstr("pose_units"));
}

TEST_F(PosePairsTest, FewCapturesThatBelongNotTogetherAreNotFine) {
  for (const char* const name : {"non3", "non4"}) {
    const CommandResult doctor = RunHeba({"doctor", Config(name), "--quiet"});
    EXPECT_THAT(doctor.out, HasSubstr("poses_unexplained")) << name;
  }
}

}  // namespace
}  // namespace heba
