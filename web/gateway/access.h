// SPDX-License-Identifier: Apache-2.0
// Who may watch: tokens, pages of which sites, and the certificate they see. One thread.
#pragma once

#include <sys/stat.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace boost::asio::ssl {
class context;
}

namespace relievo {

/// A file's content changed where this did; all 0 where there is none.
struct FileMark {
  std::int64_t time_ns = 0;
  // Another file moved in its place may have both its time and its size.
  std::uint64_t bytes = 0, inode = 0, device = 0;
  bool operator==(const FileMark&) const = default;
};
FileMark mark_of(const std::filesystem::path& file);
FileMark mark_of(const struct stat& file);
/// One that differs once the file is written to again: what is written within the tick of the change before
/// leaves the same time, so this waits it out, 20 ms at most. Of a file that is being written there may be
/// none.
FileMark settled_mark_of(const std::filesystem::path& file);
/// That wait; false where there was none.
bool let_settle(const FileMark& mark);

/// Tokens that open a gateway, from a file that may change.
class Tokens {
 public:
  /// Of `file`, a token a line, empty ones and those after # aside; fails where there is none, or a weak one.
  static Result<Tokens> load(const std::filesystem::path& file);
  /// One, made now.
  static Result<Tokens> make();
  /// Everybody may watch.
  static Tokens none() { return Tokens(); }

  bool needed() const { return !tokens_.empty(); }
  /// In a time that does not tell how much of a token is right.
  bool accepts(std::string_view token) const;
  /// Where the file has changed, for which each call looks; what is wrong with it is logged, and the old
  /// tokens stay.
  void reload();
  const std::string& first() const { return tokens_.front(); }

 private:
  Tokens() = default;

  std::filesystem::path file_;
  FileMark mark_;
  std::vector<std::string> tokens_;
};

/// A certificate and its key, from files that may change.
class TlsFiles {
 public:
  static Result<TlsFiles> load(const std::filesystem::path& cert, const std::filesystem::path& key);
  /// For a new connection; of the files as they are now, or as they last were in order. Those that already
  /// are connected keep theirs.
  std::shared_ptr<boost::asio::ssl::context> context();
  /// By the files of `newer`; a certificate that is still valid stays where theirs has expired, which is
  /// logged.
  void replace_with(TlsFiles newer);
  /// Logs, each once for a certificate, that it is not valid yet, ends soon, or has expired.
  void warn_of_dates();
  /// Until when what context() gave last is valid, Unix time.
  std::int64_t expiry_s() const { return served_.expires_s; }

 private:
  struct Served {
    std::shared_ptr<boost::asio::ssl::context> context;
    std::int64_t valid_from_s = 0, expires_s = 0;  // Unix time
  };
  enum class Dates { kGood, kNotYet, kSoon, kExpired };

  TlsFiles() = default;
  Result<Served> read() const;
  bool take(Served newer);

  std::filesystem::path cert_, key_;
  FileMark cert_mark_, key_mark_;
  Served served_;
  Dates said_ = Dates::kGood;
};

}  // namespace relievo
