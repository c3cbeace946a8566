// SPDX-License-Identifier: Apache-2.0
// A machine's keys: the folder that lets it read, or publish, the secured streams of one authority (OMG DDS
// Security 1.1: authenticated, access-controlled, encrypted). docs/SECURITY.md. Any thread.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"

namespace relievo {

/// Files of such a folder. Only identity.key is secret, but for an authority's.
namespace key_files {
inline constexpr const char* kAuthority = "authority.pem";      // whose keys these are
inline constexpr const char* kIdentity = "identity.pem";        // who this is
inline constexpr const char* kPrivate = "identity.key";         // readable by its owner alone
inline constexpr const char* kGovernance = "governance.p7s";    // what is protected, and how
inline constexpr const char* kPermissions = "permissions.p7s";  // what this machine may do
inline constexpr const char* kRevoked = "revoked.pem";          // keys that count no longer
/// Those of each folder of keys.
inline constexpr std::array kEach{kAuthority, kIdentity, kPrivate, kGovernance, kPermissions, kRevoked};
inline constexpr const char* kAuthorityKey = "authority.key";  // an authority's alone, secret, too
}  // namespace key_files

struct Keys {
  std::filesystem::path folder;
  std::string name;                  // whose, as the authority calls it
  std::string serial;                // of the identity, hexadecimal
  std::string authority;             // its fingerprint, 16 hexadecimal digits
  std::vector<std::string> revoked;  // serials, as far as this folder knows
  bool may_publish = false;
  bool of_authority = false;       // its folder can make keys
  std::int64_t valid_from_ns = 0;  // UTC
  std::int64_t expires_ns = 0;
};

/// Where this process finds its keys: `given`, or else $RELIEVO_KEYS, or else the first that exists of
/// ~/.config/relievo/keys and /etc/relievo/keys, whatever is in it. "none", or no such folder: nothing,
/// streams are plain. Fails where it cannot be known whether there is one.
Result<std::optional<std::filesystem::path>> find_keys(const std::string& given);

/// The folder for keys of this user, which find_keys() looks at.
std::filesystem::path user_keys_folder();

/// Whether this user may read a file of the folder. The error says what it lacks, and how to mend it.
Status check_readable(const std::filesystem::path& folder, const char* file);

/// Serials of the keys that count no longer, as far as the folder knows.
Result<std::vector<std::string>> read_revoked(const std::filesystem::path& folder);

/// Checks all of the folder but the time. The error says which file is missing, closed to this user, damaged
/// or of another authority.
Result<Keys> read_keys_of_any_time(const std::filesystem::path& folder);

/// The same for keys that are valid now, by this machine's clock; the error says whether they have expired or
/// the clock is behind.
Result<Keys> read_keys(const std::filesystem::path& folder);
Status check_time(const Keys& keys);

/// The clock is behind the time from which `what` is valid.
Status check_clock(const std::string& what, std::int64_t valid_from_ns);

}  // namespace relievo
