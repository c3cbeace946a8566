// SPDX-License-Identifier: Apache-2.0
#include "idl/keys.h"

#include <fcntl.h>
#include <openssl/x509v3.h>
#include <pwd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <system_error>

#include "base/time.h"
#include "idl/openssl.h"

namespace relievo {
namespace {

std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value != nullptr ? value : "";
}

Status check_identity(X509* identity, EVP_PKEY* key, X509* authority, const std::filesystem::path& folder) {
  if (X509_check_private_key(identity, key) != 1)
    return openssl::failure(std::string(key_files::kPrivate) + " in " + folder.string() +
                            " does not belong to " + key_files::kIdentity);
  const openssl::Key authority_key(X509_get_pubkey(authority));
  if (X509_verify(identity, authority_key.get()) != 1)
    return openssl::failure(std::string(key_files::kIdentity) + " in " + folder.string() +
                            " was not issued by its " + key_files::kAuthority);
  return {};
}

std::string this_user() {
  const passwd* const user = getpwuid(geteuid());
  return user != nullptr ? user->pw_name : std::to_string(geteuid());
}

constexpr const char* kInPlain = "--keys none does without, in plain";

}  // namespace

std::filesystem::path user_keys_folder() {
  const std::string config = environment("XDG_CONFIG_HOME");
  if (!config.empty()) return std::filesystem::path(config) / "relievo" / "keys";
  const std::string home = environment("HOME");
  return std::filesystem::path(home.empty() ? "/" : home) / ".config" / "relievo" / "keys";
}

Result<std::optional<std::filesystem::path>> find_keys(const std::string& given) {
  const std::string asked = given.empty() ? environment("RELIEVO_KEYS") : given;
  using Folder = std::optional<std::filesystem::path>;
  if (asked == "none") return Folder();
  if (!asked.empty()) return Folder(asked);
  for (const std::filesystem::path& folder :
       {user_keys_folder(), std::filesystem::path("/etc/relievo/keys")}) {
    // Of a link itself, since one that leads nowhere was meant to lead to keys.
    std::error_code error;
    const auto found = std::filesystem::symlink_status(folder, error);
    if (found.type() == std::filesystem::file_type::not_found) continue;
    // A folder above that may not be searched: there may be keys in it. Also above the user's own folder, as
    // where root made ~/.config/relievo, and although $HOME may be another user's: streams in plain by
    // mistake are worse than a program that asks for the right $HOME.
    if (error)
      return Error{"cannot tell whether there are keys in " + folder.string() + ": " + error.message() +
                   "; let the user " + this_user() + " search the folders above (chmod a+x), " +
                   "or name its keys (--keys DIR), or " + kInPlain};
    return Folder(folder);
  }
  return Folder();
}

Status check_readable(const std::filesystem::path& folder, const char* file) {
  const std::string path = (folder / file).string();
  if (faccessat(AT_FDCWD, path.c_str(), R_OK, AT_EACCESS) == 0) return {};
  const int error = errno;
  if (error == ENOENT)
    return Error{
        "no keys in " + folder.string() + ": " + file +
        " is missing (relievo keys init makes keys, relievo keys add-client those of another machine; "
        "--keys none does without)"};
  const std::string mend = "let the user " + this_user() + " read them: chown -R " + this_user() + ": " +
                           folder.string() + ", and chmod a+x folders above that are closed; or ";
  return Error{"cannot read the keys in " + folder.string() + ": " + file + ": " +
               std::generic_category().message(error) + "; " + (error == EACCES ? mend : "") + kInPlain};
}

Result<std::vector<std::string>> read_revoked(const std::filesystem::path& folder) {
  const auto list = openssl::read_revocation_list(folder / key_files::kRevoked);
  if (!list) return list.error();
  std::vector<std::string> serials;
  const STACK_OF(X509_REVOKED)* entries = X509_CRL_get_REVOKED(list->get());
  for (int i = 0; i < sk_X509_REVOKED_num(entries); ++i)
    serials.push_back(openssl::hex(X509_REVOKED_get0_serialNumber(sk_X509_REVOKED_value(entries, i))));
  return serials;
}

Result<Keys> read_keys_of_any_time(const std::filesystem::path& folder) {
  for (const char* file : key_files::kEach)
    if (auto s = check_readable(folder, file); !s) return s.error();
  const auto authority = openssl::read_certificate(folder / key_files::kAuthority);
  if (!authority) return authority.error();
  const auto identity = openssl::read_certificate(folder / key_files::kIdentity);
  if (!identity) return identity.error();
  const auto key = openssl::read_key(folder / key_files::kPrivate);
  if (!key) return key.error();
  if (auto s = check_identity(identity->get(), key->get(), authority->get(), folder); !s) return s.error();
  const auto governance = openssl::read_signed(folder / key_files::kGovernance, authority->get());
  if (!governance) return governance.error();
  const auto permissions = openssl::read_signed(folder / key_files::kPermissions, authority->get());
  if (!permissions) return permissions.error();
  auto revoked = read_revoked(folder);
  if (!revoked) return revoked.error();

  Keys keys;
  keys.folder = folder;
  keys.name = openssl::name_of(identity->get());
  keys.serial = openssl::serial_of(identity->get());
  keys.authority = openssl::fingerprint(authority->get());
  keys.revoked = *std::move(revoked);
  keys.may_publish = permissions->find("<grant name=\"publisher\">") != std::string::npos;
  std::error_code unreadable;  // as good as absent: it is not ours then
  keys.of_authority = std::filesystem::exists(folder / key_files::kAuthorityKey, unreadable);
  keys.valid_from_ns = std::max(openssl::start_ns(identity->get()), openssl::start_ns(authority->get()));
  keys.expires_ns = std::min(openssl::expiry_ns(identity->get()), openssl::expiry_ns(authority->get()));
  return keys;
}

Status check_clock(const std::string& what, std::int64_t valid_from_ns) {
  const std::int64_t now_ns = utc_now_ns();
  if (now_ns >= valid_from_ns) return {};
  return Error{what + " are valid from " + utc_text(valid_from_ns) + " on, and this machine's clock says " +
               utc_text(now_ns) + ": set it (date -s, or let timesyncd or chronyd do it)"};
}

Status check_time(const Keys& keys) {
  const std::string what = "the keys in " + keys.folder.string();
  if (auto s = check_clock(what, keys.valid_from_ns); !s) return s;
  if (utc_now_ns() < keys.expires_ns) return {};
  const char* mend = keys.of_authority
                         ? "renew them (relievo keys renew; where the authority itself has expired, "
                           "relievo keys init makes a new one)"
                         : "ask for new ones (relievo keys add-client NAME, where the authority is)";
  return Error{what + " have expired on " + utc_text(keys.expires_ns) + ": " + mend};
}

Result<Keys> read_keys(const std::filesystem::path& folder) {
  auto keys = read_keys_of_any_time(folder);
  if (!keys) return keys;
  if (auto s = check_time(*keys); !s) return s.error();
  return keys;
}

}  // namespace relievo
