// SPDX-License-Identifier: Apache-2.0
// Goes through an MCAP file's records from its start, over damage: for files without an index.
#pragma once

#include <vector>

#include "base/result.h"
#include "codec/mcap_scan.h"

namespace relievo::mcap {

enum class ReadChunks {
  kAll,          // the whole file is read once
  kWhereNeeded,  // those whose message indexes, right behind them, do not say what is in them: quick
};

/// Where bytes are no records, the file's first ones among them, looks for the next chunk or attachment whose
/// CRC is right, or the next recording of a file that was joined of several, and goes on there; what was
/// passed over is in `gaps`. A chunk whose own bytes are wrong is listed (whoever reads it meets the error)
/// where what follows it shows that its length is right.
Result<std::vector<Contents>> walk_records(const File& file, ReadChunks which);

}  // namespace relievo::mcap
