// Tests of heba/io/result_file.h.
#include "heba/io/result_file.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/files.h"
#include "heba/data/capture_role.h"
#include "tests/support/input_error.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
using ::testing::HasSubstr;

// A result with a closed form, a refinement that failed, and one capture of each role.
RunResult SmallResult() {
  RunResult result;
  result.name = "cell";
  result.target_type = "chessboard";
  for (const std::string_view name : kCaptureRoleNames) {
    CaptureResult capture;
    capture.image = "image_" + std::string(name);
    capture.role = *FindCaptureRole(name);
    result.captures.push_back(capture);
  }
  Estimate closed;
  closed.method = "park";
  closed.reason = "too few captures";
  Estimate refined;
  refined.method = kBundleMethod;
  refined.kind = EstimateKind::kRefined;
  refined.reason = "not run";
  result.estimates = {closed, refined};
  return result;
}

class ResultFileTest : public testing::Test {
 protected:
  RunResult Read(const std::string& text) const {
    WriteFileAtomically(folder_ / "result.json", text);
    return ReadResult(folder_ / "result.json");
  }
  // Returns the error of a result in which the first `from` is replaced.
  std::string ErrorOf(const std::string& from, const std::string& to) const {
    std::string text = ResultToJson(SmallResult());
    const size_t at = text.find(from);
    if (at == std::string::npos) return "the result has no " + from;
    text.replace(at, from.size(), to);
    return InputErrorOf([&] { Read(text); });
  }

 private:
  TempFolder folder_;
};

TEST_F(ResultFileTest, RolesAndKindsAreReadAsTheyWereWritten) {
  const RunResult written = SmallResult();
  const RunResult read = Read(ResultToJson(written));
  ASSERT_EQ(read.captures.size(), written.captures.size());
  for (size_t i = 0; i < written.captures.size(); ++i) EXPECT_EQ(read.captures[i].role, written.captures[i].role);
  ASSERT_EQ(read.estimates.size(), 2u);
  EXPECT_EQ(read.estimates[0].kind, EstimateKind::kClosedForm);
  EXPECT_EQ(read.estimates[1].kind, EstimateKind::kRefined);
}

TEST_F(ResultFileTest, RefusesUnknownRolesAndKinds) {
  EXPECT_THAT(ErrorOf("\"translate_x\"", "\"translate_z\""),
              HasSubstr("the role is unknown; one of: home, translate_x"));
  EXPECT_THAT(ErrorOf("\"closed_form\"", "\"open_form\""),
              HasSubstr("the kind is unknown; one of: closed_form, refined"));
}

TEST(CaptureRoleTest, NamesAndRolesAreInverse) {
  for (const std::string_view name : kCaptureRoleNames) EXPECT_EQ(RoleName(*FindCaptureRole(name)), name);
  EXPECT_EQ(RoleName(CaptureRole::kTranslateY), "translate_y");
  EXPECT_EQ(RoleName(CaptureRole::kNone), "");
  EXPECT_FALSE(FindCaptureRole("hoem").has_value());
}

}  // namespace
}  // namespace heba
