// SPDX-License-Identifier: Apache-2.0
// Who may read and publish secured streams: an authority is a folder of keys (idl/keys.h) that can also make
// and revoke those of others. docs/SECURITY.md. One process at a time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "base/result.h"

namespace relievo {

enum class KeyRole {
  kWatcher,    // reads streams, asks for key frames
  kPublisher,  // and publishes streams
};

/// A new authority, and in the same folder the keys of this machine, which may publish. Fails, and leaves
/// nothing, where `folder` exists and is not empty.
Status create_authority(const std::filesystem::path& folder);

/// Writes a folder of keys for another machine to `out`, which must not exist. `name`: as a stream's, of
/// nobody whose keys are valid. Fails where `authority` is no authority, or has expired; its own keys, those
/// of this machine, may have.
Status issue_keys(const std::filesystem::path& authority, const std::string& name, KeyRole role,
                  const std::filesystem::path& out);

/// New keys for this machine, of the same name, in place of those in the authority's folder. Those count
/// until they expire or the name is revoked.
Status renew_keys(const std::filesystem::path& authority);

/// All keys of that name count no longer, for whoever has this folder's list of revoked keys and starts
/// afterwards.
Status revoke_keys(const std::filesystem::path& authority, const std::string& name);

struct KeyHolder {
  std::string name, serial;
  bool revoked = false;
  std::int64_t expires_ns = 0;  // UTC
};
/// All keys that were made, by name, and of each name by their end.
Result<std::vector<KeyHolder>> list_keys(const std::filesystem::path& authority);

}  // namespace relievo
