// SPDX-License-Identifier: Apache-2.0
#include "client/rung_relay.h"

#include <utility>

#include "base/log.h"
#include "base/time.h"

namespace relievo {

void RungRelay::add(const std::string& stream) {
  const std::lock_guard lock(mutex_);
  live_.insert(stream);
}

void RungRelay::remove(const std::string& stream) {
  const std::lock_guard lock(mutex_);
  live_.erase(stream);
}

void RungRelay::update() {
  std::set<std::string> live;
  {
    const std::lock_guard lock(mutex_);
    live = live_;
  }
  std::erase_if(streams_, [&](const auto& entry) { return !live.contains(entry.first); });
  for (const std::string& name : live) update(name, streams_[name]);
}

void RungRelay::update(const std::string& name, Stream& stream) {
  for (const Rung rung : kRungs)  // full comes anyway, and nobody wishes for slow
    if (rung != Rung::kFull) relay(name, stream, rung);
  const std::int64_t now_ns = steady_now_ns();
  if (stream.asked_ns == 0) {
    auto made = ClockProbe::create(domain_, name);
    if (made)
      stream.clock = *std::move(made);
    else
      log_warning("the clock of " + name + "'s server cannot be compared: " + made.error().message);
  }
  const auto clock = stream.clock ? stream.clock->offset() : std::nullopt;
  if (clock) gateway_.set_clock(name, clock->offset_ns);
  if (clock && now_ns - stream.asked_ns < kNanosecondsPerSecond) return;
  stream.asked_ns = now_ns;
  if (stream.clock) stream.clock->ask();  // at each call until the first answer: no latency is known before
}

void RungRelay::relay(const std::string& name, Stream& stream, Rung rung) {
  const bool wanted = gateway_.watchers(name, rung) > 0;
  const auto found = stream.rungs.find(rung);
  if (wanted == (found != stream.rungs.end())) return;
  if (!wanted) {
    stream.rungs.erase(found);
    return;
  }
  Subscriber::Callbacks callbacks;
  callbacks.frame = [this](const std::string& from, const FrameMessage& frame) {
    gateway_.publish(from, frame);
  };
  auto made = Subscriber::create(domain_, name, std::move(callbacks), rung);
  if (!made)
    return log_warning(name + " in quality " + std::string(to_string(rung)) + ": " + made.error().message);
  stream.rungs[rung] = *std::move(made);
}

}  // namespace relievo
