// SPDX-License-Identifier: Apache-2.0
#include "capture/source/sim/render_ahead.h"

#include <sys/resource.h>

#include <algorithm>
#include <utility>

#include "base/time.h"

namespace relievo::sim {
namespace {

constexpr double kLongestHold_s = 2.0;  // a slow start would be worse than a first pass that stutters

}  // namespace

RenderAhead::RenderAhead(std::shared_ptr<const Renderer> renderer, const Options& options)
    : renderer_(std::move(renderer)), options_(options), started_ns_(steady_now_ns()) {
  started_ = options_.paced_rate <= 0;
  for (int i = 0; i < options_.threads; ++i) threads_.emplace_back([this] { work(); });
}

RenderAhead::~RenderAhead() {
  stop();
  for (std::thread& thread : threads_) thread.join();
}

void RenderAhead::stop() {
  {
    std::lock_guard lock(mutex_);
    stopped_ = true;
  }
  changed_.notify_all();
}

bool RenderAhead::may_start() const {
  const double spent_s = seconds(steady_now_ns() - started_ns_);
  if (done_ == options_.count || spent_s > kLongestHold_s) return true;
  if (done_ < 4) return false;
  // Half the rate seen so far: from now on the rest of the program wants the processors as well.
  const double rate = 0.5 * static_cast<double>(done_) / spent_s;
  const double left_s = static_cast<double>(options_.count - done_) / rate;
  return left_s < static_cast<double>(options_.count) / options_.paced_rate;
}

std::shared_ptr<const RenderedFrame> RenderAhead::get(std::uint64_t index) {
  std::unique_lock lock(mutex_);
  if (!options_.keep) {
    while (first_ < index) {
      if (!frames_.empty()) frames_.pop_front();
      ++first_;
    }
    changed_.notify_all();
  }
  const auto ready = [&] {
    const std::uint64_t slot = index - first_;
    return started_ && slot < frames_.size() && frames_[slot];
  };
  changed_.wait(lock, [&] { return stopped_ || ready(); });
  return stopped_ ? nullptr : frames_[index - first_];
}

void RenderAhead::work() {
  bool polite = options_.paced_rate <= 0;
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [&] {
      return stopped_ || claimed_ >= options_.count || options_.keep || claimed_ < first_ + options_.ahead;
    });
    if (stopped_ || claimed_ >= options_.count) return;
    claimed_ = std::max(claimed_, first_);
    const std::uint64_t index = claimed_++;
    if (started_ && !polite) {
      // From now on the program that plays the frames goes first; niceness is a thread's own on Linux.
      setpriority(PRIO_PROCESS, 0, 3);
      polite = true;
    }
    lock.unlock();
    auto rendered = renderer_->render(index, options_.truth, stopped_);
    if (!rendered) return;
    auto frame = std::make_shared<const RenderedFrame>(*std::move(rendered));
    lock.lock();
    ++done_;
    if (!started_) started_ = may_start();
    if (index >= first_) {
      const std::uint64_t slot = index - first_;
      if (frames_.size() <= slot) frames_.resize(slot + 1);
      frames_[slot] = std::move(frame);
    }
    changed_.notify_all();
  }
}

}  // namespace relievo::sim
