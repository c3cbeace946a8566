// SPDX-License-Identifier: Apache-2.0
// A bounded queue between two threads. The policy for a full queue is the caller's choice at each push; drops
// are counted where they happen.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <utility>

namespace relievo {

/// Any number of producers and consumers; every function may be called from any thread.
template <typename T>
class BoundedQueue {
 public:
  explicit BoundedQueue(std::size_t capacity) : capacity_(capacity) {}

  /// Live policy: where full, the oldest item makes room and is counted. False once closed.
  bool push_drop_oldest(T item) {
    {
      std::lock_guard lock(mutex_);
      if (closed_) return false;
      if (items_.size() >= capacity_) {
        items_.pop_front();
        ++drops_;
      }
      items_.push_back(std::move(item));
    }
    not_empty_.notify_one();
    return true;
  }

  /// Lossless policy: waits for room. False once closed.
  bool push_wait(T item) {
    {
      std::unique_lock lock(mutex_);
      not_full_.wait(lock, [&] { return closed_ || items_.size() < capacity_; });
      if (closed_) return false;
      items_.push_back(std::move(item));
    }
    not_empty_.notify_one();
    return true;
  }

  /// Waits for an item; nothing once the queue is closed and empty.
  std::optional<T> pop() {
    std::unique_lock lock(mutex_);
    not_empty_.wait(lock, [&] { return closed_ || !items_.empty(); });
    return take_front(lock);
  }

  /// As pop(); where wanted(item) is true the one behind it as well, waited for like the first. Nothing is
  /// dropped between the two. Of a capacity of two or more.
  template <typename Wanted>
  std::pair<std::optional<T>, std::optional<T>> pop_with_next_if(const Wanted& wanted) {
    std::unique_lock lock(mutex_);
    not_empty_.wait(lock, [&] { return closed_ || !items_.empty(); });
    std::pair<std::optional<T>, std::optional<T>> out;
    if (items_.empty()) return out;
    const bool both = wanted(std::as_const(items_.front()));
    if (both) not_empty_.wait(lock, [&] { return closed_ || items_.size() > 1; });
    out.first = take_front();
    if (both && !items_.empty()) out.second = take_front();
    lock.unlock();
    not_full_.notify_all();
    return out;
  }

  /// As pop(), but gives up after `timeout`; finished() tells the two kinds of nothing apart.
  std::optional<T> pop_for(std::chrono::nanoseconds timeout) {
    std::unique_lock lock(mutex_);
    not_empty_.wait_for(lock, timeout, [&] { return closed_ || !items_.empty(); });
    return take_front(lock);
  }

  /// Closed and empty: nothing will come any more.
  bool finished() const {
    std::lock_guard lock(mutex_);
    return closed_ && items_.empty();
  }

  /// Wakes everybody; items already queued can still be popped.
  void close() {
    {
      std::lock_guard lock(mutex_);
      closed_ = true;
    }
    not_empty_.notify_all();
    not_full_.notify_all();
  }

  std::uint64_t drops() const {
    std::lock_guard lock(mutex_);
    return drops_;
  }
  std::size_t size() const {
    std::lock_guard lock(mutex_);
    return items_.size();
  }

 private:
  std::optional<T> take_front(std::unique_lock<std::mutex>& lock) {
    if (items_.empty()) return std::nullopt;
    std::optional<T> item = take_front();
    lock.unlock();
    not_full_.notify_one();
    return item;
  }
  std::optional<T> take_front() {
    std::optional<T> item(std::move(items_.front()));
    items_.pop_front();
    return item;
  }

  const std::size_t capacity_;
  mutable std::mutex mutex_;
  std::condition_variable not_empty_;
  std::condition_variable not_full_;
  std::deque<T> items_;
  std::uint64_t drops_ = 0;
  bool closed_ = false;
};

}  // namespace relievo
