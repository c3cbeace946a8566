// SPDX-License-Identifier: Apache-2.0
// Files that appear whole or not at all, and errors of files in words.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "base/result.h"

namespace relievo {

/// The file that a rename is to replace, where `path` is a link what it leads to, also where that is new.
/// Fails on what is there and no file: a pipe, a device, a folder.
Result<std::filesystem::path> where_to_write(const std::filesystem::path& path);

/// Where to write what is to be `path` once it is whole: beside it, under a name of this process.
std::filesystem::path unfinished_name(const std::filesystem::path& path);

/// What failed under the name `unfinished`, told of `path`, the one that somebody gave.
Error told_of(const std::filesystem::path& path, Error error, const std::filesystem::path& unfinished);

/// Writes under a temporary name beside `path`, then renames: replaces a file of that name, or what a link of
/// that name leads to, leaves nothing behind on failure. Refuses to replace what is no file. The error names
/// the file.
Status write_whole_file(const std::filesystem::path& path, std::span<const std::uint8_t> bytes);
Status write_whole_file(const std::filesystem::path& path, std::string_view text);

/// A descriptor of a file opened for reading, which the caller closes. A pipe, device or folder is refused at
/// once: opening or reading one may take for ever. The error names the file.
Result<int> open_file_to_read(const std::filesystem::path& path);

/// All of a file, nothing of what is larger than `most` bytes. Errors as of open_file_to_read().
Result<std::string> read_whole_file(const std::filesystem::path& path, std::size_t most);

/// The same of a text, without the mark that editors of Windows put before UTF-8.
Result<std::string> read_whole_text(const std::filesystem::path& path, std::size_t most);

/// Why a file could not be written, from errno, with what to do about it where that is known.
std::string write_failure(int error);

}  // namespace relievo
