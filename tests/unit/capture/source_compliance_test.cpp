// SPDX-License-Identifier: Apache-2.0
#include "source_compliance.h"

namespace relievo::test {
namespace {

std::string small_take(const std::filesystem::path& folder, Scan scan) {
  write_small_take(folder, scan, 5);
  return "take:" + folder.string();
}

const std::string kSmall = ",stripes=20";

const SourceCase kCases[] = {
    {"TakeInterlaced", false, [](const auto& folder) { return small_take(folder, Scan::kInterlaced); }},
    {"TakeInterlacedLoop", true, [](const auto& folder) { return small_take(folder, Scan::kInterlaced); }},
    {"TakeProgressive", false, [](const auto& folder) { return small_take(folder, Scan::kProgressive); }},
    {"TakeProgressiveLoop", true, [](const auto& folder) { return small_take(folder, Scan::kProgressive); }},
    {"SimInterlaced", false, [](const auto&) { return "sim:face,width=64,height=48,frames=7" + kSmall; }},
    {"SimInterlacedLoop", true,
     [](const auto&) { return "sim:object,width=64,height=48,period=8" + kSmall; }},
    {"SimProgressive", false,
     [](const auto&) { return "sim:walk,width=64,height=48,scan=progressive,frames=6,drop=3" + kSmall; }},
    {"SimProgressiveLoop", true,
     [](const auto&) { return "sim:plane,width=64,height=48,scan=progressive,period=6,drop=4" + kSmall; }},
    {"Board", false, [](const auto&) { return "sim:board,width=64,height=48,frames=7" + kSmall; }},
    {"BoardBottomFirst", false,
     [](const auto&) { return "sim:board,width=64,height=48,frames=7,field_order=bottom" + kSmall; }},
    {"BoardProgressiveLoop", true,
     [](const auto&) { return "sim:board,width=64,height=48,scan=progressive,drop=5" + kSmall; }},
    {"Sheet", false, [](const auto&) { return "sim:sheet,width=64,height=48,frames=9" + kSmall; }},
};

INSTANTIATE_TEST_SUITE_P(Sources, SourceCompliance, testing::ValuesIn(kCases),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace relievo::test
