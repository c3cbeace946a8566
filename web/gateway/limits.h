// SPDX-License-Identifier: Apache-2.0
// How much one address may have: connections at a time and requests a second. One thread; the clock is given.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <unordered_map>

namespace relievo {

/// So many a second over a long time, `burst` of them at once.
struct Rate {
  double per_s = 0;
  double burst = 0;
};

class Bucket {
 public:
  Bucket(Rate rate, std::int64_t now_ns) : rate_(rate), level_(rate.burst), then_ns_(now_ns) {}
  /// One more; false where that is too many.
  bool take(std::int64_t now_ns);
  bool full(std::int64_t now_ns) const { return level_at(now_ns) >= rate_.burst; }

 private:
  double level_at(std::int64_t now_ns) const;

  Rate rate_;
  double level_;
  std::int64_t then_ns_;
};

class AddressLimits {
 public:
  AddressLimits(int connections, Rate requests) : connections_(connections), requests_(requests) {}

  /// A connection of `address` begins; false, and it does not count, where there are too many.
  bool connect(const std::string& address, std::int64_t now_ns);
  void disconnect(const std::string& address);
  bool request(const std::string& address, std::int64_t now_ns);

  /// Of all addresses, from now on; connections that there are stay.
  void change(int connections, Rate requests, std::int64_t now_ns);

  std::size_t size() const { return entries_.size(); }  // addresses remembered

 private:
  struct Entry {
    int connections = 0;
    Bucket requests;
  };
  Entry& entry(const std::string& address, std::int64_t now_ns);

  int connections_;
  Rate requests_;
  std::unordered_map<std::string, Entry> entries_;
};

}  // namespace relievo
