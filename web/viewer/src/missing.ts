// SPDX-License-Identifier: Apache-2.0
// Why parts of a recording do not come from its server.

/** They may later. */
export class Unavailable extends Error {}

/** Nobody answers, or no more of the answer comes. */
export class NoAnswer extends Unavailable {
  constructor() {
    super('the server does not answer');
  }
}

/** Asking again does not help. */
export class Final extends Error {}
