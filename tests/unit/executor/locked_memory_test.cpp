// Which memory is locked, as the kernel's own table of this process says.
#include "core/executor/locked_memory.hpp"

#include <gmock/gmock.h>
#include <pthread.h>
#include <sys/mman.h>
#include <unistd.h>

#include <malloc.h>
#include <cstdint>
#include <fstream>
#include <future>
#include <memory>
#include <sstream>
#include <string>
#include <thread>

namespace invar {
namespace {

/// Whether the page of an address is locked: the flag `lo` of its mapping.
bool is_locked(const void* address) {
  const auto wanted = reinterpret_cast<std::uintptr_t>(address);
  std::ifstream smaps{"/proc/self/smaps"};
  bool here = false;
  for (std::string line; std::getline(smaps, line);) {
    std::uintptr_t begin = 0, end = 0;
    char dash = 0;
    std::istringstream words{line};
    if (words >> std::hex >> begin >> dash >> end && dash == '-') here = begin <= wanted && wanted < end;
    if (here && line.starts_with("VmFlags:")) return line.find(" lo") != std::string::npos;
  }
  ADD_FAILURE() << "no mapping of " << address;
  return false;
}

struct LockedMemory : ::testing::Test {
  void SetUp() override {
    const int error = lock_memory();
    if (error == EPERM || error == ENOMEM) GTEST_SKIP() << "this user may not lock memory";
    ASSERT_EQ(error, 0);
  }
  void TearDown() override { munlockall(); }
};

TEST_F(LockedMemory, HoldsProgramHeapAndTheCallersStack) {
  EXPECT_TRUE(is_locked(reinterpret_cast<const void*>(&lock_memory)));
  EXPECT_TRUE(is_locked(std::make_unique<double>(1.0).get()));
  std::thread{[] {
    const int here = 0;
    ASSERT_EQ(lock_memory(), 0);
    EXPECT_TRUE(is_locked(&here));
  }}.join();
}

TEST_F(LockedMemory, LeavesOutOtherStacksAndSharedMemory) {
  void* shared = mmap(nullptr, 1U << 20U, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  ASSERT_NE(shared, MAP_FAILED);
  std::promise<const void*> stack;
  std::promise<void> end;
  std::thread other{[&] {
    const int here = 0;
    stack.set_value(&here);
    end.get_future().wait();
  }};
  const void* const there = stack.get_future().get();
  ASSERT_EQ(lock_memory(), 0);
  EXPECT_FALSE(is_locked(there));
  EXPECT_FALSE(is_locked(shared));
  end.set_value();
  other.join();
  munmap(shared, 1U << 20U);
}

TEST_F(LockedMemory, TheKeeperLocksATableThatCameLater) {
  config::RealtimeRequest request;
  request.lock_memory = true;
  const std::string table(4U << 20U, 'x');  // a mapping of its own
  EXPECT_FALSE(is_locked(table.data()));
  EXPECT_EQ(MemoryKeeper{request}.look(), "");
  EXPECT_TRUE(is_locked(table.data()));
}

TEST(SmallMemory, GivesThreadsHalfAMegabyteAndGoesBackToTheSystem) {
  keep_memory_small();
  std::size_t size = 0;
  std::thread{[&] {
    pthread_attr_t attributes;
    pthread_getattr_np(pthread_self(), &attributes);
    void* begin = nullptr;
    pthread_attr_getstack(&attributes, &begin, &size);
    pthread_attr_destroy(&attributes);
  }}.join();
  EXPECT_LE(size, 512U * 1024U);
  EXPECT_GE(size, 448U * 1024U);
  const auto resident = [] {
    std::size_t all = 0, pages = 0;
    std::ifstream{"/proc/self/statm"} >> all >> pages;
    return pages * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  };
  const std::size_t before = resident();
  // Loads of a table beside what stays: each leaves nothing behind.
  std::vector<std::unique_ptr<int>> stays;
  for (int load = 0; load < 100; ++load) {
    const std::string table((1U << 20U) + 4096U * static_cast<unsigned>(load), 'x');
    stays.push_back(std::make_unique<int>(load));
  }
  EXPECT_LT(resident(), before + (2U << 20U));
}

}  // namespace
}  // namespace invar
