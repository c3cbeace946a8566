// SPDX-License-Identifier: Apache-2.0
#include <sys/random.h>
#include <utility>  // before Asio 1.74 in C++20

#include "web/gateway/access.h"

#include <algorithm>
#include <array>
#include <boost/asio/ssl/context.hpp>
#include <chrono>
#include <ctime>
#include <limits>
#include <sstream>
#include <thread>

#include "base/log.h"
#include "base/secret_file.h"
#include "base/time.h"
#include "base/whole_file.h"

namespace relievo {
namespace {

namespace ssl = boost::asio::ssl;
using ErrorCode = boost::system::error_code;

constexpr std::size_t kLeastToken = 16, kMostToken = 256;
constexpr std::size_t kLargestTokenFile = 1 << 20, kLargestPem = 1 << 20;
constexpr std::size_t kMadeToken = 24;            // bytes of chance
constexpr std::int64_t kSoon_s = 14 * 24 * 3600;  // before the end of a certificate
constexpr const char* kHowToMake = "make one with: openssl rand -hex 24 > FILE";

// What needs no quoting in an address, a cookie or a header.
bool is_token_character(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_' ||
         c == '.' || c == '~';
}

std::string trimmed(const std::string& line) {
  const auto first = line.find_first_not_of(" \t\r");
  return first == std::string::npos ? "" : line.substr(first, line.find_last_not_of(" \t\r") + 1 - first);
}

Result<std::vector<std::string>> read_tokens(const std::filesystem::path& file) {
  const auto text = read_whole_file(file, kLargestTokenFile);
  if (!text) return Error{text.error().message + "; " + kHowToMake};
  std::istringstream in(*text);
  std::vector<std::string> tokens;
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    const std::string token = trimmed(line);
    if (token.empty() || token.front() == '#') continue;
    const std::string where = file.string() + ":" + std::to_string(number) + ": ";
    if (token.size() < kLeastToken || token.size() > kMostToken)
      return Error{where + "a token has 16 to 256 characters; " + kHowToMake};
    if (!std::all_of(token.begin(), token.end(), is_token_character))
      return Error{where + "a token is made of letters, digits, '-', '_', '.' and '~'; " + kHowToMake};
    tokens.push_back(token);
  }
  if (tokens.empty()) return Error{"there is no token in " + file.string() + "; " + kHowToMake};
  return tokens;
}

std::int64_t unix_time(const ASN1_TIME* time) {
  std::tm parts{};
  return ASN1_TIME_to_tm(time, &parts) == 1 ? timegm(&parts) : 0;
}

std::string date(std::int64_t unix_s) {
  constexpr std::int64_t kLast_s = std::numeric_limits<std::int64_t>::max() / kNanosecondsPerSecond;
  return utc_text(std::clamp(unix_s, -kLast_s, kLast_s) * kNanosecondsPerSecond);
}

}  // namespace

FileMark mark_of(const std::filesystem::path& file) {
  struct stat status {};
  return stat(file.c_str(), &status) == 0 ? mark_of(status) : FileMark{};
}

FileMark mark_of(const struct stat& file) {
  return {.time_ns = file.st_mtim.tv_sec * kNanosecondsPerSecond + file.st_mtim.tv_nsec,
          .bytes = static_cast<std::uint64_t>(file.st_size),
          .inode = file.st_ino,
          .device = file.st_dev};
}

FileMark settled_mark_of(const std::filesystem::path& file) {
  const FileMark mark = mark_of(file);
  return let_settle(mark) ? mark_of(file) : mark;
}

bool let_settle(const FileMark& mark) {
  constexpr std::int64_t kTick_ns = 20'000'000;  // longer than any clock takes by which files' times go
  const std::int64_t age_ns = utc_now_ns() - mark.time_ns;
  if (age_ns < 0 || age_ns > kTick_ns) return false;
  std::this_thread::sleep_for(std::chrono::nanoseconds(kTick_ns - age_ns));
  return true;
}

Result<Tokens> Tokens::load(const std::filesystem::path& file) {
  Tokens out;
  out.file_ = file;
  out.mark_ = mark_of(file);
  auto tokens = read_tokens(file);
  if (!tokens) return tokens.error();
  out.tokens_ = *std::move(tokens);
  if (readable_by_all(file))
    log_warning("every user of this machine can read the token in " + file.string() + ": chmod 600 it");
  return out;
}

Result<Tokens> Tokens::make() {
  std::array<std::uint8_t, kMadeToken> chance{};
  if (getrandom(chance.data(), chance.size(), 0) != static_cast<ssize_t>(chance.size()))
    return Error{"the system gives no random numbers to make a token of: give --token-file FILE"};
  std::string token;
  for (const std::uint8_t byte : chance) {
    token += "0123456789abcdef"[byte >> 4];
    token += "0123456789abcdef"[byte & 15];
  }
  Tokens out;
  out.tokens_.push_back(std::move(token));
  return out;
}

