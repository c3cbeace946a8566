// SPDX-License-Identifier: Apache-2.0
#include "base/bounded_queue.h"

#include <gtest/gtest.h>

#include <memory>
#include <thread>
#include <vector>

namespace relievo {
namespace {

TEST(BoundedQueue, DropsTheOldestAndCountsIt) {
  BoundedQueue<int> queue(2);
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(queue.push_drop_oldest(i));
  EXPECT_EQ(queue.drops(), 3u);
  EXPECT_EQ(queue.pop(), 3);
  EXPECT_EQ(queue.pop(), 4);
}

TEST(BoundedQueue, HandsOverWhatWasQueuedBeforeClosing) {
  BoundedQueue<std::unique_ptr<int>> queue(4);
  queue.push_wait(std::make_unique<int>(7));
  queue.close();
  EXPECT_FALSE(queue.push_wait(std::make_unique<int>(8)));
  EXPECT_FALSE(queue.push_drop_oldest(std::make_unique<int>(8)));
  const auto item = queue.pop();
  ASSERT_TRUE(item.has_value());
  EXPECT_EQ(**item, 7);
  EXPECT_FALSE(queue.pop().has_value());
}

TEST(BoundedQueue, WaitingProducerLosesNothing) {
  BoundedQueue<int> queue(3);
  constexpr int kCount = 2000;
  std::thread producer([&] {
    for (int i = 0; i < kCount; ++i) queue.push_wait(i);
    queue.close();
  });
  int expected = 0;
  while (const auto item = queue.pop()) EXPECT_EQ(*item, expected++);
  producer.join();
  EXPECT_EQ(expected, kCount);
  EXPECT_EQ(queue.drops(), 0u);
}

TEST(BoundedQueue, CloseWakesAWaitingConsumer) {
  BoundedQueue<int> queue(1);
  std::thread consumer([&] { EXPECT_FALSE(queue.pop().has_value()); });
  queue.close();
  consumer.join();
}

TEST(BoundedQueue, TheNextOneComesAlongWhereItIsWanted) {
  BoundedQueue<int> queue(3);
  const auto odd = [](int i) { return i % 2 == 1; };
  using Both = std::pair<std::optional<int>, std::optional<int>>;
  for (const int i : {1, 2, 4}) queue.push_wait(i);
  EXPECT_EQ(queue.pop_with_next_if(odd), (Both{1, 2}));
  EXPECT_EQ(queue.pop_with_next_if(odd), (Both{4, {}}));
  queue.push_wait(5);
  std::thread producer([&] {
    queue.push_wait(6);
    queue.push_wait(7);
    queue.close();
  });
  EXPECT_EQ(queue.pop_with_next_if(odd), (Both{5, 6}));   // waits for it
  EXPECT_EQ(queue.pop_with_next_if(odd), (Both{7, {}}));  // which will never come
  EXPECT_EQ(queue.pop_with_next_if(odd), Both());
  producer.join();
}

}  // namespace
}  // namespace relievo
