// SPDX-License-Identifier: Apache-2.0
#include "client/time_range.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <ctime>
#include <limits>
#include <optional>
#include <string_view>

#include "base/counted.h"
#include "base/time.h"
#include "client/options.h"

namespace relievo {
namespace {

/// Positions in the recording, from 0, both ends included.
struct FrameRange {
  std::uint64_t first = 0;
  std::uint64_t last = std::numeric_limits<std::uint64_t>::max();
};

bool parse_number(std::string_view text, std::uint64_t& number) {
  if (text.empty()) return true;  // an open end
  const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), number);
  return failed == std::errc() && end == text.data() + text.size();
}

std::optional<FrameRange> parse_frames(const std::string& text) {
  FrameRange range;
  const std::size_t colon = text.find(':');
  if (colon == std::string::npos) {
    if (text.empty() || !parse_number(text, range.first)) return std::nullopt;
    range.last = range.first;
    return range;
  }
  const bool read = parse_number(std::string_view(text).substr(0, colon), range.first) &&
                    parse_number(std::string_view(text).substr(colon + 1), range.last);
  return read && range.first <= range.last ? std::optional(range) : std::nullopt;
}

/// A decimal number of seconds, to the nanosecond, below 10^9.
std::optional<std::int64_t> parse_seconds_ns(std::string_view text) {
  const std::string_view whole = text.substr(0, text.find('.'));
  const std::string_view part = whole.size() == text.size() ? "" : text.substr(whole.size() + 1);
  const auto digits = [](std::string_view s) {
    return std::ranges::all_of(s, [](char c) { return c >= '0' && c <= '9'; });
  };
  if (whole.empty() || whole.size() > 9 || part.size() > 9 || !digits(whole) || !digits(part))
    return std::nullopt;
  std::int64_t ns = 0;
  for (const char c : whole) ns = 10 * ns + (c - '0');
  for (std::size_t i = 0; i < 9; ++i) ns = 10 * ns + (i < part.size() ? part[i] - '0' : 0);
  return ns;
}

/// "2026-01-02T03:04:05.5Z"; the Z may be missing.
std::optional<std::int64_t> parse_utc_ns(std::string text) {
  if (text.ends_with('Z')) text.pop_back();
  std::tm parts{};
  const char* const end = ::strptime(text.c_str(), "%Y-%m-%dT%H:%M:", &parts);
  if (end == nullptr) return std::nullopt;
  const auto second_ns = parse_seconds_ns(end);
  const int day = parts.tm_mday;
  const std::time_t minute_s = ::timegm(&parts);
  const bool is_date = parts.tm_mday == day;  // else moved into the next month: February 31
  constexpr std::int64_t kLast_s = std::numeric_limits<std::int64_t>::max() / kNanosecondsPerSecond - 61;
  if (!second_ns || *second_ns >= 61 * kNanosecondsPerSecond || !is_date || minute_s < 0 ||
      minute_s > kLast_s)
    return std::nullopt;
  return std::int64_t{minute_s} * kNanosecondsPerSecond + *second_ns;
}

std::string check_time(const std::string& text) {
  const auto time = parse_recorded_time_ns(text, 0);
  return time ? std::string() : time.error().message;
}

std::string check_frames(const std::string& text) {
  return parse_frames(text) ? std::string() : "'" + text + "' is no range such as 10:19";
}

Error no_frame(const RecordedStream& recorded) {
  if (recorded.frames() == 0) return {"the recording holds no frame"};
  const RecordingSummary& summary = recorded.summary();
  return {"the recording has no frame in that range: it holds " + counted(recorded.frames(), "frame") +
          " in " + duration_text(seconds(summary.end_ns - summary.start_ns)) + ", from " +
          utc_text(summary.start_ns) + " on"};
}

}  // namespace

Result<std::int64_t> parse_recorded_time_ns(const std::string& text, std::int64_t start_ns) {
  if (const auto after_ns = parse_seconds_ns(text)) return start_ns + *after_ns;
  if (const auto utc_ns = parse_utc_ns(text)) return *utc_ns;
  return Error{"'" + text + "' is no time such as 12.5 (seconds after the start) or 2026-01-02T03:04:05Z"};
}

std::shared_ptr<RangeOptions> add_range_options(CLI::App& app) {
  auto options = std::make_shared<RangeOptions>();
  app.add_option("--from", options->from,
                 "Seconds after the recording's start, or UTC as 2026-01-02T03:04:05.5Z")
      ->type_name("TIME")
      ->check(check_time);
  app.add_option("--to", options->to, "The same; included")->type_name("TIME")->check(check_time);
  app.add_option("--frames", options->frames,
                 "Positions in the recording from 0, both included; A:, :B and A work too")
      ->type_name("A:B")
      ->check(check_frames);
  return options;
}

Result<TimeRange> find_range(const RangeOptions& options, RecordedStream& recorded) {
  const std::int64_t start_ns = recorded.summary().start_ns;
  TimeRange range{.from_ns = start_ns, .to_ns = std::numeric_limits<std::int64_t>::max()};
  if (!options.from.empty()) {
    const auto from_ns = parse_recorded_time_ns(options.from, start_ns);
    if (!from_ns) return from_ns.error();
    range.from_ns = *from_ns;
  }
  if (!options.to.empty()) {
    const auto to_ns = parse_recorded_time_ns(options.to, start_ns);
    if (!to_ns) return to_ns.error();
    range.to_ns = *to_ns;
  }
  const auto times = recorded.frame_times();
  if (!times) return times.error();
  if (const auto frames = options.frames.empty() ? std::nullopt : parse_frames(options.frames)) {
    if (frames->first >= times->size()) return no_frame(recorded);
    range.from_ns = std::max(range.from_ns, (*times)[frames->first]);
    if (frames->last < times->size()) range.to_ns = std::min(range.to_ns, (*times)[frames->last]);
  }
  range.frames = static_cast<std::uint64_t>(
      std::ranges::count_if(*times, [&](std::int64_t time_ns) { return range.contains(time_ns); }));
  if (range.frames == 0) return no_frame(recorded);
  return range;
}

}  // namespace relievo