bool Tokens::accepts(std::string_view token) const {
  bool any = false;
  for (const std::string& known : tokens_) {
    unsigned different = known.size() == token.size() ? 0 : 1;
    for (std::size_t i = 0; i < known.size(); ++i) {
      const char given = i < token.size() ? token[i] : '\0';
      different |= static_cast<unsigned char>(known[i] ^ given);
    }
    any = any || different == 0;
  }
  return any;
}

void Tokens::reload() {
  if (file_.empty()) return;
  const FileMark mark = mark_of(file_);
  if (mark == mark_) return;
  mark_ = mark;
  auto tokens = read_tokens(file_);
  if (!tokens) return log_warning("the old tokens stay: " + tokens.error().message);
  tokens_ = *std::move(tokens);
  log_info("the tokens of " + file_.string() + " were read again");
}

Result<TlsFiles> TlsFiles::load(const std::filesystem::path& cert, const std::filesystem::path& key) {
  TlsFiles out;
  out.cert_ = cert;
  out.key_ = key;
  out.cert_mark_ = mark_of(cert);
  out.key_mark_ = mark_of(key);
  auto served = out.read();
  if (!served) return served.error();
  out.served_ = *std::move(served);
  return out;
}

Result<TlsFiles::Served> TlsFiles::read() const {
  auto context = std::make_shared<ssl::context>(ssl::context::tls_server);
  ErrorCode error;
  context->set_options(ssl::context::default_workarounds | ssl::context::no_sslv2 | ssl::context::no_sslv3 |
                           ssl::context::no_tlsv1 | ssl::context::no_tlsv1_1,
                       error);
  // What OpenSSL would ask a person at the terminal for.
  if (!error) context->set_password_callback([](auto...) { return std::string(); }, error);
  const auto cert = read_whole_file(cert_, kLargestPem);
  if (!cert) return cert.error();
  const auto key = read_whole_file(key_, kLargestPem);
  if (!key) return key.error();
  if (!error) context->use_certificate_chain(boost::asio::buffer(*cert), error);
  if (error)
    return Error{"cannot use the certificate " + cert_.string() + ": " + error.message() +
                 "; it must be a PEM file, the server's own certificate first"};
  context->use_private_key(boost::asio::buffer(*key), ssl::context::pem, error);
  if (error)
    return Error{"cannot use the key " + key_.string() + ": " + error.message() +
                 "; it must be the certificate's own, a PEM file without a password"};
  const X509* const own = SSL_CTX_get0_certificate(context->native_handle());
  return Served{.context = std::move(context),
                .valid_from_s = unix_time(X509_get0_notBefore(own)),
                .expires_s = unix_time(X509_get0_notAfter(own))};
}

bool TlsFiles::take(Served newer) {
  const std::int64_t now_s = utc_now_ns() / kNanosecondsPerSecond;
  if (newer.expires_s <= now_s && now_s < served_.expires_s) {
    log_warning("the old certificate stays: " + cert_.string() + " has expired on " + date(newer.expires_s) +
                "; put a valid one in its place");
    return false;
  }
  served_ = std::move(newer);
  said_ = Dates::kGood;
  return true;
}

void TlsFiles::replace_with(TlsFiles newer) {
  cert_ = std::move(newer.cert_);
  key_ = std::move(newer.key_);
  cert_mark_ = newer.cert_mark_;
  key_mark_ = newer.key_mark_;
  take(std::move(newer.served_));
}

void TlsFiles::warn_of_dates() {
  const std::int64_t now_s = utc_now_ns() / kNanosecondsPerSecond;
  const Dates dates = served_.expires_s <= now_s             ? Dates::kExpired
                      : now_s < served_.valid_from_s         ? Dates::kNotYet
                      : served_.expires_s - now_s <= kSoon_s ? Dates::kSoon
                                                             : Dates::kGood;
  if (dates == said_) return;
  said_ = dates;
  const std::string what = "the certificate " + cert_.string();
  constexpr const char* kMend = ": put a new one in its place, and it is read again";
  if (dates == Dates::kExpired)
    log_warning(what + " has expired on " + date(served_.expires_s) + ", and browsers refuse it" + kMend);
  if (dates == Dates::kNotYet)
    log_warning(what + " is valid from " + date(served_.valid_from_s) +
                " on, and browsers refuse it until then; this machine's clock says " + date(now_s));
  if (dates == Dates::kSoon) log_warning(what + " expires on " + date(served_.expires_s) + kMend);
}

std::shared_ptr<ssl::context> TlsFiles::context() {
  const FileMark cert = mark_of(cert_), key = mark_of(key_);
  if (cert != cert_mark_ || key != key_mark_) {
    cert_mark_ = cert;
    key_mark_ = key;
    // Between the two files' replacement they do not fit together; the second one brings us here again.
    if (auto again = read(); !again) {
      log_warning("the old certificate stays: " + again.error().message);
    } else if (take(*std::move(again))) {
      log_info("the certificate " + cert_.string() + " was read again");
    }
  }
  warn_of_dates();
  return served_.context;
}

}  // namespace relievo
