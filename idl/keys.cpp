// SPDX-License-Identifier: Apache-2.0
#include "idl/keys.h"

#include <openssl/x509v3.h>

#include <cstdlib>

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
  if (X509_cmp_current_time(X509_get0_notAfter(identity)) < 0)
    return Error{
        "the keys in " + folder.string() +
        " have expired: ask for new ones (relievo keys add-client), or renew them if they are yours"};
  return {};
}

std::vector<std::string> revoked_serials(X509_CRL* list) {
  std::vector<std::string> serials;
  const STACK_OF(X509_REVOKED)* entries = X509_CRL_get_REVOKED(list);
  for (int i = 0; i < sk_X509_REVOKED_num(entries); ++i)
    serials.push_back(openssl::hex(X509_REVOKED_get0_serialNumber(sk_X509_REVOKED_value(entries, i))));
  return serials;
}

}  // namespace

std::filesystem::path user_keys_folder() {
  const std::string config = environment("XDG_CONFIG_HOME");
  if (!config.empty()) return std::filesystem::path(config) / "relievo" / "keys";
  const std::string home = environment("HOME");
  return std::filesystem::path(home.empty() ? "/" : home) / ".config" / "relievo" / "keys";
}

std::optional<std::filesystem::path> find_keys(const std::string& given) {
  const std::string asked = given.empty() ? environment("RELIEVO_KEYS") : given;
  if (asked == "none") return std::nullopt;
  if (!asked.empty()) return std::filesystem::path(asked);
  for (const std::filesystem::path& folder :
       {user_keys_folder(), std::filesystem::path("/etc/relievo/keys")}) {
    std::error_code unreadable;  // as good as absent
    if (std::filesystem::exists(folder / key_files::kIdentity, unreadable)) return folder;
  }
  return std::nullopt;
}

Result<Keys> read_keys(const std::filesystem::path& folder) {
  std::error_code error;
  for (const char* file : {key_files::kAuthority, key_files::kIdentity, key_files::kPrivate,
                           key_files::kGovernance, key_files::kPermissions, key_files::kRevoked}) {
    if (!std::filesystem::exists(folder / file, error))
      return Error{
          "no keys in " + folder.string() + ": " + file +
          " is missing (relievo keys init makes keys, relievo keys add-client those of another machine; "
          "--keys none does without)"};
  }
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
  const auto revoked = openssl::read_revocation_list(folder / key_files::kRevoked);
  if (!revoked) return revoked.error();

  Keys keys;
  keys.folder = folder;
  keys.name = openssl::name_of(identity->get());
  keys.serial = openssl::serial_of(identity->get());
  keys.authority = openssl::fingerprint(authority->get());
  keys.revoked = revoked_serials(revoked->get());
  keys.may_publish = permissions->find("<grant name=\"publisher\">") != std::string::npos;
  keys.expires_ns = openssl::expiry_ns(identity->get());
  return keys;
}

}  // namespace relievo
