// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace relievo {

/// idl/relievo.idl, whole: a self-contained schema of every type.
extern const char* const kIdlText;

}  // namespace relievo
