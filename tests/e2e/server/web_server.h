// SPDX-License-Identifier: Apache-2.0
// relievo-server with its gateway, as users run it.
#pragma once

#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/e2e/server/server_process.h"
#include "tests/support/socket_client.h"

namespace relievo::test {

/// `serve` with a gateway on a free port; killed with this object where it still runs.
class WebServer {
 public:
  using Json = nlohmann::json;

  explicit WebServer(const std::vector<std::string>& command,
                     const std::vector<std::string>& environment = {})
      : process_(command, environment) {
    port_ = viewer_port(process_);
  }
  Process& process() { return process_; }
  std::uint16_t port() const { return port_; }  // 0: it did not come so far

  /// What /api/streams says of a stream; null where it is not live.
  Json stream(const std::string& name) const {
    const Json all = Json::parse(request(port_, "GET", "/api/streams").body, nullptr, false);
    if (!all.is_object()) return nullptr;
    for (const Json& one : all["streams"])
      if (one["name"] == name) return one;
    return nullptr;
  }
  std::uint64_t frames(const std::string& name) const {
    const Json one = stream(name);
    return one.is_object() ? one["frames"].get<std::uint64_t>() : 0;
  }
  /// Waits until so many more have come.
  bool goes_on(const std::string& name, std::uint64_t more) const {
    const std::uint64_t until = frames(name) + more;
    return eventually([&] { return frames(name) >= until; });
  }
  Json recording(const std::string& name) const {
    return Json::parse(request(port_, "GET", "/api/recording/" + name).body, nullptr, false);
  }
  Response order(const std::string& name, const std::string& action) const {
    return post_json(port_, "/api/recording/" + name, R"({"action":")" + action + R"("})");
  }

 private:
  Process process_;
  std::uint16_t port_ = 0;
};

}  // namespace relievo::test
