// SPDX-License-Identifier: Apache-2.0
#include "capture/field_order_file.h"

#include <utility>

#include "capture/storage_file.h"

namespace relievo {
namespace {

constexpr const char* kKey = "field_order";

/// Before the frame rate, which every whole rig.yaml has.
std::string with_line(std::string yaml, const std::string& order) {
  const auto at = yaml.find("\nframe_rate:");
  if (at != std::string::npos && yaml.find(std::string("\n") + kKey + ":") == std::string::npos)
    yaml.insert(at, std::string("\n") + kKey + ": " + order);
  return yaml;
}

}  // namespace

bool states_field_order(const std::filesystem::path& rig) {
  const auto file = StorageFile::open(rig, StorageForm::kYaml);
  return file && file->has(kKey);
}

std::string with_field_order(std::string yaml, const Rig& rig) {
  if (rig.scan != Scan::kInterlaced) return yaml;
  return with_line(std::move(yaml), std::string(to_string(rig.field_order)));
}

std::string keeping_field_order(std::string yaml, const std::filesystem::path& before) {
  const auto file = StorageFile::open(before, StorageForm::kYaml);
  if (!file || !file->has(kKey)) return yaml;
  return with_line(std::move(yaml), file->text(kKey).value_or(std::string(to_string(FieldOrder::kTop))));
}

}  // namespace relievo
