// Tests that share a rendered rig.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/pipeline/cli.h"

namespace heba {

// A fixture `Derived` derives from it, and has the static functions Name(), the name of the folder, and Scene(), the
// scene to render.
template <class Derived>
class RenderedCellTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new std::filesystem::path(TestFolder(Derived::Name()));
    WriteAll(*folder_ / "scene.yaml", Derived::Scene());
    std::filesystem::create_directory(*folder_ / "cache");
    const CommandResult made =
        RunHeba({"simulate", (*folder_ / "scene.yaml").string(), "--out", Cell().string(), "--quiet"});
    ASSERT_EQ(made.status, 0) << made.err;
  }
  static void TearDownTestSuite() {
    std::filesystem::remove_all(*folder_);
    delete folder_;
  }

  static std::filesystem::path Cell() { return *folder_ / "rig"; }

  // The tests share the detections.
  static std::string Cache() { return "HEBA_CACHE=" + ShellQuoted((*folder_ / "cache").string()); }

  // Runs a command with these settings (--set).
  static CommandResult WithSettings(std::vector<std::string> arguments, const std::vector<std::string>& settings) {
    for (const std::string& setting : settings) {
      arguments.emplace_back("--set");
      arguments.push_back(setting);
    }
    return RunHeba(arguments, Cache());
  }

  inline static std::filesystem::path* folder_ = nullptr;
};

}  // namespace heba
