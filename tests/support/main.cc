#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/memory.h"

int main(int argc, char** argv) {
  heba::KeepFreedMemory();
  testing::InitGoogleMock(&argc, argv);
  return RUN_ALL_TESTS();
}
