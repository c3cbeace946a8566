// SPDX-License-Identifier: Apache-2.0
#include "idl/recording_segments.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <optional>
#include <system_error>

#include "base/whole_file.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;

/// Of STEM_000123.EXTENSION.
std::optional<std::uint64_t> number_of(const fs::path& file, const fs::path& whole) {
  const std::string name = file.stem().string();
  const std::string head = whole.stem().string() + "_";
  if (file.extension() != whole.extension() || !name.starts_with(head)) return std::nullopt;
  const char* const from = name.data() + head.size();
  const char* const to = name.data() + name.size();
  std::uint64_t number = 0;
  const auto [end, failed] = std::from_chars(from, to, number);
  // Only names that we would give: face_2.mcap is somebody's own file.
  if (failed != std::errc() || end != to || to - from < 6) return std::nullopt;
  return number;
}

Error not_removed(const fs::path& file, const std::error_code& why) {
  return {"cannot remove the old recording " + file.string() + ": " + why.message()};
}

}  // namespace

std::vector<fs::path> RecordingSegments::there() const {
  std::vector<std::pair<std::uint64_t, fs::path>> found;
  std::error_code ignored;
  const fs::path folder = file_.has_parent_path() ? file_.parent_path() : fs::path(".");
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, ignored)) {
    if (const auto number = number_of(entry.path(), file_)) found.emplace_back(*number, entry.path());
  }
  std::ranges::sort(found);
  std::vector<fs::path> out;
  for (auto& [number, path] : found) out.push_back(std::move(path));
  return out;
}

std::vector<fs::path> RecordingSegments::there_but(const fs::path& open) const {
  std::vector<fs::path> files = there();
  std::erase_if(files, [&](const fs::path& f) { return f.filename() == open.filename(); });
  return files;
}

fs::path RecordingSegments::at(std::uint64_t number) const {
  char digits[32];
  std::snprintf(digits, sizeof digits, "_%06llu", static_cast<unsigned long long>(number));
  return file_.parent_path() / (file_.stem().string() + digits + file_.extension().string());
}

fs::path RecordingSegments::next() const {
  const std::vector<fs::path> before = there();
  return at(before.empty() ? 0 : *number_of(before.back(), file_) + 1);
}

bool RecordingSegments::is_full(std::uint64_t bytes, double duration_s) const {
  return (options_.split_bytes > 0 && bytes >= options_.split_bytes) ||
         (options_.split_s > 0 && duration_s >= options_.split_s);
}

bool RecordingSegments::is_all_kept(std::uint64_t bytes, double duration_s) const {
  return (options_.keep_bytes > 0 && bytes >= options_.keep_bytes) ||
         (options_.keep_s > 0 && duration_s >= options_.keep_s);
}

Status RecordingSegments::remove_old(const fs::path& open) const {
  if (!options_.keep()) return {};
  const std::vector<fs::path> files = there_but(open);
  std::error_code error, failed;
  std::uint64_t bytes = 0;
  const auto size_of = [&](const fs::path& file) {
    const std::uintmax_t size = fs::file_size(file, error);
    return error ? 0 : static_cast<std::uint64_t>(size);
  };
  for (const fs::path& file : files) bytes += size_of(file);
  bytes += size_of(open);
  fs::path kept;
  for (const fs::path& file : files) {
    const auto written = fs::last_write_time(file, error);
    const double age_s =
        error ? 0 : std::chrono::duration<double>(fs::file_time_type::clock::now() - written).count();
    const bool old = options_.keep_s > 0 && age_s > options_.keep_s;
    const bool much = options_.keep_bytes > 0 && bytes > options_.keep_bytes;
    if (!old && !much) break;
    const std::uint64_t size = size_of(file);
    if (fs::remove(file, error)) {
      bytes -= size;
    } else if (error) {
      failed = error;
      kept = file;
    }
  }
  return failed ? Status(not_removed(kept, failed)) : Status();
}

Result<fs::path> RecordingSegments::remove_oldest(const fs::path& open) const {
  std::optional<Error> failed;
  for (const fs::path& file : there_but(open)) {
    std::error_code error;
    if (fs::remove(file, error)) return file;
    if (error && !failed) failed = not_removed(file, error);
  }
  return failed ? Result<fs::path>(*failed) : fs::path();
}

fs::path unused_name(const fs::path& file) {
  fs::path out = file;
  std::error_code ignored;
  for (int n = 2; fs::exists(out, ignored); ++n)
    out = file.parent_path() / (file.stem().string() + "-" + std::to_string(n) + file.extension().string());
  return out;
}

Status check_record_folder(const fs::path& folder) {
  if (::faccessat(AT_FDCWD, folder.c_str(), W_OK | X_OK, AT_EACCESS) == 0) return {};
  return Error{"cannot record in the folder " + folder.string() + ": " + write_failure(errno) +
               (errno == EACCES ? "; let this user write there, or name another one" : "")};
}

Status check_recording_target(const fs::path& file, bool split) {
  std::error_code error;
  const auto leads = split ? Result<fs::path>(file) : where_to_write(file);
  if (!leads) return leads.error();
  if (!split && fs::exists(*leads, error))
    return Error{"cannot record to " + file.string() + ": it exists already; give another name or remove it"};
  const fs::path folder = leads->has_parent_path() ? leads->parent_path() : fs::path(".");
  if (!fs::is_directory(folder, error))
    return Error{"cannot record to " + file.string() + ": there is no folder " + folder.string()};
  return check_record_folder(folder);
}

}  // namespace relievo
