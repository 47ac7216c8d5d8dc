#include <gtest/gtest.h>

#include <future>
#include <thread>

namespace {

TEST(NoThreads, AThreadEndsAProgramThatDoesNotDeclareThem) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_DEATH(std::thread([] {}).join(), "declare its program THREADS");
  EXPECT_DEATH(std::jthread([] {}).join(), "declare its program THREADS");
  EXPECT_DEATH(std::async(std::launch::async, [] {}).wait(), "declare its program THREADS");
}

}  // namespace
