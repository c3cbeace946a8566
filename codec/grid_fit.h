// SPDX-License-Identifier: Apache-2.0
// The weights with which a grid is predicted best, by least squares on some of its lines.
#pragma once

#include "codec/grid_predict.h"
#include "codec/stripe_grid.h"

namespace relievo {

/// `key` null: of a key grid. Deterministic.
GridModel fit_model(const StripeGrid& grid, const StripeGrid* key);

}  // namespace relievo
