// SPDX-License-Identifier: Apache-2.0
#include "idl/dds_log.h"

#include <dds/ddsrt/log.h>

#include <algorithm>
#include <atomic>
#include <mutex>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "base/log.h"

namespace relievo {
namespace {

constexpr std::size_t kMaxKinds = 64;  // of messages; each comes from one place in Cyclone's source

std::atomic<std::uint64_t> g_refused{0};

/// The message alone, without its time and its end of line.
std::string_view text_of(const dds_log_data_t& data) {
  std::string_view text = data.message;
  while (!text.empty() && text.back() == '\n') text.remove_suffix(1);
  return text;
}

/// Of a handshake: who could not be identified, is not known to the authority, or (where this side began, and
/// the other one does not take its word) fell silent.
bool is_refusal(std::string_view text) {
  constexpr std::string_view kSteps[] = {"Validate remote identity failed", "Begin handshake request failed",
                                         "Begin handshake reply failed",    "Process handshake failed",
                                         "permissions from plugin",         ") failed: ("};
  return std::ranges::any_of(
      kSteps, [&](std::string_view step) { return text.find(step) != std::string_view::npos; });
}

/// Whether a message from there was seen before.
bool is_new(const dds_log_data_t& data) {
  static std::mutex mutex;
  static std::set<std::pair<std::string, std::uint32_t>> seen;
  const std::lock_guard lock(mutex);
  return seen.size() < kMaxKinds && seen.emplace(data.file, data.line).second;
}

void on_message(void*, const dds_log_data_t* data) {
  const std::string_view text = text_of(*data);
  if (is_refusal(text)) ++g_refused;
  const std::string line = "DDS: " + std::string(text);
  if ((data->priority & DDS_LC_INFO) != 0) return log_debug(line);
  if (!is_new(*data)) return log_debug(line);
  log_warning(line + " (further ones like it are logged with -v only)");
}

}  // namespace

void take_over_dds_log() {
  static std::once_flag once;
  std::call_once(once, [] { dds_set_log_sink(on_message, nullptr); });
}

std::uint64_t refused_handshakes() {
  return g_refused;
}

}  // namespace relievo
