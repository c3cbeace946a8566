// SPDX-License-Identifier: Apache-2.0
#include "base/whole_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <system_error>
#include <vector>

namespace relievo {

std::string write_failure(int error) {
  if (error == ENOSPC || error == EDQUOT) return "no space left: make room or write elsewhere";
  if (error == EFBIG) return "the file may not grow further (a limit of the system or its file system)";
  if (error == ENOENT) return "there is no such folder";
  return std::generic_category().message(error);
}

namespace {

std::string what_it_is(mode_t mode) {
  return S_ISDIR(mode) ? "folder" : S_ISFIFO(mode) ? "pipe" : S_ISSOCK(mode) ? "socket" : "device";
}

}  // namespace

Result<std::filesystem::path> where_to_write(const std::filesystem::path& path) {
  struct stat info {};
  std::error_code failed;
  if (::stat(path.c_str(), &info) != 0) {  // a new file, or an error that writing it says
    if (errno != ENOENT) return path;
    const auto target = std::filesystem::read_symlink(path, failed);
    return failed ? path : where_to_write(path.parent_path() / target);
  }
  if (!S_ISREG(info.st_mode))
    return Error{"cannot write " + path.string() + ": it is a " + what_it_is(info.st_mode) + ", not a file"};
  auto target = std::filesystem::canonical(path, failed);
  if (failed) return Error{"cannot write " + path.string() + ": " + failed.message()};
  return target;
}

std::filesystem::path unfinished_name(const std::filesystem::path& path) {
  return path.string() + ".part" + std::to_string(::getpid());
}

Error told_of(const std::filesystem::path& path, Error error, const std::filesystem::path& unfinished) {
  const std::string name = unfinished.string();
  if (const auto at = error.message.find(name); at != std::string::npos)
    error.message.replace(at, name.size(), path.string());
  return error;
}

Status write_whole_file(const std::filesystem::path& named, std::span<const std::uint8_t> bytes) {
  const auto leads = where_to_write(named);
  if (!leads) return leads.error();
  const std::filesystem::path& path = *leads;
  const auto failed = [&](int error) {
    return Error{"cannot write " + path.string() + ": " + write_failure(error)};
  };
  const std::filesystem::path temporary = unfinished_name(path);
  const int file = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (file < 0) return failed(errno);
  int error = 0;
  while (!bytes.empty() && error == 0) {
    const ssize_t written = ::write(file, bytes.data(), bytes.size());
    if (written >= 0)
      bytes = bytes.subspan(static_cast<std::size_t>(written));
    else if (errno != EINTR)
      error = errno;
  }
  if (::close(file) != 0 && error == 0) error = errno;
  if (error == 0 && std::rename(temporary.c_str(), path.c_str()) != 0) error = errno;
  if (error == 0) return {};
  ::unlink(temporary.c_str());
  return failed(error);
}

Status write_whole_file(const std::filesystem::path& path, std::string_view text) {
  return write_whole_file(path, std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
}

namespace {

Error cannot_read(const std::filesystem::path& path, const std::string& why) {
  return {"cannot read " + path.string() + ": " + why};
}

Error cannot_read(const std::filesystem::path& path, int error) {
  if (error == ENOENT) return {path.string() + " is missing"};
  return cannot_read(path, std::generic_category().message(error));
}

}  // namespace

Result<int> open_file_to_read(const std::filesystem::path& path) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
  if (file < 0) return cannot_read(path, errno);
  struct stat info {};
  if (::fstat(file, &info) == 0 && S_ISREG(info.st_mode)) return file;
  ::close(file);
  return cannot_read(path, "it is a " + what_it_is(info.st_mode) + ", not a file");
}

Result<std::string> read_whole_file(const std::filesystem::path& path, std::size_t most) {
  const auto file = open_file_to_read(path);
  if (!file) return file.error();
  int error = 0;
  std::string all;
  std::vector<char> part(64 * 1024);
  for (ssize_t got = 1; error == 0 && got != 0 && all.size() <= most;) {
    got = ::read(*file, part.data(), part.size());
    if (got > 0)
      all.append(part.data(), static_cast<std::size_t>(got));
    else if (got < 0 && errno != EINTR)
      error = errno;
  }
  ::close(*file);
  if (error != 0) return cannot_read(path, error);
  if (all.size() > most)
    return Error{path.string() + " has more than the " + std::to_string(most) + " bytes it may have"};
  return all;
}

Result<std::string> read_whole_text(const std::filesystem::path& path, std::size_t most) {
  constexpr std::string_view kMark = "\xEF\xBB\xBF";
  auto text = read_whole_file(path, most);
  if (text && text->starts_with(kMark)) text->erase(0, kMark.size());
  return text;
}

}  // namespace relievo
